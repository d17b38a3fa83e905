"""Seeded draws of the things of a world: spots, objects, the hand's start, disturbances."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, NoDrawError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import PlaceModel
from bt_tasksim.scene.configuration import Disturbance, ObjectActor
from bt_tasksim.scene.fixtures import Fixture
from bt_tasksim.scene.outlines import deepest, fixture_slabs
from bt_tasksim.scene.shape_kind import ShapeKind
from bt_tasksim.scene.shapes import ShapeSize, object_model, resting_height, shape, shape_kind
from bt_tasksim.scene.specs import HandStart, ObjectSpec, SpotSpec
from bt_tasksim.scene.starts import Candidate, start_of

ASIDE = 0.5
"""Radians by which a tilted approach may lean aside, see `bt_tasksim.scene.scene.CurriculumStage`."""
TRIES = 200
"""Draws of an object's place, after which there is none."""
_INTERVALS = 10


def draw_spot(spec: SpotSpec, places: Mapping[str, PlaceModel], rng: np.random.Generator) -> PlaceModel:
    """The spot as a place in the robot base frame."""
    base = places[spec.on]
    offset = np.array(spec.centre) + rng.uniform(-1, 1, 2) * np.array(spec.area)
    local = poses.pose([*offset, 0.0], poses.yaw(draw_heading(spec.yaw, rng)))
    return dataclasses.replace(
        base,
        name=spec.name,
        kind="spot",
        pose=poses.multiply(base.pose, local),
        extent=spec.extent,
        centre=(0.0, 0.0),
    )


def draw_heading(yaw: float | tuple[float, float], rng: np.random.Generator) -> float:
    """A heading in radians, from half the width of a range about 0 or from the range itself."""
    low, high = yaw if isinstance(yaw, tuple) else (-yaw, yaw)
    return float((low + high) / 2 + rng.uniform(-1, 1) * (high - low) / 2)


def draw_object(
    name: str,
    spec: ObjectSpec,
    places: Mapping[str, PlaceModel],
    others: Sequence[ObjectActor],
    rng: np.random.Generator,
    fixtures: Sequence[Fixture] = (),
) -> ObjectActor:
    """An object that stands clear of the others and of the furniture.

    Args:
        name: Its name.
        spec: What it may be.
        places: The places, by name.
        others: The objects that were drawn before.
        rng: Random numbers.
        fixtures: The furniture.

    Raises:
        NoDrawError: None of 200 draws of its place was free.
        InputError: A cube was asked for with unequal sides.
    """
    kind = spec.kinds[int(rng.integers(len(spec.kinds)))]
    entry = shape_kind(kind)
    low, high = spec.size or entry.sizes(spec.mesh)
    size = _draw_in(low, high, spec.split, rng)
    if entry.round:
        size = (size[0], size[0], size[2])
    if entry.cubic:
        _check_equal(name, spec)
        size = (size[0],) * 3
    e_low, e_high = (np.broadcast_to(np.array(v, float), 2) for v in spec.exponents)
    if isinstance(spec.exponents[0], tuple):
        e_low, e_high = np.array(spec.exponents, float).T
    exponents = _draw_in(e_low, e_high, spec.split, rng)
    geometry = ShapeSize((size[0], size[1], size[2]), (exponents[0], exponents[1]), spec.mesh)
    mass, friction = float(rng.uniform(*spec.mass)), float(rng.uniform(*spec.friction))
    start = start_of(name, spec, places, {other.name: other for other in others})
    model = object_model(name, kind, geometry, spec.grasps, spec.symmetry)
    area, centre = start.area(spec, entry, model), start.centre(spec)
    pieces, height = shape(kind, geometry).collision, resting_height(kind, geometry)

    def tried(offset: Array, heading: float, floor: float = 0.0) -> Candidate:
        local = poses.pose([*offset, height + floor], poses.yaw(heading))
        return Candidate(pieces, poses.multiply(start.place.pose, local), model.extent)

    for _ in range(TRIES):
        offset = centre + rng.uniform(-1, 1, 2) * area
        heading = draw_heading(spec.yaw, rng)
        found = tried(offset, heading)
        if (floor := start.floor(found)) > 0.0:
            found = tried(offset, heading, floor)
        stuck = found.stuck_in(fixtures)
        if stuck is None and found.clear_of(others, spec.gap) and start.fits(found, spec):
            break
    else:
        if stuck is not None:
            depth = deepest(found.parts, fixture_slabs(stuck))
            raise NoDrawError(
                f"object '{name}' and fixture '{stuck.name}' overlap by {1000 * depth:.1f} mm at the start, "
                f"{start} in the last of {TRIES} draws: draw it from another area"
            )
        raise NoDrawError(
            f"object '{name}' finds no free spot {start} beside the others: "
            f"widen its area, or take fewer or smaller objects"
        )
    taken = {o.colour for o in others}
    colours = [c for c in entry.colours if c not in taken] or entry.colours
    drawn = colours[int(rng.integers(len(colours)))]  # also where one is given: the draws after it stay
    known_size = _known_size(size, entry, spec, rng)
    return ObjectActor(
        name=name,
        kind=kind,
        size=geometry.size,
        exponents=geometry.exponents,
        mass=mass,
        friction=friction,
        pose=tuple(float(v) for v in found.pose),
        colour=spec.colour or drawn,
        mesh=spec.mesh,
        known_size=known_size,
        on=start.under,
        base=start.base,
        movable=spec.movable,
        grasps=spec.grasps,
        symmetry=spec.symmetry,
        category=spec.category,
    )


