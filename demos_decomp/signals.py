"""Even sampling, smoothing and turning points of what sensors recorded."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.demos_decomp.log import Demonstration, Floats

RATE = 50.0
"""Samples per second to which every demonstration is brought."""
MOST_POSES = 4_000_000
"""Poses of hand and objects after sampling: eleven hours with one object, one hour with twenty."""

SMOOTHING = 0.06
"""Standard deviation in seconds of the Gaussian that takes off tremor (8 to 12 Hz) and sensor noise."""


@dataclass(frozen=True)
class SmoothMotion:
    """A demonstration on an even time grid, smoothed.

    Attributes:
        time: ``(N,)`` seconds, evenly spaced.
        hand: ``(N, 7)`` pose of the hand.
        opening: ``(N,)`` metres.
        objects: ``(N, 7)`` poses by name.
        noise: Standard deviation in metres of each smoothed object's position, one axis, by name.
        opening_noise: The same of the smoothed opening.
        sampled: ``(T,)`` times of the recorded samples, seconds.
    """

    time: Floats
    hand: Floats
    opening: Floats
    objects: dict[str, Floats]
    noise: dict[str, float]
    opening_noise: float
    sampled: Floats

    def gap(self, first: int, last: int) -> float:
        """Longest time in seconds without a sample, of those that touch a span of indices."""
        start, end = np.searchsorted(self.sampled, [self.time[first], self.time[last]])
        steps = np.diff(self.sampled[max(start - 1, 0) : end + 1])
        return float(steps.max()) if len(steps) else 0.0

    def at(self, seconds: float) -> int:
        """Index of the sample nearest to a time."""
        return int(np.clip(round((seconds - self.time[0]) * RATE), 0, len(self.time) - 1))


def evenly_sampled(demonstration: Demonstration) -> SmoothMotion:
    """Brings a demonstration to `RATE`, fills dropped samples in and takes off tremor and noise.

    Args:
        demonstration: A checked demonstration.

    Returns:
        The motion. Positions and the opening are interpolated linearly, rotations along the shortest arc.

    Raises:
        InputError: It lasts so long, with so many objects, that there would be more than `MOST_POSES`.
    """
    time = demonstration.time
    count = max(2, int(np.floor((time[-1] - time[0]) * RATE + 1e-6)) + 1)
    if count * (1 + len(demonstration.objects)) > MOST_POSES:
        raise InputError(
            f"demonstration '{demonstration.name}' lasts {time[-1] - time[0]:.0f} s, too long to look at in "
            f"one piece with the tracks of its objects ({len(demonstration.objects)}); split the log"
        )
    grid = time[0] + np.arange(count) / RATE
    tracks = {name: track.pose for name, track in demonstration.objects.items()}
    rate = 1.0 / float(np.median(np.diff(time)))
    opening = np.interp(grid, time, demonstration.hand_opening)
    return SmoothMotion(
        time=grid,
        hand=_smooth_poses(_resample(time, demonstration.hand_pose, grid)),
        opening=smooth(opening),
        objects={name: _smooth_poses(_resample(time, track, grid)) for name, track in tracks.items()},
        noise={name: left_noise(track[:, :3], rate) for name, track in tracks.items()},
        opening_noise=left_noise(demonstration.hand_opening[:, None], rate),
        sampled=time,
    )


def smooth(values: Floats, seconds: float = SMOOTHING) -> Floats:
    """Gaussian smoothing without delay of ``(N,)`` or ``(N, k)``, ends held."""
    reach = int(np.ceil(3 * seconds * RATE))
    offsets = np.arange(-reach, reach + 1)
    kernel = np.exp(-0.5 * (offsets / (seconds * RATE)) ** 2)
    kernel /= kernel.sum()
    columns = values.reshape(len(values), -1)
    padded = np.pad(columns, ((reach, reach), (0, 0)), mode="edge")
    done = np.stack([np.convolve(column, kernel, mode="valid") for column in padded.T], axis=1)
    return done.reshape(values.shape)


def left_noise(values: Floats, rate: float) -> float:
    """Standard deviation that is left of white sensor noise after smoothing.

    The noise of one sample is judged from second differences by their median, so that motion and jumps do
    not count; the Gaussian then averages over about ``2 sqrt(pi) SMOOTHING rate`` samples.

    Args:
        values: ``(T, k)`` as recorded.
        rate: Samples per second of the recording.
    """
    if len(values) < 5:
        return 0.0
    second = np.diff(values, n=2, axis=0)
    one_sample = float(np.median(np.abs(second))) / 0.6745 / np.sqrt(6.0)
    return float(one_sample / max(1.0, np.sqrt(2 * np.sqrt(np.pi) * SMOOTHING * rate)))


def speed(values: Floats) -> Floats:
    """Speed ``(N,)`` of a position ``(N, k)`` on the even grid."""
    return np.asarray(np.linalg.norm(np.gradient(values, 1 / RATE, axis=0), axis=1))


@dataclass(frozen=True)
class Swing:
    """A rise or a fall of a signal between two turning points.

    Attributes:
        first: Index at which a tenth of the change is done.
        last: Index at which nine tenths of it are done.
        change: Signed change from turning point to turning point.
    """

    first: int
    last: int
    change: float


def swings(values: Floats, threshold: float) -> list[Swing]:
    """Rises and falls larger than a threshold, alternating, in order.

    A turning point counts once the signal has come back from it by more than the threshold, so that noise
    and tremor below the threshold make none, however fast or slow the motion is.

    Args:
        values: ``(N,)`` signal.
        threshold: Smallest change that counts.
    """
    turns = [0]
    extreme = low = high = 0
    direction = 0
    for i, value in enumerate(values):
        if direction == 0:
            low = i if value < values[low] else low
            high = i if value > values[high] else high
            if values[high] - value > threshold:
                turns.append(high)
                direction, extreme = -1, i
            elif value - values[low] > threshold:
                turns.append(low)
                direction, extreme = 1, i
        elif direction * (value - values[extreme]) > 0:
            extreme = i
        elif direction * (values[extreme] - value) > threshold:
            turns.append(extreme)
            direction, extreme = -direction, i
    turns.append(extreme if direction else len(values) - 1)
    found = []
    for a, b in pairwise(turns):
        change = float(values[b] - values[a])
        if abs(change) <= threshold:
            continue
        done = (values[a : b + 1] - values[a]) / change
        first = a + int(np.flatnonzero(done <= 0.1)[-1])
        last = a + int(np.flatnonzero(done >= 0.9)[0])
        found.append(Swing(min(first, last), max(first, last), change))
    return found


def simplified(points: Floats, tolerance: float) -> NDArray[np.int64]:
    """Indices of the points that a polyline needs to stay within a tolerance of a path.

    After Ramer (1972) and Douglas and Peucker (1973); the ends are always kept.

    Args:
        points: ``(N, 3)`` path in metres.
        tolerance: Largest distance in metres between path and polyline.
    """
    keep = {0, len(points) - 1}
    stack = [(0, len(points) - 1)]
    while stack:
        a, b = stack.pop()
        if b - a < 2:
            continue
        distances = distance_to_segment(points[a + 1 : b], points[a], points[b])
        worst = int(np.argmax(distances))
        if distances[worst] > tolerance:
            middle = a + 1 + worst
            keep.add(middle)
            stack += [(a, middle), (middle, b)]
    return np.array(sorted(keep), dtype=np.int64)


def distance_to_segment(points: Floats, a: Floats, b: Floats) -> Floats:
    """Distance ``(N,)`` of points ``(N, 3)`` from the straight segment between two points ``(3,)``."""
    along = b - a
    length = float(along @ along)
    share = np.clip((points - a) @ along / length, 0, 1) if length > 0 else np.zeros(len(points))
    return np.asarray(np.linalg.norm(points - a - share[:, None] * along, axis=1))


def _resample(time: Floats, track: Floats, grid: Floats) -> Floats:
    after = np.clip(np.searchsorted(time, grid, side="right"), 1, len(time) - 1)
    share = (grid - time[after - 1]) / (time[after] - time[after - 1])
    return np.asarray(poses.interpolate(track[after - 1], track[after], np.clip(share, 0, 1)))


def _smooth_poses(track: Floats) -> Floats:
    rotation = track[:, 3:].copy()
    flips = np.cumprod(np.where(np.sum(rotation[1:] * rotation[:-1], axis=1) < 0, -1.0, 1.0))
    rotation[1:] *= flips[:, None]
    rotation = smooth(rotation)
    rotation /= np.maximum(np.linalg.norm(rotation, axis=1, keepdims=True), 1e-9)
    return np.concatenate([smooth(track[:, :3]), rotation], axis=1)
