"""How a hand closes: whether one side of it stands still while the other one comes."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.models import body_index, full_model

_STILL = 2e-3
"""Metres that a finger moves at most, from open to closed, that counts as one that stands still."""
_BESIDE = 8e-3
"""Metres between the point of a finger that stands still and an object beside which it comes down: estimates
are wrong by some millimetres (the noise "fine" has a standard deviation of 2 mm an axis), and a fingertip
that is meant to pass 3 mm beside a thing lands on it once in fifteen times."""
SLIDE = 4e-3
"""Metres that such a hand then goes aside, so that this finger is at the object when the other one closes:
what is pushed against it from farther away, by the other one's tip alone, is tipped over."""

SPARE = 0.024
"""Metres by which it is wider open than what it takes: `_BESIDE` where the jaw stands still, twice that where
the other one leans and swings."""
_SHARE = 0.05
"""Steps of closure in which it is opened, so that what stands around is looked at for few hands."""
_SHALLOW = 0.5
"""Share of its depth to which a hand with a jaw that swings reaches beside what is wide. Of 8 cups of 37 to
46 mm that the SO-100 takes from above with 15 N, 5 stay in the hand with its depth of 30 mm, 7 with 10 mm and
8 with 16 mm."""


def tips_in_tool(robot: RobotDescription, hand: Array) -> Array:
    """Points ``(n_tips, 3)`` of the fingertips in the tool frame, for joints of the hand ``(n_hand,)``.

    Raises:
        InputError: The description does not fit its URDF.
    """
    model, order = full_model(robot)
    data, q = model.createData(), np.array(pin.neutral(model))
    q[order] = np.concatenate([robot.rest, hand])
    pin.framesForwardKinematics(model, data, q)
    tool = data.oMf[model.getFrameId("tool")]
    points = [data.oMf[body_index(model, tip.links[0], robot)].act(np.array(tip.point)) for tip in robot.tips]
    return np.array([tool.actInv(point) for point in points])


def standing_side(robot: RobotDescription) -> float | None:
    """Where along the closing axis an object's face belongs in a hand of which one side stands still.

    Returns:
        Metres along the tool's y axis, the object on the side of zero; None for a hand all of whose fingers
        move.

    Raises:
        InputError: The description does not fit its URDF.
    """
    found: float | None = robot.derived("standing side", _standing_side)
    return found


def depth_at(robot: RobotDescription, width: Array) -> Array:
    """Metres ``(...)`` that a hand may reach below the top of what is as wide as ``width (...)``.

    A jaw that swings about a pivot leans away from the one that stands still where it is wide open, and
    touches a wide thing by its upper edge alone, high above where the other one touches it. The two then
    press past each other, the more so the deeper they reach; so what is wider than where they are parallel is
    held less deep.
    """
    xp = array_namespace(width)
    depth = xp.full_like(width, robot.depth)
    if standing_side(robot) is None:
        return depth
    parallel: float = robot.derived("parallel", _parallel)
    return xp.where(width > parallel, _SHALLOW * depth, depth)


def shorter_at(robot: RobotDescription, width: Array) -> Array:
    """Metres ``(...)`` by which a jaw that swings reaches less deep where the hand is ``width (...)`` open.

    That is against where it reaches deepest, which is where the jaws are parallel; 0 for other hands.
    """
    if standing_side(robot) is None:
        return 0.0 * width
    widths, depths, _ = _swing_of(robot)
    found: Array = depths.max() - np.interp(width, widths, depths)
    return found


def swung_at(robot: RobotDescription, width: Array) -> Array:
    """Radians ``(...)`` by which a jaw that swings leans away from what is ``width (...)`` wide; else 0."""
    if standing_side(robot) is None:
        return 0.0 * width
    widths, _, angles = _swing_of(robot)
    found: Array = np.interp(width, widths, angles)
    return found


def opened_about(robot: RobotDescription, width: float, spare: float = SPARE) -> Array:
    """Joints ``(n_hand,)`` of a hand that comes about what is so many metres wide, or lets go of it.

    A jaw that swings sweeps aside and down what stands within its reach; so it is opened no wider than it has
    to be. Other hands open all the way.

    Args:
        robot: The robot.
        width: Metres.
        spare: Metres by which it is wider open, at least.
    """
    if standing_side(robot) is None:
        return robot.hand_open
    widths, _, _ = _swing_of(robot)
    share = float(np.interp(width + spare, widths, np.linspace(1.0, 0.0, len(widths))))
    found: Array = robot.hand_open + np.floor(share / _SHARE) * _SHARE * (robot.hand_closed - robot.hand_open)
    return found


def wide_at(robot: RobotDescription, closure: float) -> float:
    """Metres between the sides of a hand with one that stands still, closed so far; 0 for other hands."""
    if standing_side(robot) is None:
        return 0.0
    widths, _, _ = _swing_of(robot)
    return float(np.interp(1.0 - closure, np.linspace(0.0, 1.0, len(widths)), widths))


def _swing_of(robot: RobotDescription) -> tuple[Array, Array, Array]:
    found: tuple[Array, Array, Array] = robot.derived("swing", _swing)
    return found


def _parallel(robot: RobotDescription) -> float:
    """Metres between the sides of a hand where the side that moves goes straight towards the other one."""
    widths, depths, _ = _swing_of(robot)
    return float(widths[np.argmax(depths)])


def _swing(robot: RobotDescription) -> tuple[Array, Array, Array]:
    """How a jaw swings, by the width between the jaws, rising: that, its depth, and how far it leans away.

    Metres, metres and radians ``(n,)``. The tip goes across its jaw, so where it goes straight towards the
    other one the jaws are parallel.
    """
    shares = np.linspace(1.0, 0.0, 41)[:, None]
    hands = robot.hand_open + shares * (robot.hand_closed - robot.hand_open)
    tips = np.array([tips_in_tool(robot, hand) for hand in hands])
    gone = np.abs(tips[0, :, 1] - tips[-1, :, 1])
    moving, still = int(np.argmax(gone)), int(np.argmin(gone))
    widths, depths = np.abs(tips[:, moving, 1] - tips[:, still, 1]), tips[:, moving, 2]
    angles = np.arctan2(-np.gradient(depths), np.gradient(widths))
    return widths, depths, np.maximum(angles, 0.0)


def _standing_side(robot: RobotDescription) -> float | None:
    opened, closed = (tips_in_tool(robot, hand) for hand in (robot.hand_open, robot.hand_closed))
    for group in robot.opposition:
        tips = list(group)
        if float(np.abs(opened[tips] - closed[tips]).max()) < _STILL:
            y = float(opened[tips, 1].mean())
            return y - float(np.sign(y)) * _BESIDE
    return None
