"""One world of MuJoCo as it goes on: how finely it is stepped, when overlaps are looked for, what is read."""

from __future__ import annotations

import math
from types import ModuleType
from typing import NamedTuple

import numpy as np

from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.body_contacts import BodyContacts
from bt_tasksim.engines.physics.disturbance import DisturbanceForce
from bt_tasksim.engines.physics.mujoco_model import GRAVITY, BodyNumbers, World, build_world
from bt_tasksim.engines.physics.mujoco_sensing import ContactReader, Forces, Near, object_velocities
from bt_tasksim.engines.physics.mujoco_timing import StepPlan
from bt_tasksim.engines.physics.threaded import FALLING
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.shapes import BallPiece

WATCHED = 4
"""Control periods after the hand was moved or a contact came or went, in which overlaps are looked for at
every step; at other times at the period's end."""
STRIDE = 6e-4
"""Metres that a ball which falls goes in one step, at most, and so deep it is in what it meets."""


class MujocoReading(NamedTuple):
    """What MuJoCo has of a world at a period's end: positions of this instant, forces felt until then.

    Attributes:
        time: Seconds since the episode began.
        position: Of the joints ``(n_joints,)``.
        velocity: The same.
        frame_position: Of the bodies that carry the tool and the fingertips ``(1 + n_tips, 3)``.
        frame_rotation: The same ``(1 + n_tips, 4)``.
        object_position: ``(n_objects, 3)``.
        object_rotation: ``(n_objects, 4)``.
        object_motion: ``(n_objects, 6)``, of the origin in the world's frame and about the object's own axes.
        object_com: Centres of mass ``(n_objects, 3)`` in the objects' own frames.
        wrist: Of each of the last steps what `wrist_wrenches` takes, ``(16,)``.
        tip_force: Force on each fingertip, N, the mean of these steps.
        hand_force: Force of the robot on each object, N, the mean of these steps.
        near: What is near what.
        penetration: The deepest overlap so far, metres.
    """

    time: float
    position: Array
    velocity: Array
    frame_position: Array
    frame_rotation: Array
    object_position: Array
    object_rotation: Array
    object_motion: Array
    object_com: Array
    wrist: list[list[float]]
    tip_force: list[list[float]]
    hand_force: list[float]
    near: Near
    penetration: float


