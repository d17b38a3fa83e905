"""Physics of many worlds at once: what the executor of a batch asks of a simulator.

An engine that has one says so with `bt_tasksim.engines.base.PhysicsEngine.batch`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, JointTarget, WorldState
from bt_tasksim.scene.configuration import ActorConfiguration


class PhysicsBatch(ABC):
    """Worlds of one robot that know nothing of each other: they begin, go on and fail one by one.

    ``rows`` are indices of worlds ``(k,)``, each at most once, in any order; arrays that go in or come out
    have a leading axis in that order. Worlds of one batch may hold different objects and fixtures: arrays
    are as wide as the world with the most, filled up with NaN and False. The columns of `Hidden.support` are
    those of the objects, and then those of the fixtures, which so begin at the same column in all worlds.

    A world's states are the same bits for any number of worlds, order of rows and number of threads.

    Args:
        worlds: How many there are; at least 1.

    Attributes:
        worlds: How many there are.
        errors: Why each world failed, ``worlds`` long; None where it has not. A world fails when it cannot be
            built, when its target or its state is no longer finite, or when its engine gives up. It stays as
            it last was, whatever is asked of it, until it is reset; the others go on.
    """

    def __init__(self, worlds: int) -> None:
        self.worlds = worlds
        self.errors: list[BtTasksimError | None] = [None] * worlds

    @abstractmethod
    def reset(self, rows: Array, configurations: Sequence[ActorConfiguration]) -> None:
        """Fresh worlds, at rest, at these rows; the others go on untouched."""

    @abstractmethod
    def step(self, target: JointTarget, rows: Array) -> None:
        """One control period in these worlds; ``target (k, n_joints)``. Those that have failed stay."""

    @abstractmethod
    def state(self, rows: Array) -> WorldState:
        """The states ``(k, ...)`` of worlds that were reset; the caller's own arrays."""

    @abstractmethod
    def hidden(self, rows: Array) -> Hidden:
        """What only a simulator knows ``(k, ...)`` of worlds that were reset; the caller's own arrays."""

    def deepest_pair(self, row: int) -> tuple[str, str, float, float] | None:
        """See `bt_tasksim.engines.base.PhysicsEngine.deepest_pair`, of one world."""
        return None

    def close(self) -> None:  # noqa: B027  # a default, and not a method that was forgotten
        """Let go of worlds and threads; by default nothing. May be called more than once."""
