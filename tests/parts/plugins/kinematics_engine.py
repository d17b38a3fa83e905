"""A kinematics engine from outside: the tool never goes lower than a given height."""

from dataclasses import replace

from bt_tasksim.core.registry import register
from bt_tasksim.engines.base import KinematicsEngine
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics

LOWEST = 0.25  # metres above the robot's base


@register("engine/kinematics", "high")
class HighKinematics(KinematicsEngine):
    def __init__(self, robot):
        self.inverse = PinocchioKinematics(robot)

    def reset(self, configuration):
        self.inverse.reset(configuration)

    def solve(self, command, state):
        if command.tool is not None:
            tool = command.tool.copy()
            tool[2] = max(tool[2], LOWEST)
            command = replace(command, tool=tool)
        return self.inverse.solve(command, state)
