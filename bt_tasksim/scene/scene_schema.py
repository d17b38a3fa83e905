"""What may stand in a scene's file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Discriminator, Field, Tag

from bt_tasksim.core.registry import OWN, parts
from bt_tasksim.core.typed_file import (
    Direction,
    Extent2,
    Model,
    Name,
    Number,
    Switch,
    Text,
    Vector2,
    known_values,
)
from bt_tasksim.scene.object_schema import ObjectFile
from bt_tasksim.scene.spec_fields import (
    Distance,
    Extents,
    FixtureHeading,
    Gap,
    Headings,
    Parameters,
    Position,
)
from bt_tasksim.scene.specs import OLD_RELATION


def _relations() -> list[str]:
    return [*parts("goal relation"), OLD_RELATION]


class ObjectEntry(ObjectFile):
    """An object."""

    object: Text | None = None
    """An object file in the scene file's folder or below, or a bundled one; the entry goes before it."""
    on: Text | None = None
    """Name of the place where it starts, or of the object on top of which it starts."""
    inside: Text | None = None
    """Instead of `on`: name of the container, a place or an object, in which it starts."""
    beside: Text | None = None
    """Instead of `on`: name of the object beside which it starts, on the same place."""
    at: Vector2 | None = None
    """Middle of the area in which it is drawn, in the place's frame, m; by default the place's origin."""
    area: Extents | None = None
    """Half sizes of that area, m; by default 0 with `at`, else what an arm reaches well."""
    heading: Headings = math.pi
    """Half width of the range of its heading, rad; or the lowest and the highest heading."""
    distance: Distance = 0.10
    """Of `beside`: between the two outlines from above, at most, m."""
    gap: Gap = 0.005
    """To other objects at the same height, at least, m."""
    movable: Switch = False
    """It may be shifted and tilted in a run; else it counts as knocked over where no goal names it."""


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
    heading: Headings = 0.0
    """Half width of the range of its heading, rad; or the lowest and the highest heading."""


class FixturePlacement(Model):
    """A fixture that stands elsewhere than its file says, or one of several of its kind."""

    fixture: Text
    """A bundled fixture, or a fixture file in this file's folder or below."""
    at: Position | None = None
    """Where its origin is, x y or x y z, robot base frame, m; by default where its file says."""
    yaw: FixtureHeading | None = None
    """Its heading in the robot base frame, rad, or the lowest and the highest; by default that of its file.
    """
    area: Extents = (0.0, 0.0)
    """Half sizes of the rectangle about `at` in which its origin is drawn, m; by default it is always there.
    """
    name: Name | None = None
    """Its own name; its places and parts are called by it, too: `<name>`, or `<name>_<place>`."""
    sensed: Switch | None = None
    """The robot sees how far its parts are open; by default as its file says."""
    parameters: Parameters = {}
    """Of a made fixture: values, two numbers to draw one between, or words to choose from."""


def _fixture_form(value: object) -> str:
    return "~name" if isinstance(value, str | int) else "~placed"


FixtureOrPlacement = Annotated[
    Annotated[Text, Tag("~name")] | Annotated[FixturePlacement, Tag("~placed")], Discriminator(_fixture_form)
]


class GoalEntry(Model):
    """Where an object should be."""

    object: Text
    """Name of the object."""
    place: Text | None = None
    """Name of a place or of another object, with `relation`; or give `on`, `inside` or `beside`."""
    on: Text | None = None
    """What it should stand on: a place's origin, the middle of an object; or the reference of `relation`."""
    inside: Text | None = None
    """The container, or object, that it should be in."""
    beside: Text | None = None
    """The object or place that it should stand near."""
    relation: Annotated[Text, known_values(_relations, "relation", OWN)] = "on"
    """`on`, `anywhere` on it, `inside`, `beside`, `lifted` in the hand above where it stood, or your own."""
    position_tolerance: Annotated[Number, Field(gt=0.0, le=10.0)] | None = None
    """How far from the place's origin the object may be, or from the value a part, m; by default 0.03, and
    0.01 of parts of fixtures and what is inserted."""
    angle_tolerance: Annotated[Number, Field(gt=0.0, le=math.pi)] | None = None
    """How far it may be tilted, or turned from the place's heading, or from the value a part, rad; by
    default 10 degrees, and 5 of parts of fixtures."""
    height: Annotated[Number, Field(gt=0.0, le=10.0)] = 0.3
    """Of `lifted`: how far above where it stood, m."""
    when: Literal["end", "once", "kept"] = "end"
    """True at the `end` of the run, `once` in it, or `kept` so for `duration` of it without a break."""
    distance: Annotated[Number, Field(gt=0.0, le=10.0)] = 0.10
    """Of `beside`: between the two outlines from above, at most, m."""
    value: Annotated[Number, Field(ge=-100.0, le=100.0)] | None = None
    """Of `open`, at least, and `set`: how far a part of a fixture should be open, m or rad; of `turned` and
    `oriented` an angle, rad."""
    axis: Direction | None = None
    """Of `turned`, `oriented` and `pointing_up`: a direction, x y z."""
    duration: Annotated[Number, Field(gt=0.0, le=1000.0)] = 1.0
    """Of `kept`: for how long, s."""


class SceneFile(Model):
    """A robot, furniture and objects, and how worlds with them are drawn."""

    former: ClassVar[Mapping[str, str]] = {"knock": "disturbed"}

    name: Text | None = None
    """Name of the scene in results; by default that of the file."""
    robot: Text = "panda"
    """A bundled robot, or a robot file in this file's folder or below."""
    fixtures: Annotated[tuple[FixtureOrPlacement, ...], Field(strict=False, max_length=50)] = ()
    """Bundled fixtures, fixture files in this file's folder or below, or entries; the table is always there.
    """
    objects: Annotated[dict[Name, ShortOrEntry], Field(max_length=100)] | None = None
    """By name: an entry, or in short ``cup on upper_board``, or ``on upper_board``."""
    spots: Annotated[tuple[SpotEntry, ...], Field(strict=False, max_length=100)] = ()
    """Spots marked on places."""
    goal: GoalEntry | None = None
    """What should be true, where that is one thing."""
    goals: Annotated[tuple[GoalEntry, ...], Field(strict=False, max_length=100)] = ()
    """All that should be true."""
    disturbed: Text | None = None
    """An object that is knocked out of the hand on the way."""
