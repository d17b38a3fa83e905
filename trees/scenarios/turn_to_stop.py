"""Turn a lever onto its far stop, and let it go."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, Release, TurnToStop
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.resting_hand import console_at

TURNS = 1.4


def scene(robot: str = "panda") -> Scene:
    """A lever on the top of a console or on its front; sizes, place and friction are drawn."""
    stands: dict[str, float | tuple[float, float]] = {
        "value": (0.0, 0.6),
        "x": console_at(robot),
        "heading": (-0.2, 0.2),
        "turns": TURNS,
    }
    return Scene(
        robot,
        fixtures=[FixtureSpec("lever", parameters=stands)],
        goal=Goal("lever", relation="set", value=TURNS, angle_tolerance=0.05),
        name="turn_to_stop",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "throw the lever",
        Grasp("lever"),
        TurnToStop("lever"),
        Release("lever"),
    )
