"""An object is checked by itself: its size and weight, whether it stands, and whether a hand can hold it."""

from __future__ import annotations

import pytest

from bt_tasksim import InputError, ObjectSpec
from bt_tasksim.checking.object_check import check_mesh, check_object
from bt_tasksim.checking.report import ERROR, WARNING
from bt_tasksim.core.resources import asset

trimesh = pytest.importorskip("trimesh")


def test_the_bundled_bottle_is_in_millimetres_and_sound():
    report = check_mesh(asset("objects", "bottle.obj"))
    assert [(f.level, f.function) for f in report.findings] == [(WARNING, "scale")]
    assert report.seen[0].startswith("size   56 x 42 x 146 mm, ")


def test_what_cannot_be_held_or_does_not_stand_is_named(tmp_path):
    trimesh.creation.box(extents=(0.12, 0.10, 0.09)).export(tmp_path / "crate.stl")
    report = check_mesh(tmp_path / "crate.stl")
    assert [(f.level, f.function) for f in report.findings] == [(ERROR, "crate")]
    assert "is 90 mm wide where it is narrowest" in report.findings[0].what
    foot = trimesh.creation.box(extents=(0.02, 0.035, 0.08))
    arm = trimesh.creation.box(extents=(0.14, 0.04, 0.03))
    arm.apply_translation((0.06, 0.0, 0.056))
    trimesh.util.concatenate([foot, arm]).export(tmp_path / "crane.stl")
    report = check_mesh(tmp_path / "crane.stl")
    assert any("does not stand where it is put" in f.what for f in report.findings), report.lines()


def test_a_weight_that_cannot_be_is_named():
    heavy = ObjectSpec(("cube",), on="table", mass=(4.0, 5.0), size=((0.05,) * 3, (0.05,) * 3))
    (finding,) = check_object("cube", heavy).findings
    assert (finding.level, finding.function) == (WARNING, "mass") and "denser than steel" in finding.what
    with pytest.raises(InputError):
        check_mesh("none.stl")
