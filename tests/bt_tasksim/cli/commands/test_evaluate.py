"""``bt-tasksim evaluate``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.physical


def test_evaluate_writes_what_is_promised(call):
    code, out, err = call(
        "evaluate", "pick_and_throw", "--episodes", 2, "--seed", 40, "--noise", "none", "--json", "e.json"
    )
    assert code == 0 and err == "", "quiet when not on a terminal"
    content = json.loads(Path("e.json").read_text())
    assert {
        "scenario", "robot", "engines", "perception", "policies", "episodes", "successes", "success_rate",
        "confidence_interval", "failures", "failed_seeds", "seconds", "control_steps",
    } <= content.keys()  # fmt: skip
    assert content["episodes"] == 2 and content["perception"] == "state, noise none"
    assert f"pick_and_throw on panda (sapien, state, noise none): {content['successes']} of 2" in out


def test_evaluate_counts_failures_with_a_seed_and_a_reason(call, tree_file):
    name = tree_file('sequence("far", Grasp("cup"), Pick("cup", distance=10.0))')
    code, out, _ = call("evaluate", name, "--episodes", 2)
    assert code == 0 and "tree on panda" in out and "0 of 2 (0.0 %" in out
    assert "2 x grasp cup: no_way, such as seed 0: " in out and "that cannot also be lifted" in out


OWN = """
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.world import Command
from trees import sequence
from trees.scenarios.pick_and_throw import scene


class Never(ConceptModel):
    def command(self, action, seen, memory):
        return Command(tool=seen.tool)

    def done(self, seen, memory):
        return seen.tool[:, 2] < -1.0

    def violated(self, seen, memory):
        return seen.tool[:, 2] > -1.0


def build():
    return sequence("never", Never())
"""


def test_where_ones_own_concept_never_succeeds_it_points_to_check(call, tree_file):
    Path("never.py").write_text(OWN)
    code, out, _ = call("evaluate", "never.py", "--episodes", 2)
    assert code == 0 and "0 of 2" in out and "bt-tasksim check never.py" in out
    _, out, _ = call("evaluate", tree_file('sequence("far", Pick("cup"))'), "--episodes", 1)
    assert "0 of 1" in out and "check" not in out, "there is nothing in it that check could try"


def test_a_machine_without_the_simulator_says_what_to_install(call, monkeypatch):
    monkeypatch.setitem(sys.modules, "sapien", None)
    code, _, err = call("evaluate", "pick_and_place", "--episodes", 1)
    assert code == 1 and err.count("\n") == 1
    assert "SAPIEN physics cannot start" in err and "pip install 'bt-tasksim[sim]'" in err


@pytest.mark.parametrize("batch", [1, 2])
def test_an_episode_is_as_long_as_is_asked_for(call, batch):
    words = ("evaluate", "pick_and_place", "--episodes", 2, "--batch", batch, "--json", "e.json")
    code, out, _ = call(*words, "--longest", 1.5)
    assert code == 0
    found = json.loads(Path("e.json").read_text())
    assert found["failures"] == {"time_over": 2} and "1.5 s" in out
    assert [outcome["control_steps"] for outcome in found["outcomes"]] == [30, 30]
    assert call(*words, "--resume", "--longest", 1.5)[0] == 0
    for other in ((), ("--longest", 2)):
        code, _, err = call(*words, "--resume", *other)
        assert code == 2 and "longest time of an episode" in err


@pytest.mark.parametrize("time", [0, -1, "nan", "inf", "soon", 1e9])
def test_a_length_that_is_none_is_refused(call, time):
    code, out, err = call("evaluate", "pick_and_place", "--longest", time)
    assert code == 2 and out == "" and "number of seconds" in err
