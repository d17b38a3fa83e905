"""Reference motions: smooth tool paths through waypoints, as tables that are cheap to sample.

A path is planned once, when a concept becomes active, and then only looked up at every tick.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, array_namespace

SHARP = np.cos(np.radians(100.0))
"""Cosine of the angle between two segments from which on a path turns back. The way round such a corner has
next to no length, and an even speed along it would be a jerk; it is taken at even acceleration."""
TURN_BACK = 2.5
"""Acceleration of the tool where a path turns back, m/s^2, at most: less than arms and their guards allow."""
_SAMPLES = 33


class Path(NamedTuple):
    """A tool path in time; batch dimensions ``(...)``.

    Attributes:
        table: Poses ``(..., n, 7)`` at equal steps of the path's own parameter in [0, 1].
        duration: ``(...)`` seconds.
    """

    table: Array
    duration: Array


def minimum_jerk(fraction: Array) -> Array:
    """Position of a minimum-jerk motion from 0 to 1 at a fraction ``(...)`` of its duration.

    Source: T. Flash and N. Hogan, "The coordination of arm movements", J. Neuroscience 5(7), 1985.
    """
    return fraction * fraction * fraction * (10.0 - 15.0 * fraction + 6.0 * fraction * fraction)


def plan(
    waypoints: Sequence[Array],
    speed: float,
    turn: float = 1.5,
    blend: float = 0.05,
    shortest: float = 0.3,
    acceleration: float = math.inf,
    samples: int = _SAMPLES,
) -> Path:
    """A path through waypoints whose corners are rounded and whose peak speeds are bounded.

    Args:
        waypoints: Poses ``(7,)``, at least one.
        speed: Peak speed, m/s.
        turn: Peak turning rate, rad/s.
        blend: A corner is rounded from this distance before to this distance after it, metres; never more
            than half of a segment. A path that turns back (`SHARP`) does so within twice that.
        shortest: Least duration, s.
        acceleration: Peak acceleration along the path, m/s^2. Without it short paths are hurried.
        samples: Rows of the table; two are exact for a straight path.

    Returns:
        A path whose time law is minimum jerk over the path's length.
    """
    line, ways, reversal = _rounded(waypoints, blend)
    fastest = min(speed, math.sqrt(TURN_BACK * reversal))
    lengths = [
        max(way, float(poses.angle_between(a[3:], b[3:])) * speed / turn)
        for way, (a, b) in zip(ways, itertools.pairwise(line), strict=True)
    ]
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    total = float(along[-1])
    peak = 1.875  # of a minimum-jerk motion, over its mean speed
    hardest = 10.0 / math.sqrt(3.0)  # peak acceleration of a minimum-jerk motion, over length by time squared
    duration = max(shortest, peak * total / fastest, math.sqrt(hardest * total / acceleration))
    table = np.empty((samples, 7))
    for i, s in enumerate(np.linspace(0.0, total, samples)):
        k = min(int(np.searchsorted(along, s, side="right")) - 1, len(line) - 2) if total > 0 else 0
        if len(line) == 1 or lengths[k] == 0.0:
            table[i] = line[min(k, len(line) - 1)]
        else:
            table[i] = poses.interpolate(line[k], line[k + 1], (s - along[k]) / lengths[k])
    return Path(table, np.float64(duration))


def sample(path: Path, time: Array) -> Array:
    """Poses ``(..., 7)`` of a path at ``time (...)`` seconds since its begin; it stays at its end."""
    table = path.table
    if type(table) is np.ndarray and table.ndim == 2:
        f = min(max(float(time) / float(path.duration), 0.0), 1.0)
        s = float(minimum_jerk(f)) * (table.shape[0] - 1)
        i = min(int(s), table.shape[0] - 2)
        return poses.interpolate(table[i], table[i + 1], s - i)
    xp = array_namespace(table)
    n = table.shape[-2]
    s = minimum_jerk(xp.clip(time / path.duration, 0.0, 1.0)) * (n - 1)
    i = xp.clip(xp.astype(xp.floor(s), xp.int64), 0, n - 2)
    index = xp.broadcast_to(i[..., None, None], (*i.shape, 1, 7))
    a = xp.take_along_axis(table, index, axis=-2)[..., 0, :]
    b = xp.take_along_axis(table, index + 1, axis=-2)[..., 0, :]
    return poses.interpolate(a, b, s - xp.astype(i, s.dtype))


def _rounded(
    waypoints: Sequence[Array], blend: float, pieces: int = 6
) -> tuple[list[Array], list[float], float]:
    """A line with rounded corners, the metres that each piece counts for, and those before a reversal."""
    line, ways, reversal = [np.asarray(waypoints[0], float)], [], math.inf

    def go(pose: Array, way: float | None = None) -> None:
        ways.append(float(np.linalg.norm(pose[:3] - line[-1][:3])) if way is None else way)
        line.append(pose)

    for k in range(1, len(waypoints) - 1):
        before, corner, after = line[-1], np.asarray(waypoints[k], float), np.asarray(waypoints[k + 1], float)
        into = float(np.linalg.norm(corner[:3] - before[:3]))
        out = float(np.linalg.norm(after[:3] - corner[:3]))
        if min(into, out) < 1e-6:
            go(corner)
            continue
        first, last, way = min(blend, into / 2), min(blend, out / 2), None
        if (corner[:3] - before[:3]) @ (after[:3] - corner[:3]) < SHARP * into * out:
            first = last = min(2 * blend, into if k == 1 else into / 2, out / 2)
            reversal = min(reversal, first)
            way = 2 * first / (pieces - 1)  # even steps of a Bezier curve's parameter: even acceleration
        a = poses.interpolate(before, corner, 1.0 - first / into)
        b = poses.interpolate(corner, after, last / out)
        go(a)
        for t in np.linspace(0.0, 1.0, pieces)[1:]:  # quadratic Bezier curve (de Casteljau)
            go(poses.interpolate(poses.interpolate(a, corner, t), poses.interpolate(corner, b, t), t), way)
    go(np.asarray(waypoints[-1], float))
    return line, ways, reversal
