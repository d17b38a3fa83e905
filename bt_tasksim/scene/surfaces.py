"""Nearest points on the outer surfaces of simple solids, centred on the origin.

A surface's numbers may be plain ones or arrays with a surface a row, so that many unlike solids of one kind
are one law's case of many: `together`. Exact for boxes, upright cylinders and upright prisms with a polygon
as footprint; for ellipses and superellipsoids the point on the line to the middle is taken, which is the
nearest one on the axes (where fingers close) and always lies on the surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self, TypeGuard

import numpy as np

from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.scene.meshes import superellipsoid_scale

_MIDDLE = 1e-9
"""Metres, or a share of the size, from the origin that are the origin itself."""


class Footprint(Protocol):
    """A convex area around the origin of the plane."""

    def nearest(self, point: Array) -> tuple[Array, Array]:
        """Nearest points ``(..., 2)`` of the outline to points ``(..., 2)``; these are inside ``(...)``."""

    @classmethod
    def together(cls, footprints: Sequence[Self]) -> Self:
        """Several as one, for points ``(len(footprints), ..., 2)`` with one axis between."""


class OuterSurface(Protocol):
    """The outer surface of a solid."""

    def nearest(self, point: Array) -> Array:
        """The nearest points ``(..., 3)`` to points ``(..., 3)``, in the solid's frame, metres."""


class Joinable(Protocol):
    """A surface several of which can be computed at once."""

    @property
    def kind(self) -> Any:
        """Surfaces of one class and the same kind can be `together`."""

    @classmethod
    def together(cls, surfaces: Sequence[Any]) -> OuterSurface:
        """Several as one, for points ``(len(surfaces), n, 3)``."""


@dataclass(frozen=True)
class Ellipse:
    """Footprint with half sizes ``a`` along x and ``b`` along y, metres, or arrays of them ``(k, 1)``."""

    a: float | Array
    b: float | Array

    def nearest(self, point: Array) -> tuple[Array, Array]:
        """See `Footprint`."""
        xp = array_namespace(point)
        a, b = constant(self.a, point), constant(self.b, point)
        u, v = point[..., 0] / a, point[..., 1] / b
        gauge = xp.sqrt(u * u + v * v)
        middle = gauge < _MIDDLE
        safe = xp.where(middle, xp.ones_like(gauge), gauge)
        x = xp.where(middle, xp.zeros_like(gauge), point[..., 0] / safe)
        y = xp.where(middle, b + xp.zeros_like(gauge), point[..., 1] / safe)
        return xp.stack([x, y], axis=-1), gauge < 1

    @classmethod
    def together(cls, footprints: Sequence[Self]) -> Self:
        """See `Footprint`."""
        return cls(_column([f.a for f in footprints]), _column([f.b for f in footprints]))


@dataclass(frozen=True)
class Polygon:
    """Footprint with corners ``((x, y), ...)``, counter-clockwise, metres, or arrays ``(k, 1, most, 2)``.

    The last corner may come again: so polygons with few corners are filled up.
    """

    corners: Any

    def nearest(self, point: Array) -> tuple[Array, Array]:
        """See `Footprint`."""
        xp = array_namespace(point)
        corners = constant(self.corners, point)
        edge = xp.roll(corners, -1, axis=-2) - corners
        ex, ey = edge[..., 0], edge[..., 1]
        px, py = point[..., :1] - corners[..., 0], point[..., 1:] - corners[..., 1]
        square = ex * ex + ey * ey
        none = square == 0.0
        t = xp.clip((px * ex + py * ey) / xp.where(none, xp.ones_like(square), square), 0.0, 1.0)
        dx, dy = px - t * ex, py - t * ey
        distance = xp.where(none, xp.full_like(dx, xp.inf), dx * dx + dy * dy)
        best = xp.argmin(distance, axis=-1)
        x, y = dx[..., 0], dy[..., 0]
        for i in range(1, corners.shape[-2]):
            x, y = xp.where(best == i, dx[..., i], x), xp.where(best == i, dy[..., i], y)
        return point - xp.stack([x, y], axis=-1), xp.all(ex * py - ey * px >= 0, axis=-1)

    @classmethod
    def together(cls, footprints: Sequence[Self]) -> Self:
        """See `Footprint`."""
        most = max(len(f.corners) for f in footprints)
        filled = [[*f.corners, *[f.corners[-1]] * (most - len(f.corners))] for f in footprints]
        return cls(np.array(filled)[:, None])


