"""What a demonstration is: the motions of a hand and of the objects around it, over time.

Poses are ``(..., 7)``: position in metres and quaternion ``w x y z``, robot base frame (table top at z = 0,
x forward, z up). The hand's pose is its tool frame: z is the approach axis (out of the palm), y the opening
axis, the origin lies between the finger tips. `docs/demonstrations.md` describes the file format.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.plain import shown
from bt_tasksim.core.world import PlaceModel

Floats = NDArray[np.float64]

SOURCES = ("synthetic", "human", "simulation", "robot", "maniskill")
MOST_SAMPLES = 5_000_000
LONGEST = 86_400.0
"""Seconds that a demonstration may last."""
SLOWEST = 5.0
"""Seconds from one sample to the next, half of them at most being longer, up to which a log shows motion."""
FARTHEST = 1_000.0
"""Metres from the robot's base up to which poses and sizes are believed."""


@dataclass(frozen=True)
class Track:
    """The motion of one object.

    Attributes:
        pose: ``(T, 7)`` in metres; the origin is the centre of the object's bounding box.
        kind: What it is, such as ``box`` or ``cup``.
        size: ``(3,)`` full extents of the bounding box in the object's frame, metres.
    """

    pose: Floats
    kind: str
    size: Floats


@dataclass(frozen=True)
class Surface:
    """A place: a surface that objects can stand on, or a container.

    Attributes:
        pose: ``(7,)``; the origin lies on the surface, where a thing stands when placed without an offset;
            z points out of the surface.
        extent: ``(2,)`` full size along the surface's x and y, metres.
        kind: ``table``, ``board``, ``spot`` (a part of another surface) or ``bin`` (walls around it).
        fixture: Name of the piece of furniture it belongs to, where it belongs to one.
        centre: ``(2,)`` centre of the extent in the surface's own frame, metres.
        height: Free height above the surface, metres; walls' height for a bin; 0 where unknown.
    """

    pose: Floats
    extent: Floats
    kind: str = "table"
    fixture: str | None = None
    centre: Floats = field(default_factory=lambda: np.zeros(2))
    height: float = 0.0


def surface_of(place: PlaceModel) -> Surface:
    """A place of a scene, as a log holds it."""
    return Surface(
        pose=np.array(place.pose, dtype=np.float64),
        extent=np.array(place.extent, dtype=np.float64),
        kind=place.kind,
        fixture=place.fixture or None,
        centre=np.array(place.centre, dtype=np.float64),
        height=place.height,
    )


@dataclass(frozen=True)
class Utterance:
    """What was said at a time in seconds, on the demonstration's clock."""

    time: float
    text: str


@dataclass(frozen=True)
class Video:
    """A video that belongs to a demonstration: path relative to the log, and frames per second."""

    path: str
    fps: float


@dataclass(frozen=True)
class Demonstration:
    """One activity, shown once.

    Attributes:
        name: Its name in the log, such as ``000``.
        time: ``(T,)`` seconds, strictly increasing; any sampling rate, samples may be missing.
        hand_pose: ``(T, 7)`` tool frame of the hand.
        hand_opening: ``(T,)`` distance between the finger tips, metres.
        objects: Tracks by name, at least one.
        places: Surfaces by name; may be empty.
        task: What was shown, in a word; may be empty.
        seed: Seed from which a machine made it.
        narration: What was said, in order of time.
        video: The video of it.
        extra: Further arrays by path, such as ``commands/tool``; kept, and not looked at here.
        notes: Further attributes, such as ``configuration`` (JSON); kept, and not looked at here.
    """

    name: str
    time: Floats
    hand_pose: Floats
    hand_opening: Floats
    objects: Mapping[str, Track]
    places: Mapping[str, Surface] = field(default_factory=dict)
    task: str = ""
    seed: int | None = None
    narration: tuple[Utterance, ...] = ()
    video: Video | None = None
    extra: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Log:
    """Demonstrations of one activity.

    Attributes:
        source: Who or what made it, one of `SOURCES`.
        demonstrations: At least one, in order.
        description: A sentence for people.
        path: The file it came from; empty where it came from none.
    """

    source: str
    demonstrations: tuple[Demonstration, ...]
    description: str = ""
    path: str = ""

    def demonstration(self, episode: int | str) -> Demonstration:
        """A demonstration by its number in the log or its name.

        Raises:
            InputError: The log has no such demonstration.
        """
        for demonstration in self.demonstrations:
            if demonstration.name == episode:
                return demonstration
        try:
            number = int(episode)
        except ValueError:
            number = -1
        if 0 <= number < len(self.demonstrations):
            return self.demonstrations[number]
        where = f"'{self.path}'" if self.path else "the log"
        last = len(self.demonstrations) - 1
        raise InputError(f"{where} has no demonstration {episode!r}; choose a number from 0 to {last}")


def checked(demonstration: Demonstration, where: str) -> Demonstration:
    """The same demonstration after a check of everything that later steps rely upon.

    Args:
        demonstration: What to check.
        where: File (and group) that error messages name.

    Returns:
        A copy in which arrays are float64 and quaternions have unit length.

    Raises:
        InputError: Something is missing, empty, not finite, of a wrong shape, or time does not increase.
    """
    time = _time(demonstration.time, where)
    if not demonstration.objects:
        raise InputError(f"{where} has no objects; a demonstration needs at least one under objects/")
    count = len(time)
    opening = _array(demonstration.hand_opening, (count,), f"{where}/hand/opening")
    if (np.abs(opening) > FARTHEST).any():
        raise InputError(f"{where}/hand/opening is more than {FARTHEST:.0f} m; write metres")
    objects = {
        name: Track(
            _poses(track.pose, count, f"{where}/objects/{name}/pose"),
            track.kind,
            _size(track.size, 3, f"{where}/objects/{name} attribute size"),
        )
        for name, track in demonstration.objects.items()
    }
    said = sorted(demonstration.narration, key=lambda utterance: utterance.time)
    if not np.isfinite([utterance.time for utterance in said]).all():
        raise InputError(f"{where}/narration/time is not finite; give the second at which each word was said")
    changes: dict[str, Any] = {
        "time": time,
        "hand_pose": _poses(demonstration.hand_pose, count, f"{where}/hand/pose"),
        "hand_opening": opening,
        "objects": objects,
        "places": {
            name: _surface(surface, f"{where}/places/{name}")
            for name, surface in demonstration.places.items()
        },
        "narration": tuple(said),
    }
    return Demonstration(**{**vars(demonstration), **changes})


