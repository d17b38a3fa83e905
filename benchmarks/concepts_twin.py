"""Ready-made scenarios on the twin: over ROS and in real time, judged by the twin's own truth.

A scene's parts that slide and turn are in the twin's world as in a simulation, and nobody tells the tree how
far they are open unless the scene says that this is sensed: it knows what its hand has done with them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict
from typing import Any

from benchmarks.faults import Bench, bench_of
from benchmarks.gap import judged_by_truth
from bt_tasksim.core.closing import Closing
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.training.evaluation_outcomes import wilson
from bt_tasksim.training.named_tree import NamedTree

DOMAIN = 48
"""ROS domain."""


class TwinOfScenarios(Closing):
    """One twin for any number of scenarios, begun by the first draw."""

    def __init__(self) -> None:
        self._open = ExitStack()
        self._bench: Bench | None = None

    def close(self) -> None:
        """End the twin."""
        self._open.close()
        self._bench = None

    def measure(self, scenario: str, robot: str, seeds: Sequence[int]) -> dict[str, Any]:
        """What is kept of a scenario; a line is printed for each draw as it ends."""
        bench = self._bench = self._bench or self._open.enter_context(bench_of(DOMAIN))
        options = EngineOptions(engines=f"ros:127.0.0.1:{bench.twin.port}", noise="fine")
        source = NamedTree(scenario, None, robot).load(options)
        runner = Runner(source.build(), source.scene, options)
        draws = []
        try:
            for seed in seeds:
                found = judged_by_truth(runner, bench.evaluation, seed)
                told = bench.evaluation.tell()
                times = {"simulated": round(told["time"], 2), "left_out": round(told["left_out"], 3)}
                draws.append({"seed": int(seed), **asdict(found), **times})
                mark = "ok  " if found.success else "FAIL"
                print(f"{mark} {scenario} {seed}  {found.leaf} {found.reason} {found.why}", flush=True)
        finally:
            runner.close()
        return summary(draws)


def summary(draws: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Successes, and failures by leaf and reason."""
    successes = sum(draw["success"] for draw in draws)
    reasons = Counter(f"{draw['leaf']}: {draw['reason']}" for draw in draws if not draw["success"])
    return {
        "episodes": len(draws),
        "successes": successes,
        "confidence_interval": [round(end, 4) for end in wilson(successes, len(draws))],
        "reasons": dict(reasons.most_common()),
        "draws": list(draws),
    }
