"""How far out a robot's hand rests, for furniture that is to stand clear of it."""

from __future__ import annotations

from bt_tasksim.planning.arm import arm_of
from bt_tasksim.robot.description import load_robot

FAR = 0.36
"""Metres before its base at which a hand may rest and be clear of furniture where that usually stands."""

CONSOLE = (0.52, 0.58)
"""Metres between which consoles usually stand from a robot's base."""


def farther_out(robot: str) -> float:
    """Metres by which a robot's hand rests farther out than `FAR`; 0 where it does not.

    Args:
        robot: Name of the robot.

    Raises:
        InputError: There is no such robot.
    """
    made = load_robot(robot)
    return max(0.0, float(arm_of(made).tool(made.rest)[0]) - FAR)


def console_at(robot: str) -> tuple[float, float]:
    """How far from its base, in metres, a console stands before a robot; the usual place, or farther out."""
    farther = farther_out(robot)
    return CONSOLE[0] + farther, CONSOLE[1] + farther
