"""What may stand in an environment's file: which of its things are objects, fixtures and places."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, model_validator

from bt_tasksim.core.typed_file import (
    Direction,
    Extent2,
    Length,
    Model,
    Name,
    NotNegative,
    Switch,
    Text,
    Vector2,
    Vector3,
)


class ActorEntry(Model):
    """An object that trees name; its size, mass and friction are those of the simulation."""

    actor: Text | None = None
    """Name of the actor in ManiSkill; by default the object's own."""
    kind: Text | None = None
    """What its bounding box is taken for (box, cylinder, ...); by default what its collision shape is: a
    cube, a box, a ball or a cylinder."""


class FixtureEntry(Model):
    """Something to keep clear of, with the boxes of its collision shapes."""

    actor: Text | None = None
    """Name of the actor in ManiSkill; by default the fixture's own."""


class TargetEntry(Model):
    """A place that trees name, where an actor is when the episode begins."""

    actor: Text
    """Name of the actor in ManiSkill whose pose, turned about the vertical alone, it has; a hole is turned as
    the actor is."""
    offset: Vector3 = (0.0, 0.0, 0.0)
    """Its origin in the actor's frame, m: where something stands that is put there without an offset."""
    kind: Literal["table", "board", "bin", "spot", "hole"] = "spot"
    """What it is."""
    through: Direction | None = None
    """Of a hole: the way into it in the actor's frame, along an axis of its boxes. Where it is, how wide and
    how deep, is that of the room between them."""
    extent: Extent2 = (0.1, 0.1)
    """Full size along x and y, m."""
    centre: Vector2 = (0.0, 0.0)
    """Middle of that size, from the origin, m."""
    height: Length = 10.0
    """Free height above it, m; of a bin, that of its rim."""
    access: Direction = (0.0, 0.0, -1.0)
    """Direction in which the hand comes, robot base frame."""
    exit: Direction = (0.0, 0.0, 1.0)
    """Direction in which things leave it, robot base frame."""
    clearance: Annotated[NotNegative, Field(le=10.0)] = 0.1
    """Distance along `exit` after which a hand is clear of it, m."""

    @model_validator(mode="after")
    def _holes_go_through(self) -> TargetEntry:
        if (self.kind == "hole") != (self.through is not None):
            raise ValueError("a hole, and nothing else, has 'through', the way into it, such as [1, 0, 0]")
        return self


class DistanceEntry(Model):
    """What results measure besides what the environment says."""

    object: Name
    """An object."""
    place: Name
    """The place above whose origin it should stand."""


class EnvironmentFile(Model):
    """What a ManiSkill environment's things are called, and what they are."""

    environment: Text
    """Its id, such as PickCube-v1. One of your own as module:Id-v1: that module has to be loaded, with
    --plugin module or by the tree's file, since this file runs no code."""
    robots: Annotated[dict[Text, Text], Field(min_length=1)]
    """Our robots by ManiSkill's names of them; the first one is used unless another is asked for."""
    objects: dict[Name, ActorEntry | None] = Field(default_factory=dict)
    """Objects by name."""
    fixtures: dict[Name, FixtureEntry | None] = Field(default_factory=dict)
    """Fixtures by name."""
    places: dict[Name, TargetEntry] = Field(default_factory=dict)
    """Places by name."""
    distance: DistanceEntry | None = None
    """What results measure besides what the environment says."""
    max_episode_steps: Annotated[int, Field(ge=1, le=10**6)] = 100_000
    """Control steps after which the environment ends an episode; its own limit is for learners."""
    rebuild: Switch = True
    """Build its scene anew in each episode, so that a seed gives the same bits whatever came before; without,
    an episode begins some 0.2 s sooner, and differs by a micrometre or so."""

    @model_validator(mode="after")
    def _names_fit(self) -> EnvironmentFile:
        if twice := sorted(self.objects.keys() & self.places.keys()):
            raise ValueError(f"an object and a place are both called '{twice[0]}'")
        if self.distance is not None:
            for name, known in ((self.distance.object, self.objects), (self.distance.place, self.places)):
                if name not in known:
                    raise ValueError(f"'distance' names '{name}', which is not in the file")
        return self

    @property
    def object_entries(self) -> Mapping[str, ActorEntry]:
        """Objects by name, those that the file only names included."""
        return {name: entry or ActorEntry() for name, entry in self.objects.items()}

    @property
    def fixture_entries(self) -> Mapping[str, FixtureEntry]:
        """Fixtures by name, those that the file only names included."""
        return {name: entry or FixtureEntry() for name, entry in self.fixtures.items()}
