"""An object is checked by itself: its size and weight, whether it stands, and whether a hand can hold it."""

from __future__ import annotations

import pytest

from bt_tasksim import InputError, ObjectSpec
from bt_tasksim.checking.kinds import check_file
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
    for mass, level, said in (((1.2, 1.3), WARNING, "denser than steel"), ((2.0, 2.6), ERROR, "any metal")):
        heavy = ObjectSpec(("cube",), on="table", mass=mass, size=((0.05,) * 3, (0.05,) * 3))
        (finding,) = check_object("cube", heavy).findings
        assert (finding.level, finding.function) == (level, "mass") and said in finding.what
    with pytest.raises(InputError):
        check_mesh("none.stl")


def found(report):
    return [(f.level, f.function, f.what) for f in report.findings]


@pytest.mark.parametrize("name", ["mug.yaml"])
def test_bundled_object_files_are_sound(name):
    report = check_file(str(asset("objects", name)))
    assert not report.errors, report.lines()
    assert report.checked[-1].startswith(f"object {name.removesuffix('.yaml')}, ")


def test_an_object_file_is_checked_with_its_grips(tmp_path):
    (tmp_path / "brick.yaml").write_text(
        "kind: box\nsize: [0.14, 0.05, 0.06]\nmass: 8.0\ngrasps:\n"
        "  - {point: [0, 0, 0], closing: [0, 1, 0]}\n"
        "  - {point: [0, 0, 0], closing: [0, 1, 0], width: 0.02}\n"
        "  - {point: [0, 0, 0], closing: [1, 0, 0]}\n"
        "  - {point: [0, 0, 0.2], closing: [0, 1, 0], width: 0.05}\n"
    )
    said = found(check_file(str(tmp_path / "brick.yaml")))
    assert [(level, where) for level, where, _ in said[:4]] == [
        (WARNING, "mass"), (WARNING, "grasps[1]"), (WARNING, "grasps[2]"), (ERROR, "grasps[3]"),
    ]  # fmt: skip
    assert "denser than steel" in said[0][2] and "50 mm is measured" in said[1][2]
    assert "the hand opens to 80 mm" in said[2][2] and "meet nothing" in said[3][2]


def test_an_object_file_in_millimetres_and_one_that_is_none_are_said_to_be(tmp_path):
    trimesh.creation.box(extents=(50.0, 40.0, 60.0)).export(tmp_path / "mm.stl")
    (tmp_path / "mm.yaml").write_text("mesh: mm.stl\n")
    with pytest.raises(InputError, match=r"mm.yaml.*millimetres: set scale: 0.001"):
        check_file(str(tmp_path / "mm.yaml"))
    (tmp_path / "mm.yaml").write_text("mesh: mm.stl\nscale: 0.001\n")
    assert not check_file(str(tmp_path / "mm.yaml"), robot="so100").errors
