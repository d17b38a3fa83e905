"""The engine of a real robot from outside; this one only echoes: its joints are where they were sent last."""

import time

import numpy as np

from bt_tasksim.core.registry import register
from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.hardware.safety.engine import EmergencyStop, JointReading, RealEngine


@register("engine/physics", "echo")
class EchoRobot(RealEngine):
    def __init__(self, robot):
        self.robot, self.kinematics = robot, PinocchioKinematics(robot)
        self.emergency, self.held = EmergencyStop(), ""

    def reset(self, configuration, heartbeat):
        self.began, self.held = time.monotonic(), ""
        self.position = np.concatenate([self.robot.rest, self.robot.hand_open])
        self.velocity = np.zeros_like(self.position)

    def send(self, target):
        self.position, self.velocity = target.position, target.velocity

    def latest(self):
        return JointReading(self.robot.joints, self.position, self.velocity, time.monotonic())

    def state(self, reading):
        joints = reading.position
        return WorldState(
            time=np.float64(time.monotonic() - self.began),
            joint_position=joints,
            joint_velocity=reading.velocity,
            joint_effort=np.zeros_like(joints),
            tip_force=np.zeros((len(self.robot.tips), 3)),
            wrench=np.zeros(6),
            tool_pose=self.kinematics.forward(joints),
            tips=self.kinematics.tips(joints),
            objects=np.array([[0.5, 0.0, 0.05, 1.0, 0.0, 0.0, 0.0]]),
        )

    def hold(self, why, here):
        self.held = why
