"""ManiSkill's StackCube-v1: put the red cube on the green one, and let it go.

bt-tasksim evaluate examples/maniskill/stack_cube.py --engines maniskill:StackCube-v1
"""

from py_trees.behaviour import Behaviour

from concept_nodes import Bring, Grasp, Pick, Place, Release, Wait
from trees import fallback, sequence


def grasp(cube: str) -> Behaviour:
    """Grasp a cube; where a finger comes down on its neighbour, or the arm is too short, in another way."""

    def again(name: str, way: Grasp) -> Behaviour:
        return sequence(name, Release(cube, retreat=0.06, opening=0.1, force_limit=1000.0), way)

    return fallback(
        f"grasp {cube} somehow",
        Grasp(cube),
        again("from other sides", Grasp(cube, closing=(1.0, 0.0, 0.0), name="along x")),
        again("from other sides again", Grasp(cube, closing=(0.0, 1.0, 0.0), name="along y")),
        again("leaning outwards", Grasp(cube, approach=(0.26, 0.0, -0.97), name="leaning")),
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "stack cube",
        grasp("cubeA"),
        Pick("cubeA", distance=0.08),
        Bring("cubeA", to="cubeB", hover=0.03),
        Place("cubeA", on="cubeB"),
        Release("cubeA", retreat=0.05),
        Wait(0.5),  # a cube that was let go of rocks a little
    )
