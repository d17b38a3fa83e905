"""Where objects may start: on places and objects, in containers and objects, and beside objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import FieldError, InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel, PlaceModel
from bt_tasksim.scene.configuration import ObjectActor
from bt_tasksim.scene.fixtures import Fixture
from bt_tasksim.scene.geometry import Piece
from bt_tasksim.scene.hollows import outer_corners
from bt_tasksim.scene.outlines import (
    TOUCHING,
    Slab,
    distance,
    fixture_bounds,
    fixture_slabs,
    holds,
    overlapping,
    rectangle,
    slabs,
    whole_outline,
)
from bt_tasksim.scene.shape_kind import ShapeKind
from bt_tasksim.scene.spatial_laws import Hollow, PlacedObject, beyond_hollow
from bt_tasksim.scene.specs import Goal, ObjectSpec

DEEP = 0.02
"""Metres from the floor of a hollow up to its rim where something may start in it, if it is that deep."""


def draw_order(specs: Mapping[str, ObjectSpec]) -> list[str]:
    """Names in an order in which each comes after the object that it starts on, in or beside.

    Objects that refer to places alone keep their order.

    Raises:
        FieldError: Objects refer to one another in a circle.
    """
    order: list[str] = []

    def add(name: str, above: tuple[str, ...]) -> None:
        if name in above:
            circle = (*above[above.index(name) :], name)
            said = ", ".join(f"'{a}' starts {specs[a].start[0]} '{b}'" for a, b in pairwise(circle))
            raise FieldError(
                f"objects start on one another in a circle: {said}", "objects", name, specs[name].start[0]
            )
        if name in order:
            return
        reference = specs[name].start[1]
        if reference in specs:
            add(reference, (*above, name))
        order.append(name)

    for name in specs:
        add(name, ())
    return order


def parts_of(actor: ObjectActor) -> tuple[Slab, ...]:
    """The convex pieces of an object from above, as it was drawn."""
    return slabs(actor.shape().collision, np.array(actor.pose))


@dataclass(frozen=True)
class Candidate:
    """An object where it may be drawn.

    Attributes:
        pieces: Its convex pieces.
        pose: Its pose ``(7,)``.
        extent: Full size ``(3,)`` of its bounding box, metres.
    """

    pieces: Sequence[Piece]
    pose: Array
    extent: Sequence[float]

    @cached_property
    def parts(self) -> tuple[Slab, ...]:
        """Its pieces from above."""
        return slabs(self.pieces, self.pose)

    def clear_of(self, others: Sequence[ObjectActor], gap: float) -> bool:
        """It is clear of other objects.

        Two whose circles are 1 cm apart, or ``gap`` where that is more, are clear at once, and so they are at
        different heights; of all others the outlines of their parts at the same height are to be ``gap``
        metres apart.
        """
        for other in others:
            apart = float(np.hypot(*(self.pose[:2] - np.array(other.pose[:2]))))
            if apart > _radius(self.extent) + _radius(other.size) + max(gap, 0.01):
                continue
            if abs(self.pose[2] - other.pose[2]) > (self.extent[2] + other.size[2]) / 2:
                continue
            if overlapping(self.parts, parts_of(other), gap):
                return False
        return True

    def within(self, container: ObjectActor) -> bool:
        """Its middle is in the hollow of another object."""
        body = PlacedObject(
            self.pose[None], outer_corners([p.corners() for p in self.pieces])[None], np.zeros(1, bool)
        )
        boxes = container.shape().hollow
        depth = boxes[:, 5] - boxes[:, 4]
        boxes = boxes[depth >= min(DEEP, depth.max(initial=0.0))]  # on a spout nothing stays
        return bool(len(boxes)) and bool(
            beyond_hollow(body, Hollow(np.array(container.pose)[None], boxes[None]))[0] <= 0.0
        )

    def stuck_in(self, fixtures: Sequence[Fixture]) -> Fixture | None:
        """The first fixture that it would stand in; None where it stands in none."""
        radius = _radius(self.extent)
        reach = np.array([radius, radius, self.extent[2] / 2 - TOUCHING])
        for fixture in fixtures:
            low, high = fixture_bounds(fixture)
            near = np.all((low < self.pose[:3] + reach) & (high > self.pose[:3] - reach), axis=1).any()
            if near and overlapping(self.parts, fixture_slabs(fixture), -TOUCHING):
                return fixture
        return None


@dataclass(frozen=True)
class Start:
    """Where one object is drawn.

    Attributes:
        word: ``on``, ``inside`` or ``beside``.
        reference: What that refers to.
        place: The frame in which it is drawn, as a place.
        under: Name of the place that all stands on in the end.
        actor: The object that it starts on, in or beside, as drawn; None on and in places.
        base: Name of the object that it starts on or in; empty on places.
    """

    word: str
    reference: str
    place: PlaceModel
    under: str
    actor: ObjectActor | None = None
    base: str = ""

    def __str__(self) -> str:
        return f"{self.word.replace('inside', 'in')} '{self.reference}'"

    def centre(self, spec: ObjectSpec) -> Array:
        """Middle ``(2,)`` of the area in which it is drawn, in the frame of its place."""
        middle = np.array(spec.centre)
        return middle + np.array(self.place.centre) if self.word == "inside" else middle

    def area(self, spec: ObjectSpec, kind: ShapeKind, model: ObjectModel) -> Array:
        """Half sizes ``(2,)`` of that area."""
        if spec.area is not None:
            return np.array(spec.area)
        if self.word == "inside":
            return np.maximum(np.array(self.place.extent) - min(model.extent[:2]), 0.0) / 2
        if self.word == "beside" and self.actor is not None:
            return np.full(2, _radius(self.actor.size) + _radius(model.extent) + spec.distance)
        return np.array(kind.area_on(self.place))

    def floor(self, tried: Candidate) -> float:
        """Metres from the frame up to the floor under an object that would stand at the frame's height."""
        if self.word != "inside" or self.actor is None:
            return 0.0
        outline, low = whole_outline(tried.parts), float(self.place.pose[2])
        tops = [part.high for part in parts_of(self.actor) if distance(part.outline, outline) < 0.0]
        return max(tops, default=low) - low

    def fits(self, tried: Candidate, spec: ObjectSpec) -> bool:
        """An object is where it should start: it does not stand over an edge, nor in a wall."""
        if self.word == "on":
            if self.actor is None:
                return True
            return holds(whole_outline(parts_of(self.actor)), tried.pose[None, :2])
        outline = whole_outline(tried.parts)
        room = rectangle(self.place.pose, self.place.centre, self.place.extent)
        if self.actor is None:
            return holds(room, outline, spec.gap)
        if self.word == "inside":
            return holds(room, outline) and tried.within(self.actor)
        away = distance(outline, whole_outline(parts_of(self.actor)))
        return away <= spec.distance and holds(room, outline)


