"""How something may be turned to be as it should, up to its symmetry: poses on the way, in one world."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bt_tasksim.concept_nodes.turning import swung
from bt_tasksim.core import poses
from bt_tasksim.core.fact_making import rotations
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel

AROUND = 16
"""Headings about an axis that are looked at where any will do."""
NOTHING = 1e-6
"""Radians of a turn that is none."""


class Turning(NamedTuple):
    """One way to turn something.

    Attributes:
        poses: Poses ``(n, 7)`` on the way, the present one left out.
    """

    poses: Array


def turnings(
    now: Array, model: ObjectModel, *, should: Array | None = None, up: Array | None = None
) -> list[Turning]:
    """The ways to turn something about its middle, the shortest first.

    Args:
        now: Its pose ``(7,)``.
        model: What it is.
        should: The rotation ``(4,)`` that it gets, up to its symmetry.
        up: Or the axis ``(3,)`` in its frame that shall point up.
    """
    if up is not None:
        ends = _about(now[3:], up, np.array([0.0, 0.0, 1.0]))
    else:
        assert should is not None
        if model.symmetry == 0 and not model.cubic:
            axis = np.array([0.0, 0.0, 1.0])
            ends = _about(now[3:], axis, poses.rotate(should, axis))
        else:
            ends = poses.quat_multiply(should[None], rotations(model))
    turns = poses.rotation_vector(poses.quat_multiply(ends, poses.quat_conjugate(now[3:])[None]))
    angles = np.linalg.norm(turns, axis=-1)
    found = []
    for k in np.argsort(np.round(angles, 6), kind="stable").tolist():
        if angles[k] < NOTHING:
            found.append(Turning(now[None].copy()))
        else:
            found.append(Turning(swung(now, turns[k] / angles[k], now[:3], float(angles[k]))))
    return found


def _about(now: Array, axis: Array, direction: Array) -> Array:
    """Rotations ``(k, 4)`` in which an axis ``(3,)`` of something points along a direction ``(3,)``.

    All around; the one that is the shortest turn from a rotation ``(4,)`` is among them.
    """
    turn = poses.shortest_turn(poses.rotate(now, axis), direction)
    first = poses.quat_multiply(poses.from_rotation_vector(turn), now)
    angles = 2.0 * np.pi * np.arange(AROUND) / AROUND
    found: Array = poses.quat_multiply(poses.from_rotation_vector(angles[:, None] * direction), first[None])
    return found
