"""Physics by MuJoCo, one fresh model and state an episode.

The world is built in `mujoco_model` and `mujoco_robot`, contacts are chosen in `mujoco_contacts`, and what
is felt is read in `mujoco_sensing`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Hidden, JointTarget, WorldState
from bt_tasksim.engines.base import PhysicsEngine
from bt_tasksim.engines.physics.disturbance import DisturbanceForce
from bt_tasksim.engines.physics.mujoco_contacts import FINE_STEP, TIMESTEP
from bt_tasksim.engines.physics.mujoco_model import World, build_world
from bt_tasksim.engines.physics.mujoco_sensing import ContactReader, Felt, Near, wrist_wrench
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

if TYPE_CHECKING:
    import mujoco as mj

FALLING = (0.1, 1.5)
"""Speeds in m/s and rad/s of an object that the hand does not touch, from which steps are fine ones."""
WATCHED = 4
"""Control periods after the hand was moved or a contact came or went, in which overlaps are looked for at
every step; at other times at the period's end."""


@register("engine/physics", "mujoco")
class MujocoPhysics(PhysicsEngine):
    """The physics engine on MuJoCo.

    The same world as that of `SapienPhysics`, by another method: links carry no weight, drives follow the
    same law, the same bodies can touch, and friction is the mean of two bodies' as there. The forces on
    fingertips have their friction, which PhysX does not report.

    Args:
        robot: The robot.

    Raises:
        MachineError: MuJoCo is not installed.
    """

    def __init__(self, robot: RobotDescription) -> None:
        try:
            import mujoco
        except ImportError as error:
            raise MachineError(
                f"MuJoCo physics cannot start: {error}; "
                "install the extra 'mujoco': pip install 'bt-tasksim[mujoco]'"
            ) from error
        self._mujoco = mujoco
        self.robot = robot

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """See `PhysicsEngine.reset`."""
        mujoco, robot = self._mujoco, self.robot
        world = build_world(mujoco, robot, configuration)
        self._world: World = world
        self._data: mj.MjData = mujoco.MjData(world.model)
        self._period = 1.0 / configuration.control_frequency
        self._steps = math.ceil(self._period / TIMESTEP - 1e-9)
        share = configuration.control_frequency / configuration.physics_frequency
        self._sensed = min(max(round(self._steps * share), 1), self._steps)
        self._finer = math.ceil(self._period / self._steps / FINE_STEP - 1e-9)
        self._periods = 0
        self._names = [actor.name for actor in configuration.objects]
        self._reader = ContactReader(
            world.bodies,
            world.model.geom_bodyid,
            len(robot.tips),
            len(self._names),
            len(configuration.fixtures),
        )
        self._stiffness = robot.drive_array("stiffness")
        self._damping = robot.drive_array("damping")
        self._limit = robot.drive_array("force_limit")
        self._index_links()
        start = np.array(configuration.joint_position or np.concatenate([robot.rest, robot.hand_open]))
        self._data.qpos[world.joint_qpos] = start
        self._data.xfrc_applied[world.object_body, 2] = -world.weight
        self._set_target(JointTarget(start, np.zeros_like(start)))
        self._disturbance = DisturbanceForce(configuration.disturbance)
        self._pushed = (
            self._names.index(configuration.disturbance.object) if configuration.disturbance else -1
        )
        self._penetration, self._falling, self._watch = 0.0, False, 0
        self.deepest_pair: tuple[str, str, float, float] | None = None
        n = len(self._names)
        self._felt = Felt(np.zeros((len(robot.tips), 3)), np.zeros(n), np.zeros(6))
        self._near = Near(np.full(n, np.inf), np.zeros((n, n + len(configuration.fixtures)), bool))
        mujoco.mj_forward(world.model, self._data)
        self._samples = [self._feel()]
        return self._state()

    def _index_links(self) -> None:
        model, robot = self._world.model, self.robot

        def body(link: str) -> int:
            return int(model.body(f"robot/{link}").id)

        self._tool_body, self._wrist_body = body(robot.tool_link), body(robot.wrist_link)
        self._root_body = int(model.body_rootid[self._wrist_body])
        self._tip_bodies = np.array([body(tip.links[0]) for tip in robot.tips])
        self._tip_points = np.array([tip.point for tip in robot.tips])
        self._object_com = model.body_ipos[self._world.object_body]

    def _set_target(self, target: JointTarget) -> None:
        self._target = target
        self._data.ctrl[:] = self._stiffness * target.position + self._damping * target.velocity

    # ---- running ----------------------------------------------------------------------------------------

    def step(self, target: JointTarget) -> WorldState:
        """See `PhysicsEngine.step`.

        Raises:
            MachineError: The target or the state is not finite; nothing has moved for a bad target.
        """
        if not (np.isfinite(target.position).all() and np.isfinite(target.velocity).all()):
            raise MachineError(f"the joint target is not finite: {target.position}, {target.velocity}")
        before, n_arm = self._target, len(self.robot.arm_joints)
        if np.any(target.position[n_arm:] != before.position[n_arm:]):
            self._watch = WATCHED
        self._set_target(target)
        self._world.model.opt.timestep = self._period / self._steps
        self._samples = []
        quiet = self._disturbance.over and not self._falling and self._watch == 0
        if quiet:
            self._mujoco.mj_step(self._world.model, self._data, self._steps - self._sensed)
        for k in range(self._steps - self._sensed if quiet else 0, self._steps):
            self._step(sensed=k >= self._steps - self._sensed)
        self._watch = max(self._watch - 1, 0)
        self._periods += 1
        return self._state()

    def _step(self, sensed: bool) -> None:
        """One ordinary step, in finer ones while something falls or is pushed."""
        model, data, mj_step = self._world.model, self._data, self._mujoco.mj_step
        if not self._disturbance.over:
            k = self._pushed
            held = bool(self._felt.hand_force[k] > 1.0 and not self._near.support[k].any())
            self._disturbance.watch(float(data.time), held)
            self._falling |= self._disturbance.pushing  # until the period's end, where it is looked at again
        if self._falling:
            ordinary = model.opt.timestep
            model.opt.timestep = ordinary / self._finer
            for _ in range(self._finer):
                if self._disturbance.pushing:
                    self._push()
                mj_step(model, data)
                self._read_depth()
            model.opt.timestep = ordinary
        else:
            mj_step(model, data)
            self._read_depth()
        if sensed:
            self._samples.append(self._feel())

    def _feel(self) -> Felt:
        """The forces of the last step."""
        model, data = self._world.model, self._data
        self._mujoco.mj_rnePostConstraint(model, data)
        x, y, z, *q = self._tool().tolist()
        force, torque = wrist_wrench(data, self._root_body, self._wrist_body, (x, y, z))
        back = [0.0, 0.0, 0.0, q[0], -q[1], -q[2], -q[3]]
        wrench = np.array([*poses.point(back, force), *poses.point(back, torque)])
        return Felt(*self._reader.forces(data), wrench)

    def _read_depth(self) -> None:
        """Remember the deepest overlap."""
        found = self._reader.deeper(self._data, self._penetration)
        if found is not None:
            self._penetration, a, b = found
            self.deepest_pair = (a, b, self._penetration, float(self._data.time))

    def _state(self) -> WorldState:
        """The state of now: positions and distances of this instant, forces as felt since just before."""
        model, data, world = self._world.model, self._data, self._world
        if not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
            raise MachineError(
                f"MuJoCo's state is no longer finite after {data.time:.2f} s: see the last target"
            )
        self._mujoco.mj_kinematics(model, data)
        self._mujoco.mj_comPos(model, data)
        self._mujoco.mj_collision(model, data)
        self._read_depth()
        near, felt = self._reader.near(data), Felt.mean(self._samples)
        touched = felt.hand_force > 0.0
        if not (
            np.array_equal(touched, self._felt.hand_force > 0.0)
            and np.array_equal(near.support, self._near.support)
        ):
            self._watch = WATCHED
        self._near, self._felt = near, felt
        q, v = data.qpos[world.joint_qpos], data.qvel[world.joint_dof]
        effort = self._stiffness * (self._target.position - q) + self._damping * (self._target.velocity - v)
        velocities = self._object_velocities()
        speed = np.linalg.norm(velocities.reshape(-1, 2, 3), axis=-1)
        self._falling = bool(np.any(~touched[:, None] & (speed > FALLING)))
        return WorldState(
            time=np.float64(self._periods * self._period),
            joint_position=q,
            joint_velocity=v,
            joint_effort=np.clip(effort, -self._limit, self._limit),
            tip_force=felt.tip_force,
            wrench=felt.wrench,
            tool_pose=self._tool(),
            tips=poses.transform(self._poses(self._tip_bodies), self._tip_points),
            objects=self._poses(world.object_body),
            velocities=velocities,
        )

    def _poses(self, bodies: Array) -> Array:
        return np.concatenate([self._data.xpos[bodies], self._data.xquat[bodies]], axis=-1)

    def _tool(self) -> Array:
        return poses.multiply(self._poses(np.array(self._tool_body)), self.robot.tool_pose)

    def _object_velocities(self) -> Array:
        """Velocities ``(n_objects, 6)`` of centres of mass and angular, base frame.

        MuJoCo has the origin's velocity in the world's frame and the angular one in the body's.
        """
        moving = self._data.qvel[self._world.object_dof].reshape(-1, 6)
        rotation = self._data.xquat[self._world.object_body]
        turning = poses.rotate(rotation, moving[:, 3:])
        lever = poses.rotate(rotation, self._object_com)
        return np.concatenate([moving[:, :3] + np.cross(turning, lever), turning], axis=-1)

    def hidden(self) -> Hidden:
        """See `PhysicsEngine.hidden`."""
        return Hidden(
            time=np.float64(self._periods * self._period),
            objects=self._poses(self._world.object_body),
            velocities=self._object_velocities(),
            hand_force=self._felt.hand_force.copy(),
            hand_distance=self._near.hand_distance.copy(),
            support=self._near.support.copy(),
            penetration=np.float64(self._penetration),
            tool_pose=self._tool(),
        )

    def _push(self) -> None:
        """Set the force of the disturbance for the next step."""
        k, data = self._pushed, self._data
        touched = bool(self._reader.near(data).hand_distance[k] < np.inf)
        force = self._disturbance.force(float(data.time), touched, self._object_velocities()[k, :3])
        body = self._world.object_body[k]
        lever = data.xpos[body] - data.xipos[body]
        data.xfrc_applied[body, :3] = force - np.array([0.0, 0.0, self._world.weight[k]])
        data.xfrc_applied[body, 3:] = np.cross(lever, force)
