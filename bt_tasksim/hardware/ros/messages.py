"""ROS messages as rosbridge writes them in JSON: from plain data to checked arrays, and back.

Every function takes whatever has arrived. What is not a message of its type, of the expected frame and of a
sane size is an `UnusableMessageError` with one sentence. JSON has no NaN: rosbridge writes null, which joint
states keep as NaN, since the guard says what that means for a robot; elsewhere it is refused.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.hardware.safety.motion import JointMotion, resting

MOST_JOINTS = 256
MOST_BYTES = 8_000_000
"""Of one compressed image."""
MOST_PIXELS = 4096
"""Along one side of an image."""
MILLIMETRES = ("16UC1", "mono16")
"""Encodings of a depth image of 16 bits in millimetres."""
SHORTEST = 0.1
"""Least seconds in which a moving arm is told to come to stand."""
_LARGEST = 1e9


class UnusableMessageError(ValueError):
    """A message that is not used, and why."""


@dataclass(frozen=True, slots=True)
class JointStates:
    """Joint states as they came; ``(n,)`` each, NaN where the message says nothing."""

    names: tuple[str, ...]
    position: Array
    velocity: Array
    effort: Array
    stamp: float


def joint_states(message: object) -> JointStates:
    """A sensor_msgs/JointState."""
    data = _mapping(message, "joint states")
    raw = _get(data, "name", "joint states")
    if not isinstance(raw, list) or not raw or not all(isinstance(n, str) for n in raw):
        raise UnusableMessageError(f"joint states: 'name' should be a list of names, found {_shown(raw)}")
    if len(raw) > MOST_JOINTS:
        raise UnusableMessageError(f"joint states: {len(raw)} joints, more than {MOST_JOINTS}")
    names = tuple(raw)
    if len(set(names)) < len(names):
        raise UnusableMessageError("joint states: a joint is named twice")
    n = len(names)

    def optional(key: str) -> Array:
        values = data.get(key) or []
        return _numbers(values, n, f"joint states: '{key}'") if values else np.full(n, np.nan)

    position = _numbers(_get(data, "position", "joint states"), n, "joint states: 'position'")
    return JointStates(names, position, optional("velocity"), optional("effort"), stamp(data, "joint states"))


def wrench(message: object, frame: str) -> tuple[Array, float]:
    """A geometry_msgs/WrenchStamped: force and torque ``(6,)``, and its stamp."""
    data = _mapping(message, "wrench")
    _check_frame(data, frame, "wrench")
    inner = _mapping(_get(data, "wrench", "wrench"), "wrench: 'wrench'")
    values = [*_xyz(inner, "force", "wrench"), *_xyz(inner, "torque", "wrench")]
    return np.array(values), stamp(data, "wrench")


def pose(message: object, frame: str) -> tuple[Array, float]:
    """A geometry_msgs/PoseStamped: a pose ``(7,)``, quaternion w x y z, and its stamp."""
    data = _mapping(message, "pose")
    _check_frame(data, frame, "pose")
    inner = _mapping(_get(data, "pose", "pose"), "pose: 'pose'")
    place = _xyz(inner, "position", "pose")
    turn = _mapping(_get(inner, "orientation", "pose"), "pose: 'orientation'")
    q = np.array([_number(_get(turn, k, "pose"), f"pose: orientation {k}") for k in ("w", "x", "y", "z")])
    length = float(np.linalg.norm(q))
    if abs(length - 1.0) > 0.01:
        raise UnusableMessageError(f"pose: the quaternion has length {length:.3g} instead of 1")
    return np.concatenate([place, q / length]), stamp(data, "pose")


def flag(message: object) -> bool:
    """A std_msgs/Bool."""
    value = _get(_mapping(message, "flag"), "data", "flag")
    if not isinstance(value, bool):
        raise UnusableMessageError(f"flag: 'data' should be true or false, found {_shown(value)}")
    return value


def text(message: object, longest: int = 500) -> str:
    """A std_msgs/String of a sane length."""
    value = _get(_mapping(message, "text"), "data", "text")
    if not isinstance(value, str) or len(value) > longest:
        raise UnusableMessageError(f"text: 'data' should be a text of at most {longest} characters")
    return value


@dataclass(frozen=True, slots=True)
class Calibration:
    """Size in pixels and intrinsic matrix ``(3, 3)`` of a camera."""

    width: int
    height: int
    matrix: Array


def camera_info(message: object) -> Calibration:
    """A sensor_msgs/CameraInfo of a camera without distortion."""
    data = _mapping(message, "camera info")
    width, height = (_side(_get(data, key, "camera info")) for key in ("width", "height"))
    matrix = _finite(_get(data, "k", "camera info"), 9, "camera info: 'k'").reshape(3, 3)
    if matrix[0, 0] <= 0.0 or matrix[1, 1] <= 0.0 or matrix[2].tolist() != [0.0, 0.0, 1.0]:
        raise UnusableMessageError("camera info: 'k' is no intrinsic matrix")
    distortion = data.get("d") or []
    if not isinstance(distortion, list) or any(v not in (0, 0.0) for v in distortion):
        raise UnusableMessageError("camera info: the images are distorted ('d'); publish rectified ones")
    return Calibration(width, height, matrix)


def _side(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MOST_PIXELS:
        raise UnusableMessageError(f"camera info: a size of {_shown(value)} pixels")
    return value


_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"


def image_content(
    message: object, what: str, size: tuple[int, int], encodings: Sequence[str] = ()
) -> tuple[bytes, float]:
    """A sensor_msgs/CompressedImage: the file in it, and its stamp; not yet unpacked.

    What image_transport writes before a depth image (12 bytes) is left out.

    Args:
        message: PNG or JPEG.
        what: Its name in sentences.
        size: Width and height that it must have.
        encodings: Of the pixels, those that may be; where the format names one, as image_transport does
            (``32FC1; compressedDepth png`` holds inverse depth as whole numbers, and looks like millimetres).
    """
    data = _mapping(message, what)
    kind = data.get("format", "")
    if not isinstance(kind, str):
        raise UnusableMessageError(f"{what}: 'format' should be a text, found {_shown(kind)}")
    encoding, separator, _ = kind.partition(";")
    if encodings and separator and encoding.strip() not in encodings:
        raise UnusableMessageError(f"{what}: in format {_shown(kind)}; publish {encodings[0]}")
    raw = _get(data, "data", what)
    if not isinstance(raw, str) or len(raw) > MOST_BYTES * 4 // 3 + 4:
        raise UnusableMessageError(f"{what}: 'data' holds no bytes, or too many")
    try:
        content = base64.b64decode(raw, validate=True)
    except (binascii.Error, ValueError):
        raise UnusableMessageError(f"{what}: 'data' is not base64") from None
    if content[12:20] == _PNG and not content.startswith(_PNG):
        content = content[12:]
    found = _size(content)
    if found is None:
        raise UnusableMessageError(f"{what}: neither PNG nor JPEG")
    if found != size:
        raise UnusableMessageError(
            f"{what}: {found[0]} x {found[1]} pixels, and the camera has {size[0]} x {size[1]}"
        )
    return content, stamp(data, what)


def colours(content: bytes) -> Array:
    """A picture in colour, unpacked: ``(height, width, 3)`` uint8 RGB."""
    import cv2

    pixels = _unpacked(content, cv2.IMREAD_COLOR, "colour image")
    if pixels.ndim != 3 or pixels.dtype != np.uint8:
        raise UnusableMessageError("colour image: no colours of 8 bits")
    return np.ascontiguousarray(pixels[:, :, ::-1])


def metres(content: bytes) -> Array:
    """A picture of depths, a PNG of 16 bits in millimetres: ``(height, width)`` metres, 0 nothing."""
    import cv2

    pixels = _unpacked(content, cv2.IMREAD_UNCHANGED, "depth image")
    if pixels.ndim != 2 or pixels.dtype != np.uint16:
        raise UnusableMessageError(f"depth image: should be one channel of 16 bits, found {pixels.dtype}")
    return pixels.astype(np.float32) / np.float32(1000.0)


def _unpacked(content: bytes, how: int, what: str) -> Array:
    import cv2

    try:
        pixels = cv2.imdecode(np.frombuffer(content, np.uint8), how)
    except cv2.error as error:
        raise UnusableMessageError(f"{what}: cannot be read ({error.err})") from None
    if pixels is None or pixels.shape[1::-1] != _size(content):
        raise UnusableMessageError(f"{what}: cannot be read")
    return np.asarray(pixels)


def _size(content: bytes) -> tuple[int, int] | None:
    """Width and height as a PNG or JPEG says them in its head, before anything is unpacked."""
    if content.startswith(_PNG) and len(content) >= 24:
        return int.from_bytes(content[16:20], "big"), int.from_bytes(content[20:24], "big")
    if not content.startswith(_JPEG):
        return None
    at = 2
    while at + 9 <= len(content) and content[at] == 0xFF:
        kind, length = content[at + 1], int.from_bytes(content[at + 2 : at + 4], "big")
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            height, width = (int.from_bytes(content[at + k : at + k + 2], "big") for k in (5, 7))
            return width, height
        at += 2 + max(length, 2)
    return None


# ---- what goes out ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Point:
    """A point of a trajectory, ``time`` seconds after its begin; ``position`` and ``velocity (n,)``.

    Without velocities a controller goes straight from point to point.
    """

    position: Array
    velocity: Array | None
    time: float


def trajectory(joints: Sequence[str], points: Sequence[Point], run: str = "") -> dict[str, object]:
    """A trajectory_msgs/JointTrajectory that begins when it arrives; the run's name stands in its frame."""
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": run},
        "joint_names": list(joints),
        "points": [
            {
                "positions": np.asarray(p.position, float).tolist(),
                "velocities": [] if p.velocity is None else np.asarray(p.velocity, float).tolist(),
                "accelerations": [],
                "effort": [],
                "time_from_start": _duration(p.time),
            }
            for p in points
        ],
    }


