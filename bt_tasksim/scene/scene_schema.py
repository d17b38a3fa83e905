"""What may stand in a scene's file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import BeforeValidator, Discriminator, Field, Tag

from bt_tasksim.core.registry import OWN, parts
from bt_tasksim.core.typed_file import (
    Extent2,
    Model,
    Name,
    Number,
    Text,
    Vector2,
    known_values,
    sized,
)
from bt_tasksim.scene.mesh_file import check_size
from bt_tasksim.scene.shapes import KINDS
from bt_tasksim.scene.specs import OLD_RELATION

Range = tuple[float, float]
"""Lowest and highest value."""
HalfSize = Annotated[Number, Field(ge=0.0, le=100.0)]
Extents = Annotated[tuple[HalfSize, HalfSize], Field(strict=False), sized(2)]
"""Half sizes along x and y, metres."""
SizeRange = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Lowest and highest full size."""


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError("should be a number, or two")
    return float(value)


def between(low: float, high: float, unit: str = "") -> BeforeValidator:
    """A value, or a lowest and a highest one, between bounds."""
    bounds = f"between {low:g} and {high:g}{f' {unit}' if unit else ''}"

    def check(value: object) -> Range:
        pair = value if isinstance(value, (list, tuple)) and len(value) == 2 else (value, value)
        first, second = _number(pair[0]), _number(pair[1])
        if not low <= first <= second <= high:
            raise ValueError(f"should be {bounds}, the lower one first")
        return first, second

    return BeforeValidator(check, json_schema_input_type=float | tuple[float, float])


def _sizes(value: object) -> SizeRange:
    nested = isinstance(value, list) and len(value) == 2 and isinstance(value[0], list)
    low, high = (_size(v) for v in (value if nested and isinstance(value, list) else (value, value)))
    if min(low) <= 0 or any(a > b for a, b in zip(low, high, strict=True)):
        raise ValueError("should be positive, the smaller one first")
    for bound in (low, high):
        check_size("it", bound)
    return low, high


def _size(value: object) -> tuple[float, float, float]:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise ValueError("should be 3 numbers, or two times 3")
    x, y, z = (_number(v) for v in value)
    return x, y, z


def _listed(value: object) -> object:
    return value if isinstance(value, list) else [value]


def _relations() -> list[str]:
    return [*parts("goal relation"), OLD_RELATION]


Kind = Annotated[Text, known_values(lambda: list(KINDS), "kind of object", OWN)]


class ObjectEntry(Model):
    """An object."""

    kind: (
        Annotated[
            tuple[Kind, ...],
            BeforeValidator(_listed, json_schema_input_type=str | list[str]),
            Field(strict=False, min_length=1, max_length=100),
        ]
        | None
    ) = None
    """A kind of object, or a list to draw from; by default `mesh` with a mesh, else the object's name."""
    on: Text
    """Name of the place where it starts."""
    at: Vector2 | None = None
    """Middle of the area in which it is drawn, in the place's frame, m; by default the place's origin."""
    area: Extents | None = None
    """Half sizes of that area, m; by default 0 with `at`, else what an arm reaches well."""
    heading: Annotated[Number, Field(ge=-math.tau, le=math.tau)] = math.pi
    """Half width of the range of its heading, rad."""
    size: (
        Annotated[SizeRange, BeforeValidator(_sizes, json_schema_input_type=list[float] | list[list[float]])]
        | None
    ) = None
    """Full size, or the lowest and the highest one, m; by default the kind's range."""
    mass: Annotated[Range, between(0.001, 20.0, "kg")] = (0.08, 0.25)
    """Mass, or the lowest and the highest one, kg."""
    friction: Annotated[Range, between(0.01, 2.0)] = (0.4, 0.9)
    """Friction coefficient, or the lowest and the highest one."""
    exponents: Annotated[Range, between(1e-6, 2.0)] = (0.2, 1.0)
    """Shape exponents of a superellipsoid, from box-like (near 0) to ellipsoid (1)."""
    mesh: Text | None = None
    """A mesh file in the scene file's folder or below: OBJ, STL, PLY, OFF or GLB."""
    scale: Annotated[Number, Field(gt=0.0, le=1e6)] | None = None
    """What brings the mesh file's numbers to metres; by default 1."""


def _form(value: object) -> str:
    return "~short" if isinstance(value, str) else "~entry"


ShortOrEntry = Annotated[
    Annotated[Text, Tag("~short")] | Annotated[ObjectEntry, Tag("~entry")], Discriminator(_form)
]


class SpotEntry(Model):
    """A spot marked on a place, where something is to stand."""

    name: Name
    """The spot's name, a place like any other."""
    on: Text
    """Name of the place it lies on."""
    at: Vector2 = (0.0, 0.0)
    """Middle of the area in which it is drawn, in that place's frame, m."""
    area: Extents = (0.0, 0.0)
    """Half sizes of that area, m."""
    extent: Extent2 = (0.12, 0.12)
    """Full size of the spot, m."""
    heading: Annotated[Number, Field(ge=-math.tau, le=math.tau)] = 0.0
    """Half width of the range of its heading, rad."""


class GoalEntry(Model):
    """Where an object should be at the end."""

    object: Text
    """Name of the object."""
    place: Text
    """Name of the place."""
    relation: Annotated[Text, known_values(_relations, "relation", OWN)] = "on"
    """`on` the place's origin, `inside` it, `lifted` in the hand above where it stood, or one of yours."""
    position_tolerance: Annotated[Number, Field(gt=0.0, le=10.0)] = 0.03
    """How far from the place's origin the object may be, m."""
    angle_tolerance: Annotated[Number, Field(gt=0.0, le=math.pi)] = math.radians(10.0)
    """How far it may be tilted, or turned from the place's heading, rad."""
    height: Annotated[Number, Field(gt=0.0, le=10.0)] = 0.3
    """Of `lifted`: how far above where it stood, m."""


class SceneFile(Model):
    """A robot, furniture and objects, and how worlds with them are drawn."""

    former: ClassVar[Mapping[str, str]] = {"knock": "disturbed"}

    name: Text | None = None
    """Name of the scene in results; by default that of the file."""
    robot: Text = "panda"
    """A bundled robot, or a robot file in this file's folder or below."""
    fixtures: Annotated[tuple[Text, ...], Field(strict=False, max_length=50)] = ()
    """Bundled fixtures, or fixture files in this file's folder or below; the table is always there."""
    objects: Annotated[dict[Name, ShortOrEntry], Field(max_length=100)] | None = None
    """By name: an entry, or in short ``cup on upper_board``, or ``on upper_board``."""
    spots: Annotated[tuple[SpotEntry, ...], Field(strict=False, max_length=100)] = ()
    """Spots marked on places."""
    goal: GoalEntry | None = None
    """What should be true at the end."""
    disturbed: Text | None = None
    """An object that is knocked out of the hand on the way."""
