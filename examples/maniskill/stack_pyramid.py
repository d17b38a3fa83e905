"""ManiSkill's StackPyramid-v1: put cubeA beside cubeB, and cubeC on top of both.

bt-tasksim evaluate examples/maniskill/stack_pyramid.py --engines maniskill:StackPyramid-v1
"""

from py_trees.behaviour import Behaviour

from concept_nodes import Bring, Grasp, Pick, Place, Release, Wait
from trees import sequence


def put(cube: str, place: str) -> Behaviour:
    """Take a cube from the table and put it on a place."""
    return sequence(
        f"{cube} to {place}",
        Grasp(cube),
        Pick(cube, distance=0.08),
        Bring(cube, to=place, hover=0.03),
        Place(cube, on=place),
        Release(cube, retreat=0.08),
    )


def build() -> Behaviour:
    """The tree."""
    return sequence("stack pyramid", put("cubeA", "beside"), put("cubeC", "top"), Wait(0.5))
