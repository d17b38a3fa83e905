"""Random chores: functions of their seeds, that fit, and are judged by the physics."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from benchmarks import chores
from benchmarks.chores import __main__ as command
from benchmarks.chores.chore import FRONT, KINDS, SLOTS
from benchmarks.chores.draw import task
from bt_tasksim.core.errors import InputError


def test_a_seed_is_one_task():
    one, two = task(910003), task(910003)
    assert one.words == two.words
    assert one.scene.sample(910003).objects == two.scene.sample(910003).objects
    assert len({task(seed).words for seed in range(910000, 910006)}) > 3


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_things_goals_and_leaves(kind):
    drawn = task(910010, kinds=[kind])
    assert {chore.kind for chore in drawn.chores} == {kind}
    assert 1 <= len(drawn.chores) <= len(SLOTS)
    tree = drawn.tree()
    assert len(tree.children) == sum(len(chore.leaves()) for chore in drawn.chores)
    assert all(chore.goals for chore in drawn.chores)
    assert all(goal.angle_tolerance < 1.0 for chore in drawn.chores for goal in chore.goals)  # it stands


def test_an_unknown_kind_is_refused():
    with pytest.raises(InputError, match="no kind of chore 'juggle'"):
        task(0, kinds=["juggle"])


def test_one_is_measured(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert command.main(["--episodes", "1", "--seed", "910000", "--kinds", "carry", "--oracle", "0"]) == 0
    (file,) = tmp_path.glob("runs/benchmarks/chores-panda.json")
    found = json.loads(file.read_text())
    assert found["episodes"] == 1 and found["draws"][0]["kinds"]
    assert "1 draws (" in capsys.readouterr().out
    assert chores.__doc__


def test_what_the_oracle_never_achieves_is_counted_and_listed():
    ok = {"success": True, "leaf": "", "reason": "", "kinds": ["pour"]}
    failed = ok | {"success": False, "leaf": "pour", "reason": "spilled"}
    never = failed | {"possible": False, "oracle": ["grasp: no_way", "grasp: no_way"]}
    found = command.summary([ok, failed | {"possible": True, "oracle": []}, never])
    assert (found["episodes"], found["possible"], found["successes"]) == (3, 2, 1)
    assert found["confidence_interval_of_all"][1] < found["confidence_interval"][1]
    assert found["failures"] == {"pour: spilled": 2} and found["impossible"] == {"grasp: no_way": 1}


def test_the_ledge_is_in_its_slot():
    slot = dataclasses.replace(FRONT, centre=(0.70, 0.05))
    (ledge,) = KINDS["slide_to_stop"](slot, np.random.default_rng(0)).fixtures
    assert ledge.at == pytest.approx((0.62, 0.05))


def test_a_block_is_measured_with_all_kinds(capsys):
    assert command.main(["--block", "B0012", "--kinds", "carry"]) == 2
    assert "leave out --kinds" in capsys.readouterr().err
