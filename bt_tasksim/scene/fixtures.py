"""Fixtures: tables, shelves, bins and other furniture made of boxes, from data files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bt_tasksim import poses
from bt_tasksim.errors import InputError, nearest
from bt_tasksim.poses import Array
from bt_tasksim.resources import asset
from bt_tasksim.world import PlaceModel

LOOKS = ("matte", "wood", "metal")


@dataclass(frozen=True)
class Box:
    """A solid box of a fixture: pose ``(7,)`` in its frame, full size (m), sRGB colour, friction.

    ``look`` says what it is drawn like: ``matte``, ``wood`` or ``metal``.
    """

    pose: tuple[float, ...]
    size: tuple[float, float, float]
    colour: tuple[float, float, float] = (0.6, 0.5, 0.4)
    friction: float = 0.6
    look: str = "matte"


@dataclass(frozen=True)
class Place:
    """A place of a fixture, in the fixture's frame; see `bt_tasksim.world.PlaceModel`."""

    name: str
    kind: str
    position: tuple[float, float, float]
    extent: tuple[float, float]
    centre: tuple[float, float]
    height: float
    access: tuple[float, float, float]
    exit: tuple[float, float, float]
    clearance: float


@dataclass(frozen=True)
class Fixture:
    """Furniture that does not move.

    Attributes:
        name: Its name.
        pose: Pose ``(7,)`` in the robot base frame.
        boxes: The solid parts.
        places: Where things can stand.
    """

    name: str
    pose: tuple[float, ...]
    boxes: tuple[Box, ...]
    places: tuple[Place, ...]

    def pose_array(self) -> Array:
        """The pose as an array ``(7,)``."""
        return np.array(self.pose)

    def place_models(self) -> tuple[PlaceModel, ...]:
        """Its places in the robot base frame."""
        frame = self.pose_array()
        return tuple(
            PlaceModel(
                name=place.name,
                kind=place.kind,
                pose=poses.multiply(frame, poses.pose(place.position)),
                extent=place.extent,
                centre=place.centre,
                height=place.height,
                access=poses.rotate(frame[3:], np.array(place.access)),
                exit=poses.rotate(frame[3:], np.array(place.exit)),
                fixture=self.name,
                clearance=place.clearance,
            )
            for place in self.places
        )

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Fixture:
        """A fixture from plain data, as in a file.

        Raises:
            KeyError, TypeError, ValueError: The data lacks something or has something of a wrong kind.
        """
        pose = _pose(data.get("pose", (0, 0, 0, 1, 0, 0, 0)))
        boxes = tuple(
            Box(
                pose=_pose(b["pose"] if "pose" in b else (*b["position"], 1, 0, 0, 0)),
                size=_size(b["size"]),
                colour=_floats(b.get("colour", (0.6, 0.5, 0.4)), 3),
                friction=float(b.get("friction", 0.6)),
                look=_look(b.get("look", "matte")),
            )
            for b in data["boxes"]
        )
        places = tuple(
            Place(
                name=str(p["name"]),
                kind=str(p["kind"]),
                position=_floats(p["position"], 3),
                extent=_floats(p["extent"], 2),
                centre=_floats(p.get("centre", (0, 0)), 2),
                height=float(p.get("height", 10.0)),
                access=_floats(p.get("access", (0, 0, -1)), 3),
                exit=_floats(p.get("exit", (0, 0, 1)), 3),
                clearance=float(p.get("clearance", 0.1)),
            )
            for p in data["places"]
        )
        return cls(str(data["name"]), pose, boxes, places)


def _pose(values: Any) -> tuple[float, ...]:
    out: tuple[float, ...] = _floats(values, 7)
    if abs(np.linalg.norm(out[3:]) - 1) > 1e-3:
        raise ValueError(f"a pose is x y z and a unit quaternion w x y z, found {values!r}")
    return out


def _size(values: Any) -> Any:
    out = _floats(values, 3)
    if min(out) <= 0:
        raise ValueError(f"a size is three positive numbers, found {values!r}")
    return out


def _look(name: Any) -> str:
    if name not in LOOKS:
        raise ValueError(f"unknown look '{name}'{nearest(str(name), LOOKS)}")
    return str(name)


def _floats(values: Any, n: int) -> Any:
    out = tuple(float(v) for v in values)
    if len(out) != n or not np.all(np.isfinite(out)):
        raise ValueError(f"expected {n} finite numbers, found {values!r}")
    return out


@lru_cache(maxsize=64)
def load_fixture(name: str) -> Fixture:
    """A bundled fixture by name, or one from a data file by path.

    Raises:
        InputError: No such fixture, or the file is not one; says what is wrong.
    """
    if name.endswith((".yaml", ".yml")):
        path = Path(name)
        if not path.is_file():
            raise InputError(f"no fixture file '{name}'")
    else:
        path = asset("fixtures", f"{name}.yaml")
        if not path.is_file():
            known = [p.stem for p in asset("fixtures").glob("*.yaml")]
            raise InputError(f"unknown fixture '{name}'{nearest(name, known)}")
    try:
        data = yaml.safe_load(path.read_text())
        return Fixture.from_data(data)
    except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"fixture file '{path}': {type(error).__name__}: {error}") from error
