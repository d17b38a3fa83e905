"""One draw on the twin: the same tree over ROS in real time, judged by the twin's own truth.

The twin takes each task's world over its evaluation channel, so furniture, objects and goals are those of the
draw; what it knows of them has the errors that its own file states.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from typing import Any

from benchmarks.any_tree.episodes import Conditions, Player, longest
from benchmarks.any_tree.tasks import Task
from benchmarks.faults import Bench, bench_of
from benchmarks.gap import settled_truth
from bt_tasksim import Runner, load_robot
from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.outcomes import outcome_of_error
from bt_tasksim.scene.success import evaluate_success

DOMAIN = 47
"""ROS domain."""


class TwinPlayer(Player):
    """Runs one draw after the other on one twin.

    Args:
        conditions: What is measured.
    """

    def __init__(self, conditions: Conditions) -> None:
        super().__init__(conditions)
        self._open = ExitStack()
        self._bench: Bench | None = None

    def close(self) -> None:
        """End the twin."""
        self._open.close()
        self._bench = None

    def _ran(self, drawn: Task) -> dict[str, Any]:
        if self._bench is None:
            camera = self._conditions.options.perception == "camera"
            self._bench = self._open.enter_context(bench_of(DOMAIN, camera=camera))
        engines = f"ros:127.0.0.1:{self._bench.twin.port}"
        options = replace(self._conditions.options, engines=engines, noise="fine")
        tree = drawn.tree(self._conditions.tree, self._conditions.grasp)
        runner = Runner(tree, drawn.scene, options, longest=longest(drawn))
        try:
            return self._judged(runner, drawn)
        finally:
            runner.close()

    def _judged(self, runner: Runner, drawn: Task) -> dict[str, Any]:
        assert self._bench is not None
        configuration, robot = drawn.sample(), load_robot(drawn.robot)
        self._bench.evaluation.load(configuration, drawn.seed)
        try:
            result = runner.run(drawn.seed, drawn.stream)
            status, leaf, reason, why = result.status.name, result.leaf, result.reason, result.why
        except BtTasksimError as error:
            outcome = outcome_of_error(error)
            status, leaf, reason, why = "INVALID", "", outcome.cause.reason.name, outcome.sentence
        truth = settled_truth(self._bench.evaluation)
        model = configuration.world_model([tip.name for tip in robot.tips], robot.opening)
        verdict = evaluate_success(configuration, model, truth)
        if status == "SUCCESS":
            reason, why = verdict.reason, verdict.why
        return {
            "success": status == "SUCCESS" and verdict.success,
            "status": status,
            "leaf": leaf,
            "concept": self.concept_of(runner, leaf),
            "reason": reason,
            "why": why,
        }
