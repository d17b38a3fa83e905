"""Surfaces of unlike solids together: each point is found as if its solid were alone."""

from __future__ import annotations

import numpy as np
import pytest

from bt_tasksim.core.poses import Array, constant
from bt_tasksim.scene.surfaces import Ellipse, ManySurfaces, OuterSurface, Polygon, PrismSurface
from bt_tasksim.scene.surfaces import SuperellipsoidSurface as Egg
from tests.array_libraries import agree


class Flat:
    """A surface of somebody else's, that nobody can join with others."""

    def nearest(self, point: Array) -> Array:
        return point * constant([1.0, 1.0, 0.0], point)


def corners(n: int, size: float) -> tuple[tuple[float, float], ...]:
    angle = 2 * np.pi * np.arange(n) / n
    return tuple(zip((size * np.cos(angle)).tolist(), (size * np.sin(angle)).tolist(), strict=True))


SURFACES: list[OuterSurface] = [
    PrismSurface(Polygon(corners(4, 0.03)), 0.05),
    PrismSurface(Ellipse(0.03, 0.02), 0.04),
    Egg((0.03, 0.04, 0.05), (0.7, 1.0)),
    Flat(),
    PrismSurface(Polygon(corners(7, 0.04)), 0.02),
    PrismSurface(Polygon(corners(3, 0.05)), 0.07),
    Egg((0.02, 0.02, 0.06), (1.0, 0.4)),
    PrismSurface(Ellipse(0.05, 0.05), 0.01),
]


@pytest.mark.parametrize("tips", [1, 2, 5])
def test_many_are_as_each_alone_bit_by_bit(tips: int) -> None:
    rng = np.random.default_rng(0)
    which = rng.integers(0, len(SURFACES), 65)
    points = rng.normal(scale=0.04, size=(65, tips, 3))
    points[::9] = 0.0
    points[1::9, :, :2] = 0.0
    together = ManySurfaces([SURFACES[i] for i in which]).nearest(points)
    for order in ([3], [40, 7], list(range(64)), rng.permutation(65).tolist()):
        some = ManySurfaces([SURFACES[which[i]] for i in order]).nearest(points[order])
        np.testing.assert_array_equal(some, together[order])
    for i, surface in enumerate(which):
        np.testing.assert_allclose(together[i], SURFACES[surface].nearest(points[i]), atol=1e-12)


def test_points_of_polygons_do_not_depend_on_how_many_corners_others_have() -> None:
    points = np.concatenate([np.array(corners(3, s)) for s in (0.02, 0.05, 0.08)])
    points = np.column_stack([points, np.zeros(9)])[None]
    alone = ManySurfaces([SURFACES[5]]).nearest(points)
    beside = ManySurfaces([SURFACES[5], SURFACES[4]]).nearest(np.repeat(points, 2, axis=0))
    np.testing.assert_array_equal(beside[:1], alone)
    np.testing.assert_allclose(alone[0, 3:6], points[0, 3:6], atol=1e-15)


@pytest.mark.parametrize("surfaces", [*([surface] * 3 for surface in SURFACES), SURFACES], ids=len)
def test_every_library_and_device_finds_the_same_and_single_precision_stays_so(
    surfaces: list[OuterSurface],
) -> None:
    points = np.random.default_rng(1).normal(scale=0.04, size=(len(surfaces), 2, 3))
    agree(ManySurfaces(surfaces).nearest, points, close=1e-12, single_close=1e-5)
    points[0], points[1, :, :2] = 0.0, 0.0
    agree(ManySurfaces(surfaces).nearest, points, close=1e-12, single_close=None)
