"""What may stand in a fixture's file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from bt_tasksim.core.joints import check_way
from bt_tasksim.core.typed_file import (
    Direction,
    Extent2,
    Length,
    Model,
    Name,
    NotNegative,
    Number,
    Pose7,
    Quaternion,
    Share,
    Size3,
    Switch,
    Vector2,
    Vector3,
    sized,
)

Colour = Annotated[tuple[Share, Share, Share], Field(strict=False), sized(3)]


def _opening(value: object) -> object:
    """Check that a value is one number or two: of a union nothing better would be said."""
    numbers = value if isinstance(value, list | tuple) else (value, value)
    if len(numbers) != 2 or not all(_is_opening(number) for number in numbers):
        raise ValueError("should be a number or two, the lower one first, from -100 to 100")
    return value


def _is_opening(number: object) -> bool:
    return isinstance(number, int | float) and not isinstance(number, bool) and abs(number) <= 100.0


class BoxEntry(Model):
    """A solid box."""

    former: ClassVar[Mapping[str, str]] = {"look": "material"}

    position: Vector3 | None = None
    """Its middle in the fixture's frame, m; or give `pose`."""
    pose: Pose7 | None = None
    """Position (m) and unit quaternion w x y z in the fixture's frame."""
    size: Size3
    """Full size, m."""
    colour: Colour = (0.6, 0.5, 0.4)
    """Red, green, blue (sRGB), each from 0 to 1."""
    friction: Annotated[Number, Field(ge=0.0, le=10.0)] = 0.6
    """Friction coefficient."""
    material: Literal["matte", "wood", "metal"] = "matte"
    """What it is drawn like."""

    @model_validator(mode="after")
    def _one_place(self) -> BoxEntry:
        if (self.position is None) == (self.pose is None):
            raise ValueError("a box has either 'position' or 'pose'")
        return self


class PlaceEntry(Model):
    """A place where things can stand, or be put into."""

    name: Name
    """Its name in trees and scenes."""
    kind: Literal["table", "board", "bin", "spot", "hole"]
    """What it is; a spot is marked with a colour, and into a hole things are pushed along one line."""
    position: Vector3
    """Its origin in the fixture's frame, m: where something stands that is put there without an offset; of a
    hole the middle of its end."""
    turn: Quaternion = (1.0, 0.0, 0.0, 0.0)
    """Unit quaternion w x y z in the fixture's frame, of a hole, out of which z points; others lie level."""
    extent: Extent2
    """Full size along x and y, m."""
    centre: Vector2 = (0.0, 0.0)
    """Middle of that size, from the origin, m."""
    height: Length = 10.0
    """Free height above it, m; of a bin, that of its rim; of a hole, how deep it is."""
    access: Direction = (0.0, 0.0, -1.0)
    """Direction in which the hand comes, fixture's frame; scaled to length one."""
    exit: Direction = (0.0, 0.0, 1.0)
    """Direction in which things leave it, fixture's frame; scaled to length one."""
    clearance: Annotated[NotNegative, Field(le=10.0)] = 0.1
    """Distance along `access` that a hand keeps before it comes close, m."""

    @model_validator(mode="after")
    def _level(self) -> PlaceEntry:
        if abs(sum(v * v for v in self.turn) - 1.0) > 1e-3:
            raise ValueError(f"'turn' should be a unit quaternion w x y z, found {self.turn}")
        if self.kind != "hole" and self.turn != (1.0, 0.0, 0.0, 0.0):
            raise ValueError("only a hole may be turned, other places lie level: leave out 'turn'")
        return self


class HoldEntry(Model):
    """Where two fingers may hold a part."""

    point: Vector3
    """Middle between the fingers, fixture's frame where the part's value is 0, m."""
    closing: Direction
    """Direction in which the fingers close, likewise."""
    width: Length
    """Between the fingers, m."""
    approach: Direction | None = None
    """Direction in which the hand comes, likewise; by default any across the closing one."""


class PartEntry(Model):
    """A part that slides or turns: a drawer, a door, a lid, a knob, a lever, a button."""

    name: Name
    """Its name, by which trees and goals speak of it as of an object."""
    joint: Literal["slide", "hinge"]
    """Whether it slides along its axis or turns about it."""
    axis: Direction
    """The way in which it opens, or the axis about which it does, by the right hand; fixture's frame."""
    origin: Vector3 = (0.0, 0.0, 0.0)
    """A point on the axis, fixture's frame, m."""
    limits: Vector2
    """Lowest and highest value, m or rad; 0 is where the boxes are given."""
    boxes: Annotated[tuple[BoxEntry, ...], Field(strict=False, min_length=1, max_length=100)]
    """What it is made of, in the fixture's frame where its value is 0."""
    mass: Annotated[Number, Field(ge=1e-6, le=200.0)] = 1.0
    """kg."""
    friction: Annotated[NotNegative, Field(le=500.0)] = 0.0
    """What it takes to move it, N or Nm."""
    damping: Annotated[NotNegative, Field(le=1000.0)] = 0.0
    """N or Nm for each m or rad a second."""
    stiffness: Annotated[NotNegative, Field(le=1e4)] = 0.0
    """Of its spring, N/m or Nm/rad."""
    rest: Annotated[Number, Field(ge=-100.0, le=100.0)] = 0.0
    """Value at which the spring is at rest, m or rad."""
    latch: Annotated[NotNegative, Field(le=500.0)] = 0.0
    """What a latch holds it shut with, N or Nm."""
    value: Annotated[Number | Vector2, BeforeValidator(_opening)] = 0.0
    """How far it is open at the start, m or rad; two numbers: drawn between them."""
    grasps: Annotated[tuple[HoldEntry, ...], Field(strict=False, max_length=64)] = ()
    """Where two fingers may hold it."""
    sensed: Switch = False
    """The robot sees how far it is open; else it knows only what its own hand has done with it."""

    @model_validator(mode="after")
    def _within_limits(self) -> PartEntry:
        low, high = (self.value,) * 2 if isinstance(self.value, float) else self.value
        check_way(self.joint, self.limits, (low, high))
        return self


class FixtureFile(Model):
    """Furniture: solid boxes, places on or in them, and parts that slide or turn."""

    name: Name
    """Its name."""
    pose: Pose7 = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    """Position (m) and unit quaternion w x y z in the robot base frame."""
    boxes: Annotated[tuple[BoxEntry, ...], Field(strict=False, max_length=500)]
    """The solid parts."""
    places: Annotated[tuple[PlaceEntry, ...], Field(strict=False, max_length=100)]
    """Where things can stand."""
    parts: Annotated[tuple[PartEntry, ...], Field(strict=False, max_length=20)] = ()
    """What slides or turns."""

    @model_validator(mode="after")
    def _names_differ(self) -> FixtureFile:
        names = [place.name for place in self.places]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"two places are called '{twice[0]}'")
        names += [part.name for part in self.parts]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"two parts, or a part and a place, are called '{twice[0]}'")
        return self
