"""The parts of a reward, as parts: each says what it pays for one decision, before it is weighted."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import Literal

from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.training.decision import Decision

End = Literal["", "success", "failure", "violated", "timeout", "cut"]
"""How an episode ended; empty where it goes on. Cut: from outside, or it was not to be judged."""


@dataclass(frozen=True)
class Transition:
    """A decision, and what came of it.

    Attributes:
        decision: What the leaf saw and remembered when it decided.
        motion: The motion ``(actions,)`` that was decided on; 0 is the reference motion.
        last_motion: The motion of the same leaf's decision before; None at its first one.
        before: Potential when it was decided: necessary cost at the leaf's first decision less that then.
        after: Potential at the next decision; 0 where the episode ended and nothing of it is kept.
        gamma: The learner's discount.
        end: How the episode ended with it.
    """

    decision: Decision
    motion: Array
    last_motion: Array | None
    before: float
    after: float
    gamma: float
    end: End = ""


class RewardPart(abc.ABC):
    """A part of a reward; a subclass announces itself with ``@register("reward part", NAME)``."""

    @abc.abstractmethod
    def pay(self, transition: Transition) -> float:
        """What a decision pays; the settings weight it."""


@register("reward part", "success")
class Success(RewardPart):
    """The completion signal was right: what follows succeeded, judged by the hidden state too."""

    def pay(self, transition: Transition) -> float:
        """Once, at the end."""
        return float(transition.end == "success")


@register("reward part", "failure")
class Failure(RewardPart):
    """The completion signal was wrong, or the subtree failed by itself."""

    def pay(self, transition: Transition) -> float:
        """Once, at the end."""
        return float(transition.end == "failure")


@register("reward part", "violated")
class Violated(RewardPart):
    """A limit was exceeded."""

    def pay(self, transition: Transition) -> float:
        """Once, at the end."""
        return float(transition.end == "violated")


@register("reward part", "timeout")
class TimedOut(RewardPart):
    """The concept's own time was over."""

    def pay(self, transition: Transition) -> float:
        """Once, at the end."""
        return float(transition.end == "timeout")


@register("reward part", "shaping")
class Shaping(RewardPart):
    """The change of the potential, which shows the way and changes nothing of what is best.

    Sources: A. Ng, D. Harada, S. Russell, "Policy invariance under reward transformations", ICML 1999; for
    the end, where the potential is nothing, M. Grzes, "Reward shaping in episodic reinforcement learning",
    AAMAS 2017.
    """

    def pay(self, transition: Transition) -> float:
        """At each decision."""
        return transition.gamma * transition.after - transition.before