def _duration(seconds: float) -> dict[str, int]:
    nanoseconds = round(seconds * 1e9)
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}


def ending_at_rest(
    position: Array,
    velocity: Array,
    period: float,
    acceleration: Array,
    lower: Array,
    upper: Array,
    validity: float,
) -> tuple[Point, ...]:
    """A trajectory of one target and, where it is still moving there, of a point at which it has braked.

    Args:
        position: Where to be at the control period's end ``(n,)``.
        velocity: How fast, there ``(n,)``.
        period: Seconds until then.
        acceleration: With which joints may brake ``(n,)``.
        lower: Position limits ``(n,)``.
        upper: Position limits ``(n,)``.
        validity: Seconds after which the arm stands, if its speed allows that.
    """
    still = np.zeros_like(position)
    if not np.any(np.abs(velocity) > 1e-9):
        return (Point(position, still, period),)
    rest, braking = resting(JointMotion(position, velocity), acceleration, max(validity - period, 0.01))
    rest = np.minimum(np.maximum(rest, np.minimum(lower, position)), np.maximum(upper, position))
    return Point(position, velocity, period), Point(rest, still, period + braking)


def standing(position: Array, velocity: Array, acceleration: Array, lower: Array, upper: Array) -> Point:
    """The point where joints that brake evenly come to stand, in `SHORTEST` or as soon as they may.

    Args:
        position: Where they are ``(n,)``.
        velocity: How fast ``(n,)``.
        acceleration: With which they may brake ``(n,)``.
        lower: Position limits ``(n,)``.
        upper: Position limits ``(n,)``.
    """
    rest, braking = resting(JointMotion(position, velocity), acceleration, SHORTEST)
    rest = np.minimum(np.maximum(rest, np.minimum(lower, position)), np.maximum(upper, position))
    return Point(rest, np.zeros_like(rest), braking)


