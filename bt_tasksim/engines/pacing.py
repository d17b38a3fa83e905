"""A simulation in real time."""

from __future__ import annotations

from bt_tasksim.core.world import JointTarget, WorldState
from bt_tasksim.engines.base import PhysicsEngine, PhysicsWrapper
from bt_tasksim.engines.clock import Clock
from bt_tasksim.scene.configuration import ActorConfiguration


class PacedPhysics(PhysicsWrapper):
    """A simulation in real time: each step takes one control period.

    Args:
        inner: The physics engine.
        clock: The clock.
    """

    def __init__(self, inner: PhysicsEngine, clock: Clock) -> None:
        super().__init__(inner)
        self.clock = clock

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """See `PhysicsEngine.reset`."""
        state = self.inner.reset(configuration)
        self.clock.start(1.0 / configuration.control_frequency)
        return state

    def step(self, target: JointTarget) -> WorldState:
        """See `PhysicsEngine.step`."""
        state = self.inner.step(target)
        self.clock.wait()
        return state
