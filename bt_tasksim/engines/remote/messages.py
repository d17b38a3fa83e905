"""The messages between a client and a served engine: their schema, and bytes to messages and back.

A message is some frames. The first is msgpack: ``[protocol, number, kind, fields, layout]``, where ``layout``
lists name, dtype and shape of the arrays whose raw bytes are the other frames, in order. A reply carries the
number of its request. `SCHEMA` says what each kind must hold; `decode` checks everything against it before
anything is done with a message, so what it returns is well formed, finite and of the right shapes.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgpack
import numpy as np

from bt_tasksim.engines.pipeline import CameraModel, Image
from bt_tasksim.engines.remote.plain import LARGEST, from_plain, shown, spelled, to_plain
from bt_tasksim.errors import InputError
from bt_tasksim.poses import Array
from bt_tasksim.robot import RobotDescription
from bt_tasksim.scene import ActorConfiguration

PROTOCOL = 1
LARGEST_HEADER = 1 << 20
"""Bytes of the first frame, the drawn world in it."""
MOST_FRAMES = 48
MOST_IMAGES = 8
LARGEST_SIDE = 8192
"""Of what no message says beforehand, such as an image's width."""
LARGE = 1 << 16
"""Bytes from which an array is sent and kept without a copy."""
DTYPES: Mapping[str, Any] = {name: np.dtype(name) for name in ("<f8", "<f4", "|u1", "|b1")}
"""The types that arrays may have: NumPy's names with their byte order."""


@dataclass(frozen=True)
class ArraySpec:
    """What an array in a message must be.

    Attributes:
        shape: Numbers, or names of sizes that are the same throughout a message and an episode.
        dtype: One of `DTYPES`.
        values: ``finite`` (and within `LARGEST`), ``not NaN`` or ``any``.
        optional: It may be missing.
    """

    shape: tuple[int | str, ...]
    dtype: str = "<f8"
    values: str = "finite"
    optional: bool = False


@dataclass(frozen=True)
class MessageSpec:
    """What a kind of message holds: fields with their types, arrays, and images by their cameras."""

    fields: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, ArraySpec] = field(default_factory=dict)
    images: bool = False


_STATE = {
    "time": ArraySpec(()),
    "joint_position": ArraySpec(("joints",)),
    "joint_velocity": ArraySpec(("joints",)),
    "joint_effort": ArraySpec(("joints",)),
    "tip_force": ArraySpec(("tips", 3)),
    "wrench": ArraySpec((6,)),
    "tool_pose": ArraySpec((7,)),
    "tips": ArraySpec(("tips", 3)),
    "objects": ArraySpec(("objects", 7), optional=True),
    "velocities": ArraySpec(("objects", 6), optional=True),
}
_HIDDEN = {
    "time": ArraySpec(()),
    "objects": ArraySpec(("objects", 7)),
    "velocities": ArraySpec(("objects", 6)),
    "hand_force": ArraySpec(("objects",)),
    "hand_distance": ArraySpec(("objects",), values="not NaN"),
    "support": ArraySpec(("objects", "bodies"), "|b1"),
    "penetration": ArraySpec(()),
    "tool_pose": ArraySpec((7,)),
}
_OBSERVATION = {
    "time": ArraySpec(()),
    "arm_position": ArraySpec(("arm",)),
    "arm_velocity": ArraySpec(("arm",)),
    "hand_position": ArraySpec(("hand",)),
    "hand_effort": ArraySpec(("hand",)),
    "closure": ArraySpec(()),
    "tool_pose": ArraySpec((7,)),
    "tips": ArraySpec(("tips", 3)),
    "contacts": ArraySpec(("tips",), "|b1"),
    "contact_force": ArraySpec(("tips", 3)),
    "wrench": ArraySpec((6,)),
    "objects": ArraySpec(("objects", 7), values="any"),
    "contact_points": ArraySpec(("tips", 3)),
    "motion": ArraySpec((6,)),
}
_TARGET = {"position": ArraySpec(("joints",)), "velocity": ArraySpec(("joints",))}
_COMMAND = {"tool": ArraySpec((7,), optional=True), "hand": ArraySpec(("closures",), optional=True)}
_IMAGE = {
    "colour": ArraySpec(("height", "width", 3), "|u1"),
    "depth": ArraySpec(("height", "width"), "<f4", optional=True),
    "taken": ArraySpec((), optional=True),
}

