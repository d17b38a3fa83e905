"""One activation of what stands under a `Train` node, from the draw of its world to the judgement."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.leaf import Decision
from bt_tasksim.concept.reporting import outcome_of, speaker
from bt_tasksim.core.errors import BtTasksimError, InputError, LeafError
from bt_tasksim.core.outcomes import (
    INTERRUPTED,
    LIMIT_VIOLATED,
    TIME_OVER,
    TIMED_OUT,
    Outcome,
    outcome_of_error,
    register_reason,
)
from bt_tasksim.execution.leaf_errors import ticking
from bt_tasksim.execution.runner import Runner
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.training.judge import Judgement, SignalOutcome
from bt_tasksim.training.reward_parts import End
from bt_tasksim.trees.nodes.train import Train

BEGAN_ANEW = register_reason("began_anew", "'{train}' began anew before what follows ended")
TREE_ENDED = register_reason("tree_ended", "the tree ended before what follows did")
FOLLOWER_LATE = register_reason("follower_late", "what follows did not end in time")


@dataclass(frozen=True)
class Ending:
    """How an episode ended.

    Attributes:
        end: What is paid for it.
        outcome: Why; None where nobody says.
        truncated: It was cut off from outside, or its judgement was spoiled; else it is terminated.
        kept: Its last state counts as one from which things could have gone on, so its potential stays.
        judged: What became of the completion signal; None without one.
        status: Status of the subtree.
        seconds: Simulated time since the world was drawn.
    """

    end: End
    outcome: Outcome | None
    truncated: bool
    kept: bool
    judged: SignalOutcome | None
    status: str
    seconds: float

    @property
    def is_success(self) -> bool:
        """The completion signal was right, and nothing spoiled the judgement."""
        return self.judged is not None and self.judged.success and not self.judged.discarded

    @property
    def discarded(self) -> bool:
        """An error spoiled the judgement."""
        return self.judged is not None and self.judged.discarded

    def info(self, paid: dict[str, float]) -> dict[str, Any]:
        """What gymnasium's ``info`` says of an episode's last step.

        Args:
            paid: What it paid, by part.
        """
        return {
            "reward": paid,
            "is_success": self.is_success,
            "status": self.status,
            "follower": "" if self.judged is None else self.judged.status,
            "reason": "" if self.outcome is None else self.outcome.cause.reason.name,
            "why": "" if self.outcome is None else self.outcome.sentence,
            "discarded": self.discarded,
            "seconds": self.seconds,
        }


def ending_of(
    cut: Outcome | None,
    judged: SignalOutcome | None,
    outcome: Outcome | None,
    said: Outcome | None,
    sufficient: bool,
    status: str,
    seconds: float,
) -> Ending:
    """How an episode ended.

    Args:
        cut: What broke it off; None: nothing did.
        judged: What became of the completion signal; None without one.
        outcome: How the leaf ended that decided last; None where it runs, or says nothing.
        said: What the node says that made the subtree fail.
        sufficient: What follows pays.
        status: Status of the subtree.
        seconds: Simulated time since the world was drawn.
    """
    end: End = "cut"
    truncated = False
    if cut is not None:
        outcome, truncated = cut, cut.is_a(TIME_OVER)
    elif judged is not None:
        outcome, truncated = judged.outcome, judged.discarded
        if not judged.discarded and sufficient:
            end = "success" if judged.success else "failure"
    elif outcome is not None and outcome.is_a(LIMIT_VIOLATED):
        end = "violated"
    elif outcome is not None and outcome.is_a(TIMED_OUT):
        end = "timeout"
    else:
        outcome, end = said or outcome, "failure"
    kept = truncated or (judged is not None and (judged.success or not sufficient))
    return Ending(end, outcome, truncated, kept, judged, status, seconds)


class Episode:
    """Drives a tree from decision to decision; everything that is true of one episode alone is here.

    Args:
        runner: Of the tree; it is reset to the world.
        train: The node whose activation it is.
        configuration: The world.
    """

    def __init__(self, runner: Runner, train: Train, configuration: ActorConfiguration) -> None:
        runner.reset(configuration)
        self._runner, self._tree, self._train = runner, runner.tree, train
        self._judgement = Judgement(train, runner.context, configuration.tolerance)
        self._ticks_left = round(runner.longest * configuration.control_frequency)
        self._ticking: Generator[Behaviour | Decision, None, None] | None = None
        self._activation: int | None = None
        self._judged: SignalOutcome | None = None
        self._cut: Outcome | None = None
        self._last: Decision | None = None
        self.waiting: Decision | None = None
        """The decision that the tree waits for; None before the first, while it goes on, and at the end."""

    def next_decision(self) -> Decision | None:
        """Tick and step until a leaf under training is about to act, or the activation has ended (None).

        A decision that is waited for was taken with ``waiting.leaf.decide(...)`` before.
        """
        self.waiting = None
        self.waiting = self._until_decision()
        self._last = self.waiting or self._last
        return self.waiting

    def ending(self, sufficient: bool = True) -> Ending:
        """How it ended, after `next_decision` gave None.

        Args:
            sufficient: What follows pays.
        """
        failed = speaker(self._train)
        return ending_of(
            self._cut,
            self._judged,
            None if self._last is None else self._last.leaf.outcome,
            None if failed is None else outcome_of(failed),
            sufficient,
            self._train.status.name,
            self._runner.context.now,
        )

    def close(self) -> None:
        """End a tick that is suspended."""
        self.waiting = None
        if self._ticking is not None:
            self._ticking.close()
            self._ticking = None

    def _until_decision(self) -> Decision | None:
        train, judgement = self._train, self._judgement
        while True:
            node = self._next_node()
            if isinstance(node, Decision):
                if self._activation is None:
                    self._activation = train.activations
                    if judgement.follower is not None:
                        judgement.reset()  # what it did in earlier rounds
                if train.activations == self._activation:
                    return node
                self._cut = INTERRUPTED()
                return None
            judgement.saw(node)
            if node is train and train.status != Status.RUNNING:
                if self._activation is None:  # nothing was decided
                    judgement.reset()
                    continue
                if train.status == Status.SUCCESS:
                    self._judged = self._follow()
                return None
            if node is not None:
                continue
            if self._activation is not None and train.status != Status.RUNNING:
                self._cut = INTERRUPTED()
                return None
            if self._tree.status != Status.RUNNING:
                return None
            if not self._control_period():
                self._cut = TIME_OVER(limit=self._runner.longest)
                return None

    def _follow(self) -> SignalOutcome:
        """Run what follows to its end."""
        judgement = self._judgement
        try:
            judged = judgement.ended(self._train)
            while judged is None:
                node = self._next_node()
                if isinstance(node, Decision):
                    return SignalOutcome(False, "INVALID", BEGAN_ANEW(train=self._train.name))
                judgement.saw(node)
                judged = judgement.ended(node)
                if judged is None and node is None:
                    if self._tree.status != Status.RUNNING:
                        return SignalOutcome(False, "INVALID", TREE_ENDED())
                    if not self._control_period():
                        return SignalOutcome(False, "RUNNING", FOLLOWER_LATE(), discarded=True)
            return judged
        except (InputError, LeafError):
            raise
        except BtTasksimError as error:
            return SignalOutcome(False, "INVALID", outcome_of_error(error), discarded=True)

    def _next_node(self) -> Behaviour | Decision | None:
        """The next node that the present tick visits; None at its end."""
        if self._ticking is None:
            self._ticking = ticking(self._tree)
        node = next(self._ticking, None)
        if node is None:
            self._ticking = None
        return node

    def _control_period(self) -> bool:
        """Step the world, if there is time left."""
        if self._ticks_left <= 0:
            return False
        self._ticks_left -= 1
        self._runner.step(self._runner.context.command)
        return True
