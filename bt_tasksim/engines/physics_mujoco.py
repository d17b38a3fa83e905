"""Physics by MuJoCo, one fresh model and state an episode.

The world is built in `mujoco_model` and `mujoco_robot`, contacts are chosen in `mujoco_contacts`, and what is felt
is read in `mujoco_sensing`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bt_tasksim import poses
from bt_tasksim.engines.disturbance import Knock
from bt_tasksim.engines.mujoco_contacts import FINE_STEP, TIMESTEP
from bt_tasksim.engines.mujoco_model import World, build_world
from bt_tasksim.engines.mujoco_sensing import ContactReader, wrist_wrench
from bt_tasksim.errors import MachineError
from bt_tasksim.poses import Array
from bt_tasksim.robot import RobotDescription
from bt_tasksim.scene import ActorConfiguration
from bt_tasksim.world import Hidden, JointTarget, WorldState

FALLING = (0.1, 1.5)
"""Speeds in m/s and rad/s of an object that the hand does not touch, from which steps are fine ones."""
WATCHED = 4
"""Control periods after the hand was moved or a contact came or went, in which overlaps are looked for at every
step; at other times at the period's end."""


class MujocoPhysics:
    """The physics engine on MuJoCo.

    The same world as that of `SapienPhysics`, by another method: links carry no weight, drives follow the same
    law, the same bodies can touch, and friction is the mean of two bodies' as there. The forces on fingertips
    have their friction, which PhysX does not report.

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
        self._data: Any = mujoco.MjData(world.model)
        self._period = 1.0 / configuration.control_frequency
        self._steps = math.ceil(self._period / TIMESTEP - 1e-9)
        self._finer = math.ceil(self._period / self._steps / FINE_STEP - 1e-9)
        self._periods = 0
        self._names = [actor.name for actor in configuration.objects]
        self._reader = ContactReader(
            world.bodies, world.model.geom_bodyid, len(robot.tips), len(self._names), len(configuration.fixtures)
        )
        self._stiffness = robot.drive_array("stiffness")
        self._damping = robot.drive_array("damping")
        self._limit = robot.drive_array("force_limit")
        self._index_links()
        start = np.array(configuration.joint_position or np.concatenate([robot.rest, robot.hand_open]))
        self._data.qpos[world.joint_qpos] = start
        self._data.xfrc_applied[world.object_body, 2] = -world.weight
        self._set_target(JointTarget(start, np.zeros_like(start)))
        self._knock = Knock(configuration.disturbance)
        self._knocked = (
            self._names.index(configuration.disturbance.object) if configuration.disturbance else -1
        )
        self._penetration, self._falling, self._watch = 0.0, False, 0
        self._touched, self._support = np.zeros(0, bool), np.zeros(0, bool)
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
        """See `PhysicsEngine.step`."""
        before, n_arm = self._target, len(self.robot.arm_joints)
        if np.any(target.position[n_arm:] != before.position[n_arm:]):
            self._watch = WATCHED
        self._set_target(target)
        self._world.model.opt.timestep = self._period / self._steps
        if not self._knock.over:
            for _ in range(self._steps):
                self._disturbed_step()
        elif self._falling:
            self._fine_steps(self._steps)
        elif self._watch > 0:
            self._watch -= 1
            for _ in range(self._steps):
                self._mujoco.mj_step(self._world.model, self._data)
                self._read_depth()
        else:
            self._mujoco.mj_step(self._world.model, self._data, self._steps)
        self._periods += 1
        return self._state()

    def _fine_steps(self, n: int) -> None:
        """Move on by ``n`` ordinary steps in finer ones."""
        model, data = self._world.model, self._data
        ordinary = model.opt.timestep
        model.opt.timestep = ordinary / self._finer
        for _ in range(n * self._finer):
            if self._knock.pushing:
                self._push()
            self._mujoco.mj_step(model, data)
            self._read_depth()
        model.opt.timestep = ordinary

    def _read_depth(self) -> None:
        """Remember the deepest overlap."""
        depth, a, b = self._reader.deepest(self._data)
        if depth > self._penetration:
            self._penetration = depth
            self.deepest_pair = (a, b, depth, float(self._data.time))

    def _state(self) -> WorldState:
        """The state of now, with positions, contacts and forces that belong to it."""
        model, data, world = self._world.model, self._data, self._world
        self._mujoco.mj_forward(model, data)
        self._mujoco.mj_rnePostConstraint(model, data)
        self._read_depth()
        contacts = self._contacts = self._reader.read(data)
        touched = contacts.hand_force > 0.0
        if not (np.array_equal(touched, self._touched) and np.array_equal(contacts.support, self._support)):
            self._watch = WATCHED
        self._touched, self._support = touched, contacts.support
        q, v = data.qpos[world.joint_qpos], data.qvel[world.joint_dof]
        effort = self._stiffness * (self._target.position - q) + self._damping * (self._target.velocity - v)
        tool = self._tool()
        velocities = self._object_velocities()
        speed = np.linalg.norm(velocities.reshape(-1, 2, 3), axis=-1)
        self._falling = bool(np.any(~touched[:, None] & (speed > FALLING)))
        tips = poses.transform(self._poses(self._tip_bodies), self._tip_points)
        rotation = poses.to_matrix(tool[3:])
        return WorldState(
            time=np.float64(self._periods * self._period),
            joint_position=q,
            joint_velocity=v,
            joint_effort=np.clip(effort, -self._limit, self._limit),
            tip_force=contacts.tip_force,
            wrench=wrist_wrench(data, self._root_body, self._wrist_body, tool[:3], rotation),
            tool_pose=tool,
            tips=tips,
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
            hand_force=self._contacts.hand_force.copy(),
            hand_distance=self._contacts.hand_distance.copy(),
            support=self._contacts.support.copy(),
            penetration=np.float64(self._penetration),
            tool_pose=self._tool(),
        )

    # ---- disturbance ------------------------------------------------------------------------------------

    def _disturbed_step(self) -> None:
        """One step, with a push that begins some time after the object was first held clear."""
        k, contacts = self._knocked, self._contacts
        held = bool(contacts.hand_force[k] > 1.0 and not contacts.support[k].any())
        self._knock.watch(float(self._data.time), held)
        if self._knock.pushing or self._falling:
            self._fine_steps(1)
        else:
            self._mujoco.mj_step(self._world.model, self._data)

    def _push(self) -> None:
        k, data = self._knocked, self._data
        touched = bool(self._reader.read(data).hand_force[k] > 0.0)
        force = self._knock.force(float(data.time), touched, self._object_velocities()[k, :3])
        body = self._world.object_body[k]
        lever = data.xpos[body] - data.xipos[body]
        data.xfrc_applied[body, :3] = force - np.array([0.0, 0.0, self._world.weight[k]])
        data.xfrc_applied[body, 3:] = np.cross(lever, force)
