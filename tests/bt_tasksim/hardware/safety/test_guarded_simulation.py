"""A tree in simulation behind the guard: as without it, and stopped in order where a limit is exceeded."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.engines.registry import EngineOptions
from bt_tasksim.report.write import write_run
from bt_tasksim.runner import Runner
from trees.load import load_source


def runner_of(**limits):
    source = load_source("pick_and_place")
    runner = Runner(source.build(), source.scene, EngineOptions(safety=True))
    guard = runner.pipeline.physics.guard
    guard.limits = dataclasses.replace(guard.limits, **limits)
    return runner, guard


def test_a_shipped_tree_keeps_the_limits_and_succeeds():
    runner, guard = runner_of()
    result = runner.run(7)
    assert result.success, result.why
    assert guard.stopped.limit == "ended", "it was not stopped before its end"


@pytest.mark.parametrize(
    ("limits", "reason", "sentence"),
    [
        ({"tool_speed": 0.3}, "safety stop, tool velocity", "the tool would move at 0.3"),
        (
            {"workspace": np.array([[-1, -1, 0.1], [1, 1, 1]])},
            "safety stop, workspace",
            "outside the box in z",
        ),
        ({"force": 2.0}, "safety stop, wrench", "force on the tool"),
    ],
)
def test_a_limit_ends_the_tree_in_order_and_the_arm_holds(limits, reason, sentence, tmp_path):
    runner, guard = runner_of(**limits)
    result, files = write_run(tmp_path / "run", runner, 7)
    assert result.reason == reason and not result.success and result.status.name == "INVALID"
    leaf = result.why.partition(":")[0]
    assert leaf in {n.name for n in runner.tree.iterate()} and sentence in result.why
    assert result.why.endswith("; the arm holds")
    assert not [n.name for n in runner.tree.iterate() if n.status.name == "RUNNING"]
    seen = []
    for _ in range(40):
        runner.pipeline.step(dataclasses.replace(runner.pipeline.last, tool=None))
        seen.append(runner.pipeline.state.joint_position[:7])
    assert np.abs(seen[-1] - seen[-10]).max() < 1e-3, "it stands"
    assert sentence in (files.folder / "result.json").read_text()
    runner.begin(7)
    assert guard.stopped is None, "a new run begins anew"


def test_a_stop_while_things_come_to_rest_does_not_escape_the_run():
    runner, guard = runner_of()

    def narrow(step):
        if step.tree_status.name != "RUNNING":
            guard.limits = dataclasses.replace(guard.limits, force=1e-6)

    result = runner.run(7, record=narrow)
    assert guard.stopped.limit == "wrench", "it was stopped after its end"
    assert result.success, "what the tree had done is judged all the same"