class MujocoWorld:
    """A world of MuJoCo, see `bt_tasksim.engines.physics.threaded.SimulatedWorld`.

    Args:
        mujoco: The library.
        robot: The robot.
        configuration: What was drawn.
        start: Joints ``(n_joints,)`` to begin with.

    Attributes:
        world: The model, and where things are in its arrays.
        data: Its ``mujoco.MjData``.
        reading: What was read last.
        deepest_pair: See `bt_tasksim.engines.physics.threaded.SimulatedWorld`.

    Raises:
        InputError: The robot or an object cannot be built.
    """

    reading: MujocoReading

    def __init__(
        self, mujoco: ModuleType, robot: RobotDescription, configuration: ActorConfiguration, start: Array
    ) -> None:
        self._mujoco = mujoco
        self.world: World = build_world(mujoco, robot, configuration)
        self.data = mujoco.MjData(self.world.model)
        kinds = mujoco.mjtWarning
        self._blown_up = (kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC)
        names = [actor.name for actor in configuration.objects]
        self.n_objects, self.n_fixtures = len(names), len(configuration.fixtures)
        self._plan = StepPlan.of(configuration)
        self._periods, self._finer = 0, self._plan.finer
        self._reader = ContactReader(
            self.world.bodies, self.world.model.geom_bodyid, len(robot.tips), len(names), self.n_fixtures
        )
        self._stiffness = robot.drive_array("stiffness")
        self._damping = robot.drive_array("damping")
        self._n_arm = len(robot.arm_joints)
        self._numbers = BodyNumbers.of(robot, self.world, self.n_fixtures)
        self._frames = self._numbers.read[: 1 + len(robot.tips)]
        self._object_com = self.world.model.body_ipos[self.world.object_body]
        self._balls = np.array([_is_ball(actor) for actor in configuration.objects], bool)
        disturbance = configuration.disturbance
        self._disturbance = DisturbanceForce(disturbance)
        self._pushed = names.index(disturbance.object) if disturbance is not None else -1
        self._penetration, self._falling, self._watch = 0.0, False, 0
        self.deepest_pair: tuple[str, str, float, float] | None = None
        self._near = Near([math.inf] * self.n_objects, set())
        self._hand_force = [0.0] * self.n_objects
        self.data.qpos[self.world.joint_qpos] = start
        for address, value in self.world.opened:
            self.data.qpos[address] = value
        self.data.xfrc_applied[self.world.object_body, 2] = -self.world.weight
        self._hand_target: list[float] = start[self._n_arm :].tolist()
        self.drive_to(start.tolist(), [0.0] * len(start))
        mujoco.mj_forward(self.world.model, self.data)
        self._samples = [self._feel()]

    # ---- running ----------------------------------------------------------------------------------------

    def drive_to(self, position: list[float], velocity: list[float]) -> None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`."""
        if position[self._n_arm :] != self._hand_target:
            self._watch = WATCHED
        self._hand_target = position[self._n_arm :]
        self.data.ctrl[:] = self._stiffness * np.array(position) + self._damping * np.array(velocity)

    def advance(self) -> None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`."""
        plan = self._plan
        self.world.model.opt.timestep = plan.step
        self._samples = []
        quiet = self._disturbance.over and not self._falling and self._watch == 0 and not self.world.latched
        if quiet:
            self._mujoco.mj_step(self.world.model, self.data, plan.steps - plan.sensed)
        for k in range(plan.steps - plan.sensed if quiet else 0, plan.steps):
            self._step(sensed=k >= plan.steps - plan.sensed)
        self._watch = max(self._watch - 1, 0)
        self._periods += 1
        if any(self.data.warning[kind].number for kind in self._blown_up):
            after = self._periods * plan.period
            raise MachineError(
                f"MuJoCo's simulation has become unstable within {after:.2f} s: speeds or accelerations are "
                "beyond all bounds; is something far too light or too heavy, or stuck in something else?"
            )

    def note_motion(self, falling: bool, spin: float) -> None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`.

        Balls may spin, since that sinks no corner into anything; those that go along with what the hand
        holds, as in a jug, do not fall; and for those that do steps are as fine as they are fast.
        """
        self._finer = self._plan.finer
        self._falling = falling
        if falling and self._balls.any():
            self._falling, speed = self._falls()
            if speed is not None:
                sunk = (speed + GRAVITY * self._plan.period) * self._plan.step
                self._finer = min(self._plan.finer, max(1, math.ceil(sunk / STRIDE)))

    def _falls(self) -> tuple[bool, float | None]:
        """Whether an object that the hand does not touch is fast; where balls alone are, how fast, m/s."""
        held: Array = np.array(self.reading.hand_force) > 0.0
        linear, angular = self.reading.object_motion[:, :3], self.reading.object_motion[:, 3:]
        speed = np.linalg.norm(linear, axis=1)
        beside = np.linalg.norm(linear[:, None] - linear[None, held], axis=2).min(axis=1, initial=math.inf)
        others = ~held & ~self._balls
        if (others & ((speed > FALLING[0]) | (np.linalg.norm(angular, axis=1) > FALLING[1]))).any():
            return True, None
        fast = ~held & self._balls & (np.minimum(speed, beside) > FALLING[0])
        return bool(fast.any()), float(speed[fast].max(initial=0.0))

    def _step(self, sensed: bool) -> None:
        """One ordinary step, in finer ones while something falls or is pushed."""
        model, data, mj_step = self.world.model, self.data, self._mujoco.mj_step
        if not self._disturbance.over:
            k = self._pushed
            held = self._hand_force[k] > 1.0 and not any(i == k for i, _ in self._near.support)
            self._disturbance.watch(float(data.time), held)
            self._falling |= self._disturbance.pushing  # until the period's end, where it is looked at again
        if self._falling:
            ordinary = model.opt.timestep
            model.opt.timestep = ordinary / self._finer
            for _ in range(self._finer):
                if self._disturbance.pushing:
                    self._push()
                self._pull()
                mj_step(model, data)
                self._read_depth()
            model.opt.timestep = ordinary
        else:
            self._pull()
            mj_step(model, data)
            self._read_depth()
        if sensed:
            self._samples.append(self._feel())

    def _pull(self) -> None:
        """Set what latches pull with in the next step."""
        for k, joint in self.world.latched:
            value = float(self.data.qpos[self.world.object_qpos[k, 0]])
            self.data.qfrc_applied[self.world.object_dof[k, 0]] = joint.hold(value)

    # ---- reading ----------------------------------------------------------------------------------------

    def contact_points(self) -> BodyContacts:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`."""
        return self._reader.points(self.data)

    def _feel(self) -> tuple[Forces, list[float]]:
        """The forces of the last step, and what its wrench at the wrist is computed from."""
        data, numbers = self.data, self._numbers
        self._mujoco.mj_rnePostConstraint(self.world.model, data)
        wrist = [
            *data.cfrc_int[numbers.wrist].tolist(),
            *data.subtree_com[numbers.root].tolist(),
            *data.xpos[numbers.tool].tolist(),
            *data.xquat[numbers.tool].tolist(),
        ]
        return self._reader.forces(data), wrist

    def _read_depth(self) -> None:
        """Remember the deepest overlap."""
        found = self._reader.deeper(self.data, self._penetration)
        if found is not None:
            self._penetration, a, b = found
            self.deepest_pair = (a, b, self._penetration, float(self.data.time))

    def read(self) -> None:
        """Read the state: positions and distances of this instant, forces as felt since just before."""
        model, data, world = self.world.model, self.data, self.world
        self._mujoco.mj_kinematics(model, data)
        self._mujoco.mj_comPos(model, data)
        self._mujoco.mj_collision(model, data)
        self._read_depth()
        near, felt = self._reader.near(data), Forces.mean([forces for forces, _ in self._samples])
        before = [force > 0.0 for force in self._hand_force]
        if [force > 0.0 for force in felt.hand] != before or near.support != self._near.support:
            self._watch = WATCHED
        self._near, self._hand_force = near, felt.hand
        bodies = world.object_body
        self.reading = MujocoReading(
            self._periods * self._plan.period,
            data.qpos[world.joint_qpos],
            data.qvel[world.joint_dof],
            data.xpos[self._frames],
            data.xquat[self._frames],
            data.xpos[bodies],
            data.xquat[bodies],
            world.object_motion(data.qvel, data.xquat[bodies]),
            self._object_com,
            [wrist for _, wrist in self._samples],
            felt.tips,
            felt.hand,
            near,
            self._penetration,
        )

    def _push(self) -> None:
        """Set the force of the disturbance for the next step."""
        k, data, world = self._pushed, self.data, self.world
        touched = self._reader.near(data).hand_distance[k] < math.inf
        body = world.object_body[k]
        moving = object_velocities(
            data.qvel[world.object_dof[k : k + 1]], data.xquat[[body]], self._object_com[k : k + 1]
        )
        force = self._disturbance.force(float(data.time), touched, moving[0, :3])
        lever = data.xpos[body] - data.xipos[body]
        data.xfrc_applied[body, :3] = force - np.array([0.0, 0.0, world.weight[k]])
        data.xfrc_applied[body, 3:] = np.cross(lever, force)


def _is_ball(actor: ObjectActor) -> bool:
    return all(isinstance(piece, BallPiece) for piece in actor.shape().collision)