def checked_log(log: Log, where: str) -> Log:
    """The same log, each demonstration `checked`.

    Raises:
        InputError: It has no demonstration, an unknown source, two of one name, or a faulty demonstration.
    """
    if log.source not in SOURCES:
        raise InputError(f"{where} has source '{shown(log.source)}'{nearest(log.source, SOURCES)}")
    if not log.demonstrations:
        raise InputError(f"{where} has no demonstrations; nothing can be learned from an empty log")
    names = [demonstration.name for demonstration in log.demonstrations]
    if len(set(names)) < len(names):
        raise InputError(f"{where} has two demonstrations of one name; give each its own")
    done = tuple(checked(d, f"{where}: demonstrations/{d.name}") for d in log.demonstrations)
    return Log(log.source, done, log.description, log.path)


def _array(values: Any, shape: tuple[int, ...], where: str) -> Floats:
    array = np.asarray(values)
    if array.dtype.kind not in "biuf":
        raise InputError(f"{where} does not hold numbers; write floats")
    array = array.astype(np.float64, copy=False)
    if array.shape != shape:
        if array.shape[1:] == shape[1:] and array.ndim == len(shape):
            raise InputError(
                f"{where} has {len(array)} rows but time has {shape[0]}; give one row per sample"
            )
        raise InputError(f"{where} has shape {array.shape} instead of {shape}")
    wrong = np.flatnonzero(~np.isfinite(array).reshape(len(array), -1).all(axis=1))
    if wrong.size:
        raise InputError(
            f"{where} has NaN or infinity at index {wrong[0]}; leave out samples in which tracking was lost"
        )
    return array


def _time(values: Any, where: str) -> Floats:
    time = np.asarray(values)
    if time.ndim != 1 or len(time) < 2:
        raise InputError(f"{where}/time has shape {time.shape}; it needs at least 2 samples in one row")
    if len(time) > MOST_SAMPLES:
        raise InputError(f"{where}/time has {len(time)} samples, more than {MOST_SAMPLES}; split the log")
    time = _array(time, (len(time),), f"{where}/time")
    steps = np.diff(time)
    wrong = np.flatnonzero(steps <= 0)
    if wrong.size:
        at = int(wrong[0])
        how = "stands still" if steps[at] == 0 else "runs backwards"
        raise InputError(
            f"{where}/time {how} at index {at + 1} ({time[at]:.6g} s, then {time[at + 1]:.6g} s); "
            "sort the samples and drop repeated ones"
        )
    _check_unit(float(np.median(steps)), float(time[-1] - time[0]), where)
    return time


def _check_unit(step: float, duration: float, where: str) -> None:
    """Check that times are in seconds: what comes later takes memory for each of them."""
    for most, unit in (
        (SLOWEST * 1e6, "nanoseconds"),
        (SLOWEST * 1e3, "microseconds"),
        (SLOWEST, "milliseconds"),
    ):
        if step > most:
            raise InputError(
                f"{where}/time has {step:.4g} s from sample to sample, which looks like {unit}; write seconds"
            )
    if duration > LONGEST:
        raise InputError(
            f"{where}/time lasts {duration:.6g} s, more than {LONGEST:.0f}; split the log, or write seconds"
        )


def _poses(values: Any, count: int, where: str) -> Floats:
    poses = _array(values, (count, 7), where).copy()
    far = np.flatnonzero((np.abs(poses[:, :3]) > FARTHEST).any(axis=1))
    if far.size:
        raise InputError(
            f"{where} is more than {FARTHEST:.0f} m away at index {far[0]}; write metres in its base"
        )
    lengths = np.linalg.norm(poses[:, 3:], axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1) > 0.05)
    if wrong.size:
        at = int(wrong[0])
        what = "a zero quaternion" if lengths[at] < 1e-6 else f"a quaternion of length {lengths[at]:.3g}"
        raise InputError(f"{where} has {what} at index {at}; write unit quaternions w x y z")
    poses[:, 3:] /= lengths[:, None]
    return poses


def _size(values: Any, count: int, where: str) -> Floats:
    size = _array(values, (count,), where)
    if (size <= 0).any() or (size > FARTHEST).any():
        raise InputError(
            f"{where} is {size.tolist()}; give full extents in metres, all above zero, up to {FARTHEST:.0f}"
        )
    return size


def _surface(surface: Surface, where: str) -> Surface:
    pose = _poses(np.asarray(surface.pose)[None], 1, f"{where} attribute pose")[0]
    extent = _size(surface.extent, 2, f"{where} attribute extent")
    centre = _array(surface.centre, (2,), f"{where} attribute centre")
    height = float(surface.height)
    if not 0 <= height <= FARTHEST:
        raise InputError(f"{where} attribute height is {height}; give metres, from 0 to {FARTHEST:.0f}")
    if (np.abs(centre) > FARTHEST).any():
        raise InputError(f"{where} attribute centre is {centre.tolist()}; give metres")
    return Surface(pose, extent, surface.kind, surface.fixture, centre, height)
