"""A simulation behind the guard, to see what the guard would do to a tree before a robot is moved."""

from __future__ import annotations

from bt_tasksim.core.world import JointTarget, WorldState
from bt_tasksim.engines.base import PhysicsEngine, PhysicsWrapper
from bt_tasksim.hardware.safety.engine import JointReading
from bt_tasksim.hardware.safety.guard import ENDED, Guard
from bt_tasksim.hardware.safety.stop import SafetyStop
from bt_tasksim.scene.configuration import ActorConfiguration


class GuardedSimulation(PhysicsWrapper):
    """A physics engine whose every command and state is checked; after a stop it brakes and holds.

    Args:
        inner: The simulation.
        guard: The guard.
    """

    def __init__(self, inner: PhysicsEngine, guard: Guard) -> None:
        super().__init__(inner)
        self.guard = guard

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """See `PhysicsEngine.reset`."""
        state = self.inner.reset(configuration)
        self.guard.begin(state.joint_position, 1.0 / configuration.control_frequency)
        return state

    def step(self, target: JointTarget) -> WorldState:
        """See `PhysicsEngine.step`; after a stop, whatever the target, the arm slows down and holds.

        Raises:
            SafetyStop: A limit would be, or is, exceeded; once.
        """
        guard = self.guard
        if guard.stopped is not None:
            return self.inner.step(guard.brake())
        try:
            sent = guard.command(target)
        except SafetyStop:
            self.inner.step(guard.brake())
            raise
        state = self.inner.step(sent)
        now = float(state.time)
        guard.reading(JointReading(guard.names, state.joint_position, state.joint_velocity, now), now)
        guard.wrench(state.wrench)
        return state

    def hold(self, why: str) -> None:
        """See `PhysicsEngine.hold`: no more targets are accepted."""
        self.guard.stop(ENDED(why=why))
