"""What a leaf of many trees at once is: statuses as numbers, for index arrays of worlds."""

from __future__ import annotations

import abc
from typing import Final

from bt_tasksim.core.outcomes import Outcome
from bt_tasksim.core.poses import Array

INVALID: Final = 0
"""Not active: never ticked, or stopped."""
RUNNING: Final = 1
SUCCESS: Final = 2
FAILURE: Final = 3
PENDING: Final = 4
"""The tick stands still before this leaf: it goes on when what the leaf waits for is there. Never kept as a
node's status, which stays what it was before the tick."""


class BatchLeaf(abc.ABC):
    """A leaf of a tree that is ticked in many worlds at once.

    Worlds are given as ``rows``, an integer array ``(k,)`` of ascending numbers; statuses go back as an
    ``int8`` array ``(k,)`` of the same library and device.
    """

    stops_ended: bool = False
    """It is stopped in worlds where it has ended, too, as py_trees does."""

    @abc.abstractmethod
    def tick(self, rows: Array, fresh: Array) -> Array:
        """One tick in some worlds.

        Args:
            rows: ``(k,)`` the worlds.
            fresh: boolean ``(k,)``: the leaf was not RUNNING there before, so that it begins now.

        Returns:
            ``(k,)`` RUNNING, SUCCESS or FAILURE; or PENDING, where `resume` is to end this tick.
        """

    def resume(self, rows: Array) -> Array:
        """End the tick in worlds where it was PENDING.

        Returns:
            ``(k,)`` statuses, as of `tick`.

        Raises:
            NotImplementedError: The leaf never is PENDING.
        """
        raise NotImplementedError(f"{type(self).__name__} was never PENDING")

    def stop(self, rows: Array) -> None:  # noqa: B027  # most have nothing to do
        """It is interrupted in worlds where it is RUNNING or PENDING, which the tree does not tick on.

        With `stops_ended` this is called, too, where it has ended and is to be INVALID.
        """

    def outcome(self, row: int) -> Outcome | None:
        """How it ended in a world when it was last active; None: it runs, or has nothing to say."""
        return None