def start_of(
    name: str, spec: ObjectSpec, places: Mapping[str, PlaceModel], drawn: Mapping[str, ObjectActor]
) -> Start:
    """Where an object starts.

    Args:
        name: The object's name.
        spec: What the scene says of it.
        places: The places, by name.
        drawn: The objects that were drawn before, by name.

    Raises:
        InputError: There is no such place or object, it is beside a place, or in what has no hollow.
    """
    word, reference = spec.start
    if reference not in drawn:
        if reference not in places or word == "beside":
            raise InputError(f"object '{name}' starts {word} '{reference}', which is none of the scene's")
        return Start(word, reference, places[reference], reference)
    actor = drawn[reference]
    if word == "on":
        return Start(word, reference, top_of(actor, places), actor.on, actor, reference)
    if word == "inside":
        return Start(word, reference, _floor_of(actor, places), actor.on, actor, reference)
    under = top_of(drawn[actor.base], places) if actor.base else places[actor.on]
    frame = poses.multiply(poses.inverse(under.pose), np.array(actor.pose))
    level = poses.multiply(under.pose, poses.pose([*frame[:2], 0.0]))
    middle = np.array(under.centre) - frame[:2]
    beside = replace(under, pose=level, centre=(float(middle[0]), float(middle[1])))
    return Start(word, reference, beside, actor.on, actor, actor.base)


def check_hollows(goals: Sequence[object], objects: Mapping[str, ObjectActor]) -> None:
    """What is to be inside an object has room there.

    Args:
        goals: Goals, and functions, which are passed over.
        objects: The drawn objects, by name.

    Raises:
        InputError: An object has no hollow.
    """
    for goal in goals:
        actor = objects.get(goal.place) if isinstance(goal, Goal) and goal.relation == "inside" else None
        if actor is not None and not len(actor.shape().hollow):
            raise InputError(
                f"nothing can come to be inside '{actor.name}', as a goal asks: "
                f"it has no hollow with a floor and walls all around"
            )


def top_of(actor: ObjectActor, places: Mapping[str, PlaceModel]) -> PlaceModel:
    """The top of an object as a place: its origin in the middle, with the object's heading."""
    top = max(part.high for part in parts_of(actor))
    return _place_at(actor, top, places)


def _floor_of(actor: ObjectActor, places: Mapping[str, PlaceModel]) -> PlaceModel:
    """The room within an object as a place at the height of its lowest point: all that its hollow covers.

    Raises:
        InputError: It has no hollow.
    """
    boxes = actor.shape().hollow
    if not len(boxes):
        raise InputError(
            f"nothing can start in '{actor.name}': it has no hollow with a floor and walls all around"
        )
    low, high = np.min(boxes[:, :2] - boxes[:, 2:4], axis=0), np.max(boxes[:, :2] + boxes[:, 2:4], axis=0)
    floor = _place_at(actor, min(part.low for part in parts_of(actor)), places)
    (x, y), (width, depth) = ((low + high) / 2).tolist(), (high - low).tolist()
    return replace(floor, extent=(width, depth), centre=(x, y))


def _place_at(actor: ObjectActor, height: float, places: Mapping[str, PlaceModel]) -> PlaceModel:
    model = actor.model()
    pose = np.array([*actor.pose[:2], height, *actor.pose[3:]])
    below = places[actor.on]
    return replace(below, name=actor.name, kind="spot", pose=pose, extent=model.extent[:2], centre=(0.0, 0.0))


def _radius(size: Sequence[float]) -> float:
    return float(np.hypot(size[0], size[1])) / 2
