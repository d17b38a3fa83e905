"""Where furniture stands, and which rectangle of the table is left for things."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.any_tree.settings import Setting, Stand
from bt_tasksim import Fixture
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.fixture_overlap import check_fixtures
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.outlines import distance, fixture_slabs, rectangle, whole_outline

CLEAR = 0.04
"""Metres between furniture and the rectangle in which things begin."""
TRIES = 60


@dataclass(frozen=True, eq=False)
class Room:
    """Furniture, and the rectangle of the table in which things begin.

    Attributes:
        name: Name of the arrangement.
        stands: What there is.
        fixtures: The same with poses.
        outlines: Each from above ``(n, 2)``, robot base frame.
        centre: Middle ``(2,)`` of the rectangle, robot base frame, metres.
        half: Half sizes ``(2,)`` of it along x and y.
    """

    name: str
    stands: tuple[Stand, ...]
    fixtures: tuple[Fixture, ...]
    outlines: tuple[Array, ...]
    centre: Array
    half: Array

    @property
    def area(self) -> float:
        """Of the rectangle, square decimetres."""
        return float(400.0 * self.half[0] * self.half[1])


def draw_room(setting: Setting, rng: np.random.Generator) -> Room:
    """Furniture of one of the arrangements, and a rectangle clear of it.

    Raises:
        InputError: None of the tries fits.
    """
    name = str(rng.choice(list(setting.stands)))
    for _ in range(TRIES):
        stands = setting.stands[name]
        fixtures = tuple(_placed(stand, setting, rng) for stand in stands)
        loaded = [load_fixture(fixture) for fixture in fixtures]
        outlines = tuple(whole_outline(fixture_slabs(fixture)) for fixture in loaded)
        about = rectangle(poses.pose([0.0, 0.0, 0.0]), (0.0, 0.0), (2 * setting.base, 2 * setting.base))
        try:
            check_fixtures([load_fixture("table"), *loaded])
        except InputError:
            continue
        if any(distance(about, outline) < 0.0 for outline in outlines):
            continue
        found = _rectangle(setting, outlines, rng)
        if found is not None:
            return Room(name, stands, fixtures, outlines, *found)
    raise InputError(f"no room for {name}")


def _placed(stand: Stand, setting: Setting, rng: np.random.Generator) -> Fixture:
    far = rng.uniform(*stand.distance)
    bearing = setting.ahead + rng.uniform(-1, 1) * stand.bearing
    yaw = bearing + rng.uniform(-1, 1) * stand.turned
    at = (round(far * math.cos(bearing), 3), round(far * math.sin(bearing), 3))
    return Fixture(stand.fixture, at=at, yaw=round(math.remainder(yaw, 2 * math.pi), 3))


def _rectangle(
    setting: Setting, outlines: Sequence[Array], rng: np.random.Generator
) -> tuple[Array, Array] | None:
    """Middle and half sizes ``(2,)`` of a rectangle that is within reach and clear of furniture."""
    for _ in range(TRIES):
        size = np.array([rng.uniform(*setting.deep), rng.uniform(*setting.wide)])
        low, high = setting.forward
        room = np.array([high - low, 2 * setting.aside])
        size = np.minimum(size, room)
        offset = rng.uniform(-0.5, 0.5, 2) * (room - size)
        middle = np.array([(low + high) / 2, 0.0]) + offset
        centre, half = in_base(setting, middle), np.abs(in_base(setting, size / 2))
        corners = rectangle(poses.pose([0.0, 0.0, 0.0]), centre.tolist(), (2 * half).tolist())
        reached = float(np.max(np.hypot(corners[:, 0], corners[:, 1]))) <= setting.farthest
        if reached and all(distance(corners, outline) >= CLEAR for outline in outlines):
            return centre, half
    return None


def in_base(setting: Setting, point: Array) -> Array:
    """A point ``(2,)`` ahead of a robot and to its left, in the robot base frame."""
    c, s = round(math.cos(setting.ahead), 9), round(math.sin(setting.ahead), 9)
    return np.array([c * point[0] - s * point[1], s * point[0] + c * point[1]])