REQUESTS: Mapping[str, MessageSpec] = {
    "hello": MessageSpec({"role": str, "version": str, "robot": str, "digests": dict[str, str]}),
    "reset": MessageSpec({"configuration": ActorConfiguration}),
    "step": MessageSpec(arrays=_TARGET),
    "hidden": MessageSpec(),
    "solve": MessageSpec(arrays={**_STATE, **_COMMAND}),
    "hand_start": MessageSpec(arrays={"start": ArraySpec((4,))}),
    "render": MessageSpec({"camera": str, "depth": bool}, _STATE),
    "cameras": MessageSpec({"needed": bool}),
    "observe": MessageSpec(arrays=_STATE, images=True),
}
"""What a client may send: what it is for is in `bt_tasksim.engines.remote.session`."""
REPLIES: Mapping[str, MessageSpec] = {
    "welcome": MessageSpec(
        {"role": str, "engine": str, "version": str, "robot": str, "digests": dict[str, str]}
    ),
    "done": MessageSpec(),
    "state": MessageSpec(arrays=_STATE),
    "truth": MessageSpec(arrays=_HIDDEN),
    "no truth": MessageSpec(),
    "target": MessageSpec(arrays=_TARGET),
    "joints": MessageSpec(arrays={"position": ArraySpec(("joints",))}),
    "image": MessageSpec(images=True),
    "names": MessageSpec({"names": tuple[str, ...]}),
    "observation": MessageSpec({"unseen": dict[str, str]}, _OBSERVATION),
    "error": MessageSpec({"error": str, "sentence": str, "distance": float, "angle": float}),
    "notice": MessageSpec(),
}
"""What a server may send; ``notice`` answers nothing, and finds out whether a client is still there."""
SCHEMA: Mapping[str, MessageSpec] = {**REQUESTS, **REPLIES}


class BadMessageError(InputError):
    """A message that is not as the schema says.

    Args:
        message: The sentence.
        number: Number of the message, as far as it could be read; else 0.
    """

    def __init__(self, message: str, number: int = 0) -> None:
        super().__init__(message)
        self.number = number


class OtherProtocolError(BadMessageError):
    """The other side speaks another protocol."""


@dataclass(frozen=True)
class Message:
    """One message: its number, kind, typed fields, arrays and images (in the order of their cameras)."""

    number: int
    kind: str
    fields: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, Array] = field(default_factory=dict)
    images: tuple[Image, ...] = ()


def sizes_of(robot: RobotDescription, configuration: ActorConfiguration | None = None) -> dict[str, int]:
    """The named sizes of arrays for a robot and, once it is known, a drawn world."""
    sizes = {
        "joints": len(robot.joints),
        "arm": len(robot.arm_joints),
        "hand": len(robot.hand_joints),
        "tips": len(robot.tips),
        "closures": 1 + len(robot.synergies),
    }
    if configuration is not None:
        objects = len(configuration.objects)
        sizes |= {"objects": objects, "bodies": objects + len(configuration.fixtures)}
    return sizes


def layout_digest() -> str:
    """A hash of the whole schema: two sides that have the same one lay their messages out alike.

    Every dataclass in it counts with all its fields, down to a drawn world's boxes.
    """
    whole = {"protocol": PROTOCOL, "kinds": {kind: _spelled(kind, spec) for kind, spec in SCHEMA.items()}}
    return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()


def _spelled(kind: str, spec: MessageSpec) -> dict[str, Any]:
    """A kind of message as plain data, one image standing for all that it may have."""
    return {
        "fields": {name: spelled(t) for name, t in spec.fields.items()},
        "arrays": to_plain(_array_specs(kind, 1 if spec.images else 0)),
        "images": spelled(CameraModel) if spec.images else None,
    }


def encode(message: Message, sizes: Mapping[str, int]) -> list[Any]:
    """The frames of a message: bytes, or views of large arrays, which must not change until they are sent.

    Raises:
        InputError: It is not as the schema says, such as a state with NaN in it.
    """
    specs = _array_specs(message.kind, len(message.images))
    arrays = {**message.arrays, **_image_arrays(message.images)}
    bound = dict(sizes)
    layout, frames = [], []
    for name, spec in specs.items():
        value = arrays.get(name)
        if value is None:
            if not spec.optional:
                raise InputError(f"message '{message.kind}' lacks the array '{name}'")
            continue
        array = _contiguous(value, DTYPES[spec.dtype])
        _check_shape(name, array.shape, spec, bound)
        _check_values(name, array, spec)
        layout.append((name, spec.dtype, array.shape))
        frames.append(array.tobytes() if array.nbytes < LARGE else array.data.cast("B"))
    plain = to_plain(message.fields)
    if message.images:
        plain["cameras"] = [to_plain(image.camera) for image in message.images]
    try:
        header = msgpack.packb([PROTOCOL, message.number, message.kind, plain, layout])
    except (OverflowError, ValueError) as error:
        raise InputError(f"message '{message.kind}' cannot be sent: {error}") from None
    if len(header) > LARGEST_HEADER:
        raise InputError(
            f"message '{message.kind}' has {len(header)} bytes of plain data, and at most {LARGEST_HEADER} "
            "can be sent: take a world with fewer objects and boxes"
        )
    return [header, *frames]


