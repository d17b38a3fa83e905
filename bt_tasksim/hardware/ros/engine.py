"""A real robot through rosbridge, in the physics role: commands as short trajectories, states from topics.

Every command is a trajectory that ends at rest, so that it expires by itself in any controller that carries
trajectories out. Nothing here waits but `reset`, and nothing judges: the guard does
(`bt_tasksim.hardware.safety.guarded_robot`).
"""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Callable
from dataclasses import replace
from itertools import compress
from typing import ClassVar, Self

import numpy as np

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import JointTarget, WorldState
from bt_tasksim.engines.base import EngineSetup
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.remote.address import Address
from bt_tasksim.hardware.ros import messages
from bt_tasksim.hardware.ros.address import parse_ros
from bt_tasksim.hardware.ros.button import EmergencyStopTopic
from bt_tasksim.hardware.ros.cameras import RosCameras
from bt_tasksim.hardware.ros.joints import JointFeed
from bt_tasksim.hardware.ros.link import PATIENCE, Link
from bt_tasksim.hardware.ros.messages import Point
from bt_tasksim.hardware.ros.sensors import Sensors
from bt_tasksim.hardware.ros.setting import RosSetting, load_setting
from bt_tasksim.hardware.ros.start import WayToStart
from bt_tasksim.hardware.safety import checks
from bt_tasksim.hardware.safety.engine import ChannelSpec, EmergencyStop, JointReading, RealEngine
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor

MATCH = 0.3
"""Seconds after which whoever listens to a topic has found whoever publishes there."""
ANNOUNCED = 2.0
"""Seconds for which each command comes with the word that its run has begun: a first one may get lost."""
TRAJECTORY, TEXT = "trajectory_msgs/JointTrajectory", "std_msgs/String"


@register("engine/physics", "ros")
class RosRobot(RealEngine):
    """A `RealEngine` through rosbridge.

    Attributes:
        joints: Joint states, and the cell's clock.
        sensors: Forces and tracked objects.
        began: When the run began, seconds of `time.monotonic`.

    Args:
        robot: The robot.
        setting: Topics and names.
        address: Where rosbridge is.
        kinematics: For the poses of tool and fingertips.
        tracked: Objects' poses come from a tracking system; else perception has images.
    """

    takes_address: ClassVar[bool] = True

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
        self.button = EmergencyStopTopic(setting.emergency_stop, setting.emergency_every, self.emergency)
        self.emergency.held_down = lambda: self.button.pressed
        self.link: Link | None = None
        self._lock = threading.RLock()
        self._held, self._run, self._period, self._announced = True, "", 0.05, 0.0
        self.began = 0.0
        self._seen = np.zeros(0, bool)
        self.joints = JointFeed(robot, setting)
        self.sensors = Sensors(robot, setting, self.joints.convert)
        self._forget()

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """See `Engine.create`; objects are tracked where perception does not work on images.

        Raises:
            InputError: The robot's files are no good, or name nothing that tracks objects.
        """
        setting = load_setting(robot, setup.ros)
        return cls(robot, setting, parse_ros(setup.name), PinocchioKinematics(robot), not setup.images)

    @classmethod
    def check_name(cls, name: str) -> None:
        """See `Engine.check_name`."""
        parse_ros(name)

    def rendering(self) -> RosCameras:
        """See `RealEngine.rendering`.

        Raises:
            InputError: The robot's files name no cameras.
        """
        return RosCameras(self)

    def _forget(self) -> None:
        """Only what arrives from now on counts."""
        self.joints.forget()
        self._told: Array | None = None
        self.sensors.forget()

    # ---- a run begins -----------------------------------------------------------------------------------

    def reset(self, configuration: ActorConfiguration, heartbeat: Callable[[], None]) -> None:
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
        self._way().go(goal, heartbeat)
        self.began = time.monotonic()

    def _way(self) -> WayToStart:
        return WayToStart(self.robot, self.limits, self.setting, self.kinematics, self._checked, self._send)

    def _connected(self, configuration: ActorConfiguration) -> Link:
        """The connection, with the topics of this world's objects."""
        seen = [_is_tracked(actor) for actor in configuration.objects]
        names = [actor.name for actor in configuration.objects]
        objects = tuple(compress(names, seen)) if self.tracked else ()
        self._seen = np.array(seen, bool)
        if self.link is not None and not self.link.lost and objects == self.sensors.objects:
            return self.link
        self.close()
        self.button.anew()
        self.joints.anew()
        link, setting = Link(self.address), self.setting
        self.link = link
        for topic in (setting.arm.command, setting.hand.command):
            link.advertise(topic, TRAJECTORY)
        for topic in filter(None, (setting.begin, setting.hold)):
            link.advertise(topic, TEXT)
        link.subscribe(setting.emergency_stop, "std_msgs/Bool", self.button.take)
        link.subscribe(setting.joint_states, "sensor_msgs/JointState", self.joints.take)
        self.sensors.listen(link, objects)
        time.sleep(MATCH)
        return link

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
        silent = [] if self.joints.newest is not None else [self.setting.joint_states]
        if self.button.silent():
            silent.append(self.setting.emergency_stop)
        return silent + self.sensors.silent()

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
        if breach := checks.wrench(
            self.sensors.wrench(self.limits.stale), self.limits.force, self.limits.torque
        ):
            raise MachineError(breach.sentence)
        return reading

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
            "bt_tasksim.hardware.ros.hold:RosHold",
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
        position, effort = np.array(reading.position), np.zeros_like(reading.position)
        if reading.effort is not None:
            effort = np.nan_to_num(reading.effort)
        return WorldState(
            time=np.float64(time.monotonic() - self.began),
            joint_position=position,
            joint_velocity=np.array(reading.velocity),
            joint_effort=effort,
            wrench=self.sensors.wrench(self.limits.stale),
            tip_force=self.sensors.tip_force(effort),
            tool_pose=self.kinematics.forward(position),
            tips=self.kinematics.tips(position),
            objects=self._objects() if self.tracked else None,
        )

    def _objects(self) -> Array:
        """Poses ``(n_objects, 7)``, NaN for parts of fixtures that nobody tracks."""
        found = np.full((len(self._seen), 7), np.nan)
        found[self._seen] = self.sensors.poses()
        return found

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


def _is_tracked(actor: ObjectActor) -> bool:
    """Something says where it is; of a part of a fixture only where the scene says that it is sensed."""
    return actor.joint is None or actor.joint.sensed
