"""Free spots for an object, anywhere on a surface or next to another object, in one world.

They are looked for from above: on a grid, in some headings, inside of the edges and clear of the outlines of
what stands at the same height. Whether an arm can put the object there is asked afterwards, of a few of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept_nodes.standing import reference_frame, standing_height, supports_of
from bt_tasksim.concept_nodes.surface import heading_of, upright
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel
from bt_tasksim.planning.room import Room
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import box_corners
from bt_tasksim.scene.outlines import hull, rectangle

STEP = 0.03
"""Metres between the points of the grid."""
TURNS = 8
"""Headings that are tried, from one along the surface's edges on; every second one is along them."""
EDGE = 0.01
"""Metres between an outline and the edge, where the surface is large enough for that."""
LEAST, AMPLE = 0.012, 0.06
"""Metres of room around an outline: the least, and what is sought after for the fingers of an opening
hand."""
APART = (0.12, 0.06, 0.0)
"""Metres between spots that are tried one after the other: far from each other first, since what is wrong
with one is mostly wrong with its neighbours, too."""
MOST = 40
"""Spots that are tried."""
PLACES, HANDFUL = 4, 16
"""How many places, and spots there, a grasp is asked to serve one of."""
AROUND = 24
"""Directions in which one stands beside another."""
GAP = 0.04
"""Metres between the outlines of two objects of which one is put beside the other."""
SHARES = (1.0, 1.75, 0.5)
"""Shares of the gap between two objects that are tried."""
TURNED = 0.06
"""Metres of way that one radian of turn counts for."""
CROWDED = 2.0
"""Metres of way that one metre of missing room counts for."""
RESERVED = 1.0
"""Metres of way that it counts to stand on a spot that is marked for something else."""
LEVEL = 0.02
"""Metres by which surfaces of one level may seem to differ."""
TOUCHING = 0.005
"""Metres by which what stands on a surface, or is the surface, may seem to be in it."""


class Spots(NamedTuple):
    """Free spots, the preferred ones first.

    Attributes:
        poses: Poses ``(k, 7)`` of the object standing there.
        rims: Metres ``(k,)`` above the surface that it has to be lifted over on its way there.
        supports: Names of what it touches there.
        few: Indices of those, at some places far from each other, of which a grasp has to serve one.
    """

    poses: Array
    rims: Array
    supports: frozenset[str]
    few: list[int]


class FreeSurface(NamedTuple):
    """A rectangle on which things stand.

    Attributes:
        frame: Its frame ``(7,)``.
        centre: Its middle ``(2,)`` in that frame, metres.
        half: Its half size ``(2,)``.
        rim: Height of what is around it, metres.
        name: Name of the place or the object.
    """

    frame: Array
    centre: Array
    half: Array
    rim: float
    name: str


class _Found(NamedTuple):
    """Spots in some order.

    Attributes:
        points: The object's middle from above ``(k, 2)``.
        turns: Numbers of its headings ``(k,)``.
        cost: What it costs to stand there ``(k,)``, metres.
        turned: What it costs to turn that way ``(k,)``, metres.
        on: Numbers of the surfaces ``(k,)``.
    """

    points: Array
    turns: Array
    cost: Array
    turned: Array
    on: Array

    def at(self, which: Array | list[int]) -> _Found:
        """Some of them."""
        return _Found(*(values[which] for values in self))


def spots_on(view: WorldView, target: str, place: str) -> Spots:
    """Where an object may stand on a place or on another object, anywhere on it.

    Raises:
        NoWayError: There is no room.
    """
    surface = surface_of(view, place)
    search = _Search(view, target, surface.frame, (place,))
    return search.spots(list(_free_on(surface, search)), [surface], f"anywhere on {place}")


