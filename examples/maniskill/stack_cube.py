"""ManiSkill's StackCube-v1: put the red cube on the green one, and let it go.

bt-tasksim evaluate examples/maniskill/stack_cube.py --engines maniskill:StackCube-v1
"""

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release, Wait
from bt_tasksim.trees import sequence


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "stack cube",
        Grasp("cubeA"),
        Pick("cubeA", distance=0.08),
        Bring("cubeA", to="cubeB", hover=0.03),
        Place("cubeA", on="cubeB"),
        Release("cubeA", retreat=0.05),
        Wait(0.5),  # a cube that was let go of rocks a little
    )