# ---- reading plain data -----------------------------------------------------------------------------------


def stamp(data: Mapping[str, object], what: str) -> float:
    """Seconds of the message's header."""
    header = _mapping(_get(data, "header", what), f"{what}: 'header'")
    time = _mapping(_get(header, "stamp", what), f"{what}: 'stamp'")
    sec, nanosec = _get(time, "sec", what), _get(time, "nanosec", what)
    if not _is_whole(sec) or not _is_whole(nanosec):
        raise UnusableMessageError(f"{what}: a stamp of {_shown(sec)} s and {_shown(nanosec)} ns")
    return float(sec) + 1e-9 * float(nanosec)


def _is_whole(value: object) -> TypeGuard[int]:
    """It is a whole number of a sane size."""
    return not isinstance(value, bool) and isinstance(value, int) and abs(value) <= 2**40


def _check_frame(data: Mapping[str, object], frame: str, what: str) -> None:
    header = _mapping(_get(data, "header", what), f"{what}: 'header'")
    if header.get("frame_id") != frame:
        raise UnusableMessageError(f"{what}: in frame {_shown(header.get('frame_id'))}, expected '{frame}'")


def _mapping(value: object, what: str) -> Mapping[str, object]:
    if not isinstance(value, Mapping):
        raise UnusableMessageError(f"{what}: no message, but {_shown(value)}")
    return value


