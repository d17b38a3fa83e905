"""ManiSkill's PlaceSphere-v1: put the ball into the shallow bin, and let it go.

bt-tasksim evaluate examples/maniskill/place_sphere.py --engines maniskill:PlaceSphere-v1
"""

from py_trees.behaviour import Behaviour

from concept_nodes import Bring, Grasp, Pick, Place, Release
from trees import sequence


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "place sphere",
        Grasp("ball"),
        Pick("ball", distance=0.08),
        Bring("ball", to="tray_floor", hover=0.03),
        Place("ball", on="tray_floor"),
        Release("ball", retreat=0.05),
    )
