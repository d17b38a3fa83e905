"""A goal relation from outside of the package, in one file: `plugins/goal_relation.py`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from py_trees.common import Status

from bt_tasksim import Goal, ObjectSpec, Runner, Scene, SpotSpec, trees
from bt_tasksim.cli.main import main
from bt_tasksim.concept_nodes import Wait
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import reason_named

FILE = str(Path(__file__).parent / "plugins" / "goal_relation.py")
ROOM = """
objects: {cup: {kind: cup, on: table, at: [0, 0]}}
spots: [{name: mat, on: table, at: [0, MAT], extent: [0.1, 0.1]}]
goal: {object: cup, place: mat, relation: near, position_tolerance: 0.05}
"""
TREE = '<root BTCPP_format="4"><BehaviorTree ID="a"><Wait duration="0.2"/></BehaviorTree></root>'


@pytest.mark.parametrize(("mat", "reason"), [(0.08, ""), (0.0, "not_near"), (0.15, "not_near")])
def test_python_judges_by_it(plugin, mat, reason):
    plugin("goal_relation")
    scene = Scene(
        objects={"cup": ObjectSpec(("cup",), on="table", area=(0.0, 0.0))},
        spots=[SpotSpec("mat", on="table", centre=(0.0, mat), area=(0.0, 0.0), extent=(0.1, 0.1))],
        goal=Goal("cup", "mat", relation="near", position_tolerance=0.05),
    )
    result = Runner(trees.sequence("wait", Wait(0.2)), scene).run(1)
    assert result.status == Status.SUCCESS and result.success is (reason == "") and result.reason == reason
    assert result.outcome.is_a(reason_named(reason or "is_near"))
    assert result.outcome.numbers["gap"] == pytest.approx(mat - 0.05, abs=0.005)


@pytest.mark.parametrize(("mat", "failures"), [(0.08, {}), (0.15, {"not_near": 2})])
def test_the_command_line_judges_by_it_and_writes_its_reason(
    plugin, capsys, tmp_path, monkeypatch, mat, failures
):
    monkeypatch.chdir(tmp_path)
    Path("tree.xml").write_text(TREE)
    Path("room.yaml").write_text(ROOM.replace("MAT", str(mat)))
    words = ["evaluate", "tree.xml", "--scene", "room.yaml", "--episodes", "2", "--json", "e.json"]
    assert main([*words, "--plugin", FILE]) == 0
    content = json.loads(Path("e.json").read_text())
    assert content["failures"] == failures and content["successes"] == 2 - sum(failures.values())
    outcome = content["outcomes"][0]["outcome"]
    assert outcome["reason"] in ("is_near", "not_near") and outcome["units"] == {"gap": "m"}
    assert ("2 x not_near, such as seed 0: " in capsys.readouterr().out) is bool(failures)


def test_without_the_plugin_the_relation_is_unknown(capsys, tmp_path, monkeypatch):
    with pytest.raises(InputError, match="unknown relation 'insid'; did you mean 'inside'"):
        Goal("cup", "mat", relation="insid")
    monkeypatch.chdir(tmp_path)
    Path("tree.xml").write_text(TREE)
    Path("room.yaml").write_text(ROOM.replace("MAT", "0.1"))
    assert main(["run", "tree.xml", "--scene", "room.yaml"]) == 2
    assert "'near'" in capsys.readouterr().err


def test_what_older_files_call_stands_is_on():
    assert Goal("cup", "mat", "stands") == Goal("cup", "mat", "on") == Goal("cup", "mat")
