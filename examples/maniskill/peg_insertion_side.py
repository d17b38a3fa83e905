"""ManiSkill's PegInsertionSide-v1: push a peg that lies on the table into the hole of a box, head first.

bt-tasksim evaluate examples/maniskill/peg_insertion_side.py --engines maniskill:PegInsertionSide-v1
"""

from py_trees.behaviour import Behaviour

from concept_nodes import Grasp, Insert, Pick
from trees import sequence


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "peg insertion side",
        Grasp("peg"),
        Pick("peg", distance=0.10),
        Insert("peg", into="hole", leading=(1.0, 0.0, 0.0), share=0.5),
    )
