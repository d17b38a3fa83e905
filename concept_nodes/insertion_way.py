"""The way of something that is held to before a hole, and straight in or out, yielding to the walls."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept_nodes.closer import BROUGHT, CARRIED, TOUCHING, with_room
from bt_tasksim.concept_nodes.insertion import fitting_poses, hole_of, in_fingers
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.world import FURNITURE, PlaceModel
from bt_tasksim.planning.reference_motion import Path
from bt_tasksim.planning.route import Pace, Route
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import Held, Leave
from bt_tasksim.planning.ways import WayFinder

STANDOFF = 0.015
"""Metres before the mouth at which it comes to rest, is lined up anew and goes straight in."""
ROOMS = (CARRIED, BROUGHT, TOUCHING)
"""How much closer than usual one may come to things, tried one after the other."""
OTHERS, POSTURES = 8, 4
"""Ways round in which it may go in, and postures before the mouth, that are tried."""
HELD_BY = 0.015
"""Metres of what is in a hole by which fingers hold it, at least."""
ROWS = 33
"""Poses straight in, or out, for which joints are computed."""
YIELDS, MOST = 0.0004, 0.004
"""Metres a second for each newton from aside with which it yields to a wall, and how far at most."""


class WayIn(NamedTuple):
    """The way into a hole in one world.

    Attributes:
        route: The motion to before the mouth.
        joints: The arm's ``(n, n_arm)`` from there straight in, evenly along the way.
        start: Pose ``(7,)`` of the object before the mouth.
        end: Where it should end.
        lies: How it lies in the hand ``(7,)``, as seen from where it seems to be.
    """

    route: Route
    joints: Array
    start: Array
    end: Array
    lies: Array


def ends_in(view: WorldView, target: str, into: str, leading: Array | None, share: float) -> Array:
    """Poses ``(k, 7)`` in which an object may end in a hole, see `fitting_poses`.

    Args:
        view: The world.
        target: The object.
        into: The hole.
        leading: Axis of the object that goes in first.
        share: How deep, of the hole's depth.

    Raises:
        NoWayError: It is no hole, or it does not fit.
    """
    hole = hole_of(view, into)
    found = fitting_poses(view, target, hole, leading)
    return poses.shifted(found, (1.0 - share) * hole.height * poses.z_axis(np.asarray(hole.pose)[3:]))


def way_in(
    view: WorldView, target: str, into: str, leading: Array | None, share: float, speed: float
) -> WayIn:
    """The way, with what is held turned as little as it may be; arguments as of `ends_in`.

    Raises:
        NoWayError: There is none; says what is in the way.
    """
    hole, held, seen = hole_of(view, into), in_fingers(view, target), view.objects[target]
    ends = ends_in(view, target, into, leading, share)[:OTHERS]
    grip = poses.relative(held, view.tool)
    carried = Held(target, poses.relative(view.tool, held), pieces_of(view.model(target)))
    back = (share * hole.height + STANDOFF) * poses.z_axis(np.asarray(hole.pose)[3:])
    leave = Leave(held={hole.fixture or FURNITURE})
    inside = view.finder([target], held=carried, leave=leave, closer=TOUCHING)

    def find(room: tuple[float, Array]) -> WayIn:
        closer, end = room
        start = poses.shifted(end, back)
        finder = view.finder([target], held=carried, closer=closer)
        tools = poses.multiply(np.array([start, end]), grip[None])
        line = np.repeat(tools[:1], ROWS, axis=0)
        line[:, :3] += np.linspace(0.0, 1.0, ROWS)[:, None] * (tools[1] - tools[0])[None, :3]
        good = []
        for q in itertools.islice(finder.postures(tools[0]), POSTURES):
            joints = inside.arm.along(q, line[1:])
            if joints is not None and inside.clear(np.concatenate([q[None], joints])):
                good.append(np.concatenate([q[None], joints]))
        if not good:
            why = _why_not(finder, inside, tools)
            raise NoWayError(f"{target} cannot be pushed into {into}: {why}")
        route = finder.search_posture(np.array([joints[0] for joints in good]), Pace(speed))
        nearest = min(good, key=lambda joints: float(abs(joints[0] - route.joints[-1]).max()))
        return WayIn(route, nearest, start, end, poses.relative(seen, held))

    try:
        return with_room(itertools.product(ROOMS, ends), find)
    except NoWayError as error:
        if short := _too_short(view, target, hole, ends, share):
            raise NoWayError(f"{target} cannot be pushed into {into}: {short}") from error
        raise


def _too_short(view: WorldView, target: str, hole: PlaceModel, ends: Array, share: float) -> str:
    """That nothing would stick out of a hole by which a hand could hold it; empty where some does."""
    out = poses.z_axis(np.asarray(hole.pose)[3:])
    corners = np.concatenate(pieces_of(view.model(target)))
    reach = max(float((poses.rotate(end[3:], corners) @ out).max() + end[:3] @ out) for end in ends)
    sticks = reach - float(np.asarray(hole.pose)[:3] @ out) - hole.height
    if sticks >= HELD_BY:
        return ""
    return (
        f"only {1000 * max(sticks, 0.0):.0f} mm of it would stick out for the fingers: push it in less far "
        f"(share={max(0.0, share - (HELD_BY - sticks) / hole.height):.1f})"
    )


def _why_not(finder: WayFinder, inside: WayFinder, tools: Array) -> str:
    """Why the hand cannot be before a hole or in it, tool poses ``(2, 7)``."""
    if not finder.ends(tools[:1]).free[0]:
        return finder.no_end(tools[:1])
    if not inside.ends(tools[1:]).free[0]:
        return inside.no_end(tools[1:])
    return "the arm cannot follow the way in"


def joints_line(joints: Array, tool: Array) -> Path:
    """The arm's joints along straight ways as paths of one second, which are asked for shares of the ways.

    Args:
        joints: Joints ``(N, n, n_arm)`` evenly along the ways.
        tool: Poses ``(N, 7)`` that stand for the paths' own, for which nobody asks.
    """
    xp, one = array_namespace(tool), array_namespace(tool).ones_like(tool[:, 0])
    table = xp.zeros((*joints.shape[:2], 7), dtype=tool.dtype, device=tool.device) + tool[:, None, :]
    return Path(table, one, joints, one > 0.0)


def yielding(offset: Array, force: Array, way: Array, middle: Array, period: float, most: float) -> Array:
    """Offsets ``(N, 3)`` aside of straight ways for the next tick, as what is led there yields to walls.

    Args:
        offset: Those of this one, metres.
        force: Forces ``(N, 3)``, N.
        way: Unit vectors ``(N, 3)`` along the ways.
        middle: Offsets ``(N, 3)`` from which it goes no farther than `MOST`, metres.
        period: Seconds until then.
        most: Metres that it goes until then at most, along each axis.
    """
    across = force - poses.dot(force, way)[:, None] * way
    moved = offset + poses.clip(YIELDS * period * across, -most, most)
    return middle + poses.clip(moved - middle, -MOST, MOST)


def sides_of(rotation: Array, inward: Array) -> Array:
    """Unit vectors ``(N, 2, 3)`` across ways: where a hand holds loosely, and at right angles to that.

    Fingers hold firmly across their faces, the tool's y; along x and z they may hold anywhere.
    """
    xp = array_namespace(rotation)
    axes = [poses.rotate(rotation, constant(axis, inward)) for axis in ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])]
    across = [axis - poses.dot(axis, inward)[:, None] * inward for axis in axes]
    first = xp.where((poses.norm(across[0]) > 0.5)[:, None], across[0], across[1])
    first = first / poses.norm(first)[:, None]
    return xp.stack([first, poses.cross(inward, first)], axis=1)
