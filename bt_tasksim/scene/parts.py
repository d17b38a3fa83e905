"""Parts of fixtures as actors of a drawn world: objects that move on a joint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.configuration import ObjectActor
from bt_tasksim.scene.fixtures import Fixture, FixturePart
from bt_tasksim.scene.geometry import BoxPiece
from bt_tasksim.scene.grips import GivenGrip
from bt_tasksim.scene.joints import Joint
from bt_tasksim.scene.part_kind import PART

UNDER = "table"
"""The place that parts are taken to stand on: it is in every scene."""
FRICTION = 0.8
"""Friction of a part's surface, between rubber pads and wood or metal."""


def draw_parts(fixtures: Sequence[Fixture], rng: np.random.Generator) -> Iterator[ObjectActor]:
    """The parts of fixtures, each drawn as far open as its fixture says."""
    for fixture in fixtures:
        for part in fixture.parts:
            low, high = part.value
            yield part_actor(fixture, part, float(low + rng.uniform() * (high - low)))


def part_actor(fixture: Fixture, part: FixturePart, value: float) -> ObjectActor:
    """A part that is so far open, metres or radians."""
    low, high = _bounds(part.boxes)
    centre = (low + high) / 2
    zero = poses.multiply(fixture.pose_array(), poses.pose(centre))
    joint = Joint(
        kind=part.kind,
        origin=_vector(np.array(part.origin) - centre),
        axis=part.axis,
        zero=tuple(zero.tolist()),
        limits=part.limits,
        sensed=part.sensed,
        friction=part.friction,
        damping=part.damping,
        stiffness=part.stiffness,
        rest=part.rest,
        latch=part.latch,
        fixture=fixture.name,
    )
    return ObjectActor(
        name=part.name,
        kind=PART,
        size=_vector(high - low),
        exponents=(1.0, 1.0),
        mass=part.mass,
        friction=max((box.friction for box in part.boxes), default=FRICTION),
        pose=tuple(joint.pose(value).tolist()),
        colour=part.boxes[0].colour,
        on=UNDER,
        movable=True,
        grasps=tuple(_moved(grip, centre) for grip in part.grasps),
        category=part.name.rpartition("_")[2],
        boxes=tuple(_shifted(box, centre) for box in part.boxes),
        joint=joint,
    )


def _bounds(boxes: Sequence[Box]) -> tuple[Array, Array]:
    """Lowest and highest corner ``(3,)`` of boxes."""
    corners = np.concatenate(
        [BoxPiece(np.array(box.pose, float), np.array(box.size) / 2).corners() for box in boxes]
    )
    return corners.min(axis=0), corners.max(axis=0)


def _shifted(box: Box, centre: Array) -> Box:
    return replace(box, pose=(*(np.array(box.pose[:3]) - centre).tolist(), *box.pose[3:]))


def _moved(grip: GivenGrip, centre: Array) -> GivenGrip:
    return replace(grip, point=_vector(np.array(grip.point) - centre))


def _vector(values: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(v), 12) for v in values)
    return x, y, z
