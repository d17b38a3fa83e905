"""Where something that does not go into a hole is held up, by what the wrist feels, and how it gets away.

What stands on an edge is pushed back there, along the way in. With the force f at r from the tool the torque
at the tool is r x f; the end's distance along the way in is known, and so r follows.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.grasp_pose import half_extent
from bt_tasksim.concept_nodes.limits import force_at_tool, torque_at_tool
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace, constant

LEAST = 2.0
"""Newtons of a push that say where it is."""
CORNER = 0.35
"""Share of a half width from the middle from which on a push comes from that side."""
TIGHT, LONG = 2.5, 2.0
"""How many times as much room as the other way a thing has where it does not stand on an edge; and how many
times as long as wide what is turned is, too."""
STEP, LEAST_STEP, TURN = 0.001, 0.0004, math.radians(0.5)
"""Metres, at most and at least, and radians by which it goes away from an edge."""


class Edges(NamedTuple):
    """A hole and what goes into it, in ``N`` worlds.

    Attributes:
        axes: Unit vectors ``(N, 2, 3)`` along its widths, robot base frame.
        half: Half widths ``(N, 2)`` along them of what goes in, metres.
        room: By how much the hole is wider on each side ``(N, 2)``, metres.
        low: From the middle of what goes in to its end ``(N,)``, metres.
    """

    axes: Array
    half: Array
    room: Array
    low: Array


def edges_of(seen: Seen, target: str, hole: str, end: Array) -> Edges:
    """See `Edges`.

    Args:
        seen: The worlds.
        target: What goes in.
        hole: Into what.
        end: Its poses ``(N, 7)`` in there.
    """
    xp, place, model = array_namespace(end), seen.place(hole), seen.model(target)
    nothing = 0.0 * end[:, :3]
    axes = [poses.rotate(place.pose[:, 3:], constant(axis, end) + nothing) for axis in _AXES]
    halves = [half_extent(end, model, axis) for axis in axes]
    half = xp.stack(halves[:2], axis=-1)
    room = poses.clip(place.extent / 2.0 - half, 1e-4, math.inf)
    return Edges(xp.stack(axes[:2], axis=1), half, room, halves[2])


def wrench_of(seen: Seen) -> Array:
    """Force and torque ``(N, 6)`` at the tool, robot base frame, N and Nm."""
    return array_namespace(seen.tool).concat([force_at_tool(seen), torque_at_tool(seen)], axis=-1)


def held_up_at(tool: Array, now: Array, load: Array, inward: Array, edges: Edges) -> Array:
    """How hard something is held up, N, and that times where ``(N, 3)`` from its middle: ``(N, 4)``.

    Args:
        tool: Tool poses ``(N, 7)``.
        now: Its poses ``(N, 7)``.
        load: Force and torque ``(N, 6)`` at the tool, but for weights.
        inward: Unit vectors ``(N, 3)`` into the hole.
        edges: The hole.
    """
    xp = array_namespace(tool)
    force, middle = load[:, :3], now[:, :3] - tool[:, :3]
    push, along = -poses.dot(force, inward), poses.dot(middle, inward)
    torque = load[:, 3:] - (along + edges.low)[:, None] * poses.cross(inward, force)
    aside = middle - along[:, None] * inward
    found = xp.concat([push[:, None], poses.cross(torque, inward) - push[:, None] * aside], axis=-1)
    return xp.where((push > LEAST)[:, None], found, xp.zeros_like(found))


def away(felt: Array, inward: Array, edges: Edges) -> tuple[Array, Array]:
    """Metres ``(N, 3)`` by which to go away from an edge, and radians ``(N,)`` by which to turn.

    Args:
        felt: Sums ``(N, 4)`` of what `held_up_at` says.
        inward: Unit vectors ``(N, 3)`` into the hole.
        edges: The hole.
    """
    xp, push = array_namespace(felt), felt[:, 0]
    known = push > LEAST
    place = felt[:, 1:] / xp.where(known, push, xp.ones_like(push))[:, None]
    nothing, step = xp.zeros_like(edges.half), poses.clip(xp.min(edges.room, axis=-1), LEAST_STEP, STEP)
    shares = xp.stack([poses.dot(place, edges.axes[:, k, :]) for k in (0, 1)], axis=-1) / edges.half
    from_side = known[:, None] & (abs(shares) > CORNER)
    tight = edges.room <= TIGHT * xp.min(edges.room, axis=-1)[:, None]
    ways = xp.where(from_side & tight, -xp.sign(shares), nothing) * step[:, None]
    aside = ways[:, :1] * edges.axes[:, 0, :] + ways[:, 1:] * edges.axes[:, 1, :]
    # Held up at a corner: that also moves away where it is turned.
    long = xp.max(edges.half, axis=-1) > LONG * xp.min(edges.half, axis=-1)
    moves = poses.cross(inward, place)
    turns = xp.stack([poses.dot(moves, edges.axes[:, k, :]) for k in (0, 1)], axis=-1) * ways
    turns = xp.sign(turns[:, 0] + turns[:, 1]) * TURN
    corner = long & xp.all(from_side, axis=-1)
    return aside, xp.where(corner, turns, xp.zeros_like(turns))


_AXES = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
