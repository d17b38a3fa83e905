"""One draw on the twin: the same tree over ROS in real time, judged by the twin's own truth.

The twin takes each task's world over its evaluation channel, so furniture, objects and goals are those of the
draw; what it knows of them has the errors that its own file states.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict, replace
from typing import Any

from benchmarks.any_tree.episodes import Conditions, Player, longest
from benchmarks.any_tree.tasks import Task
from benchmarks.faults import Bench, bench_of
from benchmarks.gap import judged_by_truth
from bt_tasksim import Runner

DOMAIN = 47
"""ROS domain."""


class TwinPlayer(Player):
    """Runs one draw after the other on one twin; `left_out` are seconds in which its physics stood still.

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
            found = judged_by_truth(runner, self._bench.evaluation, drawn.seed, drawn.stream)
            lost = self._bench.evaluation.tell()["left_out"]
            return {**asdict(found), "concept": self.concept_of(runner, found.leaf), "left_out": lost}
        finally:
            runner.close()
