"""A tree in simulation behind the guard: as without it, and stopped in order where a limit is exceeded."""

import dataclasses
import json

import numpy as np
import pytest
from draws import successes

from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import SAFETY_STOP, Runner
from bt_tasksim.report.write import write_run
from bt_tasksim.trees.load import load_source

pytestmark = pytest.mark.physical


def runner_of(**limits):
    source = load_source("pick_and_place")
    runner = Runner(source.build(), source.scene, EngineOptions(safety=True))
    guard = runner.pipeline.physics.guard
    guard.limits = dataclasses.replace(guard.limits, **limits)
    return runner, guard


def test_a_shipped_tree_keeps_the_limits_and_succeeds():
    runner, guard = runner_of()

    def run(seed):
        result = runner.run(seed)
        assert guard.stopped.reason.name == "run_ended", "it was not stopped before its end"
        return result

    successes(run, range(7, 12))


@pytest.mark.parametrize(
    ("limits", "reason", "number"),
    [
        ({"tool_speed": 0.3}, "tool_speed_limit", "value"),
        (
            {"workspace": np.array([[-1, -1, 0.1], [1, 1, 1]])},
            "outside_workspace",
            "z",
        ),
        ({"force": 2.0}, "force_limit", "value"),
    ],
)
def test_a_limit_ends_the_tree_in_order_and_the_arm_holds(limits, reason, number, tmp_path):
    runner, guard = runner_of(**limits)
    result, files = write_run(tmp_path / "run", runner, 7)
    assert result.reason == reason and not result.success and result.status.name == "INVALID"
    assert result.leaf in {n.name for n in runner.tree.iterate()}
    assert result.outcome.is_a(SAFETY_STOP) and result.outcome.names == {"arm": "the arm holds"}
    assert not [n.name for n in runner.tree.iterate() if n.status.name == "RUNNING"]
    seen = []
    for _ in range(40):
        runner.pipeline.step(dataclasses.replace(runner.pipeline.commanded, tool=None))
        seen.append(runner.pipeline.state.joint_position[:7])
    assert np.abs(seen[-1] - seen[-10]).max() < 1e-3, "it stands"
    written = json.loads((files.folder / "result.json").read_text())
    assert written["reason"] == reason and number in written["outcome"]["detail"]["numbers"]
    runner.begin(7)
    assert guard.stopped is None, "a new run begins anew"


def test_a_stop_while_things_come_to_rest_does_not_escape_the_run():
    runner, guard = runner_of()

    def narrow(step):
        if step.tree_status.name != "RUNNING":
            guard.limits = dataclasses.replace(guard.limits, force=1e-6)

    limits = guard.limits

    def run(seed):
        guard.limits = limits
        result = runner.run(seed, record=narrow)
        assert guard.stopped.reason.name == "force_limit", "it was stopped after its end"
        return result

    assert successes(run, range(7, 10), n=1), "what the tree had done is judged all the same"
