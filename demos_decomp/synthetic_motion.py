"""Motion of a person's hand, and what sensors make of it.

Reaching is a superposition of minimum-jerk strokes (Flash and Hogan, "The coordination of arm movements",
J. Neuroscience 5(7), 1985) that overlap a little where one passes into the next. On top come physiological
tremor (8 to 12 Hz), sensor noise, calibration errors and dropped samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.demos_decomp.log import Floats

FINE_RATE = 240.0
"""Samples per second at which motion is computed before sensors sample it."""


@dataclass(frozen=True)
class Sensing:
    """How well the recording was made; standard deviations unless stated otherwise.

    Attributes:
        rate: Samples per second.
        tremor: Root mean square of the hand's tremor, metres.
        hand: Noise of the hand's position, metres.
        hand_angle: Noise of the hand's rotation, radians.
        object: Noise of an object's position, metres.
        object_angle: Noise of an object's rotation, radians.
        bias: Constant error of object tracking, metres.
        opening: Noise of the hand's opening, metres.
        dropped: Share of samples that are lost one by one.
        gaps: Number of longer losses.
        gap: Longest loss, seconds.
    """

    rate: float = 30.0
    tremor: float = 0.0005
    hand: float = 0.0008
    hand_angle: float = 0.006
    object: float = 0.0015
    object_angle: float = 0.01
    bias: float = 0.0015
    opening: float = 0.001
    dropped: float = 0.04
    gaps: int = 2
    gap: float = 0.2

    def worse(self, factor: float) -> Sensing:
        """The same recording with all errors larger by a factor."""
        scaled = {
            name: getattr(self, name) * factor
            for name in ("tremor", "hand", "hand_angle", "object", "object_angle", "bias", "opening", "gap")
        }
        return replace(self, **scaled, dropped=min(0.5, self.dropped * factor))


@dataclass(frozen=True)
class Stroke:
    """One movement of the hand: to a pose or to an opening, within a span of time."""

    start: float
    duration: float
    pose: Floats | None = None
    opening: float | None = None


@dataclass
class Hand:
    """A hand that plans one stroke after the other.

    Attributes:
        pose: ``(7,)`` where the hand is or will be after the strokes planned so far.
        opening: The same of its opening, metres.
        clock: Second at which the next stroke may begin.
        time_scaling: Factor on all durations; 1 is a calm person.
    """

    pose: Floats
    opening: float
    time_scaling: float
    clock: float = 0.3
    strokes: list[Stroke] = field(default_factory=list)
    start_pose: Floats = field(init=False)
    start_opening: float = field(init=False)

    def __post_init__(self) -> None:
        self.start_pose, self.start_opening = self.pose, self.opening

    def move(self, pose: Floats, overlap: float = 0.0, hurry: float = 1.0) -> float:
        """Plans a movement to a pose; returns the second at which it ends.

        Args:
            pose: ``(7,)`` tool pose.
            overlap: Share of the movement's duration by which it begins before the earlier one ends.
            hurry: Factor on the duration.
        """
        distance = float(np.linalg.norm(pose[:3] - self.pose[:3]))
        turn = float(poses.angle_between(self.pose[3:], pose[3:]))
        duration = self.time_scaling * hurry * (0.45 + 1.6 * distance + 0.2 * turn)
        moves = any(stroke.pose is not None for stroke in self.strokes)
        start = self.clock - (overlap * duration if moves else 0.0)
        self.strokes.append(Stroke(start, duration, pose=pose))
        self.pose, self.clock = pose, start + duration
        return self.clock

    def set_opening(self, opening: float, duration: float, start: float | None = None) -> float:
        """Plans a change of the opening; waits for it unless a start is given. Returns when it ends."""
        begin = self.clock if start is None else start
        self.strokes.append(Stroke(begin, duration, opening=opening))
        self.opening = opening
        if start is None:
            self.clock = begin + duration
        return begin + duration

    def wait(self, seconds: float) -> None:
        """Stays where it is."""
        self.clock += seconds

    def trajectory(self) -> tuple[Floats, Floats, Floats]:
        """Time ``(N,)``, poses ``(N, 7)`` and opening ``(N,)`` at `FINE_RATE`, without tremor."""
        time = np.arange(0.0, self.clock + 0.3, 1 / FINE_RATE)
        position = np.tile(self.start_pose[:3], (len(time), 1))
        rotation = np.tile(self.start_pose[3:], (len(time), 1))
        opening = np.full(len(time), self.start_opening)
        pose, width = self.start_pose, self.start_opening
        for stroke in sorted(self.strokes, key=lambda s: s.start):
            done = minimum_jerk((time - stroke.start) / stroke.duration)
            if stroke.pose is not None:
                turn = poses.rotation_vector(
                    poses.quat_multiply(poses.quat_conjugate(pose[3:]), stroke.pose[3:])
                )
                position += done[:, None] * (stroke.pose[:3] - pose[:3])
                step = poses.from_rotation_vector(done[:, None] * turn)
                rotation = poses.quat_multiply(rotation, step)
                pose = stroke.pose
            if stroke.opening is not None:
                opening += done * (stroke.opening - width)
                width = stroke.opening
        return time, np.concatenate([position, rotation], axis=1), opening


def minimum_jerk(share: Floats) -> Floats:
    """Share of the way done ``(...)`` after a share of the time, held outside [0, 1]."""
    s = np.clip(share, 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def tremor(time: Floats, size: float, rng: np.random.Generator) -> Floats:
    """Tremor ``(N, 3)`` in metres of a given root mean square, three tones between 8 and 12 Hz an axis."""
    frequency = rng.uniform(8, 12, (3, 3))
    phase = rng.uniform(0, 2 * np.pi, (3, 3))
    tones = np.sin(2 * np.pi * frequency[None] * time[:, None, None] + phase[None])
    return np.asarray(tones.sum(axis=2) * size * np.sqrt(2 / 3))


def noisy_poses(track: Floats, position: float, angle: float, rng: np.random.Generator) -> Floats:
    """Poses ``(N, 7)`` with white noise on position (metres) and rotation (radians), one axis each."""
    turn = poses.from_rotation_vector(rng.normal(0, 1, (len(track), 3)) * angle)
    return np.concatenate(
        [
            track[:, :3] + rng.normal(0, 1, (len(track), 3)) * position,
            poses.quat_multiply(track[:, 3:], turn),
        ],
        axis=1,
    )


def kept_samples(time: Floats, sensing: Sensing, rng: np.random.Generator) -> Floats:
    """Times ``(T,)`` of the samples that were recorded and not dropped."""
    ticks = np.arange(0.0, time[-1], 1 / sensing.rate)
    ticks = ticks + rng.uniform(-0.1, 0.1, len(ticks)) / sensing.rate
    keep = rng.random(len(ticks)) >= sensing.dropped
    for begin in rng.uniform(0.3, max(0.4, time[-1] - 0.5), sensing.gaps):
        keep &= ~((ticks > begin) & (ticks < begin + rng.uniform(0, sensing.gap)))
    keep[[0, -1]] = True
    return np.asarray(np.maximum(ticks[keep], 0.0))
