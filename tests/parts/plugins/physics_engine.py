"""A physics engine from outside: joints are at once where they are told to be; nothing touches anything."""

from dataclasses import replace

import numpy as np

from bt_tasksim.core.registry import register
from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.base import PhysicsEngine
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics


@register("engine/physics", "ideal")
class IdealPhysics(PhysicsEngine):
    def __init__(self, robot):
        self.robot, self.kinematics = robot, PinocchioKinematics(robot)

    def reset(self, configuration):
        robot = self.robot
        joints = np.array(configuration.joint_position or [*robot.rest, *robot.hand_open])
        objects = np.array([actor.pose for actor in configuration.objects]).reshape(-1, 7)
        self.period = 1.0 / configuration.control_frequency
        self.state = WorldState(
            time=np.float64(0.0),
            joint_position=joints,
            joint_velocity=np.zeros_like(joints),
            joint_effort=np.zeros_like(joints),
            tip_force=np.zeros((len(robot.tips), 3)),
            wrench=np.zeros(6),
            tool_pose=self.kinematics.forward(joints),
            tips=self.kinematics.tips(joints),
            objects=objects,
            velocities=np.zeros((len(objects), 6)),
        )
        return self.state

    def step(self, target):
        self.state = replace(
            self.state,
            time=self.state.time + self.period,
            joint_position=target.position,
            joint_velocity=target.velocity,
            tool_pose=self.kinematics.forward(target.position),
            tips=self.kinematics.tips(target.position),
        )
        return self.state
