"""Turn a lever with a spring onto its stop, and hold it there for four seconds."""

from __future__ import annotations

from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import Grasp, HoldTurned, TurnToStop
from bt_tasksim.scene import FixtureSpec, Goal, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.resting_hand import console_at

TURNS, SECONDS, PRESS = 1.3, 4.0, 20.0


def scene(robot: str = "panda") -> Scene:
    """A lever that its spring turns back, on a console or on its front; sizes and place are drawn."""
    lever: dict[str, float | tuple[float, float]] = {
        "x": console_at(robot),
        "heading": (-0.2, 0.2),
        "turns": TURNS,
        "friction": 0.3,
        "spring": (0.5, 0.8),
    }
    return Scene(
        robot,
        fixtures=[FixtureSpec("lever", parameters=lever)],
        goal=Goal("lever", relation="set", value=TURNS, angle_tolerance=0.06, when="kept", duration=SECONDS),
        name="hold_turned",
    )


def build() -> Behaviour:
    """The tree."""
    return sequence(
        "hold the lever on its stop",
        Grasp("lever"),
        TurnToStop("lever", press=PRESS),
        HoldTurned("lever", duration=SECONDS),
    )