def has_room(view: WorldView, target: str, place: str, margin: float = 0.0) -> bool:
    """There is a spot where an object may stand on a place or on another object, as of `spots_on`.

    What was never seen finds no room, and nothing does on what was never seen.

    Args:
        view: The world.
        target: The object.
        place: The place, or the other object.
        margin: Metres of room around the object, more than the least.
    """
    known = (view.objects.get(target), view.objects.get(place, np.zeros(7)))
    if place not in view.world.places and place not in view.objects:
        return False
    if any(pose is None or not bool(np.isfinite(pose).all()) for pose in known):
        return False
    surface = surface_of(view, place)
    search = _Search(view, target, surface.frame, (place,), LEAST + margin)
    return any(len(found.points) for found in _free_on(surface, search))


def _free_on(surface: FreeSurface, search: _Search) -> Iterator[_Found]:
    """Free spots on a surface, one heading after the other."""
    for turn, outline in enumerate(search.outlines):
        points = _grid(surface, outline)
        away = np.linalg.norm(points - surface.frame[:2], axis=1)
        yield search.rated(points, turn, away, 0)


def spots_beside(view: WorldView, target: str, other: str, gap: float = GAP) -> Spots:
    """Where an object may stand next to another one, on the surfaces on which that stands.

    Args:
        view: The world.
        target: The object.
        other: The other one.
        gap: Metres between their outlines; where there is no room for that, less or more.

    Raises:
        NoWayError: There is no room.
    """
    corners = corners_of(view, other)
    surfaces = _surfaces_below(view, corners, (target, other))
    if not surfaces:
        raise NoWayError(f"{other} stands on nothing that is known, so {target} cannot be put beside it")
    search = _Search(view, target, surfaces[0].frame, [surface.name for surface in surfaces])
    angles = 2 * np.pi * np.arange(AROUND) / AROUND
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    now = view.objects[target][:2]
    found = []
    for turn, outline in enumerate(search.outlines):
        room = Room(outline, [hull(corners[:, :2])])
        for share in SHARES:
            points = room.beside(directions, share * gap)
            for on, surface in enumerate(surfaces):
                held = points[_inside(surface, outline, points)]
                away = np.linalg.norm(held - now, axis=1) + abs(share - 1.0) * gap
                found.append(search.rated(held, turn, away, on, except_for=other))
    return search.spots(found, surfaces, f"beside {other}")


def supports_beside(view: WorldView, target: str, other: str) -> frozenset[str]:
    """Names of what an object touches that stands next to another one."""
    surfaces = _surfaces_below(view, corners_of(view, other), (target, other))
    return frozenset().union(*(supports_of(view, surface.name) for surface in surfaces))


def surface_of(view: WorldView, name: str) -> FreeSurface:
    """A place, or the top of an object, as a surface."""
    frame, rim = reference_frame(view, name)
    place = view.world.places.get(name)
    if place is None:
        extent, centre = np.array(view.model(name).extent[:2]), np.zeros(2)
    else:
        extent, centre = np.array(place.extent), np.array(place.centre)
    return FreeSurface(frame, centre, extent / 2, rim, name)


