"""A robot from outside: a Panda that rests with its tool 10 cm nearer. A data file's path would do, too."""

from dataclasses import replace

import numpy as np

from bt_tasksim.core.registry import register
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.robot.description import load_robot

panda = load_robot("panda")
kinematics = PinocchioKinematics(panda)
nearer = kinematics.forward(panda.rest) - np.array([0.1, 0, 0, 0, 0, 0, 0])

register("robot", "near_panda")(replace(panda, name="near_panda", rest=kinematics.inverse(nearer)))