@dataclass(frozen=True)
class PrismSurface:
    """An upright prism: its footprint, and half its height in metres, or arrays of them ``(k, 1)``."""

    footprint: Footprint
    half_height: float | Array

    def nearest(self, point: Array) -> Array:
        """See `OuterSurface`."""
        xp = array_namespace(point)
        flat, z, h = point[..., :2], point[..., 2], constant(self.half_height, point)
        outline, inside = self.footprint.nearest(flat)
        gap = flat - outline
        depth = xp.sqrt(gap[..., 0] * gap[..., 0] + gap[..., 1] * gap[..., 1])
        to_cap = inside & (h - abs(z) < depth)
        cap = xp.where(z < 0, -h, h)
        beside = xp.minimum(xp.maximum(z, -h), h + xp.zeros_like(z))
        height = xp.where(to_cap, cap, beside)
        return xp.concat([xp.where(to_cap[..., None], flat, outline), height[..., None]], axis=-1)

    @property
    def kind(self) -> Any:
        """See `Joinable`."""
        return type(self.footprint)

    @classmethod
    def together(cls, surfaces: Sequence[Self]) -> Self:
        """See `Joinable`."""
        footprints = [s.footprint for s in surfaces]
        return cls(type(footprints[0]).together(footprints), _column([s.half_height for s in surfaces]))


@dataclass(frozen=True)
class SuperellipsoidSurface:
    """A superellipsoid: half sizes ``(3,)`` in metres and exponents ``(2,)``, or arrays ``(k, 1, ...)``."""

    half_size: Any
    exponents: Any

    def nearest(self, point: Array) -> Array:
        """See `OuterSurface`."""
        xp = array_namespace(point)
        size, exponents = constant(self.half_size, point), constant(self.exponents, point)
        x, y, z = (abs(point[..., i]) for i in range(3))
        level = xp.maximum(xp.maximum(x, y), z)[..., None]
        aside = size * constant([0.0, 1.0, 0.0], point)
        point = xp.where(level > _MIDDLE, point, aside)
        # As many exponents as points: powers by one number have other ways, and so other last digits.
        e1, e2 = (exponents[..., i] + xp.zeros_like(level[..., 0]) for i in range(2))
        return point * superellipsoid_scale(point / size, e1, e2)[..., None]

    @property
    def kind(self) -> Any:
        """See `Joinable`."""
        return None

    @classmethod
    def together(cls, surfaces: Sequence[Self]) -> Self:
        """See `Joinable`."""
        return cls(
            np.array([s.half_size for s in surfaces])[:, None],
            np.array([s.exponents for s in surfaces])[:, None],
        )


class ManySurfaces:
    """Surfaces of unlike kinds, one a row; those of one kind are computed at once.

    Args:
        surfaces: One for each row.
    """

    def __init__(self, surfaces: Sequence[OuterSurface]) -> None:
        groups: dict[Any, list[int]] = {}
        for i, surface in enumerate(surfaces):
            key = (type(surface), surface.kind) if _joinable(surface) else id(surface)
            groups.setdefault(key, []).append(i)
        self._order = np.argsort([i for rows in groups.values() for i in rows])
        self._groups: list[tuple[np.ndarray, OuterSurface]] = []
        for rows in groups.values():
            first = surfaces[rows[0]]
            joined = type(first).together([surfaces[i] for i in rows]) if _joinable(first) else first
            self._groups.append((np.array(rows), joined))

    def nearest(self, point: Array) -> Array:
        """The nearest points ``(k, n, 3)`` on each row's surface to its points ``(k, n, 3)``."""
        xp = array_namespace(point)
        if len(self._groups) == 1:
            return self._groups[0][1].nearest(point)
        rows = [xp.asarray(rows, device=point.device) for rows, _ in self._groups]
        found = [
            surface.nearest(xp.take(point, index, axis=0))
            for index, (_, surface) in zip(rows, self._groups, strict=True)
        ]
        return xp.take(xp.concat(found, axis=0), xp.asarray(self._order, device=point.device), axis=0)


def _joinable(surface: OuterSurface) -> TypeGuard[Joinable]:
    """Whether it is a `Joinable`; asking the protocol itself takes as long as computing the surface."""
    return hasattr(type(surface), "together")


def _column(values: Sequence[float | Array]) -> Array:
    return np.array(values)[:, None]
