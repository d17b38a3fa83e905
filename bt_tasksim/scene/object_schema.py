"""What may stand in an object's file, and in a scene file's entry of an object."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated

from pydantic import BeforeValidator, Field, model_validator

from bt_tasksim.core.errors import nearest
from bt_tasksim.core.plain import shown
from bt_tasksim.core.registry import OWN
from bt_tasksim.core.typed_file import Direction, Length, Model, Number, Share, Text, Vector3, known_values
from bt_tasksim.scene.geometry import Colour
from bt_tasksim.scene.grips import ALONG, along
from bt_tasksim.scene.mesh_file import check_size
from bt_tasksim.scene.shapes import KINDS

Range = tuple[float, float]
"""Lowest and highest value."""
SizeRange = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Lowest and highest full size."""
Exponents = Range | tuple[Range, Range]
"""Lowest and highest value of both shape exponents, or of each."""
PAIR = "should be a number, or two"
TRIPLE = "should be 3 numbers, or two times 3"
COLOUR = "should be the name of a colour, or 3 numbers from 0 to 1"
COLOURS: dict[str, Colour] = {
    "red": (0.86, 0.16, 0.15),
    "orange": (0.95, 0.56, 0.12),
    "yellow": (0.93, 0.76, 0.15),
    "green": (0.22, 0.60, 0.32),
    "blue": (0.13, 0.46, 0.72),
    "purple": (0.45, 0.29, 0.64),
    "pink": (0.92, 0.52, 0.66),
    "cyan": (0.20, 0.68, 0.74),
    "brown": (0.48, 0.31, 0.20),
    "white": (0.93, 0.93, 0.91),
    "grey": (0.52, 0.53, 0.55),
    "black": (0.12, 0.12, 0.13),
}
"""Colours by name, sRGB."""


def _number(value: object, expected: str) -> float:
    """A finite number.

    Raises:
        ValueError: It is none; says what the whole field should be.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not _finite(value):
        raise ValueError(expected)
    return float(value)


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False


def _range_check(low: float, high: float, unit: str = "") -> Callable[[object], Range]:
    bounds = f"between {low:g} and {high:g}{f' {unit}' if unit else ''}"

    def check(value: object) -> Range:
        pair = value if isinstance(value, (list, tuple)) and len(value) == 2 else (value, value)
        first, second = _number(pair[0], PAIR), _number(pair[1], PAIR)
        if not low <= first <= second <= high:
            raise ValueError(f"should be {bounds}, the lower one first")
        return first, second

    return check


def between(low: float, high: float, unit: str = "") -> BeforeValidator:
    """A value, or a lowest and a highest one, between bounds."""
    check = _range_check(low, high, unit)
    return BeforeValidator(check, json_schema_input_type=float | tuple[float, float])


_exponent = _range_check(1e-6, 2.0)


def _exponents(value: object) -> Exponents:
    """Ranges of both exponents alike, or, in Python, of each."""
    if (
        isinstance(value, (list, tuple))
        and len(value) == 2
        and all(isinstance(v, (list, tuple)) for v in value)
    ):
        return _exponent(value[0]), _exponent(value[1])
    return _exponent(value)


def _sizes(value: object) -> SizeRange:
    nested = isinstance(value, (list, tuple)) and len(value) == 2 and isinstance(value[0], (list, tuple))
    pair = value if nested and isinstance(value, (list, tuple)) else (value, value)
    low, high = _size(pair[0]), _size(pair[1])
    if min(low) <= 0 or any(a > b for a, b in zip(low, high, strict=True)):
        raise ValueError("should be positive, the smaller one first")
    for bound in (low, high):
        check_size("it", bound)
    return low, high


def _size(value: object) -> tuple[float, float, float]:
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise ValueError(TRIPLE)
    x, y, z = (_number(v, TRIPLE) for v in value)
    return x, y, z


def _listed(value: object) -> object:
    return value if isinstance(value, list) else [value]


def _colour(value: object) -> Colour:
    if isinstance(value, str):
        if value not in COLOURS:
            raise ValueError(f"unknown colour '{shown(value)}'{nearest(value, COLOURS)}")
        return COLOURS[value]
    if not isinstance(value, (list, tuple)) or len(value) != 3:
        raise ValueError(COLOUR)
    r, g, b = (_number(v, COLOUR) for v in value)
    if not all(0.0 <= v <= 1.0 for v in (r, g, b)):
        raise ValueError(COLOUR)
    return r, g, b


SizeField = Annotated[
    SizeRange, BeforeValidator(_sizes, json_schema_input_type=list[float] | list[list[float]])
]
"""A full size, or the lowest and the highest one."""
MassField = Annotated[Range, between(0.001, 20.0, "kg")]
FrictionField = Annotated[Range, between(0.01, 2.0)]
ColourField = Annotated[Colour, BeforeValidator(_colour, json_schema_input_type=str | list[float])]
SymmetryField = Annotated[int, Field(ge=0, le=360)]
AnyExponents = Annotated[Exponents, BeforeValidator(_exponents)]
"""Also with a range for each of the two, which files do not have."""
Kind = Annotated[Text, known_values(lambda: list(KINDS), "kind of object", OWN)]


class GraspEntry(Model):
    """Where two fingers may hold an object, in its frame, whose origin is the bounding box's middle."""

    point: Vector3
    """Middle between the two contacts, m."""
    closing: Direction
    """Direction along which the fingers close."""
    approach: Direction | None = None
    """Direction along which the hand comes; by default any across the closing one."""
    width: Length | None = None
    """Between the contacts, m; by default what the object measures there."""
    firmness: Share = 1.0
    """How well it holds, from 0 to 1."""

    @model_validator(mode="after")
    def _across(self) -> GraspEntry:
        if self.approach is not None and along(self.closing, self.approach):
            raise ValueError(ALONG)
        return self


class ObjectFile(Model):
    """An object: a mesh or a kind, and what is known about it."""

    kind: (
        Annotated[
            tuple[Kind, ...],
            BeforeValidator(_listed, json_schema_input_type=str | list[str]),
            Field(strict=False, min_length=1, max_length=100),
        ]
        | None
    ) = None
    """A kind of object, or a list to draw from; by default `mesh` with a mesh, else the object's name."""
    size: SizeField | None = None
    """Full size, or the lowest and the highest one, m; by default the kind's range."""
    mass: MassField = (0.08, 0.25)
    """Mass, or the lowest and the highest one, kg."""
    friction: FrictionField = (0.4, 0.9)
    """Friction coefficient, or the lowest and the highest one."""
    exponents: Annotated[Range, between(1e-6, 2.0)] = (0.2, 1.0)
    """Shape exponents of a superellipsoid, from box-like (near 0) to ellipsoid (1)."""
    mesh: Text | None = None
    """A mesh file in this file's folder or below: OBJ, STL, PLY, OFF or GLB."""
    scale: Annotated[Number, Field(gt=0.0, le=1e6)] | None = None
    """What brings the mesh file's numbers to metres; by default 1."""
    colour: ColourField | None = None
    """A colour by name, or red, green and blue from 0 to 1 (sRGB); by default one that no other has."""
    category: Text = Field("", alias="class")
    """What people call things like it; by default its kind."""
    symmetry: SymmetryField | None = None
    """Order of its symmetry about z: 2 where it looks the same after half a turn, 0 for a body of revolution;
    by default its kind's, and 1 for a mesh."""
    grasps: Annotated[tuple[GraspEntry, ...], Field(strict=False, max_length=64)] = ()
    """Where two fingers may hold it; by default found from its form."""