def decode(frames: Sequence[Any], kinds: Collection[str], sizes: Mapping[str, int]) -> Message:
    """The message in some frames (bytes or other buffers).

    Args:
        frames: The frames.
        kinds: The kinds that may come now.
        sizes: Named sizes that are known, see `sizes_of`.

    Raises:
        BadMessageError: It is not as the schema says; one sentence says where.
    """
    number, kind, plain, layout = _header(frames)
    try:
        if kind not in kinds:
            raise InputError(f"a message of kind {shown(kind)} does not belong here")
        spec = SCHEMA[kind]
        cameras = _cameras(plain) if spec.images else ()
        if not isinstance(plain, dict) or plain.keys() != spec.fields.keys():
            raise InputError(f"message '{kind}' should have the fields {sorted(spec.fields)}")
        fields = {name: from_plain(t, plain[name], f"'{kind}': {name}") for name, t in spec.fields.items()}
        arrays = _arrays(kind, layout, frames[1:], _array_specs(kind, len(cameras)), dict(sizes))
        return Message(number, kind, fields, arrays, tuple(_images(cameras, arrays)))
    except InputError as error:
        raise BadMessageError(str(error), number) from None


def _header(frames: Sequence[Any]) -> tuple[int, str, Any, list[Any]]:
    if not 1 <= len(frames) <= MOST_FRAMES:
        raise BadMessageError(f"a message has 1 to {MOST_FRAMES} frames, found {len(frames)}")
    if len(frames[0]) > LARGEST_HEADER:
        raise BadMessageError(f"a message's first frame is too large: {len(frames[0])} bytes")
    try:
        header = msgpack.unpackb(
            frames[0], max_ext_len=0, max_bin_len=0, max_array_len=1 << 16, max_map_len=1 << 12
        )
    except Exception as error:  # msgpack has errors of many kinds
        raise BadMessageError(f"a message's first frame is not msgpack ({type(error).__name__})") from None
    if not isinstance(header, list) or not header:
        raise BadMessageError("a message's first frame is not a list")
    if header[0] != PROTOCOL or isinstance(header[0], bool):
        raise OtherProtocolError(
            f"the other side speaks protocol {shown(header[0])}, and this one {PROTOCOL}: "
            "use the same version of bt-tasksim on both"
        )
    if len(header) != 5:
        raise BadMessageError(f"a message's first frame is a list of 5, found {len(header)}")
    _, number, kind, plain, layout = header
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < 1 << 53:
        raise BadMessageError(f"a message's number is a whole number, found {shown(number)}")
    if not isinstance(kind, str) or not isinstance(layout, list):
        raise BadMessageError("a message has a kind and a list of arrays", number)
    return number, kind, plain, layout


def _array_specs(kind: str, images: int) -> dict[str, ArraySpec]:
    specs = dict(SCHEMA[kind].arrays)
    for i in range(images):
        named = {"height": f"height {i}", "width": f"width {i}"}
        for part, spec in _IMAGE.items():
            shape = tuple(named.get(n, n) if isinstance(n, str) else n for n in spec.shape)
            specs[f"{part} {i}"] = ArraySpec(shape, spec.dtype, spec.values, spec.optional)
    return specs


def _image_arrays(images: Sequence[Image]) -> dict[str, Array]:
    return {f"{part} {i}": getattr(image, part) for i, image in enumerate(images) for part in _IMAGE}


def _cameras(plain: Any) -> tuple[CameraModel, ...]:
    """The cameras of a message's images, taken out of its fields."""
    cameras = plain.pop("cameras", []) if isinstance(plain, dict) else None
    if not isinstance(cameras, list) or len(cameras) > MOST_IMAGES:
        raise InputError(f"a message has at most {MOST_IMAGES} images with their cameras")
    return tuple(from_plain(CameraModel, camera, "'camera'") for camera in cameras)


