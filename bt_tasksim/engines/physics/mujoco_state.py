"""States of MuJoCo's worlds from what is read of them: the laws for all worlds of a batch at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, WorldState
from bt_tasksim.engines.physics.layout import Layout
from bt_tasksim.engines.physics.mujoco_sensing import object_velocities
from bt_tasksim.robot.description import RobotDescription


@dataclass(frozen=True, eq=False)
class StateArrays:
    """What is read of k worlds with n objects in all, which stand one after the other, world after world.

    Attributes:
        time: Seconds since the episode began ``(k,)``.
        position: Of the joints ``(k, n_joints)``.
        velocity: The same.
        effort: The same.
        frames: Poses of the bodies that carry the tool and the fingertips ``(k, 1 + n_tips, 7)``.
        objects: Poses ``(n, 7)``.
        motion: ``(n, 6)``, of the objects' origins in the world's frame and about their own axes.
        com: Centres of mass ``(n, 3)`` in the objects' own frames.
        wrench: External wrenches at the tool ``(k, 6)``.
        tip_force: ``(k, n_tips, 3)``, N.
        hand_force: Of each object ``(n,)``, N.
        hand_distance: Of each object ``(n,)``, metres.
        support: See `Hidden.support`.
        penetration: ``(k,)``, metres.
    """

    time: Array
    position: Array
    velocity: Array
    effort: Array
    frames: Array
    objects: Array
    motion: Array
    com: Array
    wrench: Array
    tip_force: Array
    hand_force: Array
    hand_distance: Array
    support: Array
    penetration: Array


def states(robot: RobotDescription, layout: Layout, read: StateArrays) -> tuple[WorldState, Hidden]:
    """States ``(k, ...)`` of worlds."""
    tool = poses.multiply(read.frames[:, 0], robot.tool_pose)
    objects = layout.padded(read.objects, 7)
    velocities = layout.padded(object_velocities(read.motion, read.objects[:, 3:], read.com), 6)
    state = WorldState(
        time=read.time,
        joint_position=read.position,
        joint_velocity=read.velocity,
        joint_effort=read.effort,
        tip_force=read.tip_force,
        wrench=read.wrench,
        tool_pose=tool,
        tips=poses.transform(read.frames[:, 1:], np.array([tip.point for tip in robot.tips])),
        objects=objects,
        velocities=velocities,
    )
    hidden = Hidden(
        time=read.time,
        objects=objects,
        velocities=velocities,
        hand_force=layout.padded(read.hand_force),
        hand_distance=layout.padded(read.hand_distance),
        support=read.support,
        penetration=read.penetration,
        tool_pose=tool,
    )
    return state, hidden
