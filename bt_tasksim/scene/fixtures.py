"""Fixtures: tables, shelves, bins and other furniture made of boxes, from data files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.document import Document
from bt_tasksim.core.errors import FieldError
from bt_tasksim.core.files import file_version
from bt_tasksim.core.joints import check_way
from bt_tasksim.core.named_data import named_data
from bt_tasksim.core.names import check_name
from bt_tasksim.core.plain import Plain, shown
from bt_tasksim.core.poses import Array
from bt_tasksim.core.resources import FURNITURE
from bt_tasksim.core.world import PlaceModel, is_container
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.grips import GivenGrip
from bt_tasksim.scene.specs import FixtureSpec

if TYPE_CHECKING:
    from bt_tasksim.scene.fixture_schema import BoxEntry, FixtureFile, PartEntry


ROUNDED = 1e-3
"""By how much the length of a unit vector in a file may differ from one."""


@dataclass(frozen=True)
class FixturePlace:
    """A place of a fixture, in the fixture's frame; see `bt_tasksim.core.world.PlaceModel`."""

    name: str
    kind: str
    position: tuple[float, float, float]
    extent: tuple[float, float]
    centre: tuple[float, float]
    height: float
    access: tuple[float, float, float]
    exit: tuple[float, float, float]
    clearance: float
    turn: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)

    @property
    def container(self) -> bool:
        """Things are put into it, and not onto it."""
        return is_container(self.kind)


@dataclass(frozen=True)
class FixturePart:
    """A part of a fixture that slides or turns, in the fixture's frame where its value is 0.

    Attributes:
        name: Its name, by which trees speak of it as of an object.
        boxes: What it is made of.
        kind: ``slide`` or ``hinge``.
        axis: The way in which it opens, or the axis about which it does, by the right hand; of length one.
        origin: A point on the axis, metres.
        limits: Lowest and highest value, metres or radians.
        mass: Kilograms.
        friction: What it takes to move it, N or Nm.
        damping: N or Nm for each metre or radian a second.
        stiffness: Of its spring, N/m or Nm/rad.
        rest: Value at which the spring is at rest.
        latch: Force or torque with which a latch holds it shut, N or Nm.
        value: How far it is open at the start; two values: drawn between them.
        grasps: Where two fingers may hold it.
        sensed: The robot sees how far it is open.
    """

    name: str
    boxes: tuple[Box, ...]
    kind: str
    axis: tuple[float, float, float]
    limits: tuple[float, float]
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass: float = 1.0
    friction: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    latch: float = 0.0
    value: tuple[float, float] = (0.0, 0.0)
    grasps: tuple[GivenGrip, ...] = ()
    sensed: bool = False

    def __post_init__(self) -> None:
        check_name(self.name, "the name of a part of a fixture")
        check_way(self.kind, self.limits, self.value)


