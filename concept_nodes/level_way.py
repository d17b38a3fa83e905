"""A level way along a support, as the author of a tree gives it: to one goal, or so far in a direction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bt_tasksim.concept.demonstrated import position_words, straight_words
from bt_tasksim.core.poses import Array, constant

STEEP = 0.1
"""Upward part of a unit vector, of either sign, from which on it is no level direction."""

Vector = tuple[float, float, float]


def goal_words(parameters: Mapping[str, Any]) -> list[str]:
    """Where a way goes, in words: parameters ``to``, ``position``, or ``direction`` and ``distance``."""
    said = [f"to {parameters['to']}"] if "to" in parameters else []
    if "position" in parameters:
        said.append(f"to {position_words(parameters['position'])}")
    if "direction" in parameters and "distance" in parameters:
        said.append(straight_words(parameters))
    return said


def not_one_goal(
    to: str | None, position: Vector | None, direction: Vector | None, distance: float | None
) -> str:
    """Why such parameters do not say one goal, as the end of a sentence; empty where they do."""
    by_way = direction is not None or distance is not None
    if sum((to is not None, position is not None, by_way)) != 1:
        return "give either 'to', 'position', or 'direction' and 'distance'"
    if by_way and (direction is None or distance is None):
        return "'direction' and 'distance' go together"
    return ""


def not_level(direction: Vector | None, along: str = "is pressed on") -> str:
    """Why a direction is none along a level support, as the end of a sentence; empty where it is one.

    Args:
        direction: The direction, if it is given.
        along: What the object does there, as in "what the object stands on".
    """
    if direction is None or abs(direction[2]) <= STEEP:
        return ""
    return f"'direction' should be level: it is the way along what the object {along}"


def flattened(direction: Vector, length: float = 1.0) -> Array:
    """The level vector ``(3,)`` of some length along a direction."""
    flat = np.array([*direction[:2], 0.0])
    found: Array = length * flat / np.linalg.norm(flat)
    return found


def level(direction: Vector, distance: float, like: Array) -> Array:
    """The displacement ``(3,)`` that goes so far along the level part of a direction, like an array."""
    return constant(flattened(direction, distance), like)
