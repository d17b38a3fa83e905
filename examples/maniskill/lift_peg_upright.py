"""ManiSkill's LiftPegUpright-v1: tip the peg that lies on the table up onto one of its ends.

bt-tasksim evaluate examples/maniskill/lift_peg_upright.py --engines maniskill:LiftPegUpright-v1
"""

from py_trees.behaviour import Behaviour

from concept_nodes import Grasp, OnEnd, Release, TipUp, Withdraw
from trees import fallback, retry, sequence


def build() -> Behaviour:
    """The tree: where the peg has slipped out of the hand, or the arm came to its end, once more."""
    upright = sequence("tip it up", Grasp("peg"), TipUp("peg"), Release("peg"))
    anew = fallback("or let go", upright, sequence("let go", Withdraw(), OnEnd("peg")))
    return retry(3, anew)
