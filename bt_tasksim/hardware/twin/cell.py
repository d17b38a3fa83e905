"""The cell behind the topics: controllers, drives, physics, sensors, stops. Knows nothing of ROS.

Time is the cell's own: seconds of its steps. Commands and readings take their stated latencies.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, JointTarget, WorldState
from bt_tasksim.engines.physics.mujoco import MujocoPhysics
from bt_tasksim.hardware.ros.messages import in_tool_frame
from bt_tasksim.hardware.twin.controller import Controller, RefusedTrajectoryError, Trajectory
from bt_tasksim.hardware.twin.gap import Gap, displaced, error_in_object
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

STILL = 0.03
"""rad/s below which the arm stands."""
NEVER = "no run has begun"
AT_THE_TOOL = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True, slots=True)
class Readings:
    """What the sensors say, with noise; in the robot's order, base frame; the wrench in its sensor's own."""

    time: float
    position: Array
    velocity: Array
    effort: Array
    wrench: Array
    tips: Array
    objects: Array


class Cell:
    """A robot's cell.

    Attributes:
        time: Seconds since the world was made.
        stopped: Why it refuses commands; empty while it takes them.
        pressed: The emergency stop is pressed.
        refused: Count of refused commands.
        unfit: How many of them for what they were, and not because it holds.
        accepted: Count of the others.
        left_out: Seconds of real time by which physics has lagged and not caught up.

    Args:
        robot: The robot.
        gap: By how much the cell differs.
        configuration: The world.
        seed: Of factors and noise.
        announced: Runs are announced, by name, and the cell takes nothing else; else it takes whatever comes.
        now: Real time in seconds, of which notes of faults are taken.
        sensor: Pose ``(7,)`` of the wrist's sensor in the tool frame; its wrench is that of its own frame.
    """

    def __init__(
        self,
        robot: RobotDescription,
        gap: Gap,
        configuration: ActorConfiguration,
        seed: int = 0,
        *,
        announced: bool = True,
        now: Callable[[], float] = time.monotonic,
        sensor: Array = AT_THE_TOOL,
    ) -> None:
        self.robot, self.gap = robot, gap
        self.announced, self._now = announced, now
        self._tool_at_sensor = poses.inverse(sensor)
        self.period = 1.0 / gap.rates["control_rate"]
        self.load(configuration, seed)

    def load(self, configuration: ActorConfiguration, seed: int = 0) -> None:
        """Make the world anew: the arm stands at its start, and no announced run has begun."""
        self._rng = np.random.default_rng([seed, configuration.seed, 20_26])
        self.configuration = configuration
        robot, world = self.gap.world(self.robot, configuration, self._rng)
        n = len(configuration.objects)
        self._wrench_bias, pose_error = self.gap.biases(n, self._rng)
        if not world.joint_position:
            start = np.concatenate([robot.rest, robot.hand_open])
            world = replace(world, joint_position=tuple(start.tolist()))
        self._physics = MujocoPhysics(robot)
        self._state = self._physics.reset(world)
        self._seen_as = error_in_object(self._objects(), pose_error)
        self._steps, self.time = 0, 0.0
        self._n = len(robot.arm_joints)
        start = np.array(world.joint_position)
        self._arm, self._hand = self._controllers(start)
        self._pending: deque[tuple[float, Callable[[], None]]] = deque()
        self._leaving: deque[tuple[float, Readings]] = deque()
        self._run, self.pressed = "", False
        self.stopped = NEVER if self.announced else ""
        self._ended: set[str] = set()
        self.refused = self.unfit = self.accepted = 0
        self.left_out = 0.0
        self.note: Note | None = None

    def _controllers(self, start: Array) -> tuple[Controller, Controller]:
        robot, n = self.robot, self._n
        low, high = robot.hand_range
        speed = np.maximum(high - low, 1e-3) * robot.hand_speed * 2.0
        arm = Controller(robot.arm_joints, robot.arm_lower, robot.arm_upper, robot.arm_velocity, start[:n])
        return arm, Controller(robot.hand_joints, low, high, speed, start[n:])

    def _objects(self) -> Array:
        objects = self._state.objects
        assert objects is not None
        return objects

    # ---- what comes in ----------------------------------------------------------------------------------

    def command(self, group: str, trajectory: Trajectory) -> None:
        """A trajectory for ``arm`` or ``hand``, which takes its latency.

        Raises:
            RefusedTrajectoryError: It is not carried out.
        """
        try:
            if self.stopped:
                raise RefusedTrajectoryError(f"it holds: {self.stopped}")
            if self.announced and trajectory.run != self._run:
                raise RefusedTrajectoryError("it belongs to another run")
            controller = self._arm if group == "arm" else self._hand
            controller.check(trajectory, self.time)
        except RefusedTrajectoryError:
            self.refused += 1
            self.unfit += not self.stopped
            raise
        due = self.time + self.gap.sizes["command_latency"]
        self._pending.append((due, lambda: self._begin_trajectory(controller, trajectory)))

    def _begin_trajectory(self, controller: Controller, trajectory: Trajectory) -> None:
        try:
            controller.accept(trajectory, self.time)
            self.accepted += 1
        except RefusedTrajectoryError:
            self.refused += 1
            self.unfit += 1

    def begin(self, run: str) -> None:
        """A new run begins, and ends a hold and the run before it; never one that was ended before."""
        if self.pressed or not run or run == self._run or run in self._ended:
            return
        if self._run:
            self._ended.add(self._run)
        self._run, self.stopped = run, ""

    def hold(self, why: str) -> None:
        """Refuse every command of this run; what is being carried out comes to rest by itself."""
        if not self.stopped or self.stopped == NEVER:
            self._ended.add(self._run)
            self.stopped = why or "told to hold"
            if self.note is not None and self.note.held is None:
                self.note.held, self.note.why = self._now(), self.stopped

    def press(self, pressed: bool) -> None:
        """The emergency stop: the arm stops within its limits, and holds.

        Where runs are not announced, nothing but its release ends that.
        """
        before, self.pressed = self.pressed, pressed
        if pressed and not before:
            self.hold("emergency stop")
            self._pending.clear()  # a command under way would take the brake's place
            self._arm.stop(self.time, self.robot.arm_acceleration)
        elif before and not pressed and not self.announced:
            self.stopped = ""

    # ---- running ----------------------------------------------------------------------------------------

    def step(self) -> None:
        """One period of the controllers."""
        self._steps += 1
        self.time = self._steps * self.period
        while self._pending and self._pending[0][0] <= self.time:
            self._pending.popleft()[1]()
        arm, hand = self._arm.setpoint(self.time), self._hand.setpoint(self.time)
        position = np.concatenate([arm[0], hand[0]])
        # A hand's drive presses on what it holds; its set-point's speed means nothing to it.
        velocity = np.concatenate([arm[1], np.zeros_like(hand[0])])
        self._state = self._physics.step(JointTarget(position, velocity))
        self._leaving.append((self.time + self.gap.sizes["state_latency"], self._read()))
        if self.note is not None:
            self._take_note(self.note, arm[1])

    def _read(self) -> Readings:
        state, sizes, normal = self._state, self.gap.sizes, self._rng.standard_normal
        n = len(self.robot.joints)
        wrench, pose = self.gap.wrench, self.gap.object_pose
        tremble = np.repeat([pose["position"], pose["rotation"]], 3)
        objects = self._objects()
        seen = np.array([poses.multiply(o, e) for o, e in zip(objects, self._seen_as, strict=True)])
        seen = seen.reshape(len(objects), 7)
        noise = np.repeat([wrench["force"], wrench["torque"]], 3) * normal(6)
        return Readings(
            time=self.time,
            position=state.joint_position + sizes["joint_position"] * normal(n),
            velocity=state.joint_velocity + sizes["joint_velocity"] * normal(n),
            effort=state.joint_effort + sizes["joint_effort"] * normal(n),
            wrench=in_tool_frame(state.wrench, self._tool_at_sensor) + self._wrench_bias + noise,
            tips=state.tip_force + sizes["tip_force"] * normal(state.tip_force.shape),
            objects=displaced(seen, tremble * normal((len(objects), 6))),
        )

    def readings(self) -> list[Readings]:
        """What has left the sensors by now and was not asked for before, oldest first."""
        out = []
        while self._leaving and self._leaving[0][0] <= self.time + 1e-9:
            out.append(self._leaving.popleft()[1])
        return out

    # ---- what no tree and no policy sees ----------------------------------------------------------------

    def hidden(self) -> Hidden:
        """The physics state."""
        return self._physics.hidden()

    @property
    def deepest_pair(self) -> tuple[str, str, float, float] | None:
        """The two bodies that overlapped most, see `PhysicsEngine.deepest_pair`."""
        return self._physics.deepest_pair

    @property
    def state(self) -> WorldState:
        """The state of now, without noise."""
        return self._state

    def watch(self, name: str) -> None:
        """A fault begins: note what becomes of the arm from now on."""
        self.note = Note(name, self._now(), np.array(self._arm_position()))
        if self.stopped:
            self.note.held, self.note.why = self.note.began, self.stopped

    def _arm_position(self) -> Array:
        return self._state.joint_position[: self._n]

    def _take_note(self, note: Note, speed: Array) -> None:
        if note.speed is not None:
            change = np.abs(speed - note.speed) / self.period
            note.hardest = max(note.hardest, float(np.max(change / self.robot.arm_acceleration)))
        note.speed = speed
        note.fastest = max(note.fastest, float(np.max(np.abs(speed) / self.robot.arm_velocity)))
        position = self._arm_position()
        note.far = max(note.far, float(np.max(np.abs(position - note.position))))
        if note.held is None and self.time > self._arm.ends():
            note.held, note.why = self._now(), "the command has expired"
        elif note.why == "the command has expired" and self.time <= self._arm.ends():
            note.held, note.why = None, ""  # it came late, and went on
        if note.held is not None:
            if float(np.max(np.abs(self._state.joint_velocity[: self._n]))) < STILL:
                note.still = self._now() if note.still is None else note.still
            else:
                note.still = None

    def tell(self) -> dict[str, Any]:
        """What has happened, in plain data."""
        note = self.note
        return {
            "time": self.time,
            "stopped": self.stopped,
            "accepted": self.accepted,
            "refused": self.refused,
            "unfit": self.unfit,
            "left_out": self.left_out,
            "position": self._arm_position().tolist(),
            "speed": float(np.max(np.abs(self._state.joint_velocity[: self._n]))),
            "fault": None if note is None else note.to_json(),
        }


@dataclass
class Note:
    """What became of the arm after a fault.

    Attributes:
        name: The fault.
        began: When, seconds of real time.
        position: Where the arm was ``(n,)``.
        held: When it was told to hold, or stood by itself.
        why: By what.
        still: When it stood.
        far: Farthest that a joint got, rad.
        fastest: Greatest speed of the set-points, as a share of a joint's limit.
        hardest: Greatest acceleration, likewise, from one period of the controller to the next.
        speed: The last speed of the set-points ``(n,)``.
    """

    name: str
    began: float
    position: Array
    held: float | None = None
    why: str = ""
    still: float | None = None
    far: float = 0.0
    fastest: float = 0.0
    hardest: float = 0.0
    speed: Array | None = None

    def to_json(self) -> dict[str, Any]:
        """In plain data, times since the fault."""
        return {
            "name": self.name,
            "held": None if self.held is None else self.held - self.began,
            "still": None if self.still is None else self.still - self.began,
            "why": self.why,
            "far": self.far,
            "fastest": self.fastest,
            "hardest": self.hardest,
        }