def _surfaces_below(view: WorldView, corners: Array, without: Sequence[str]) -> list[FreeSurface]:
    """The places and tops of objects, all on one level, on which something with ``corners (n, 3)`` stands."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    at = np.array([*((low + high) / 2)[:2], low[2]])
    seen = [n for n, pose in view.objects.items() if n not in without and bool(np.isfinite(pose).all())]
    found: list[tuple[float, FreeSurface]] = []
    for name in (*view.world.places, *seen):
        surface = surface_of(view, name)
        local = poses.localise(surface.frame, at)
        if abs(local[2]) < LEVEL and bool(np.all(np.abs(local[:2] - surface.centre) <= surface.half)):
            found.append((-float(local[2]), surface))
    highest = max((height for height, _ in found), default=0.0)
    return [surface for height, surface in found if height > highest - TOUCHING]


class _Search:
    """The search for spots on one level.

    Args:
        view: The world.
        target: The object.
        frame: Frame ``(7,)`` of the level.
        own: Places that may be stood on.
        least: Metres of room around the object.
    """

    def __init__(
        self, view: WorldView, target: str, frame: Array, own: Sequence[str], least: float = LEAST
    ) -> None:
        self._view, self._target, self._frame, self._least = view, target, frame, least
        model, now = view.model(target), view.objects[target]
        stands = upright(frame[None], now[None], np.array([model.cubic]))[0]
        along = float(np.subtract(*heading_of(np.stack([frame, np.concatenate([now[:3], stands])]))))
        first = (along + np.pi / 4) % (np.pi / 2) - np.pi / 4
        self._angles = first + 2 * np.pi * np.arange(TURNS) / TURNS
        self._rotations = poses.quat_multiply(np.array([poses.yaw(a) for a in self._angles]), stands[None])
        self._height = standing_height(model)
        self.outlines = [outline_turned(model, turned) for turned in self._rotations]
        self._things = _things(view, target, float(frame[2]), 2.0 * self._height)
        self._reserved = [
            outline_of(surface_of(view, name))
            for name, place in view.world.places.items()
            if place.kind == "spot" and name not in own and abs(place.pose[2] - frame[2]) < LEVEL
        ]
        self._bearing = float(np.arctan2(now[1], now[0]))

    def rated(self, points: Array, turn: int, away: Array, on: int, except_for: str = "") -> _Found:
        """Those of some points ``(k, 2)`` that are free.

        Args:
            points: Where the object's middle is from above.
            turn: Number of its heading.
            away: Metres ``(k,)`` that it costs to stand there.
            on: Number of the surface.
            except_for: What it may be as near to as it is.
        """
        outline = self.outlines[turn]
        gaps = Room(outline, [other for name, other in self._things if name != except_for]).gaps(points)
        near = Room(outline, [other for name, other in self._things if name == except_for]).gaps(points)
        free = (gaps > self._least) & (near > 0.0)
        covers = Room(outline, self._reserved).gaps(points) < 0.0
        bearing = np.arctan2(points[:, 1], points[:, 0]) - self._bearing
        turned = np.abs(np.angle(np.exp(1j * (self._angles[turn] - bearing))))
        crowded = np.maximum(AMPLE - gaps, 0.0)
        cost = np.round(away + CROWDED * crowded + RESERVED * covers, 9)
        numbers = np.ones(len(points), int)
        return _Found(points, turn * numbers, cost, TURNED * turned, on * numbers).at(free)

    def spots(self, found: Sequence[_Found], surfaces: Sequence[FreeSurface], where: str) -> Spots:
        """What was found, in the order in which it is to be tried.

        Raises:
            NoWayError: Nothing was.
        """
        joined = _Found(*(np.concatenate(parts) for parts in zip(*found, strict=True)))
        if not len(joined.points):
            raise NoWayError(f"there is no room for {self._target} {where}: take something away from there")
        ordered = joined.at(np.argsort(joined.cost, kind="stable"))
        # What a grasp has to serve may not depend on how the hand is going to hold it.
        few = _handful(ordered)
        easy = np.argsort(np.round(ordered.cost + ordered.turned, 9), kind="stable")
        spread = easy[_spread(ordered.points[easy], APART, MOST)].tolist()
        order = list(dict.fromkeys([*spread[:PLACES], *few, *spread]))
        chosen = ordered.at(order)
        heights = np.array([surfaces[k].frame[2] for k in chosen.on]) + self._height
        position = np.column_stack([chosen.points, heights])
        rims = np.array([surfaces[k].rim for k in chosen.on])
        supports = frozenset().union(*(supports_of(self._view, surface.name) for surface in surfaces))
        return Spots(
            np.concatenate([position, self._rotations[chosen.turns]], axis=-1),
            rims,
            supports,
            [order.index(k) for k in few],
        )


def _handful(found: _Found) -> list[int]:
    """Of spots in order, those at some places far from each other, each in quarters of a turn."""
    few: list[int] = []
    for k in _spread(found.points, APART[:1], PLACES):
        near = np.linalg.norm(found.points - found.points[k], axis=1) < STEP
        for turn in range(0, TURNS, 2):
            few += np.flatnonzero(near & (found.turns == turn))[:1].tolist()
    return few[:HANDFUL]


def _spread(points: Array, apart: Sequence[float], most: int) -> list[int]:
    """Numbers of ``points (k, 2)`` in order, those first that are far from each other."""
    out: list[int] = []
    for distance in apart:
        left = np.ones(len(points), bool)
        left[out] = False
        for k in out if distance else ():
            left &= np.linalg.norm(points - points[k], axis=1) >= distance
        while left.any() and len(out) < most:
            k = int(np.argmax(left))
            out.append(k)
            left[k] = False
            if distance:
                left &= np.linalg.norm(points - points[k], axis=1) >= distance
    return out


def _grid(surface: FreeSurface, outline: Array) -> Array:
    """Points ``(k, 2)`` from above at which an outline is on a surface; its origin is one, where it fits."""
    low, high = _reach(surface, outline)
    axes = []
    for k in range(2):
        first, last = np.ceil(low[k] / STEP), np.floor(high[k] / STEP)
        steps = STEP * np.arange(first, last + 1)
        axes.append(np.unique(np.round(np.concatenate([[low[k], high[k]], steps]), 9)))
    flat = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    level = np.concatenate([flat, np.zeros((len(flat), 1))], axis=1)
    found: Array = poses.transform(surface.frame[None], level)[:, :2]
    return found


def _reach(surface: FreeSurface, outline: Array) -> tuple[Array, Array]:
    """Lowest and highest coordinates ``(2,)`` in a surface's frame of an object that is on it.

    What is too large for it has its middle there.
    """
    flat = np.concatenate([outline, np.zeros((len(outline), 1))], axis=1)
    local = poses.rotate(poses.quat_conjugate(surface.frame[3:])[None], flat)[:, :2]
    low = surface.centre - surface.half + EDGE - local.min(axis=0)
    high = surface.centre + surface.half - EDGE - local.max(axis=0)
    fits = low <= high
    return np.where(fits, low, surface.centre), np.where(fits, high, surface.centre)


def _inside(surface: FreeSurface, outline: Array, points: Array) -> Array:
    """Booleans ``(k,)``: an outline at ``points (k, 2)`` is on a surface."""
    low, high = _reach(surface, outline)
    height = np.full((len(points), 1), surface.frame[2])
    local = poses.localise(surface.frame[None], np.concatenate([points, height], axis=1))[:, :2]
    found: Array = np.all((local >= low - 1e-9) & (local <= high + 1e-9), axis=1)
    return found


def _things(view: WorldView, target: str, floor: float, height: float) -> list[tuple[str, Array]]:
    """Outlines of what stands between a floor and a height above it; furniture has no name."""
    furniture = [("", poses.transform(box.pose, box_corners(box.size))) for box in view.world.obstacles]
    seen = [n for n, pose in view.objects.items() if n != target and bool(np.isfinite(pose).all())]
    found = []
    for name, corners in (*furniture, *((n, corners_of(view, n)) for n in seen)):
        if float(corners[:, 2].max()) > floor + TOUCHING and float(corners[:, 2].min()) < floor + height:
            found.append((name, hull(corners[:, :2])))
    return found


def corners_of(view: WorldView, name: str) -> Array:
    """Corners ``(n, 3)`` of an object's pieces where it is."""
    pose = poses.unit_pose(view.objects[name])
    return np.concatenate([poses.transform(pose, piece) for piece in pieces_of(view.model(name))])


def outline_turned(model: ObjectModel, rotation: Array) -> Array:
    """Corners ``(n, 2)`` of an object from above about its origin, turned by a rotation ``(4,)``, metres."""
    return hull(poses.rotate(rotation[None], np.concatenate(pieces_of(model)))[:, :2])


def outline_of(surface: FreeSurface) -> Array:
    """Corners ``(4, 2)`` of a surface from above, base frame, metres."""
    return rectangle(surface.frame, surface.centre, 2.0 * surface.half)
