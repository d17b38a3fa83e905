"""ManiSkill's PickCube-v1: take the cube to a goal in the air, and hold it there.

bt-tasksim evaluate examples/maniskill/pick_cube.py --engines maniskill:PickCube-v1
"""

from py_trees.behaviour import Behaviour

from concept_nodes import Bring, Grasp, Pick, Wait
from trees import sequence


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "pick cube",
        Grasp("cube"),
        Pick("cube", distance=0.05),
        # Goals may be on the table, and the planner of ways keeps 12 mm clear of it; 25 mm are allowed.
        Bring("cube", to="goal", hover=0.014),
        Wait(0.3),
    )
