"""A real robot through rosbridge, in the physics role: commands as short trajectories, states from topics.

Every command is a trajectory that ends at rest, so that it expires by itself in any controller that carries
trajectories out. Nothing here waits but `reset`, and nothing judges: the guard does
(`bt_tasksim.safety.guarded_robot`).
"""

from __future__ import annotations

import itertools
import math
import threading
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bt_tasksim.engines.remote.address import Address
from bt_tasksim.engines.ros import messages
from bt_tasksim.engines.ros.button import Button
from bt_tasksim.engines.ros.joints import JointFeed
from bt_tasksim.engines.ros.link import PATIENCE, Link
from bt_tasksim.engines.ros.messages import Point
from bt_tasksim.engines.ros.setting import RosSetting
from bt_tasksim.errors import InputError, MachineError
from bt_tasksim.poses import Array
from bt_tasksim.robot import RobotDescription
from bt_tasksim.safety import checks
from bt_tasksim.safety.engine import ChannelSpec, EmergencyStop, JointReading
from bt_tasksim.safety.motion import approach
from bt_tasksim.world import JointTarget, WorldState

if TYPE_CHECKING:
    from bt_tasksim.engines.kinematics_pinocchio import PinocchioKinematics
    from bt_tasksim.scene import ActorConfiguration

STALE = 0.3
"""Seconds after which forces are too old to act on; joint states have a limit of their own."""
UNSEEN = 1.0
"""Seconds after which a tracked object counts as lost."""
STILL = (0.02, 0.03)
"""Speed (rad/s) and distance (rad) within which the arm stands where a run begins."""
SETTLE = 5.0
"""Seconds within which it must, once it has been told to be there."""
LONGEST = 60.0
"""Seconds that the way there may take."""
HAND = 0.25
"""Share of the hand's range by which a joint of it may be off there."""
MATCH = 0.3
"""Seconds after which whoever listens to a topic has found whoever publishes there."""
ANNOUNCED = 2.0
"""Seconds for which each command comes with the word that its run has begun: a first one may get lost."""
TRAJECTORY, TEXT = "trajectory_msgs/JointTrajectory", "std_msgs/String"


@dataclass(frozen=True, slots=True)
class Newest:
    """The newest value of a topic, and when it was measured, seconds of `time.monotonic`."""

    value: Array
    stamp: float


