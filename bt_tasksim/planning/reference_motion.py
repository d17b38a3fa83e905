"""Reference motions: smooth tool paths through waypoints, as tables that are cheap to sample.

A path is planned once, when a concept becomes active, and then only looked up at every tick. All arrays
have a leading axis of worlds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from bt_tasksim.core import poses
from bt_tasksim.core.fact_arrays import take_rows
from bt_tasksim.core.poses import Array, array_namespace

SHARP = math.cos(math.radians(100.0))
"""Cosine of the angle between two segments from which on a path turns back. The way round such a corner has
next to no length, and an even speed along it would be a jerk; it is taken at even acceleration."""
TURN_BACK = 2.5
"""Acceleration of the tool where a path turns back, m/s^2, at most: less than arms and their guards allow."""
_SAMPLES = 33


class Path(NamedTuple):
    """A tool path in time, in ``N`` worlds.

    Attributes:
        table: Poses ``(N, n, 7)`` at equal steps of the path's own parameter in [0, 1].
        duration: ``(N,)`` seconds.
        joints: ``(N, n, n_arm)`` the arm's joints there, where a way was searched for; else NaN. None: there
            is no such way in any world.
        even: Boolean ``(N,)``: the parameter is the share of the time; else it follows a minimum-jerk law.
            None: the law in all worlds.
    """

    table: Array
    duration: Array
    joints: Array | None = None
    even: Array | None = None


def minimum_jerk(fraction: Array) -> Array:
    """Position of a minimum-jerk motion from 0 to 1 at a fraction ``(...)`` of its duration.

    Source: T. Flash and N. Hogan, "The coordination of arm movements", J. Neuroscience 5(7), 1985.
    """
    return fraction * fraction * fraction * (10.0 - 15.0 * fraction + 6.0 * fraction * fraction)


def minimum_jerk_time(position: Array) -> Array:
    """The fraction ``(...)`` of its duration at which a minimum-jerk motion has come to a position in [0, 1].

    To 1e-4, by straight lines between a hundred points of `minimum_jerk`.
    """
    xp = array_namespace(position)
    fractions = xp.linspace(0.0, 1.0, 101, dtype=position.dtype, device=position.device)
    places = minimum_jerk(fractions)
    passed = xp.sum(xp.astype(places <= position[..., None], xp.int64), axis=-1)
    before = xp.clip(passed - 1, 0, 99)
    low, high = (xp.take(places, xp.reshape(index, (-1,))) for index in (before, before + 1))
    low, high = (xp.reshape(values, position.shape) for values in (low, high))
    return (xp.astype(before, position.dtype) + (position - low) / (high - low)) / 100


def plan(
    waypoints: Sequence[Array],
    speed: float,
    turn: float = 1.5,
    blend: float = 0.05,
    shortest: float = 0.3,
    acceleration: float = math.inf,
    samples: int = _SAMPLES,
) -> Path:
    """Paths through waypoints whose corners are rounded and whose peak speeds are bounded.

    Args:
        waypoints: Poses ``(N, 7)``, at least one. Where worlds have unlike many, the last one is repeated.
        speed: Peak speed, m/s.
        turn: Peak turning rate, rad/s.
        blend: A corner is rounded from this distance before to this distance after it, metres; never more
            than half of a segment. A path that turns back (`SHARP`) does so within twice that.
        shortest: Least duration, s.
        acceleration: Peak acceleration along the path, m/s^2. Without it short paths are hurried.
        samples: Rows of the table; two are exact for a straight path.

    Returns:
        Paths whose time law is minimum jerk over the path's length.
    """
    line, ways, reversal = _rounded(waypoints, blend)
    xp = array_namespace(line)
    zero = xp.zeros_like(reversal)
    fastest = xp.minimum(zero + speed, xp.sqrt(TURN_BACK * reversal))
    if line.shape[1] == 1:
        return Path(line + xp.zeros((1, samples, 1), dtype=line.dtype, device=line.device), zero + shortest)
    turned = poses.angle_between(line[:, :-1, 3:], line[:, 1:, 3:])
    turned = xp.where(xp.all(line[:, :-1, :] == line[:, 1:, :], axis=-1), xp.zeros_like(turned), turned)
    along = _summed(xp.maximum(ways, turned * (speed / turn)))
    total = along[:, -1]
    peak = 1.875  # of a minimum-jerk motion, over its mean speed
    hardest = 10.0 / math.sqrt(3.0)  # peak acceleration of a minimum-jerk motion, over length by time squared
    duration = xp.maximum(zero + shortest, peak * total / fastest)
    duration = xp.maximum(duration, xp.sqrt(hardest / acceleration * total))
    return Path(_spaced(line, along, samples), duration)


def sample(path: Path, time: Array) -> Array:
    """Poses ``(N, 7)`` of paths at ``time (N,)`` seconds since their begin; they stay at their ends."""
    return _posed(path, *_between(path, time))


def position(path: Path, time: Array) -> Array:
    """Positions ``(N, 3)`` on paths, those of `sample`."""
    index, share = _between(path, time)
    return _shared(path.table[..., :3], index, share)


def at_times(path: Path, time: Array) -> tuple[Array, Array | None]:
    """Poses of `sample`, and joints ``(N, n_arm)`` of the arm there, NaN where they may be any.

    They are None where no world has any.
    """
    index, share = _between(path, time)
    return _posed(path, index, share), None if path.joints is None else _shared(path.joints, index, share)


def _posed(path: Path, index: Array, share: Array) -> Array:
    return poses.interpolate(take_rows(path.table, index), take_rows(path.table, index + 1), share)


def _shared(table: Array, index: Array, share: Array) -> Array:
    """Between the rows ``(N,)`` of tables ``(N, n, k)`` and the next ones, by shares ``(N,)`` of the way."""
    first, last = take_rows(table, index), take_rows(table, index + 1)
    return first + share[:, None] * (last - first)


def searched_for(path: Path) -> Array | float:
    """Seconds ``(N,)`` that paths take which were searched for; others count as none."""
    if path.even is None:
        return 0.0
    xp = array_namespace(path.duration)
    return xp.where(path.even, path.duration, xp.zeros_like(path.duration))


def _between(path: Path, time: Array) -> tuple[Array, Array]:
    """Numbers ``(N,)`` of the rows before these times, and shares ``(N,)`` of the way to the next ones."""
    xp, n = array_namespace(path.table), path.table.shape[1]
    fraction = poses.clip(time / path.duration, 0.0, 1.0)
    place = minimum_jerk(fraction)
    if path.even is not None:
        place = xp.where(path.even, fraction, place)
    place = place * (n - 1)
    before = poses.clip(xp.floor(place), 0.0, n - 2.0)
    return xp.astype(before, xp.int64), place - before


def _summed(steps: Array) -> Array:
    """``(N, n)`` numbers as sums ``(N, n + 1)`` from zero on, each row for itself."""
    xp = array_namespace(steps)
    sums = [xp.zeros_like(steps[:, 0])]
    for k in range(steps.shape[1]):
        sums.append(sums[-1] + steps[:, k])
    return xp.stack(sums, axis=1)


def _spaced(line: Array, along: Array, samples: int) -> Array:
    """Poses ``(N, samples, 7)`` at equal distances of lines ``(N, n, 7)`` with places ``(N, n)``."""
    xp = array_namespace(line)
    shares = xp.linspace(0.0, 1.0, samples, dtype=line.dtype, device=line.device)
    wanted = shares[None, :] * along[:, -1:]
    passed = xp.sum(xp.astype(along[:, None, :] <= wanted[:, :, None], xp.int64), axis=-1)
    # The end is that of the last piece with a length: a waypoint that is repeated after it changes nothing.
    last = xp.sum(xp.astype(along < along[:, -1:], xp.int64), axis=-1)[:, None]
    k = xp.clip(xp.minimum(passed, last) - 1, 0, line.shape[1] - 2)
    begins = xp.take_along_axis(along, k, axis=1)
    length = xp.take_along_axis(along, k + 1, axis=1) - begins
    there = length > 0.0
    share = xp.where(
        there, (wanted - begins) / xp.where(there, length, xp.ones_like(length)), xp.zeros_like(length)
    )
    spread = xp.broadcast_to(k[..., None], (*k.shape, 7))
    first, last = (xp.take_along_axis(line, index, axis=1) for index in (spread, spread + 1))
    return poses.interpolate(first, last, share)


def _rounded(waypoints: Sequence[Array], blend: float, pieces: int = 6) -> tuple[Array, Array, Array]:
    """Lines with rounded corners.

    Returns:
        Poses ``(N, n, 7)``, the metres ``(N, n - 1)`` that each piece counts for, and those ``(N,)`` before
        a reversal.

    A corner that follows on another waypoint without a way between them is not rounded.
    """
    xp = array_namespace(waypoints[0])
    line, ways = [waypoints[0]], []
    reversal = xp.full_like(waypoints[0][:, 0], math.inf)
    straight = xp.ones_like(reversal) > 0.0  # no corner has been rounded so far

    def go(pose: Array, way: Array | None = None) -> None:
        ways.append(poses.norm(pose[:, :3] - line[-1][:, :3]) if way is None else way)
        line.append(pose)

    for k in range(1, len(waypoints) - 1):
        tip, corner, after = line[-1], waypoints[k], waypoints[k + 1]
        coming, going = corner[:, :3] - tip[:, :3], after[:, :3] - corner[:, :3]
        into, out = poses.norm(coming), poses.norm(going)
        rounds = xp.minimum(into, out) >= 1e-6
        back = rounds & (poses.dot(coming, going) < SHARP * into * out)
        room = xp.where(straight, into, into / 2)
        turned = xp.minimum(xp.minimum(xp.full_like(into, 2 * blend), room), out / 2)
        first = xp.where(back, turned, xp.minimum(xp.full_like(into, blend), into / 2))
        last = xp.where(back, turned, xp.minimum(xp.full_like(into, blend), out / 2))
        reversal = xp.where(back, xp.minimum(reversal, first), reversal)
        share_in = xp.where(rounds, first / xp.where(rounds, into, xp.ones_like(into)), xp.zeros_like(into))
        share_out = xp.where(rounds, last / xp.where(rounds, out, xp.ones_like(out)), xp.zeros_like(out))
        ends = poses.interpolate(
            xp.stack([tip, corner]), xp.stack([corner, after]), xp.stack([1.0 - share_in, share_out])
        )
        ends = xp.where(rounds[:, None], ends, corner)
        a, b = ends[0, ...], ends[1, ...]
        go(a)
        curve = _curve(a, corner, b, pieces)
        curve = xp.where(rounds[:, None], curve, corner)
        far = poses.norm(curve[:, :, :3] - xp.concat([a[None, ...], curve[:-1, ...]])[:, :, :3])
        # Even steps of a Bezier curve's parameter: even acceleration.
        far = xp.where(back, 2 * first / (pieces - 1), far)
        for j in range(pieces - 1):
            go(curve[j, ...], far[j, ...])
        straight = straight & ~rounds
    if len(waypoints) > 1:
        go(waypoints[-1])
    if not ways:
        return waypoints[0][:, None, :], xp.zeros_like(reversal)[:, None], reversal
    return xp.stack(line, axis=1), xp.stack(ways, axis=1), reversal


def _curve(a: Array, corner: Array, b: Array, pieces: int) -> Array:
    """Poses ``(pieces - 1, N, 7)`` on a quadratic Bezier curve after its begin (de Casteljau)."""
    xp = array_namespace(a)
    like = {"dtype": a.dtype, "device": a.device}
    shares = xp.asarray([j / (pieces - 1) for j in range(1, pieces)], **like)
    t = shares[:, None] + xp.zeros_like(a[:, 0])
    legs = poses.interpolate(
        xp.stack([a, corner])[:, None, ...], xp.stack([corner, b])[:, None, ...], t[None, ...]
    )
    return poses.interpolate(legs[0, ...], legs[1, ...], t)
