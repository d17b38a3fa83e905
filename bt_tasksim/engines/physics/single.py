"""One simulated world: a batch of one."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np

from bt_tasksim.core.bundles import mapped
from bt_tasksim.core.world import Hidden, JointTarget, WorldState
from bt_tasksim.engines.base import PhysicsEngine
from bt_tasksim.engines.body_contacts import BodyContacts
from bt_tasksim.engines.physics.threaded import SimulatedWorld, ThreadedBatch
from bt_tasksim.scene.configuration import ActorConfiguration

ONE = np.zeros(1, int)
"""The row of a batch of one."""
W = TypeVar("W", bound=SimulatedWorld)


class SimulatedPhysics(PhysicsEngine, Generic[W]):
    """A physics engine of one world: the case of one of a batch.

    Args:
        batch: The batch, of one world.
    """

    def __init__(self, batch: ThreadedBatch[W]) -> None:
        self.robot = batch.robot
        self._batch = batch

    @property
    def simulated(self) -> W:
        """The world itself, after a reset."""
        (world,) = self._batch.simulated
        assert world is not None, "it was not reset"
        return world

    def contact_points(self) -> BodyContacts | None:
        """See `PhysicsEngine.contact_points`."""
        return self.simulated.contact_points()

    @property
    def deepest_pair(self) -> tuple[str, str, float, float] | None:
        """Names of the bodies that overlapped most, metres, and seconds; None before any."""
        return self.simulated.deepest_pair

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """See `PhysicsEngine.reset`."""
        self._batch.reset(ONE, [configuration])
        return self._now()

    def step(self, target: JointTarget) -> WorldState:
        """See `PhysicsEngine.step`.

        Raises:
            MachineError: The target or the state is not finite; nothing has moved for a bad target.
        """
        self._batch.errors[0] = None  # who was told may try again
        self._batch.step(JointTarget(target.position[None], target.velocity[None]), ONE)
        return self._now()

    def hidden(self) -> Hidden:
        """See `PhysicsEngine.hidden`."""
        return _first(self._batch.hidden(ONE))

    def close(self) -> None:
        """See `Engine.close`."""
        self._batch.close()

    def _now(self) -> WorldState:
        (error,) = self._batch.errors
        if error is not None:
            raise error
        return _first(self._batch.state(ONE))


B = TypeVar("B", WorldState, Hidden)


def _first(bundle: B) -> B:
    found: B = mapped(lambda values: values[0], bundle)
    return found