def _images(cameras: Sequence[CameraModel], arrays: dict[str, Array]) -> list[Image]:
    found = []
    for i, camera in enumerate(cameras):
        colour, depth, taken = (arrays.pop(f"{part} {i}", None) for part in _IMAGE)
        assert colour is not None, "an image without colour was refused"
        if colour.shape[:2] != (camera.height, camera.width):
            raise InputError(f"an image of {colour.shape} is not what its camera {shown(camera.name)} gives")
        found.append(Image(camera, colour, depth, None if taken is None else float(taken)))
    return found


def _arrays(
    kind: str,
    layout: list[Any],
    buffers: Sequence[Any],
    specs: Mapping[str, ArraySpec],
    sizes: dict[str, int],
) -> dict[str, Array]:
    if len(layout) != len(buffers):
        raise InputError(f"message '{kind}' announces {len(layout)} arrays and has {len(buffers)}")
    found: dict[str, Array] = {}
    for entry, buffer in zip(layout, buffers, strict=True):
        if not isinstance(entry, list) or len(entry) != 3 or not isinstance(entry[0], str):
            raise InputError(f"message '{kind}' describes an array by name, dtype and shape")
        name, dtype, shape = entry
        spec = specs.get(name)
        if spec is None or name in found:
            raise InputError(f"message '{kind}' has an unknown or second array {shown(name)}")
        if dtype != spec.dtype:
            raise InputError(f"array '{name}' should be {spec.dtype}, found {shown(dtype)}")
        if not isinstance(shape, list):
            raise InputError(f"array '{name}' has no shape")
        found[name] = _array(name, buffer, spec, _check_shape(name, tuple(shape), spec, sizes))
    for name, spec in specs.items():
        if name not in found and not spec.optional:
            raise InputError(f"message '{kind}' lacks the array '{name}'")
    return found


def _array(name: str, buffer: Any, spec: ArraySpec, shape: tuple[int, ...]) -> Array:
    dtype, size = DTYPES[spec.dtype], len(buffer)
    expected = math.prod(shape) * dtype.itemsize
    if size != expected:
        raise InputError(f"array '{name}' of shape {shape} should have {expected} bytes, found {size}")
    if dtype.kind == "b":
        flags = np.frombuffer(buffer, np.uint8)
        if flags.size and flags.max() > 1:
            raise InputError(f"array '{name}' has something else than true and false in it")
        return flags.astype(bool).reshape(shape)
    array = np.frombuffer(buffer, dtype).reshape(shape)
    _check_values(name, array, spec)
    if not shape:
        return array[()]
    # Libraries behind the engines may write to small arrays, and want them aligned.
    return array if size >= LARGE and array.flags.aligned else array.copy()


def _contiguous(value: Any, dtype: Any) -> Array:
    """An array of this type with its numbers in order, which is the given one where that is so."""
    if isinstance(value, np.ndarray) and value.dtype is dtype and value.flags.c_contiguous:
        return value
    return np.ascontiguousarray(value, dtype).reshape(np.shape(value))


def _check_shape(
    name: str, shape: tuple[Any, ...], spec: ArraySpec, sizes: dict[str, int]
) -> tuple[int, ...]:
    """The shape that an array must have and has; a size that was not known is known from then on."""
    expected: tuple[Any, ...] = tuple([sizes.get(n, n) if type(n) is str else n for n in spec.shape])
    if shape == expected:
        return expected
    if len(shape) != len(expected) or not all(type(n) is int for n in shape):
        raise InputError(f"array '{name}' should have {len(expected)} dimensions, found {shown(list(shape))}")
    for n, wanted in zip(shape, expected, strict=True):
        if isinstance(wanted, str):
            if not 0 <= n <= LARGEST_SIDE or sizes.setdefault(wanted, n) != n:
                raise InputError(f"array '{name}' has a shape that cannot be: {shape}")
        elif n != wanted:
            raise InputError(f"array '{name}' should have the shape {expected}, found {shape}")
    return shape


def _check_values(name: str, array: Array, spec: ArraySpec) -> None:
    if spec.values == "any" or array.dtype.kind != "f" or not array.size:
        return
    if spec.values == "not NaN":
        if np.isnan(array).any():
            raise InputError(f"array '{name}' has NaN in it")
        return
    # No comparison with NaN holds. The sum of squares is quick, and says enough almost always.
    if array.dtype.itemsize == 8 and np.vdot(array, array) <= LARGEST * LARGEST:
        return
    if not (array.min() >= -LARGEST and array.max() <= LARGEST):
        raise InputError(f"array '{name}' has a number in it that is not finite, or beyond {LARGEST:.0e}")
