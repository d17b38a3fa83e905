"""The guard: checks every command before it is sent and every state before it is used, and stops for good.

It stands between kinematics and the physics role. What goes out is what came in, or slowed down where the
limit's policy says clip; after a stop it is a hold and nothing else, until a new run begins.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import Outcome, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.units import MILLISECONDS
from bt_tasksim.core.world import JointTarget
from bt_tasksim.hardware.safety import checks
from bt_tasksim.hardware.safety.engine import JointReading
from bt_tasksim.hardware.safety.motion import JointMotion, braked, followed, moved, resting
from bt_tasksim.hardware.safety.stop import RAD, SafetyStop
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.limits import MARGIN, REACTION, SafetyLimits

ENDED = register_reason("run_ended", "{why}")
FROZEN = register_reason(
    "frozen_joint_states",
    "stale: joint states have not changed for {time}, while commands moved by {way}",
    time=MILLISECONDS,
    way=RAD,
)
_HALVINGS = 8
"""Steps in which the fastest motion that fits is looked for."""
_MOVED = 0.01
"""Radians that commands have moved while the reported joints have not changed by a bit: they are frozen."""


class Guard:
    """Checks one robot's commands and states.

    Args:
        robot: The robot, with its ``safety`` limits.
        forward: Tool pose ``(7,)`` of joints ``(n_joints,)``.

    Raises:
        InputError: The robot's file has no section ``safety``.
    """

    def __init__(self, robot: RobotDescription, forward: Callable[[Array], Array]) -> None:
        if robot.safety is None:
            raise InputError(
                f"robot file '{robot.source}' has no section 'safety'; a robot needs its limits before it is "
                f"moved: see docs/safety.md"
            )
        self.robot, self.limits, self.forward = robot, robot.safety, forward
        self.names = robot.joints
        self._n = len(robot.arm_joints)
        self.lower, self.upper, self.velocity, self.acceleration = _bounds(robot, robot.safety)
        self.stopped: SafetyStop | None = None
        self.begin(np.zeros(len(self.names)), 0.05)

    def begin(self, position: Array, period: float) -> None:
        """Begin a run: an earlier stop is over.

        Args:
            position: Joints ``(n_joints,)`` where the robot stands.
            period: Seconds between two commands.

        Raises:
            InputError: See `check_period`.
        """
        self.check_period(period)
        self.period, self._shortest = period, self.limits.validity - period
        self.stopped = None
        still, begin, n = np.zeros_like(position), np.array(position, float), self._n
        begin[n:] = np.clip(begin[n:], self.lower[n:], self.upper[n:])  # measured, and so beside its range
        self.motion = JointMotion(begin, still)
        self._reference = self.motion
        self._tool = self.forward(self.motion.position)
        self._twist = np.zeros(6)
        self._reading: JointReading | None = None
        self._changed: tuple[float, Array] | None = None

    def check_period(self, period: float) -> None:
        """See that the limits' times suit the seconds between two commands; nothing else happens.

        Raises:
            InputError: Commands would expire, or heartbeats be missed, between two of them, or old joint
                states would be noticed too late.
        """
        limits = self.limits
        for most, what, how in (
            (limits.validity / 2.0, f"cannot expire after {1000 * limits.validity:.0f} ms", "raise validity"),
            (limits.watchdog / 1.5, f"suit no watchdog of {1000 * limits.watchdog:.0f} ms", "raise watchdog"),
            (
                REACTION - MARGIN - limits.stale,
                f"notice states of {1000 * limits.stale:.0f} ms too late to hold in {1000 * REACTION:.0f} ms",
                "lower stale",
            ),
        ):
            if period > most + 1e-9:
                raise InputError(
                    f"commands every {1000 * period:.0f} ms {what}: raise the control frequency, or {how} of "
                    f"safety.timing in '{self.robot.source}'"
                )

    # ---- commands ---------------------------------------------------------------------------------------

    def command(self, target: JointTarget) -> JointTarget:
        """The target to send, with the velocity that was checked: the mean one of its period.

        Raises:
            SafetyStop: A limit would be exceeded, or the guard has stopped already.
        """
        if self.stopped is not None:
            raise self.stopped
        position = np.asarray(target.position, float)
        self._stop_at(checks.shape_and_numbers(position, np.asarray(target.velocity, float), self.names))
        wanted = moved(self._reference, position, self.period)
        self._stop_at(self._refused(wanted))
        motion = self._stoppable(self._clipped(wanted))
        tool, twist = self._tool_motion(motion)
        if self.limits.clips("tool_acceleration") and checks.tool_acceleration(
            self._twist, twist, self.period, self.limits
        ):
            motion = self._gentler(motion)
            tool, twist = self._tool_motion(motion)
        self._stop_at(self._exceeded(motion, tool, twist))
        self._reference, self.motion, self._tool, self._twist = wanted, motion, tool, twist
        return JointTarget(motion.position, motion.velocity, self.limits.validity)

    def late(self, seconds: float) -> None:
        """The next command follows so much more than a period after the last one, whose end has begun.

        The arm has been slowing down since (`resting`), and the next motion begins where it is by now.
        """
        rest, braking = resting(self.motion, self.acceleration, self._shortest)
        share = 1.0 - min(max(seconds, 0.0) / braking, 1.0)
        velocity = self.motion.velocity * share
        position = rest - (rest - self.motion.position) * share**2
        velocity[self._n :] = 0.0  # a hand goes where it was told, and no further
        position[self._n :] = self.motion.position[self._n :]
        self.motion, self._tool = JointMotion(position, velocity), self.forward(position)
        before = self.forward(position - self.period * velocity)
        self._twist = checks.twist(before, self._tool, self.period)

    def _refused(self, wanted: JointMotion) -> Outcome | None:
        """Limits that stop, and that the command itself exceeds, whatever clipping would make of it."""
        limits, n = self.limits, self._n
        found = None
        if not limits.clips("joint_position"):
            found = checks.joint_position(wanted.position, self.lower, self.upper, self.names)
        if found is None and not limits.clips("joint_velocity"):
            found = checks.joint_step(
                self._reference.position[:n], wanted.position[:n], limits.step, self.names
            ) or checks.joint_velocity(wanted.velocity, self.velocity, self.names)
        return found

    def _clipped(self, wanted: JointMotion) -> JointMotion:
        """The wanted motion, within those joint limits that clip."""
        clips, endless = self.limits.clips, np.full(len(self.names), np.inf)
        if not (clips("joint_position") or clips("joint_velocity") or clips("joint_acceleration")):
            return moved(self.motion, wanted.position, self.period)
        inside = np.minimum(np.maximum(wanted.position, self.lower), self.upper)
        velocity = np.where(inside == wanted.position, wanted.velocity, 0.0)
        return followed(
            self.motion,
            JointMotion(inside, velocity),
            self.velocity,
            self.acceleration if clips("joint_acceleration") else endless,
            self.lower,
            self.upper,
            self.period,
        )

    def _rest(self, motion: JointMotion) -> Array:
        """Where joints ``(n_joints,)`` stand if no command follows."""
        return resting(motion, self.acceleration, self._shortest)[0]

    def _stoppable(self, motion: JointMotion) -> JointMotion:
        """The fastest motion between braking and this one that ends within the position limits."""
        clips = self.limits.clips
        if not (clips("joint_position") or clips("joint_acceleration")) or self._ends_inside(motion):
            return motion
        slowest = braked(self.motion, self.acceleration, self.period)
        return self._between(slowest.velocity, motion.velocity, self._ends_inside) or slowest

    def _ends_inside(self, motion: JointMotion) -> bool:
        return checks.joint_position(self._rest(motion), self.lower, self.upper, self.names) is None

    def _gentler(self, motion: JointMotion) -> JointMotion:
        """The motion whose change of joint speeds is the largest share that keeps the tool's acceleration."""

        def gentle(tried: JointMotion) -> bool:
            twist = self._tool_motion(tried)[1]
            return checks.tool_acceleration(self._twist, twist, self.period, self.limits) is None

        return self._between(self.motion.velocity, motion.velocity, gentle) or motion

    def _between(self, slow: Array, fast: Array, fits: Callable[[JointMotion], bool]) -> JointMotion | None:
        """The motion nearest to the fast one, of those between two velocities ``(n_joints,)``, that fits."""
        share, step, found = 0.0, 0.5, None
        for _ in range(_HALVINGS):
            velocity = slow + (share + step) * (fast - slow)
            tried = JointMotion(self.motion.position + self.period * velocity, velocity)
            if fits(tried):
                share, found = share + step, tried
            step /= 2.0
        return found

    def _tool_motion(self, motion: JointMotion) -> tuple[Array, Array]:
        tool = self.forward(motion.position)
        return tool, checks.twist(self._tool, tool, self.period)

    def _exceeded(self, motion: JointMotion, tool: Array, twist: Array) -> Outcome | None:
        """What would be sent exceeds a limit."""
        limits, names, n = self.limits, self.names, self._n
        rest = self._rest(motion)
        could_not_stop = "could not stop before"
        return (
            checks.joint_position(motion.position, self.lower, self.upper, names)
            or checks.joint_position(rest, self.lower, self.upper, names, could_not_stop)
            or checks.joint_velocity(motion.velocity, self.velocity, names)
            or checks.joint_acceleration(self.motion, motion, self.acceleration, self.period, names)
            or checks.joint_step(self.motion.position[:n], motion.position[:n], limits.step, names)
            or checks.tool_velocity(twist, limits)
            or checks.tool_acceleration(self._twist, twist, self.period, limits)
            or checks.workspace(tool[:3], limits.workspace)
            or checks.workspace(
                self.forward(rest)[:3], limits.workspace, "the tool could not stop before it is"
            )
        )

    # ---- states -----------------------------------------------------------------------------------------

    def reading(self, reading: JointReading, now: float) -> None:
        """Look at joint states.

        Args:
            reading: The newest ones.
            now: Seconds of `time.monotonic`.

        Raises:
            SafetyStop: They are not to be trusted, or the robot does not do what it is told.
        """
        if self.stopped is not None:
            raise self.stopped
        limits, names, n = self.limits, self.names, self._n
        self._stop_at(checks.joint_names(reading.names, names))
        self._stop_at(checks.reported_numbers((reading.position, reading.velocity), names))
        self._stop_at(checks.fresh(now - reading.stamp, limits.stale))
        before, arm = self._reading, reading.position[:n]
        if before is not None and reading.stamp > before.stamp:
            elapsed = reading.stamp - before.stamp
            self._stop_at(checks.plausible(before.position[:n], arm, elapsed, self.velocity[:n], names))
        self._stop_at(self._frozen(reading, now))
        self._stop_at(checks.tracking(self.motion.position[:n], arm, limits.tracking, names))
        self._reading = reading

    def _frozen(self, reading: JointReading, now: float) -> Outcome | None:
        """Joint states arrive and do not change, while commands do."""
        commanded, n = self.motion.position, self._n
        before, arm = self._reading, reading.position[:n]
        if self._changed is None or before is None or not np.array_equal(before.position[:n], arm):
            self._changed = (now, commanded)
            return None
        since, then = self._changed
        way = float(np.max(np.abs(commanded - then)[:n], initial=0.0))
        if way == 0.0:  # the arm stands, and is to stand
            self._changed = (now, then)
        if now - since < self.limits.stale or way <= _MOVED:
            return None
        return FROZEN(time=now - since, way=way)

    def wrench(self, wrench: Array) -> None:
        """Look at the external wrench ``(6,)`` on the tool.

        Raises:
            SafetyStop: It is too large.
        """
        if self.stopped is not None:
            raise self.stopped
        self._stop_at(checks.wrench(wrench, self.limits.force, self.limits.torque))

    # ---- stopping ---------------------------------------------------------------------------------------

    def stop(self, outcome: Outcome) -> SafetyStop:
        """Stop for good, and return what to raise; the first reason is the one that counts."""
        if self.stopped is None:
            self.stopped = SafetyStop(outcome)
        return self.stopped

    def _stop_at(self, breach: Outcome | None) -> None:
        if breach is not None:
            raise self.stop(breach)

    def brake(self) -> JointTarget:
        """The next target of an arm that slows down as fast as it may, for a simulation."""
        self.motion = braked(self.motion, self.acceleration, self.period)
        return JointTarget(self.motion.position, self.motion.velocity, self.limits.validity)


def _bounds(robot: RobotDescription, limits: SafetyLimits) -> tuple[Array, Array, Array, Array]:
    """Limits ``(n_joints,)``: the arm's, and those that follow from the hand's range and speed."""
    low = np.minimum(robot.hand_open, robot.hand_closed)
    high = np.maximum(robot.hand_open, robot.hand_closed)
    span = np.abs(robot.hand_closed - robot.hand_open)
    if len(robot.synergies):
        low = low + np.minimum(robot.synergy_directions, 0.0).sum(axis=0)
        high = high + np.maximum(robot.synergy_directions, 0.0).sum(axis=0)
        span = np.maximum(span, np.abs(robot.synergy_directions).max(axis=0))
    speed = np.maximum(span, 1e-6) * robot.hand_speed
    return (
        np.concatenate([limits.lower, low - checks.TOLERANCE]),
        np.concatenate([limits.upper, high + checks.TOLERANCE]),
        np.concatenate([limits.velocity, speed]),
        np.concatenate([limits.acceleration, np.full(len(low), np.inf)]),
    )
