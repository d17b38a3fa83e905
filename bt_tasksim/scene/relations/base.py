"""What a goal relation is given, and what it answers."""

from __future__ import annotations

import abc
from collections.abc import Collection
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.fact_making import rotations
from bt_tasksim.core.outcomes import Outcome
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, ObjectModel, PlaceModel, WorldModel
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.fixtures import FixturePart
from bt_tasksim.scene.geometry import Shape
from bt_tasksim.scene.hollows import NOTHING
from bt_tasksim.scene.outlines import Slab, rectangle, slabs, whole_outline
from bt_tasksim.scene.spatial_laws import Hollow, LevelSurface, PlacedObject, Whereabouts, leaning
from bt_tasksim.scene.specs import Goal

TOUCHING = 1e-4
"""Metres between hand and object within which the hand touches it."""


@dataclass(frozen=True)
class FinalState:
    """The physics state at the end of a run, with names resolved.

    Attributes:
        configuration: The world as it was drawn.
        world: Names and calibrated facts.
        hidden: The state.
    """

    configuration: ActorConfiguration
    world: WorldModel
    hidden: Hidden

    def pose(self, name: str) -> Array:
        """True pose ``(7,)`` of an object."""
        return self.hidden.objects[self.world.object_index(name)]

    def start(self, name: str) -> Array:
        """Pose ``(7,)`` in which an object was drawn."""
        return np.array(self.configuration.objects[self.world.object_index(name)].pose)

    def place(self, name: str) -> PlaceModel:
        """A place of the scene."""
        return self.world.place(name)

    def model(self, name: str) -> ObjectModel:
        """What an object truly is, whatever size it was taken to have."""
        return self.configuration.objects[self.world.object_index(name)].true_model()

    def is_object(self, name: str) -> bool:
        """It is an object, and no place."""
        return name in self.world.index

    def parts(self, name: str) -> tuple[Slab, ...]:
        """The convex pieces of an object from above, where it is."""
        return slabs(self.shape(name).collision, self.pose(name))

    def shape(self, name: str) -> Shape:
        """The shape of an object, in its own frame."""
        return self.configuration.objects[self.world.object_index(name)].shape()

    def outline(self, name: str) -> Array:
        """Outline ``(n, 2)`` from above of an object where it is, or of a place, robot base frame, metres."""
        if self.is_object(name):
            return whole_outline(self.parts(name))
        place = self.place(name)
        return rectangle(place.pose, place.centre, place.extent)

    def lowest(self, name: str) -> float:
        """Height in metres of an object's lowest point, or of a place's origin."""
        if self.is_object(name):
            return min(part.low for part in self.parts(name))
        return float(self.place(name).pose[2])

    def surface(self, name: str) -> Array:
        """The frame ``(7,)`` in which things stand on a place, or on an object where it is.

        That of an object is level, above its middle, at the height of its highest point.
        """
        if not self.is_object(name):
            return self.place(name).pose
        top = max(part.high for part in self.parts(name))
        return poses.pose([*self.pose(name)[:2].tolist(), top])

    def in_place(self, goal: Goal) -> Array:
        """Pose ``(7,)`` of the goal's object in the frame of the goal's place, or of an object's top."""
        return poses.multiply(poses.inverse(self.surface(goal.place)), self.pose(goal.object))

    @property
    def whereabouts(self) -> Whereabouts:
        """Where everything truly is, as one world of `bt_tasksim.scene.spatial_laws`."""
        return _Truth(self)

    def touched(self, name: str) -> bool:
        """The hand touches an object."""
        return float(self.hidden.hand_distance[self.world.object_index(name)]) <= TOUCHING

    def supported(self, name: str) -> bool:
        """An object touches something besides the hand."""
        return bool(np.any(self.hidden.support[self.world.object_index(name)]))

    def borne(self, name: str) -> bool:
        """Something besides the hand bears an object: not what the object itself bears, on it or in it."""
        me, count = self.world.object_index(name), len(self.world.index)
        touch: Array = np.array(self.hidden.support, bool)
        others: Array = touch[:count, :count] | touch[:count, :count].T
        grounded = touch[:count, count:].any(axis=1)
        if grounded[me]:
            return True
        near = others[me].copy()
        others[me] = others[:, me] = False
        for _ in range(count):  # from what touches furniture on to what touches that
            grounded = grounded | others[:, grounded].any(axis=1)
        return bool((near & grounded).any())


