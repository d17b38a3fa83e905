"""What became of an episode, as a value that shows itself in one line, in a table or as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from py_trees.common import Status

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.markup import html_pairs
from bt_tasksim.core.outcomes import Outcome
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.clock import Timing
from bt_tasksim.execution.paths import Paths
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.success import NO_GOAL, Verdict


@dataclass(repr=False)
class Result:
    """What became of an episode.

    Attributes:
        status: The tree's own status at the end.
        success: The tree ended SUCCESS and the physics state agrees.
        outcome: How it ended: what the success evaluator found, or why the tree failed or was stopped.
        leaf: Name of the node that made the tree fail, or of the leaf that was stopped from outside; empty
            where the tree succeeded or time was over. It is a leaf, or a node that decides by itself, such as
            a time-out: then ``why`` names the leaf that was at work.
        verdict: What the success evaluator found, None on a real robot.
        seed: Seed of the episode.
        control_steps: Control periods until the tree ended.
        sim_time: Seconds of the episode until the tree ended.
        wall_time: Seconds on the clock from its beginning to its result. In a batch other worlds are computed
            meanwhile: the sum over episodes is more than the batch took.
        policies: Policy in use by leaf.
        configuration: The world as drawn.
        timing: How well the control rate was kept; None where there was none to keep.
        paths: Where everything was at every tick; None where nobody kept it, as in a batch. Read it by
            `times`, `path` and `poses`.
    """

    status: Status
    success: bool
    outcome: Outcome
    leaf: str
    verdict: Verdict | None
    seed: int
    control_steps: int
    sim_time: float
    wall_time: float
    policies: dict[str, str]
    configuration: ActorConfiguration
    timing: Timing | None = None
    paths: Paths | None = field(default=None, compare=False)

    @property
    def times(self) -> Array:
        """Seconds ``(N,)`` since the episode began: of each tick, and of each period until all was at rest.

        Raises:
            InputError: See `path`.
        """
        return self._paths.times

    def path(self, name: str) -> Array:
        """Poses ``(N, 7)`` of an object at `times`, or of the tool by the name ``tool``, robot base frame.

        In simulation they are the true ones; on a robot those of objects are as estimated.

        Raises:
            InputError: There is no such object, or no paths were kept.
        """
        return self._paths.of(name)

    @property
    def poses(self) -> Mapping[str, Array]:
        """The last pose ``(7,)`` of each object, and of the ``tool``, see `path`.

        Raises:
            InputError: See `path`.
        """
        return self._paths.last

    @property
    def _paths(self) -> Paths:
        if self.paths is None:
            raise InputError(
                "this result keeps no paths: those of a batch, and of a run that broke off, have none; "
                "run this seed by itself, with run() or Session"
            )
        return self.paths

    @property
    def judged(self) -> bool:
        """The physics state was asked whether all goals are reached; else the tree's own word was taken."""
        return self.verdict is not None and self.verdict.judged

    @property
    def reason(self) -> str:
        """The registered name of the reason for failure, to be counted; empty on success."""
        return "" if self.success else self.outcome.cause.reason.name

    @property
    def why(self) -> str:
        """One sentence: what the success evaluator found, or the leaf that failed and why."""
        return f"{self.leaf}: {self.outcome.sentence}" if self.leaf else self.outcome.sentence

    def __str__(self) -> str:
        """As the command line prints it."""
        word = "SUCCESS" if self.success else "FAILURE"
        return f"{word}: {self.why} ({self.sim_time:.1f} s simulated, {self.wall_time:.1f} s)"

    def __repr__(self) -> str:
        why = f"reason={self.reason!r}, leaf={self.leaf!r}, " if not self.success else ""
        return f"<Result {self.status.name} success={self.success} {why}seed={self.seed}>"

    def _repr_html_(self) -> str:
        """A small table, for notebooks."""
        unjudged = self.verdict is not None and self.verdict.outcome.is_a(NO_GOAL)
        tree = "" if self.success else f" (the tree ended {self.status.name})"
        return html_pairs(
            {
                "status": f"{'SUCCESS' if self.success else 'FAILURE'}{tree}",
                "judged": "nothing, no goal is set" if unjudged else "",
                "why": self.outcome.sentence,
                **({} if self.success else self.outcome.cause.table_rows()),
                "leaf": self.leaf,
                "seed": str(self.seed),
                "time": f"{self.sim_time:.1f} s simulated in {self.control_steps} control periods, "
                f"{self.wall_time:.1f} s on the clock",
                "robot": self.configuration.robot,
                "policies": ", ".join(f"{leaf}: {policy}" for leaf, policy in self.policies.items()),
            }
        )
