"""A reason from outside of the package, in one file: `plugins/reason.py`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from py_trees.common import Status

from bt_tasksim.cli.main import main
from bt_tasksim.core.outcomes import CANNOT_START, reason_named, reason_of
from bt_tasksim.core.registry import module_of, parts

FILE = str(Path(__file__).parent / "plugins" / "reason.py")
TREE = (
    '<root BTCPP_format="4" scene="pick_and_throw"><BehaviorTree ID="a">'
    '<NearPick target="cup" limit="0.1"/></BehaviorTree></root>'
)


def test_python_sees_the_reason_its_numbers_and_its_code(plugin, toy):
    module = plugin("reason")
    leaf = module.NearPick("cup", limit=0.1)
    assert toy(leaf).tick() == Status.FAILURE
    assert leaf.outcome.is_a(CANNOT_START) and leaf.outcome.cause.is_a(module.TOO_FAR)
    assert leaf.outcome.cause.numbers["distance"] > leaf.outcome.cause.numbers["limit"] == 0.1
    assert leaf.feedback_message == leaf.outcome.sentence
    assert reason_of(module.TOO_FAR.code) == module.TOO_FAR == reason_named("too_far")
    assert "too_far" in parts("reason") and module_of("reason", "too_far") == "_plugin_reason"


@pytest.mark.parametrize("workers", ["1", "2"])
def test_the_command_line_counts_it_by_its_name(plugin, capsys, tmp_path, monkeypatch, workers):
    monkeypatch.chdir(tmp_path)
    Path("tree.xml").write_text(TREE)
    words = ["evaluate", "tree.xml", "--episodes", "2", "--json", "e.json", "--workers", workers]
    assert main([*words, "--plugin", FILE]) == 0
    content = json.loads(Path("e.json").read_text())
    assert content["failures"] == {"too_far": 2} and content["failed_leaves"] == {"nearpick cup": 2}
    cause = content["outcomes"][0]["outcome"]["detail"]
    assert cause["reason"] == "too_far" and cause["units"] == {"distance": "m", "limit": "m"}
    assert "2 x nearpick cup: too_far, such as seed 0: cannot start: cup is " in capsys.readouterr().out
    assert main(["run", "tree.xml", "--out", "here", "--plugin", FILE]) == 1
    written = json.loads(Path("here/result.json").read_text())
    assert (written["reason"], written["leaf"]) == ("too_far", "nearpick cup")
