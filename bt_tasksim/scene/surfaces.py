"""Nearest points on the outer surfaces of simple solids, centred on the origin.

Called at every control step for every fingertip, so a few points are computed in plain floats and many in
arrays. Exact for boxes, upright cylinders and upright prisms with a polygon as footprint; for ellipses and
superellipsoids the point on the line to the middle is taken, which is the nearest one on the axes (where
fingers close) and always lies on the surface.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.scene.meshes import superellipsoid_scale

_FEW = 16


class Footprint(Protocol):
    """A convex area around the origin of the plane."""

    def nearest(self, x: float, y: float) -> tuple[float, float, bool]:
        """The outline's nearest point, and whether ``(x, y)`` is inside."""

    def nearest_batch(self, point: Array) -> tuple[Array, Array]:
        """The same for points ``(..., 2)``: points ``(..., 2)`` and inside ``(...)``."""


class OuterSurface(Protocol):
    """The outer surface of a solid."""

    def nearest(self, point: Array) -> Array:
        """The nearest points ``(..., 3)`` to points ``(..., 3)``, in the solid's frame, metres."""

    def one(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """`nearest` of a single point, in plain floats."""


@dataclass(frozen=True)
class Ellipse:
    """Footprint with half sizes ``a`` along x and ``b`` along y, metres."""

    a: float
    b: float

    def nearest(self, x: float, y: float) -> tuple[float, float, bool]:
        """See `Footprint`."""
        gauge = math.hypot(x / self.a, y / self.b)
        if gauge < 1e-9:
            return 0.0, self.b, True
        return x / gauge, y / gauge, gauge < 1

    def nearest_batch(self, point: Array) -> tuple[Array, Array]:
        """See `Footprint`."""
        xp = array_namespace(point)
        gauge = xp.sqrt((point[..., 0] / self.a) ** 2 + (point[..., 1] / self.b) ** 2)
        middle = gauge < 1e-9
        safe = xp.where(middle, xp.ones_like(gauge), gauge)
        x = xp.where(middle, xp.zeros_like(gauge), point[..., 0] / safe)
        y = xp.where(middle, xp.full_like(gauge, self.b), point[..., 1] / safe)
        return xp.stack([x, y], axis=-1), gauge < 1


@dataclass(frozen=True)
class Polygon:
    """Footprint with corners ``((x, y), ...)``, counter-clockwise, metres."""

    corners: tuple[tuple[float, float], ...]

    def nearest(self, x: float, y: float) -> tuple[float, float, bool]:
        """See `Footprint`."""
        best, bx, by, inside = math.inf, 0.0, 0.0, True
        ax, ay = self.corners[-1]
        for cx, cy in self.corners:
            ex, ey, px, py = cx - ax, cy - ay, x - ax, y - ay
            if ex * py - ey * px < 0:
                inside = False
            t = min(max((px * ex + py * ey) / (ex * ex + ey * ey), 0.0), 1.0)
            dx, dy = px - t * ex, py - t * ey
            distance = dx * dx + dy * dy
            if distance < best:
                best, bx, by = distance, x - dx, y - dy
            ax, ay = cx, cy
        return bx, by, inside

    def nearest_batch(self, point: Array) -> tuple[Array, Array]:
        """See `Footprint`."""
        xp = array_namespace(point)
        corners = xp.asarray(self.corners, dtype=point.dtype)
        edge = xp.roll(corners, -1, axis=0) - corners
        p = point[..., None, :] - corners
        t = xp.clip(xp.sum(p * edge, axis=-1) / xp.sum(edge * edge, axis=-1), 0.0, 1.0)
        offset = p - t[..., None] * edge
        best = xp.argmin(xp.sum(offset * offset, axis=-1), axis=-1)
        chosen = xp.zeros_like(point)
        for i in range(len(self.corners)):
            chosen = xp.where((best == i)[..., None], offset[..., i, :], chosen)
        left = edge[:, 0] * p[..., 1] - edge[:, 1] * p[..., 0] >= 0
        return point - chosen, xp.all(left, axis=-1)


@dataclass(frozen=True)
class PrismSurface:
    """An upright prism: its footprint, and half its height in metres."""

    footprint: Footprint
    half_height: float

    def nearest(self, point: Array) -> Array:
        """See `OuterSurface`."""
        if type(point) is np.ndarray and point.size <= 3 * _FEW:
            return np.array([self.one(*p) for p in point.reshape(-1, 3).tolist()]).reshape(point.shape)
        xp = array_namespace(point)
        z, h = point[..., 2], self.half_height
        outline, inside = self.footprint.nearest_batch(point[..., :2])
        depth = xp.sqrt(xp.sum((point[..., :2] - outline) ** 2, axis=-1))
        to_cap = inside & (h - xp.abs(z) < depth)
        cap = xp.where(z < 0, xp.full_like(z, -h), xp.full_like(z, h))
        flat = xp.where(to_cap[..., None], point[..., :2], outline)
        height = xp.where(to_cap, cap, xp.clip(z, -h, h))
        return xp.concat([flat, height[..., None]], axis=-1)

    def one(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """See `OuterSurface`."""
        h = self.half_height
        fx, fy, inside = self.footprint.nearest(x, y)
        if inside and h - abs(z) < math.hypot(x - fx, y - fy):
            return x, y, math.copysign(h, z)
        return fx, fy, min(max(z, -h), h)


@dataclass(frozen=True)
class SuperellipsoidSurface:
    """A superellipsoid of half sizes ``(3,)`` in metres and exponents."""

    half_size: tuple[float, float, float]
    exponents: tuple[float, float]

    def nearest(self, point: Array) -> Array:
        """See `OuterSurface`."""
        if type(point) is np.ndarray and point.size <= 3 * _FEW:
            return np.array([self.one(*p) for p in point.reshape(-1, 3).tolist()]).reshape(point.shape)
        p = np.asarray(point, float)
        size = np.array(self.half_size)
        level = np.max(np.abs(p), axis=-1, keepdims=True)
        p = np.where(level > 1e-9, p, np.array([0.0, self.half_size[1], 0.0]))
        scale = superellipsoid_scale(p / size, *self.exponents)
        return array_namespace(point).asarray(p * scale[..., None])

    def one(self, x: float, y: float, z: float) -> tuple[float, float, float]:
        """See `OuterSurface`."""
        a, b, c = self.half_size
        e1, e2 = self.exponents
        u, v, w = abs(x / a), abs(y / b), abs(z / c)
        level = max(u, v, w)
        if level * max(a, b, c) < 1e-9:
            return 0.0, b, 0.0
        flat = ((u / level) ** (2 / e2) + (v / level) ** (2 / e2)) ** (e2 / e1)
        k = 1 / ((flat + (w / level) ** (2 / e1)) ** (e1 / 2) * level)
        return x * k, y * k, z * k