def _get(data: Mapping[str, object], key: str, what: str) -> object:
    if key not in data:
        raise UnusableMessageError(f"{what}: '{key}' is missing")
    return data[key]


def _xyz(data: Mapping[str, object], key: str, what: str) -> Array:
    inner = _mapping(_get(data, key, what), f"{what}: '{key}'")
    return np.array([_number(_get(inner, k, what), f"{what}: {key} {k}") for k in "xyz"])


def _number(value: object, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < _LARGEST:
        raise UnusableMessageError(f"{what} should be a number, found {_shown(value)}")
    return float(value)


def _numbers(values: object, n: int, what: str) -> Array:
    """``(n,)``, NaN for null."""
    if not isinstance(values, list) or len(values) != n:
        found = f"{len(values)}" if isinstance(values, list) else _shown(values)
        raise UnusableMessageError(f"{what} should be {n} numbers, found {found}")
    out = np.empty(n)
    for i, value in enumerate(values):
        if value is None or (isinstance(value, float) and math.isnan(value)):
            out[i] = math.nan
        else:
            out[i] = _number(value, what)
    return out


def _finite(values: object, n: int, what: str) -> Array:
    array = _numbers(values, n, what)
    if not np.all(np.isfinite(array)):
        raise UnusableMessageError(f"{what} is not finite")
    return array


def _shown(value: object) -> str:
    """A value in few characters."""
    if isinstance(value, str):
        return repr(value[:40])
    if isinstance(value, list | Mapping):
        return f"{type(value).__name__} of {len(value)}"
    return repr(value)[:40]


def in_tool_frame(wrench_at_sensor: Array, sensor: Array) -> Array:
    """A wrench ``(6,)`` measured in a sensor's frame, at the tool origin in the tool frame.

    Args:
        wrench_at_sensor: Force and torque about the sensor's origin.
        sensor: Pose ``(7,)`` of the sensor in the tool frame.
    """
    force = poses.rotate(sensor[3:], wrench_at_sensor[:3])
    torque = poses.rotate(sensor[3:], wrench_at_sensor[3:]) + np.cross(sensor[:3], force)
    return np.concatenate([force, torque])
