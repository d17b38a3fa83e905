"""What may stand in the specs of a scene, whether Python gives it or a file does."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, InstanceOf, Tag

from bt_tasksim.core.typed_file import (
    Coordinate,
    Direction,
    Extent2,
    Model,
    Name,
    Number,
    Switch,
    Text,
    Vector2,
    sized,
)
from bt_tasksim.scene.grips import GivenGrip
from bt_tasksim.scene.object_schema import (
    AnyExponents,
    ColourField,
    FrictionField,
    GraspEntry,
    MassField,
    SizeField,
    SymmetryField,
)

HalfSize = Annotated[Number, Field(ge=0.0, le=100.0)]
Extents = Annotated[tuple[HalfSize, HalfSize], Field(strict=False), sized(2)]
"""Half sizes along x and y, metres."""
Heading = Annotated[Number, Field(ge=-math.tau, le=math.tau)]
"""Radians within a full turn."""


def _in_order(value: object) -> object:
    if isinstance(value, tuple) and value[0] > value[1]:
        raise ValueError("should be the lowest heading first")
    return value


def _one_or_two(value: object) -> str:
    return "~range" if isinstance(value, list | tuple) else "~half width"


Headings = Annotated[
    Annotated[Heading, Tag("~half width")]
    | Annotated[
        tuple[Heading, Heading], Field(strict=False), sized(2), AfterValidator(_in_order), Tag("~range")
    ],
    Discriminator(_one_or_two),
]
"""Half width of a range of headings about 0, radians; or the lowest and the highest one."""
Distance = Annotated[Number, Field(ge=0.0, le=10.0)]
Gap = Annotated[Number, Field(ge=0.0, le=1.0)]
AboveZero = Annotated[Number, Field(gt=0.0)]
Reference = Annotated[str, Field(max_length=200)]
"""Name of a place or an object; empty where there is none."""
FilePath = Annotated[str, Field(min_length=1, max_length=4096)]


def _two_or_three(value: object) -> object:
    if not isinstance(value, list | tuple) or len(value) not in (2, 3):
        raise ValueError("should be 2 or 3 numbers")
    return value


Position = Annotated[tuple[Coordinate, ...], Field(strict=False), BeforeValidator(_two_or_three)]
"""x y or x y z, metres."""


def _parameter_form(value: object) -> str:
    if isinstance(value, str):
        return "~word"
    if not isinstance(value, list | tuple):
        return "~number"
    return "~words" if value and all(isinstance(v, str) for v in value) else "~numbers"


Word = Annotated[str, Field(min_length=1, max_length=100)]
Parameter = Annotated[
    Annotated[Number, Tag("~number")]
    | Annotated[Word, Tag("~word")]
    | Annotated[tuple[Number, Number], Field(strict=False), sized(2), Tag("~numbers")]
    | Annotated[tuple[Word, ...], Field(strict=False, min_length=1, max_length=50), Tag("~words")],
    Discriminator(_parameter_form),
]
"""A value, the lowest and the highest one, or words to choose from."""
Parameters = Annotated[dict[Word, Parameter], Field(max_length=100)]


def _form(value: object) -> str:
    return "~given" if isinstance(value, GivenGrip) else "~entry"


Grasp = Annotated[
    Annotated[InstanceOf[GivenGrip], Tag("~given")] | Annotated[GraspEntry, Tag("~entry")],
    Discriminator(_form),
]


class ObjectFields(Model):
    """The fields of `bt_tasksim.scene.specs.ObjectSpec`."""

    kinds: Annotated[tuple[str, ...], Field(strict=False, max_length=100)]
    on: Reference
    area: Extents | None
    centre: Vector2
    yaw: Headings
    size: SizeField | None
    mass: MassField
    friction: FrictionField
    exponents: AnyExponents
    mesh: FilePath | None
    split: str
    size_error: Number
    inside: Reference
    beside: Reference
    distance: Distance
    gap: Gap
    movable: Switch
    colour: ColourField | None
    grasps: Annotated[tuple[Grasp, ...], Field(strict=False, max_length=64)]
    symmetry: SymmetryField | None
    category: Annotated[str, Field(max_length=200)]


class SpotFields(Model):
    """The fields of `bt_tasksim.scene.specs.SpotSpec`."""

    name: Name
    on: Text
    centre: Vector2
    area: Extents
    extent: Extent2
    yaw: Headings


FixtureHeading = Annotated[
    Annotated[Heading, Tag("~heading")]
    | Annotated[
        tuple[Heading, Heading], Field(strict=False), sized(2), AfterValidator(_in_order), Tag("~range")
    ],
    Discriminator(lambda value: "~range" if isinstance(value, list | tuple) else "~heading"),
]


class FixtureFields(Model):
    """The fields of `bt_tasksim.scene.specs.FixtureSpec`."""

    fixture: FilePath
    at: Position | None
    yaw: FixtureHeading | None
    name: str
    area: Extents
    sensed: Switch | None
    parameters: Parameters


class HandFields(Model):
    """The fields of `bt_tasksim.scene.specs.HandStart`."""

    over: Text
    height: Vector2
    aside: HalfSize
    turn: Heading


class GoalFields(Model):
    """The fields of `bt_tasksim.scene.specs.Goal`, and the words for its reference."""

    object: Text
    place: Reference
    relation: str
    position_tolerance: AboveZero | None
    angle_tolerance: Annotated[AboveZero, Field(le=math.pi)] | None
    height: AboveZero
    when: str
    distance: AboveZero
    value: Number | None
    axis: Direction | None
    duration: AboveZero
    on: Reference
    inside: Reference
    beside: Reference
