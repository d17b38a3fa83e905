"""What a demonstration tells of a task, in words and as the arguments of a leaf."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from bt_tasksim.concept.parameters import Parameter
from bt_tasksim.concept.task import Floats

SNAP = math.radians(15.0)
"""A demonstrated direction this near to the vertical counts as vertical."""

_WAYS = {
    "up": (0, 0, 1),
    "down": (0, 0, -1),
    "forward": (1, 0, 0),
    "back": (-1, 0, 0),
    "left": (0, 1, 0),
    "right": (0, -1, 0),
}
_FROM = {
    "up": "below",
    "down": "above",
    "forward": "the front",
    "back": "behind",
    "left": "the right",
    "right": "the left",
}


class ShownObject(Protocol):
    """An object's track in a demonstration."""

    @property
    def pose(self) -> Floats:
        """Poses ``(T, 7)`` in the robot base frame."""

    @property
    def kind(self) -> str:
        """Its kind, such as ``cylinder``."""

    @property
    def size(self) -> Floats:
        """Its size ``(3,)`` in metres."""


class Shown(Protocol):
    """What a recogniser knows of a demonstration, see `bt_tasksim.demos_decomp.log.Demonstration`."""

    @property
    def time(self) -> Floats:
        """Seconds ``(T,)``."""

    @property
    def hand_pose(self) -> Floats:
        """Poses ``(T, 7)`` of the hand's tool frame in the robot base frame."""

    @property
    def hand_opening(self) -> Floats:
        """Distance ``(T,)`` between the fingertips in metres."""

    @property
    def objects(self) -> Mapping[str, ShownObject]:
        """Tracks by name."""


def nearest_way(direction: ArrayLike) -> str:
    """The word for the axis of the robot base frame that a direction ``(3,)`` is nearest to."""
    vector = np.asarray(direction, dtype=float)
    return max(_WAYS, key=lambda name: float(vector @ np.array(_WAYS[name])))


def coming_from(direction: ArrayLike) -> str:
    """The words for where something that moves along a direction ``(3,)`` comes from."""
    return _FROM[nearest_way(direction)]


def straight_words(parameters: Mapping[str, Any]) -> str:
    """A straight motion, such as ``up 0.12 m``."""
    return f"{nearest_way(parameters['direction'])} {float(parameters['distance']):.2f} m"


def position_words(position: ArrayLike) -> str:
    """A position ``(3,)``, such as ``(0.50, 0.10, 0.03) m``."""
    return "({:.2f}, {:.2f}, {:.2f}) m".format(*(np.round(np.asarray(position, float), 2) + 0.0))


def plain_words(parameters: Mapping[str, Any], declared: Mapping[str, Parameter]) -> str:
    """Parameters one by one, with their units: what is said of a concept that says nothing itself."""
    said = []
    for name, value in parameters.items():
        if name == "target":
            continue
        quantity = declared[name].quantity if name in declared else None
        unit = f" {quantity.unit}" if quantity is not None and quantity.unit not in ("", "1") else ""
        if isinstance(value, str):
            said.append(f"{name} {value}")
        elif quantity is not None and quantity.kind == "points":
            said.append(f"{name} {len(value)} point{'' if len(value) == 1 else 's'}")
        else:
            numbers = ", ".join(f"{v:.2f}" for v in np.round(np.ravel(np.asarray(value, float)), 2) + 0.0)
            said.append(f"{name} {numbers if np.ndim(value) == 0 else f'({numbers})'}{unit}")
    return ", ".join(said)


def snapped(direction: ArrayLike) -> tuple[float, float, float] | None:
    """A direction ``(3,)``, or None where it is vertical as far as a demonstration can tell."""
    d = np.asarray(direction, float)
    d = d / np.linalg.norm(d)
    if math.acos(min(1.0, abs(float(d[2])))) < SNAP:
        return None
    return rounded(d[0]), rounded(d[1]), rounded(d[2])


def rounded(value: Any) -> float:
    """A number to tenths of a millimetre: a demonstration is no more accurate, and people read the file."""
    return round(float(value), 4)


def rounded_points(points: Sequence[ArrayLike]) -> tuple[tuple[float, ...], ...]:
    """Points, each ``(3,)``, likewise."""
    return tuple(tuple(rounded(v) for v in np.asarray(point, float)) for point in points)


def plain_argument(value: Any, parameter: Parameter) -> Any:
    """A demonstrated value as the argument of a leaf."""
    match parameter.quantity.kind:
        case "number":
            return rounded(value)
        case "vector":
            return tuple(rounded(v) for v in value)
        case "points":
            return rounded_points(value)
        case _:
            return value