def draw_disturbance(name: str, rng: np.random.Generator) -> Disturbance:
    """A push out of the hand at a random moment, down and aside."""
    heading = rng.uniform(-np.pi, np.pi)
    side = rng.uniform(0.0, 20.0)
    return Disturbance(
        object=name,
        delay=float(rng.uniform(0.0, 1.6)),
        force=(float(side * np.cos(heading)), float(side * np.sin(heading)), -120.0),
    )


def draw_noise(models: Sequence[str], rng: np.random.Generator) -> str:
    """One of these noise models of the estimate; empty where there are none."""
    return models[int(rng.integers(len(models)))] if models else ""


def draw_hand(
    start: HandStart,
    objects: Sequence[ObjectActor],
    places: Mapping[str, PlaceModel],
    rng: np.random.Generator,
) -> tuple[float, ...]:
    """Position (m) and turn (rad) of a hand above an object ``(4,)``.

    Empty where the object is not reached from above.
    """
    actor = next(o for o in objects if o.name == start.over)
    if float(places[actor.on].access[2]) > -0.999:
        return ()
    centre = actor.pose
    x, y = rng.uniform(-start.aside, start.aside, 2).tolist()
    z, turn = float(rng.uniform(*start.height)), float(rng.uniform(-start.turn, start.turn))
    return centre[0] + x, centre[1] + y, centre[2] + z, turn


def tilt_access(
    tilt: tuple[float, float],
    objects: Sequence[ObjectActor],
    places: dict[str, PlaceModel],
    rng: np.random.Generator,
) -> None:
    """Lean the direction in which hands come to the objects' boards, in place; see `CurriculumStage`."""
    angle, aside = float(rng.uniform(*tilt)), float(rng.uniform(-ASIDE, ASIDE))
    for actor in objects:
        if places[actor.on].kind != "board":
            continue
        heading = np.arctan2(actor.pose[1], actor.pose[0]) + aside
        level = np.sin(angle)
        access = np.array([level * np.cos(heading), level * np.sin(heading), -np.cos(angle)])
        places[actor.on] = dataclasses.replace(places[actor.on], access=access)


def _check_equal(name: str, spec: ObjectSpec) -> None:
    """Refuse ranges of size that no cube can have; where it may also be of another kind, x gives its side."""
    if spec.size is None or len(spec.kinds) > 1 or all(len(set(sides)) == 1 for sides in spec.size):
        return
    raise InputError(
        f"object '{name}': a {spec.kinds[0]} has equal sides, and not {spec.size[0]} to {spec.size[1]}: "
        f"give three equal numbers each, or kind 'box'"
    )


def _draw_in(low: Any, high: Any, split: str, rng: np.random.Generator) -> tuple[float, ...]:
    """Uniform draws from ranges, or from every other one of ten strips of them."""
    if split == "all":
        return tuple(float(v) for v in rng.uniform(low, high))
    low, high = np.asarray(low, float), np.asarray(high, float)
    u = rng.uniform(0.0, 1.0, low.shape) * (_INTERVALS / 2)
    k = np.floor(u)
    share = (2 * k + (split == "odd") + (u - k)) / _INTERVALS
    return tuple(float(v) for v in low + share * (high - low))


def _known_size(
    size: tuple[float, ...], entry: ShapeKind, spec: ObjectSpec, rng: np.random.Generator
) -> tuple[float, float, float] | None:
    """The size with a relative error, the same along x and y for what is round."""
    if spec.size_error == 0.0:
        return None
    x, y, z = (1.0 + rng.uniform(-1.0, 1.0, 3) * spec.size_error).tolist()
    if entry.round:
        y = x
    return size[0] * x, size[1] * y, size[2] * z
