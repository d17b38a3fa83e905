"""The decisions of an episode, one after the other, as what rewards are paid for."""

from __future__ import annotations

from bt_tasksim.core.poses import Array
from bt_tasksim.training.decision import Decision
from bt_tasksim.training.reward_parts import End, Transition


class Transitions:
    """Makes a `Transition` of each decision and the one after it.

    The potential of a state is how much smaller its necessary cost is than at the leaf's first decision; a
    leaf that takes over from another one starts from nothing.

    Args:
        first: The episode's first decision.
        gamma: The learner's discount.
        cost: Its necessary cost.
    """

    def __init__(self, first: Decision, gamma: float, cost: float) -> None:
        self.decision = first
        """The last decision that was waited for."""
        self._gamma = gamma
        self._first_cost = cost
        self._potential = 0.0
        self._motion: Array | None = None
        self._last_motion: Array | None = None

    def decided(self, motion: Array) -> None:
        """Take note of what was decided: a motion ``(actions,)``."""
        self._motion = motion

    def to(self, found: Decision, cost: float) -> Transition:
        """From the decision before to this one.

        Args:
            found: This one.
            cost: Its necessary cost.
        """
        before, same_leaf = self.decision, found.leaf is self.decision.leaf
        after = self._first_cost - cost
        if not same_leaf:
            self._first_cost, self._potential, after = cost, 0.0, 0.0
        made = self._made(before, after)
        self._last_motion = self._motion if same_leaf else None
        self._potential, self.decision = after, found
        return made

    def to_end(self, end: End, kept: bool) -> Transition:
        """From the last decision to the episode's end.

        Args:
            end: How it ended.
            kept: The present observation is charged once, since there is no state after it: the potential
                stays as it is. Else it falls to nothing.
        """
        return self._made(self.decision, self._potential if kept else 0.0, end)

    def _made(self, decision: Decision, after: float, end: End = "") -> Transition:
        assert self._motion is not None, "decided() comes before"
        return Transition(decision, self._motion, self._last_motion, self._potential, after, self._gamma, end)