class _Truth(Whereabouts):
    """Where everything truly is, in one world: arrays ``(1, ...)``."""

    def __init__(self, final: FinalState) -> None:
        self._final = final

    @property
    def bodies(self) -> Collection[str]:
        """See `Whereabouts.bodies`."""
        return self._final.world.index

    @property
    def surfaces(self) -> Collection[str]:
        """See `Whereabouts.surfaces`."""
        return self._final.world.places

    def body(self, name: str) -> PlacedObject:
        """See `Whereabouts.body`."""
        model, pose = self._final.model(name), self._final.pose(name)
        pose = poses.pose(pose[:3]) if _is_ball(model) else pose
        return PlacedObject(pose[None], self._final.shape(name).outer[None], np.array([model.cubic]))

    def surface(self, name: str) -> LevelSurface:
        """See `Whereabouts.surface`."""
        place = self._final.place(name)
        half = np.array([place.extent], float) / 2
        return LevelSurface(
            place.pose[None], np.array([place.centre], float), half, np.array([place.carries])
        )

    def hollow(self, name: str) -> Hollow:
        """See `Whereabouts.hollow`."""
        if name in self.bodies:
            boxes = self._final.shape(name).hollow
            return Hollow(self._final.pose(name)[None], boxes[None] if len(boxes) else np.array([[NOTHING]]))
        place, surface = self._final.place(name), self.surface(name)
        height = np.array([[0.0, place.height]])
        return Hollow(surface.frame, np.concatenate([surface.centre, surface.half, height], axis=1)[None])


@dataclass(frozen=True)
class Placement:
    """What a relation answers.

    Attributes:
        reached: The object is as the goal asks.
        outcome: How it is, or what is wrong.
        position_error: Metres from where the object should be.
        angle_error: Radians from how it should be, up to its symmetry.
    """

    reached: bool
    outcome: Outcome
    position_error: float
    angle_error: float


class Presence(IntEnum):
    """How an object is at the place that its goal names; each includes those above it but the first."""

    ELSEWHERE = 0
    """It need not come there: the goal says how it is turned, or what is beside it."""
    THERE = 1
    """It comes there."""
    WITHIN = 2
    """It needs room on it, or in it."""
    BORNE = 3
    """The place bears it."""


class GoalRelation(abc.ABC):
    """A relation of an object to a place or to another object, judged by the physics state.

    A subclass in one file, ``@register("goal relation", "beside")``, is all that a new relation takes.
    """

    in_hand: ClassVar[bool] = False
    """The object is to be held at the end; else it must be let go and at rest."""
    may_be_held: ClassVar[bool] = False
    """The object may be in the hand at the end, or let go."""
    needs_place: ClassVar[bool] = True
    """A goal names a place or an object besides."""
    presence: ClassVar[Presence] = Presence.ELSEWHERE
    """How the object is at the place, which `bt_tasksim.checking` looks at before anything runs."""
    position_tolerance: ClassVar[float] = Goal.position_tolerance
    """Metres that a goal allows where it does not say."""
    angle_tolerance: ClassVar[float] = Goal.angle_tolerance
    """Radians that a goal allows where it does not say."""

    def fault(self, goal: Goal, part: FixturePart | None) -> str:
        """What is wrong with a goal before anything runs, in one sentence; empty where nothing is.

        Args:
            goal: The goal.
            part: The part of a fixture that it is about, as it is in the middle of all draws; None of a free
                object.
        """
        return ""

    @abc.abstractmethod
    def evaluate(self, goal: Goal, final: FinalState) -> Placement:
        """Whether the goal's object is as the goal asks."""


def lean(rotation: Array, model: ObjectModel) -> float:
    """Angle in radians between upright and ``rotation (4,)``; any face of a cubic object may be down."""
    return 0.0 if _is_ball(model) else float(leaning(rotation[None], np.array([model.cubic]))[0])


def turn(rotation: Array, model: ObjectModel) -> float:
    """Smallest angle in radians from no rotation at all to ``rotation (4,)``, over an object's symmetries."""
    if model.symmetry == 0:
        return 0.0 if _is_ball(model) else float(poses.tilt(rotation))
    return float(poses.angle_between(rotation[None], rotations(model)).min())


def _is_ball(model: ObjectModel) -> bool:
    """It looks the same however it is turned."""
    return model.cubic and model.symmetry == 0
