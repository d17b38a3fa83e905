"""Where along simple solids fingers may hold: laws that kinds of objects share."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.scene.grips import Grips, firm_about

WIDEST = 0.12
"""Metres: wider grips are left out, unless there is no other."""
TALL = 0.06
"""Metres of height from which a thing is also held above and below its middle, by `UP` of its height."""
UP = 0.3
LONG = 0.06
"""Metres of length from which it is also held to either side, by `ASIDE` of its length."""
ASIDE = 0.25
BESIDE = 0.005
"""Metres beside a contact where a curved surface still has to be near a flat fingertip."""
AROUND = 8
"""Directions about the axis of a body of revolution."""


def heights(height: float) -> tuple[float, ...]:
    """Where between bottom and top to hold, metres from the middle, the middle first."""
    return (0.0, UP * height, -UP * height) if height >= TALL else (0.0,)


def sides(length: float) -> tuple[float, ...]:
    """Where along a horizontal length to hold, metres from the middle, the middle first."""
    return (0.0, ASIDE * length, -ASIDE * length) if length > LONG else (0.0,)


def curved(drop: float) -> float:
    """How firm contacts are for how far the surface recedes `BESIDE` them, metres; 1 for flat ones."""
    return max(0.0, 1.0 - drop / BESIDE)


def receding(radius: float) -> float:
    """Metres by which a round surface of this radius recedes `BESIDE` a contact."""
    return radius - float(np.sqrt(max(radius * radius - BESIDE * BESIDE, 0.0)))


def across(
    axis: Sequence[float], width: float, points: Sequence[Sequence[float]], firm: float = 1.0
) -> Grips:
    """Grips of one width along one axis.

    Args:
        axis: Unit vector ``(3,)``.
        width: Metres.
        points: Middles ``(g, 3)``, metres, the centre of mass at the origin.
        firm: Firmness in the middle; it falls with the distance from there.
    """
    n, places = len(points), np.array(points, float).reshape(-1, 3)
    firmness = firm * firm_about(places, np.zeros(3))
    return Grips.of(places, [list(axis)] * n, [width] * n, firmness=firmness)


def not_too_wide(parts: Sequence[Grips]) -> Grips:
    """All together without those beyond `WIDEST`, the firmest first; where all are, the narrowest."""
    whole = Grips.joined(parts)
    return whole.taken(whole.widths <= max(WIDEST, float(np.min(whole.widths))))


def box_grips(size: tuple[float, float, float]) -> Grips:
    """Of a box, flat faces that are opposite each other, along each of its axes."""
    x, y, z = size
    return not_too_wide(
        [
            across((0, 1, 0), y, [(a, 0, h) for h in heights(z) for a in sides(x)]),
            across((1, 0, 0), x, [(0, a, h) for h in heights(z) for a in sides(y)]),
            across((0, 0, 1), z, [(a, 0, 0) if x >= y else (0, a, 0) for a in sides(max(x, y))]),
        ]
    )


def elliptic_grips(size: tuple[float, float, float], firm: float = 1.0, lids: bool = True) -> Grips:
    """Of an upright cylinder on an ellipse: about the axis where it is round, else along both diameters.

    Args:
        size: Full size ``(3,)``, metres.
        firm: Firmness of flat contacts in the middle.
        lids: Top and bottom can be held, too.
    """
    x, y, z = size
    places = [(0.0, 0.0, h) for h in heights(z)]
    parts = []
    if abs(x - y) < 1e-3 * x:
        for k in range(AROUND):
            angle = np.pi / 2 + np.pi * k / AROUND
            axis = (float(np.cos(angle)), float(np.sin(angle)), 0.0)
            parts.append(across(axis, min(x, y), places, firm * curved(receding(x / 2))))
    else:  # The radius of curvature at the end of a diameter is the other half size squared by this one.
        parts.append(across((0, 1, 0), y, places, firm * curved(receding(x * x / (2 * y)))))
        parts.append(across((1, 0, 0), x, places, firm * curved(receding(y * y / (2 * x)))))
    if lids:
        parts.append(across((0, 0, 1), z, [(0.0, 0.0, 0.0)], firm))
    return not_too_wide(parts)


def superelliptic_grips(
    half_size: tuple[float, float, float], exponents: tuple[float, float], steepest: float
) -> Grips:
    """Of a superellipsoid, along each axis, where its surface is not steeper than a friction cone.

    Solved for one coordinate, its equation (see `meshes.superellipsoid_scale`) gives the surface above a
    place; how far it falls beside the place in two directions says how flat it is.

    Args:
        half_size: Half sizes ``(3,)``, metres.
        exponents: ``(e1, e2)``.
        steepest: Radians between a normal and the closing axis.
    """
    parts = []
    for k in (1, 0, 2):
        u, v = ((0, 2), (1, 2), (0, 1))[(1, 0, 2).index(k)]
        full = [2 * h for h in half_size]
        along_u, along_v = sides(full[u]), heights(full[v]) if v == 2 else sides(full[v])
        for a in along_u:
            for b in along_v:
                place = np.zeros(3)
                place[u], place[v] = a, b
                level = _above(place, k, half_size, exponents)
                slopes, drops = [], []
                for other in (u, v):
                    low, high = (
                        _above(_moved(place, other, s), k, half_size, exponents) for s in (-BESIDE, BESIDE)
                    )
                    slopes.append((high - low) / (2 * BESIDE))
                    drops.append(level - (high + low) / 2)
                steep = math.atan(math.hypot(*slopes))
                if level > 0 and steep < steepest:
                    axis = np.eye(3)[k]
                    firm = (1.0 - 0.6 * steep / steepest) * curved(max(0.0, float(np.mean(drops))))
                    parts.append(across(axis.tolist(), 2 * level, [place.tolist()], firm))
    return not_too_wide(parts)


def _moved(place: Array, axis: int, by: float) -> Array:
    moved = place.copy()
    moved[axis] += by
    return moved


def _above(
    place: Array, k: int, half_size: tuple[float, float, float], exponents: tuple[float, float]
) -> float:
    """Coordinate ``k`` of the surface where its others are those of a place; 0 outside of it."""
    e1, e2 = exponents
    x, y, z = np.abs(place) / np.array(half_size)
    if k == 2:
        rest = 1.0 - (x ** (2 / e2) + y ** (2 / e2)) ** (e2 / e1)
        share = max(rest, 0.0) ** (e1 / 2)
    else:
        rest = max(1.0 - z ** (2 / e1), 0.0) ** (e1 / e2) - (y if k == 0 else x) ** (2 / e2)
        share = max(rest, 0.0) ** (e2 / 2)
    return float(half_size[k] * share)