class RosRobot:
    """A `RealEngine` through rosbridge.

    Attributes:
        joints: Joint states, and the cell's clock.
        began: When the run began, seconds of `time.monotonic`.

    Args:
        robot: The robot.
        setting: Topics and names.
        address: Where rosbridge is.
        kinematics: For the poses of tool and fingertips.
        tracked: Objects' poses come from a tracking system; else perception has images.
    """

    def __init__(
        self,
        robot: RobotDescription,
        setting: RosSetting,
        address: Address,
        kinematics: PinocchioKinematics,
        tracked: bool = True,
    ) -> None:
        if tracked and setting.objects is None:
            raise InputError(
                f"'{setting.source}' names no topic for the poses of objects: use --perception camera"
            )
        if robot.safety is None:
            raise InputError(
                f"robot file '{robot.source}' has no section 'safety', and without limits nothing is moved: "
                "docs/safety.md says what belongs in it"
            )
        self.robot, self.setting, self.address, self.kinematics = robot, setting, address, kinematics
        self.tracked = tracked
        self.limits = robot.safety
        self.emergency = EmergencyStop()
        self.button = Button(setting.emergency_stop, setting.emergency_every, self.emergency)
        self.emergency.held_down = lambda: self.button.pressed
        self.link: Link | None = None
        self._lock = threading.RLock()
        self._objects: tuple[str, ...] = ()
        self._held, self._run, self._period, self._announced = True, "", 0.05, 0.0
        self.began = 0.0
        self.joints = JointFeed(robot, setting)
        self._forget()

    def _forget(self) -> None:
        """Only what arrives from now on counts."""
        self.joints.forget()
        self._told: Array | None = None
        self._newest: dict[str, Newest] = {}

    # ---- a run begins -----------------------------------------------------------------------------------

    def reset(self, configuration: ActorConfiguration, beat: Callable[[], None]) -> None:
        """See `RealEngine.reset`: connect where need be, end a hold, bring the arm to its start.

        Raises:
            MachineError: There is no bridge, topics are silent, or the arm does not get there.
        """
        self._period = 1.0 / configuration.control_frequency
        link = self._connected(configuration)
        self._run, self._held = uuid.uuid4().hex[:12], False
        self._forget()
        self._expect_messages()
        if self.button.pressed:
            raise MachineError(f"the emergency stop is pressed ({self.setting.emergency_stop}); release it")
        if self.emergency.why:  # tapped while it was connected, and what told of it was forgotten since
            raise MachineError(f"the emergency stop was pressed: {self.emergency.why}")
        self.button.warn()
        self._announced = time.monotonic() + ANNOUNCED
        self._announce(link)
        time.sleep(0.05)
        goal = np.array(
            configuration.joint_position or np.concatenate([self.robot.rest, self.robot.hand_open])
        )
        self._approach(goal, beat)
        self.began = time.monotonic()

    def _connected(self, configuration: ActorConfiguration) -> Link:
        """The connection, with the topics of this world's objects."""
        objects = tuple(actor.name for actor in configuration.objects) if self.tracked else ()
        if self.link is not None and not self.link.lost and objects == self._objects:
            return self.link
        self.close()
        self.button.anew()
        self.joints.anew()
        link, setting = Link(self.address), self.setting
        self.link, self._objects = link, objects
        for topic in (setting.arm.command, setting.hand.command):
            link.advertise(topic, TRAJECTORY)
        for topic in filter(None, (setting.begin, setting.hold)):
            link.advertise(topic, TEXT)
        link.subscribe(setting.emergency_stop, "std_msgs/Bool", self.button.take)
        link.subscribe(setting.joint_states, "sensor_msgs/JointState", self.joints.take)
        self._listen(
            link, setting.wrench.topic, "geometry_msgs/WrenchStamped", messages.wrench, setting.wrench.frame
        )
        for topic in setting.tips.topics:
            self._listen(link, topic, "geometry_msgs/WrenchStamped", messages.wrench, setting.tips.frame)
        for name in objects:
            assert setting.objects is not None
            topic = setting.object_topic(name)
            self._listen(link, topic, "geometry_msgs/PoseStamped", messages.pose, setting.objects.frame)
        time.sleep(MATCH)
        return link

    def _listen(
        self, link: Link, topic: str, kind: str, read: Callable[[Any, str], tuple[Array, float]], frame: str
    ) -> None:
        def handle(message: Any, arrived: float) -> None:
            value, stamp = read(message, frame)
            self._newest[topic] = Newest(value, self.joints.convert(stamp, arrived))

        link.subscribe(topic, kind, handle)

    def _expect_messages(self) -> None:
        """Wait until every topic has spoken.

        Raises:
            MachineError: Some have not; names them.
        """
        end = time.monotonic() + PATIENCE
        while silent := self._silent():
            self._alive()
            if time.monotonic() > end:
                raise MachineError(
                    f"nothing usable has come for {PATIENCE:g} s on {', '.join(silent)}: do the topics of "
                    f"'{self.setting.source}' exist, does the robot publish there, what was refused above?"
                )
            time.sleep(0.01)

    def _silent(self) -> list[str]:
        setting = self.setting
        wanted = [setting.wrench.topic, *setting.tips.topics, *map(setting.object_topic, self._objects)]
        now = time.monotonic()
        silent = [] if self.joints.newest is not None else [setting.joint_states]
        if self.button.silent():
            silent.append(setting.emergency_stop)
        for topic in wanted:
            newest = self._newest.get(topic)
            if newest is None or now - newest.stamp > STALE:
                silent.append(topic)
        return silent

    def _approach(self, goal: Array, beat: Callable[[], None]) -> None:
        """Go to where the run begins, slowly, and wait until the arm stands there.

        Raises:
            MachineError: It does not follow, or was stopped.
        """
        period, n = 0.05, len(self.robot.arm_joints)
        self._checked_posture(goal)
        start = self._begin_hand(beat, period)
        speed, acceleration = self._gentle()
        motions = approach(start, goal, speed, acceleration, period)
        way = list(itertools.islice(motions, int(LONGEST / period)))
        if next(motions, None) is not None:
            k = int(np.argmax(np.abs(start - goal) / speed))
            raise MachineError(
                f"the way to the start would take more than {LONGEST:g} s: {self.robot.joints[k]} is "
                f"{abs(start[k] - goal[k]):.2f} away; is 'approach' in '{self.setting.source}' too small?"
            )
        following = time.monotonic()
        for motion in way:
            following = max(following, time.monotonic())  # what was late is not made up for
            beat()
            self._send(JointTarget(motion.position, motion.velocity, self.limits.validity), period)
            following += period
            time.sleep(max(following - time.monotonic(), 0.0))
            off = np.abs(self._checked().position - motion.position)[:n]
            if np.any(off > self.limits.tracking):
                raise self._astray(
                    int(np.argmax(off)), float(off.max()), "does not follow the way to its start"
                )
        end = time.monotonic() + SETTLE
        while True:
            beat()
            reading = self._checked()
            off = np.abs(reading.position - goal)[:n]
            if np.all(off < STILL[1]) and np.all(np.abs(reading.velocity[:n]) < STILL[0]):
                return self._check_hand(reading.position - goal)
            if time.monotonic() > end:
                raise self._astray(
                    int(np.argmax(off)), float(off.max()), "does not come to stand at its start"
                )
            time.sleep(0.02)

    def _checked_posture(self, goal: Array) -> None:
        """The tool of a run that begins may not be where the guard would stop the run at once.

        Raises:
            InputError: It is.
        """
        tool, limits = self.kinematics.forward(goal)[:3], self.limits
        if np.any(tool < limits.workspace[0]) or np.any(tool > limits.workspace[1]):
            at = ", ".join(f"{x:.2f}" for x in tool)
            raise InputError(
                f"a run would begin with the tool at ({at}), outside of safety.workspace: change that or the "
                f"rest posture in '{self.robot.source}'"
            )

    def _begin_hand(self, beat: Callable[[], None], period: float) -> Array:
        """Have the hand's controller follow from where the hand is, and say where everything is.

        It may have been told to close on something that is in the way, and what is commanded next must not be
        a jump for it; so it gets the time for its whole way, while the arm stands.
        """
        n, (low, high) = len(self.robot.arm_joints), self.robot.hand_range
        start = self._checked().position.copy()
        start[n:] = np.clip(start[n:], low, high)
        stand = JointTarget(start, np.zeros_like(start), self.limits.validity)
        for k in reversed(range(math.ceil(1.0 / (self.robot.hand_speed * period)))):
            beat()
            self._send(stand, period, (k + 1) * period)
            time.sleep(period)
            self._checked()
        return start

    def _check_hand(self, off: Array) -> None:
        """The hand has come to its start, too.

        Raises:
            MachineError: A joint is far from there.
        """
        n, (low, high) = len(self.robot.arm_joints), self.robot.hand_range
        share = np.abs(off[n:]) / np.max(high - low)
        if np.any(share > HAND):
            k = int(np.argmax(share))
            name, far = self.robot.joints[n + k], abs(off[n + k])
            raise MachineError(
                f"the hand does not come to its start: {name} is {far:.3f} away; is the controller of "
                f"'{self.setting.hand.command}' active?"
            )

    def _gentle(self) -> tuple[Array, Array]:
        """Speeds and accelerations ``(n_joints,)`` of the way to the start."""
        robot, share = self.robot, self.setting.approach
        low, high = robot.hand_range
        span = np.maximum(high - low, 0.1 * np.max(high - low)) * robot.hand_speed  # some joints only follow
        speed = np.concatenate([self.limits.velocity, span])
        acceleration = np.concatenate([self.limits.acceleration, span / 0.1])
        return share * speed, share * acceleration

    def _checked(self) -> JointReading:
        """The newest joint states, of the names and the age that a motion needs, while nothing pushes.

        Raises:
            MachineError: The arm was stopped, its states are no good, or the wrench is too large.
        """
        if self._held:
            raise MachineError(self.emergency.why or "the robot was told to hold")
        reading = self.latest()
        topic = self.setting.joint_states
        if reading.names != self.robot.joints:
            raise MachineError(
                f"{topic} names other joints than joint_states.joints in '{self.setting.source}', or in "
                f"another order: {', '.join(self.joints.heard)}"
            )
        if not np.all(np.isfinite(reading.position)):
            k = int(np.argmin(np.isfinite(reading.position)))
            raise MachineError(f"{topic}: the position of {reading.names[k]} is {reading.position[k]}")
        age = time.monotonic() - reading.stamp
        if age > (limit := self.limits.stale):
            raise MachineError(
                f"{topic} is silent for {1000 * age:.0f} ms, the limit is {1000 * limit:.0f} ms: look at "
                "network and load"
            )
        if breach := checks.wrench(self._wrench(), self.limits.force, self.limits.torque):
            raise MachineError(breach.sentence)
        return reading

    def _astray(self, joint: int, off: float, what: str) -> MachineError:
        name = self.robot.joints[joint]
        return MachineError(
            f"the arm {what}: {name} is {off:.2f} rad away; is the controller of "
            f"'{self.setting.arm.command}' active?"
        )

    # ---- commands ---------------------------------------------------------------------------------------

    def send(self, target: JointTarget) -> None:
        """See `RealEngine.send`."""
        self._send(target, self._period)

    def _send(self, target: JointTarget, period: float, hand_takes: float = 0.0) -> None:
        setting, limits, n = self.setting, self.limits, len(self.robot.arm_joints)
        arm = messages.ending_at_rest(
            target.position[:n],
            target.velocity[:n],
            period,
            limits.acceleration,
            limits.lower,
            limits.upper,
            min(target.validity, limits.validity),
        )
        hand = target.position[n:]
        with self._lock:
            if self._held:
                raise MachineError("the robot holds until a new run begins")
            link = self._alive()
            self._announce(link)
            self._told, closing = arm[0].position, (Point(hand, None, max(period, hand_takes)),)
            for group, points in ((setting.arm, arm), (setting.hand, closing)):
                link.publish(group.command, messages.trajectory(group.joints, points, self._run), period)

    def _announce(self, link: Link) -> None:
        """Say that this run has begun; a cell that knows it, or has ended it, does nothing about that."""
        if self.setting.begin and time.monotonic() < self._announced:
            link.publish(self.setting.begin, {"data": self._run})

    def hold(self, why: str, here: bool) -> None:
        """See `RealEngine.hold`: the word; the last command ends at rest, unless the arm is to stop here."""
        setting = self.setting
        with self._lock:
            self._held = True
            link = self._alive()
            if here and (points := self._standing()):
                link.publish(setting.arm.command, messages.trajectory(setting.arm.joints, points, self._run))
            if setting.hold:
                link.publish(setting.hold, {"data": why[:400]})

    def _standing(self) -> list[Point]:
        """The point where the arm can come to stand; none where nothing is known of it."""
        limits, joints, n = self.limits, self.joints.newest, len(self.robot.arm_joints)
        if (
            joints is None
            or joints.names != self.robot.joints
            or not np.all(np.isfinite(joints.position[:n]))
        ):
            return []
        velocity = np.clip(np.nan_to_num(joints.velocity[:n]), -limits.velocity, limits.velocity)
        point = messages.standing(
            joints.position[:n], velocity, limits.acceleration, limits.lower, limits.upper
        )
        # A controller goes there from where it was told to be, and at most 1.5 times as fast as on average.
        way = (
            0.0
            if self._told is None
            else float(np.max(np.abs(point.position - self._told) / limits.velocity))
        )
        return [replace(point, time=max(point.time, 1.5 * way))]

    def hold_channel(self) -> ChannelSpec | None:
        """See `RealEngine.hold_channel`: a connection of its own to the same bridge."""
        setting, limits = self.setting, self.limits
        return ChannelSpec(
            "bt_tasksim.engines.ros.hold:RosHold",
            {
                "host": self.address.host,
                "port": self.address.port,
                "states": setting.joint_states,
                "command": setting.arm.command,
                "joints": list(setting.arm.joints),
                "word": setting.hold,
                "speed": limits.velocity.tolist(),
                "acceleration": limits.acceleration.tolist(),
                "lower": limits.lower.tolist(),
                "upper": limits.upper.tolist(),
            },
        )

    # ---- states -----------------------------------------------------------------------------------------

    def latest(self) -> JointReading:
        """See `RealEngine.latest`; they do not count while an emergency stop that should speak is mute."""
        self._alive()
        if silent := self.button.silent():
            raise MachineError(silent)
        if self.joints.newest is None:
            raise MachineError(f"no joint states have come on {self.setting.joint_states}")
        return self.joints.newest

    def state(self, reading: JointReading) -> WorldState:
        """See `RealEngine.state`.

        Raises:
            MachineError: Forces or objects have not been heard of for too long.
        """
        self._alive()
        setting, now, wrench = self.setting, time.monotonic(), self._wrench()
        position, effort = np.array(reading.position), np.zeros_like(reading.position)
        if reading.effort is not None:
            effort = np.nan_to_num(reading.effort)
        objects = [self._fresh(setting.object_topic(name), now, UNSEEN) for name in self._objects]
        return WorldState(
            time=np.float64(now - self.began),
            joint_position=position,
            joint_velocity=np.array(reading.velocity),
            joint_effort=effort,
            wrench=wrench,
            tip_force=self._tip_force(effort, now),
            tool_pose=self.kinematics.forward(position),
            tips=self.kinematics.tips(position),
            objects=np.array(objects).reshape(len(objects), 7) if self.tracked else None,
        )

    def _wrench(self) -> Array:
        """The external wrench ``(6,)`` at the tool, tool frame."""
        sensor = self.setting.wrench
        return messages.in_tool_frame(
            self._fresh(sensor.topic, time.monotonic(), self.limits.stale), sensor.pose
        )

    def _tip_force(self, effort: Array, now: float) -> Array:
        """Forces ``(n_tips, 3)``: as felt, or of the drives' size where there are no sensors."""
        tips = self.setting.tips
        if tips.topics:
            return np.array([self._fresh(topic, now, STALE)[:3] for topic in tips.topics])
        n = len(self.robot.tips)
        felt = np.abs(effort[len(self.robot.arm_joints) :])
        felt = felt if len(felt) == n else np.full(n, felt.max())
        out = np.zeros((n, 3))
        out[:, 2] = np.where(felt >= tips.effort, felt, 0.0)
        return out

    def _fresh(self, topic: str, now: float, oldest: float) -> Array:
        newest = self._newest.get(topic)
        if newest is None:
            raise MachineError(f"nothing has come on {topic}")
        if now - newest.stamp > oldest:
            raise MachineError(f"stale: nothing usable on {topic} for {1000 * (now - newest.stamp):.0f} ms")
        return newest.value

    def _alive(self) -> Link:
        if self.link is None:
            raise MachineError("there is no connection to the robot")
        if self.link.lost:
            raise MachineError(self.link.lost)
        return self.link

    def close(self) -> None:
        """Disconnect."""
        if self.link is not None:
            self.link.close()
            self.link = None
