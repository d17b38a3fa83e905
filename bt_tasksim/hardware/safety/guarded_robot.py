"""A real robot in the physics role: guard, clock, watchdog and emergency stop around its engine.

Everything that can go wrong in a run ends here, in one way: the first reason counts, the arm holds, and
`SafetyStop` tells the runner.
"""

from __future__ import annotations

import threading
import time
from typing import ClassVar

from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.units import MILLISECONDS
from bt_tasksim.core.world import JointTarget, WorldState
from bt_tasksim.engines.base import PhysicsEngine
from bt_tasksim.engines.clock import Clock
from bt_tasksim.hardware.safety.checks import FORCE, TORQUE, TRACKING
from bt_tasksim.hardware.safety.engine import RealEngine
from bt_tasksim.hardware.safety.guard import ENDED, Guard
from bt_tasksim.hardware.safety.stop import SafetyStop
from bt_tasksim.hardware.safety.watchdog import Watchdog
from bt_tasksim.scene.configuration import ActorConfiguration

EMERGENCY_STOP = register_reason("emergency_stop", "emergency stop: {by}")
CHECKED_LATE = register_reason(
    "checked_late", "late: checked {early} before it could be sent", early=MILLISECONDS
)
COMMAND_LATE = register_reason(
    "command_late", "late: no command for {time}, and the last one has expired", time=MILLISECONDS
)
ENGINE_FAILED = register_reason("robot_engine_failed", "the robot's engine failed: {error}")
WATCHDOG_STOPPED = register_reason("watchdog_stop", "{trouble}")
_WHERE_IT_IS = (FORCE, TORQUE, TRACKING, WATCHDOG_STOPPED)
"""Reasons to stop where the arm is: it pushes against something, or somebody has stopped it already."""


class GuardedRobot(PhysicsEngine):
    """The physics engine that a pipeline gets for a real robot.

    Args:
        engine: The robot's engine.
        guard: The guard.
        clock: A clock of real time.
    """

    real: ClassVar[bool] = True

    def __init__(self, engine: RealEngine, guard: Guard, clock: Clock) -> None:
        self.engine, self.guard, self.clock = engine, guard, clock
        self._hold_delivered = True
        self.watchdog: Watchdog | None = None
        self._lock = threading.RLock()  # an interrupt during a hold leads to another one
        self._held = True
        self._sent = 0.0
        engine.emergency.listen(self._emergency)

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """See `PhysicsEngine.reset`: a new run, which ends an earlier stop.

        Raises:
            MachineError: The emergency stop is pressed, or the robot or the watchdog is not there.
            SafetyStop: Its joint states are not to be trusted.
        """
        self.hold("a new run begins")
        if self.engine.emergency.held_down():
            raise MachineError("the emergency stop is pressed; release it, and start again")
        self.engine.emergency.release()
        self._start_watchdog()
        self.guard.stopped = None
        self._held = False
        try:
            return self._begin(configuration)
        except BaseException as error:
            self.hold(f"the run did not begin: {error}")
            raise

    def _begin(self, configuration: ActorConfiguration) -> WorldState:
        period = 1.0 / configuration.control_frequency
        self.guard.check_period(period)
        self.engine.reset(configuration, self._beat)
        if self.watchdog is not None:  # the arm stands until the first command
            self.watchdog.rest()
        self.guard.begin(self.engine.latest().position, period)
        if why := self.engine.emergency.why:  # meanwhile, and `begin` has forgotten the stop
            raise self.guard.stop(EMERGENCY_STOP(by=why))
        state = self._read()
        self._sent = 0.0
        self.clock.start(period)
        return state

    def begin(self) -> WorldState:
        """See `PhysicsEngine.begin`: the clock starts, from this state.

        Raises:
            SafetyStop: The robot's state is not to be trusted.
        """
        try:
            state = self._read()
        except MachineError as error:
            self.hold(f"the run did not begin: {error}")
            raise
        self.clock.start(self.guard.period)
        return state

    def step(self, target: JointTarget) -> WorldState:
        """Send one command, wait until the next tick begins, and read.

        Raises:
            SafetyStop: Something was wrong; the arm holds, and will until `reset`.
        """
        try:
            checked = time.monotonic()
            self._before(checked)
            self._send(self.guard.command(target), checked)
            self.clock.acted(self._sent - self._stamp)
            self.clock.wait()
            self._beat()
            return self._read()
        except MachineError as error:
            stop = self._reason(error)
            self.hold(str(stop))
            if stop is error:
                raise
            raise stop from error

    @property
    def hold_delivered(self) -> bool:
        """The last hold was said to the robot, or to a watchdog that is there."""
        return self._hold_delivered

    def hold(self, why: str) -> None:
        """The arm holds, and nothing moves it until `reset`; a second call does nothing.

        Where the engine cannot tell the robot, the watchdog does it in its own way; and commands expire.
        """
        with self._lock:
            if self._held:
                return
            here = self.guard.stop(ENDED(why=why)).reason in _WHERE_IT_IS
            try:
                self.engine.hold(why, here)
            except Exception:  # whatever it is, there is another way
                self._hold_delivered = self.watchdog is not None and self.watchdog.hold()
            else:
                self._hold_delivered = True
                if self.watchdog is not None:
                    self.watchdog.rest()
            self._held = True

    def close(self) -> None:
        """Hold, and let go of the watchdog and the engine."""
        self.hold("the run is over")
        if self.watchdog is not None:
            self.watchdog.close()
            self.watchdog = None
        self.engine.close()

    def _start_watchdog(self) -> None:
        if self.watchdog is not None:
            if not self.watchdog.trouble():
                return
            self.watchdog.close()
            self.watchdog = None
        channel = self.engine.hold_channel()
        if channel is not None:
            self.watchdog = Watchdog(channel, self.guard.limits.watchdog)

    def _send(self, target: JointTarget, checked: float) -> None:
        """Send, unless another thread has stopped the robot since the checks, or those are too old."""
        with self._lock:
            if self.guard.stopped is not None:
                raise self.guard.stopped
            if (late := time.monotonic() - checked) > self.guard.period:
                raise self.guard.stop(CHECKED_LATE(early=late))
            self.engine.send(target)
            self._sent = time.monotonic()

    def _before(self, now: float) -> None:
        """What must hold before a command goes out."""
        guard = self.guard
        if guard.stopped is not None:
            raise guard.stopped
        self._beat()
        if self._sent and now - self._sent > guard.limits.validity:
            raise guard.stop(COMMAND_LATE(time=now - self._sent))
        guard.reading(self.engine.latest(), now)
        if self._sent and (late := now - self._sent - guard.period) > 0.0:
            guard.late(late)

    def _reason(self, error: MachineError) -> SafetyStop:
        if isinstance(error, SafetyStop):
            return error
        return self.guard.stop(ENGINE_FAILED(error=error))

    def _read(self) -> WorldState:
        reading = self.engine.latest()
        self.guard.reading(reading, time.monotonic())
        self._stamp = reading.stamp
        state = self.engine.state(reading)
        self.guard.wrench(state.wrench)
        return state

    def _beat(self) -> None:
        with self._lock:  # a heartbeat after a hold would begin the watch again
            if self.watchdog is not None and not self._held:
                if trouble := self.watchdog.trouble():
                    raise self.guard.stop(WATCHDOG_STOPPED(trouble=trouble))
                self.watchdog.heartbeat()

    def _emergency(self, why: str) -> None:
        """On the thread of whatever pressed it: the arm holds at once."""
        stop = self.guard.stop(EMERGENCY_STOP(by=why))
        self.hold(str(stop))
