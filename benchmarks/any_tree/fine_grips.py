"""Where an object may be held, sampled finely: opposite points of its surface, by rays from all over it."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from bt_tasksim.scene.antipodal import crossings
from bt_tasksim.scene.configuration import ObjectActor
from bt_tasksim.scene.grips import Grips, firm_about
from bt_tasksim.scene.mesh_surface import sampled

LINES = 1500
MOST = 240
FRICTION = 0.6
"""Coefficient in whose cone both normals lie: that of the softest pad on the smoothest object."""
WIDEST = 0.13


def fine_grips(actor: ObjectActor) -> Grips:
    """The grips that are known of an object, and many more."""
    return _found(actor.kind, actor.size, actor.exponents, actor.mesh, actor)


@lru_cache(maxsize=32)
def _found(kind: str, size: object, exponents: object, mesh: str | None, actor: ObjectActor) -> Grips:
    shape = actor.shape()
    surface, centre = shape.visual, np.asarray(shape.mass.pose)[:3]
    solid = actor.model().solid
    known = [solid.grips] if solid is not None and len(solid.grips) else []
    samples = sampled(surface, LINES, seed=5)
    corners = surface.vertices[surface.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    corners, normal = corners[length > 1e-14], cross[length > 1e-14] / length[length > 1e-14, None]
    within = math.cos(math.atan(FRICTION))
    starts, ways = samples.points + 1e-9 * samples.normals, -samples.normals
    points, closing, widths = [], [], []
    for start, way, (at, face) in zip(starts, ways, crossings(corners, starts, ways), strict=True):
        slope = normal[face] @ way
        for i in np.flatnonzero(slope < -within):
            for j in np.flatnonzero(slope > within):
                if 1e-4 < at[j] - at[i] <= WIDEST:
                    points.append(start + (at[i] + at[j]) / 2 * way)
                    closing.append(way)
                    widths.append(float(at[j] - at[i]))
    if points:
        pick = np.random.default_rng(3).permutation(len(points))[:MOST]
        middles = np.array(points)[pick]
        known.append(
            Grips.of(
                middles,
                np.array(closing)[pick],
                np.array(widths)[pick],
                firmness=0.8 * firm_about(middles, centre),
            )
        )
    return Grips.joined(known) if known else Grips.of(np.zeros((0, 3)), np.zeros((0, 3)), [])
