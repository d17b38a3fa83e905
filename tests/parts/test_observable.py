"""An observable from outside of the package, in one file: `plugins/observable.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim import Runner
from bt_tasksim.cli.main import main
from bt_tasksim.core import observables
from bt_tasksim.core.errors import InputError
from bt_tasksim.trees.load import load_source

FILE = Path(__file__).parent / "plugins" / "observable.py"


def test_a_concept_looks_at_it_and_it_is_computed_once_an_instant(plugin, monkeypatch):
    outside = plugin("observable")
    assert observables.observable("span").unit == "m"
    runner = Runner(outside.Pinch("target"), load_source("pick_and_place").scene)
    runner.begin(1)
    seen = runner.context.seen(np.array([0]), np.zeros(1))
    tips = seen.observation.tips
    assert seen.observable("span") == pytest.approx(np.linalg.norm(tips[:, 0] - tips[:, -1], axis=-1))
    asked = []
    monkeypatch.setattr(outside.Span, "read", lambda *_: asked.append(1) or np.array([0.05]))
    again = runner.context.seen(np.array([0]), np.zeros(1))
    assert again.observable("span") == again.observable("span") == 0.05
    assert len(asked) == 1


def test_it_runs_in_a_tree(plugin):
    pinch = plugin("observable").Pinch("target", policy="programmed")
    result = Runner(pinch, load_source("pick_and_place").scene).run(1)
    assert result.status == Status.SUCCESS and result.sim_time > 0.2


def test_unknown_without_the_plugin():
    with pytest.raises(InputError, match="span"):
        observables.observable("span")


TREE = """

def build():
    return {name}("target", policy="programmed")


def scene(robot="panda"):
    from bt_tasksim.trees.scenarios import pick_and_place

    return pick_and_place.scene(robot)
"""


@pytest.mark.parametrize("gap", ["small", "large"])
def test_check_knows_it(gap, plugin, tmp_path, capsys):
    name = f"Pinch{gap}"
    file = tmp_path / "pinch.py"
    source = FILE.read_text().replace('"small"', f'"{gap}"').replace("Pinch", name)
    file.write_text(source + TREE.format(name=name))
    main(["check", str(file), "--plugin", str(file)])
    said = capsys.readouterr().out
    assert ("declares 'span'" in said) == (gap == "large")
    assert "reads '" not in said
