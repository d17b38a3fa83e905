"""ManiSkill's PushCube-v1: push the cube over the table into a disc of 10 cm about the goal.

bt-tasksim evaluate examples/maniskill/push_cube.py --engines maniskill:PushCube-v1
"""

from py_trees.behaviour import Behaviour

from concept_nodes import Push
from trees import retry


def build() -> Behaviour:
    """The tree; the goal may be beyond the arm's reach, and its disc begins before that."""
    return retry(3, Push("cube", to="goal", tolerance=0.085), name="push cube")