@dataclass(frozen=True)
class Fixture:
    """Furniture that stands still, but for its parts.

    Attributes:
        name: Its name.
        pose: Pose ``(7,)`` in the robot base frame.
        boxes: What stands still.
        places: Where things can stand.
        parts: What slides or turns.
    """

    name: str
    pose: tuple[float, ...]
    boxes: tuple[Box, ...]
    places: tuple[FixturePlace, ...]
    parts: tuple[FixturePart, ...] = ()

    def __post_init__(self) -> None:
        check_name(self.name, "the name of a fixture")
        for place in self.places:
            check_name(place.name, "the name of a place")

    def pose_array(self) -> Array:
        """The pose as an array ``(7,)``."""
        return np.array(self.pose)

    def distance(self, point: Array) -> float:
        """Metres from a point ``(3,)`` in the robot base frame to the nearest box; inf without boxes."""
        inside = poses.transform(poses.inverse(self.pose_array()), point)
        return min((_distance(box, inside) for box in self.boxes), default=math.inf)

    def place_models(self) -> tuple[PlaceModel, ...]:
        """Its places in the robot base frame."""
        frame = self.pose_array()
        return tuple(
            PlaceModel(
                name=place.name,
                kind=place.kind,
                pose=poses.multiply(frame, np.array([*place.position, *place.turn])),
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
    def from_data(cls, data: Mapping[str, Plain]) -> Fixture:
        """A fixture from plain data, as in a file or a log.

        Raises:
            InputError: The data is not that of a fixture.
        """
        from bt_tasksim.core.typed_file import validate
        from bt_tasksim.scene.fixture_schema import FixtureFile

        return cls.from_file(validate(FixtureFile, Document("a fixture", dict(data))))

    @classmethod
    def from_file(cls, file: FixtureFile) -> Fixture:
        """A fixture from what stands in its file."""
        boxes = tuple(map(_box, file.boxes))
        places = tuple(
            FixturePlace(
                p.name,
                p.kind,
                p.position,
                p.extent,
                p.centre,
                p.height,
                _scaled(p.access),
                _scaled(p.exit),
                p.clearance,
                p.turn,
            )
            for p in file.places
        )
        parts = tuple(_part(entry) for entry in file.parts)
        return cls(file.name, file.pose, boxes, places, parts)


def _box(entry: BoxEntry) -> Box:
    pose = entry.pose or (*(entry.position or ()), 1.0, 0.0, 0.0, 0.0)
    return Box(pose, entry.size, entry.colour, entry.friction, entry.material)


def _part(entry: PartEntry) -> FixturePart:
    return FixturePart(
        name=entry.name,
        boxes=tuple(map(_box, entry.boxes)),
        kind=entry.joint,
        axis=_scaled(entry.axis),
        origin=entry.origin,
        limits=entry.limits,
        mass=entry.mass,
        friction=entry.friction,
        damping=entry.damping,
        stiffness=entry.stiffness,
        rest=entry.rest,
        latch=entry.latch,
        value=(entry.value, entry.value) if isinstance(entry.value, float) else entry.value,
        grasps=tuple(GivenGrip(g.point, g.closing, g.width, g.approach) for g in entry.grasps),
        sensed=entry.sensed,
    )


def _distance(box: Box, point: Array) -> float:
    """Metres from a point ``(3,)`` in the fixture's frame to a box; 0 inside."""
    local = poses.transform(poses.inverse(np.array(box.pose)), point)
    return float(np.linalg.norm(np.maximum(np.abs(local) - np.array(box.size) / 2, 0.0)))


def _scaled(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    """A direction of length one; one that is rounded in its file is kept as it stands there."""
    x, y, z = direction
    length = math.sqrt(x * x + y * y + z * z)
    return direction if abs(length - 1.0) < ROUNDED else (x / length, y / length, z / length)


class Maker(Protocol):
    """What makes fixtures by numbers, see `bt_tasksim.scene.fixture_maker.FixtureMaker`."""

    @classmethod
    def fixture(cls, name: str, parameters: Mapping[str, Any], rng: np.random.Generator | None) -> Fixture:
        """A fixture as drawn, or the one in the middle of all ranges."""

    @classmethod
    def check(cls, name: str, parameters: Mapping[str, Any]) -> None:
        """Check parameters at the ends of their ranges."""


def load_fixture(name: str | FixtureSpec, rng: np.random.Generator | None = None) -> Fixture:
    """A fixture by name, one from a data file by path, or one of these where a scene puts it.

    What is registered as a ``fixture`` is the path of its data file, a `Fixture`, or what makes some.

    Args:
        name: Its name or path, or where a scene puts it.
        rng: What parameters of a made one are drawn by; None: each is in the middle of its range.

    Raises:
        InputError: No such fixture, or the file is not one; says what is wrong and where.
    """
    if isinstance(name, FixtureSpec):
        return _put(_found(name.fixture, name.parameters, rng), name)
    return _found(name, {}, rng)


def is_made(spec: str | FixtureSpec) -> bool:
    """Whether a fixture is made by numbers, which may differ from world to world."""
    return not isinstance(_registered(spec if isinstance(spec, str) else spec.fixture), Path | Fixture)


def check_parameters(spec: str | FixtureSpec) -> None:
    """Check the parameters of a fixture, at the ends of their ranges.

    Raises:
        FieldError: Some are no good, or it takes none.
    """
    name, parameters = (spec, {}) if isinstance(spec, str) else (spec.fixture, spec.parameters)
    found = _registered(name)
    if not isinstance(found, Path | Fixture):
        found.check(name, parameters)
    elif parameters:
        raise FieldError(f"the fixture '{shown(name)}' is as it is, and has no parameters", "parameters")


def _found(name: str, parameters: Mapping[str, Any], rng: np.random.Generator | None) -> Fixture:
    found = _registered(name)
    if isinstance(found, Path):
        return _load(found, file_version(found))
    return found if isinstance(found, Fixture) else found.fixture(name, parameters, rng)


def _registered(name: str) -> Path | Fixture | type[Maker]:
    """What a name stands for, or the file of a path."""
    found: Any = named_data("fixture", name, Fixture)
    return cast("Path | Fixture | type[Maker]", found)


def _put(fixture: Fixture, spec: FixtureSpec) -> Fixture:
    """A fixture where a scene puts it, with the names that it has there."""
    position, turn = fixture.pose[:3], fixture.pose[3:]
    if spec.at is not None:
        position = (*spec.at, *position[len(spec.at) :])
    if spec.yaw is not None:
        heading = sum(spec.yaw) / 2 if isinstance(spec.yaw, tuple) else spec.yaw
        turn = tuple(float(v) for v in poses.yaw(heading))
    name, places, parts = fixture.name, fixture.places, fixture.parts
    if spec.name:
        parts = tuple(
            replace(p, name=spec.name if p.name == fixture.name else f"{spec.name}_{p.name}") for p in parts
        )
        places = tuple(
            replace(p, name=spec.name if p.name == fixture.name else f"{spec.name}_{p.name}") for p in places
        )
        name = spec.name
    if spec.sensed is not None:
        parts = tuple(replace(p, sensed=spec.sensed) for p in parts)
    return Fixture(name, (*position, *turn), fixture.boxes, places, parts)


@lru_cache(maxsize=64)
def _load(path: Path, version: tuple[int, ...]) -> Fixture:
    """The fixture in this version of a file."""
    from bt_tasksim.core.typed_file import load_typed, validate
    from bt_tasksim.scene.fixture_schema import FixtureFile

    if path.suffix in FURNITURE:
        from bt_tasksim.scene.articulated import articulated

        return Fixture.from_file(validate(FixtureFile, Document(f"fixture file '{path}'", articulated(path))))
    return Fixture.from_file(load_typed(FixtureFile, path, "fixture file")[0])


def __getattr__(name: str) -> type[FixturePlace]:
    """`FixturePlace` by its former name, which is a concept's too."""
    if name == "Place":
        return FixturePlace
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
