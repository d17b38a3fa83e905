"""What may stand in a fixture's file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from bt_tasksim.core.typed_file import (
    Direction,
    Extent2,
    Length,
    Model,
    Name,
    NotNegative,
    Number,
    Pose7,
    Share,
    Size3,
    Vector2,
    Vector3,
    sized,
)

Colour = Annotated[tuple[Share, Share, Share], Field(strict=False), sized(3)]


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
    kind: Literal["table", "board", "bin", "spot"]
    """What it is; a spot is marked with a colour."""
    position: Vector3
    """Its origin in the fixture's frame, m: where something stands that is put there without an offset."""
    extent: Extent2
    """Full size along x and y, m."""
    centre: Vector2 = (0.0, 0.0)
    """Middle of that size, from the origin, m."""
    height: Length = 10.0
    """Free height above it, m; of a bin, that of its rim."""
    access: Direction = (0.0, 0.0, -1.0)
    """Direction in which the hand comes, fixture's frame; scaled to length one."""
    exit: Direction = (0.0, 0.0, 1.0)
    """Direction in which things leave it, fixture's frame; scaled to length one."""
    clearance: Annotated[NotNegative, Field(le=10.0)] = 0.1
    """Distance along `access` that a hand keeps before it comes close, m."""


class FixtureFile(Model):
    """Furniture that does not move: solid boxes, and places on or in them."""

    name: Name
    """Its name."""
    pose: Pose7 = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    """Position (m) and unit quaternion w x y z in the robot base frame."""
    boxes: Annotated[tuple[BoxEntry, ...], Field(strict=False, max_length=500)]
    """The solid parts."""
    places: Annotated[tuple[PlaceEntry, ...], Field(strict=False, max_length=100)]
    """Where things can stand."""

    @model_validator(mode="after")
    def _places_differ(self) -> FixtureFile:
        names = [place.name for place in self.places]
        if twice := [name for name in names if names.count(name) > 1]:
            raise ValueError(f"two places are called '{twice[0]}'")
        return self
