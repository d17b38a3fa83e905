"""ManiSkill's PullCube-v1: pull the cube over the table into a disc of 10 cm about the goal.

bt-tasksim evaluate examples/maniskill/pull_cube.py --engines maniskill:PullCube-v1
"""

from py_trees.behaviour import Behaviour

from concept_nodes import Pull
from trees import retry


def build() -> Behaviour:
    """The tree."""
    return retry(3, Pull("cube", to="goal"), name="pull cube")
