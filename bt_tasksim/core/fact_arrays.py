"""Bundles of arrays in which stands what is known beforehand of objects, places and obstacles."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from bt_tasksim.core.joints import Joints
from bt_tasksim.core.poses import Array, array_namespace

_T = TypeVar("_T", bound="FactArrays")


@dataclass(frozen=True)
class FactArrays:
    """A bundle of arrays with the same leading dimensions."""

    def map(self: _T, change: Callable[[Array], Array]) -> _T:
        """The same facts, each array changed when somebody first looks at it: few of them are."""
        made = object.__new__(type(self))
        made.__dict__["_made_of"] = (self, change)
        return made

    def __getattr__(self, name: str) -> Any:
        """A field of facts that `map` has made."""
        if name not in type(self).__dataclass_fields__ or "_made_of" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__} has no '{name}'")
        source, change = self.__dict__["_made_of"]
        found = self.__dict__[name] = change(getattr(source, name))
        return found


@dataclass(frozen=True)
class ObjectFacts(FactArrays):
    """What is known beforehand of objects; leading dimensions ``(...)``, see `ObjectModel`.

    Attributes:
        present: Boolean ``(...)``: the world has it; else the numbers are of no meaning.
        extent: Full nominal bounding-box size ``(..., 3)``, metres.
        revolved: Boolean ``(...)``: a body of revolution about z.
        cubic: Boolean ``(...)``: it looks the same on each of its faces.
        ball: Boolean ``(...)``: it looks the same however it is turned.
        rotations: Rotations ``(..., most, 4)`` that bring it onto itself, in its own frame; the first one is
            the identity. Of a body of revolution only that.
        rotation_counts: Boolean ``(..., most)``: there is such a rotation.
        grasp_axes: Directions ``(..., most, 3)`` along which two fingers may close on it, best first.
        grasp_widths: Widths ``(..., most)`` along these, metres; infinite where there is no further axis.
        jointed: Boolean ``(...)``: it is a part of a fixture, and moves on a joint; else the following are of
            no meaning.
        joint_turns: Boolean ``(...)``: the joint turns, and does not slide.
        joint_origin: A point ``(..., 3)`` on its axis, in the part's frame, metres.
        joint_axis: Unit vectors ``(..., 3)`` in the part's frame.
        joint_zero: Poses ``(..., 7)`` of the part where its value is 0.
        joint_limits: Lowest and highest value ``(..., 2)``, metres or radians.
        joint_sensed: Boolean ``(...)``: the robot sees how far it is open.
        handles: Points ``(..., most, 3)`` in the part's frame where two fingers may hold it, metres.
        handle_counts: Boolean ``(..., most)``: there is such a point.
    """

    present: Array
    extent: Array
    revolved: Array
    cubic: Array
    ball: Array
    rotations: Array
    rotation_counts: Array
    grasp_axes: Array
    grasp_widths: Array
    jointed: Array
    joint_turns: Array
    joint_origin: Array
    joint_axis: Array
    joint_zero: Array
    joint_limits: Array
    joint_sensed: Array
    handles: Array
    handle_counts: Array

    @property
    def joints(self) -> Joints:
        """Their joints."""
        return Joints(
            self.joint_turns, self.joint_origin, self.joint_axis, self.joint_zero, self.joint_limits
        )

    @property
    def standing_height(self) -> Array:
        """Height ``(...)`` of its centre above what it stands on: a cube may stand on any face, metres."""
        xp = array_namespace(self.extent)
        return xp.where(self.cubic, xp.max(self.extent, axis=-1), self.extent[..., 2]) / 2


@dataclass(frozen=True)
class PlaceFacts(FactArrays):
    """Calibrated places; leading dimensions ``(...)``, see `PlaceModel`.

    Attributes:
        present: Boolean ``(...)``: the world has it; else the numbers are of no meaning.
        pose: Poses ``(..., 7)``.
        extent: Full size ``(..., 2)``, metres.
        centre: Centre ``(..., 2)`` in the place's frame, metres.
        height: Free height ``(...)``, metres.
        access: Unit vectors ``(..., 3)``.
        exit: Unit vectors ``(..., 3)``.
        clearance: ``(...)`` metres.
        container: Boolean ``(...)``: it is one, such as a bin, and ``height`` is that of its walls.
        rank: ``(...)`` its number among the places of its own world, whichever column it has.
        carries: Boolean ``(...)``: it is of some furniture, and neither a mark in the air nor a hole.
    """

    present: Array
    pose: Array
    extent: Array
    centre: Array
    height: Array
    access: Array
    exit: Array
    clearance: Array
    container: Array
    rank: Array
    carries: Array

    @property
    def rim(self) -> Array:
        """Height ``(...)`` above the place's origin that a thing has to be lifted over, metres."""
        xp = array_namespace(self.height)
        return xp.where(self.container, self.height, xp.zeros_like(self.height))


@dataclass(frozen=True)
class ObstacleFacts(FactArrays):
    """Boxes to keep clear of; leading dimensions ``(N, most)``.

    Attributes:
        present: Boolean: there is one.
        pose: Poses ``(..., 7)``.
        size: Full sizes ``(..., 3)``, metres.
    """

    present: Array
    pose: Array
    size: Array


FILLING: Mapping[str, Any] = {
    "rotations": (1.0, 0.0, 0.0, 0.0),
    "grasp_axes": (0.0, 1.0, 0.0),
    "grasp_widths": math.inf,
    "pose": (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    "handles": (0.0, 0.0, 0.0),
    "joint_axis": (1.0, 0.0, 0.0),
    "joint_zero": (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
    "joint_limits": (0.0, 1.0),
}
"""What stands in the arrays of facts where a world has fewer entries than others; else zeros."""


def take_rows(values: Array, index: Array) -> Array:
    """Of ``values (N, n, ...)`` the entry ``index (N,)`` of each row: ``(N, ...)``."""
    if isinstance(values, np.ndarray):
        return values[np.arange(values.shape[0]), index]
    xp = array_namespace(values)
    if values.ndim == 2:
        return xp.take_along_axis(values, index[:, None], axis=1)[:, 0]
    shape = (values.shape[0], 1, *values.shape[2:])
    spread = xp.broadcast_to(xp.reshape(index, (-1, *(1,) * (values.ndim - 1))), shape)
    return xp.take_along_axis(values, spread, axis=1)[:, 0, ...]
