"""ManiSkill's LiftPegUpright-v1: tip the peg that lies on the table up onto one of its ends.

bt-tasksim evaluate examples/maniskill/lift_peg_upright.py --engines maniskill:LiftPegUpright-v1
"""

from py_trees.behaviour import Behaviour

from concept_nodes import Grasp, Release, TipUp
from trees import sequence


def build() -> Behaviour:
    """The tree."""
    return sequence("lift peg upright", Grasp("peg"), TipUp("peg"), Release("peg"))
