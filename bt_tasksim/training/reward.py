"""What an episode pays, and why."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from bt_tasksim.errors import InputError


@dataclass(frozen=True)
class Reward:
    """What an episode pays.

    The sum over an episode lies near ``success`` or ``failure``; shaping only shows the way. The potential of
    a state is how much smaller its necessary cost is than the cost at the episode's first decision: so
    standing still pays nothing, and coming closer without ever being done pays less than nothing in the end.
    Source: A. Ng, D. Harada, S. Russell, "Policy invariance under reward transformations", ICML 1999.

    Attributes:
        success: The completion signal was right: what follows succeeded, judged by the hidden state too.
        failure: It was wrong, or the subtree failed by itself.
        violated: A limit was exceeded.
        timeout: The concept's own time was over.
        shaping: Weight of the potential.
        gamma: The learner's discount, for the potential too. With 0.99 a second of care would cost a fifth of
            what it may save.
        sufficient: What follows pays; else only shaping and limits do (an ablation).
    """

    success: float = 1.0
    failure: float = -1.0
    violated: float = -1.0
    timeout: float = -1.0
    shaping: float = 0.3
    gamma: float = 0.999
    sufficient: bool = True

    def __post_init__(self) -> None:
        if not 0.0 < self.gamma <= 1.0:
            raise InputError(f"'gamma' should be above 0 and at most 1, found {self.gamma:g}")
        paid = (self.success, self.failure, self.violated, self.timeout, self.shaping)
        if not all(math.isfinite(v) for v in paid):
            raise InputError(f"a reward's parts should be finite numbers, found {paid}")
        if self.success <= 0.0 or max(self.failure, self.violated, self.timeout) > 0.0:
            raise InputError("success should pay more than nothing, and failures no more than nothing")
        if self.shaping < 0.0:
            raise InputError(f"'shaping' should not be negative, found {self.shaping:g}")

    def shape(self, before: float, after: float) -> float:
        """Shaping for a change of potential (necessary cost at the start less the present one)."""
        return self.shaping * (self.gamma * after - before)

    def take_back(self, before: float) -> float:
        """Shaping at an end without success: the potential after it is nothing, so coming near never pays.

        Source: M. Grzes, "Reward shaping in episodic reinforcement learning", AAMAS 2017.
        """
        return -self.shaping * before


PARTS = tuple(f.name for f in fields(Reward) if f.name not in ("gamma", "sufficient"))
"""Names of the parts of a reward, as an episode's ``info["reward"]`` gives them."""
