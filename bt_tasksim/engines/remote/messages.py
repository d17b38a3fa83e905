"""Bytes to messages and back.

A message is some frames. The first is msgpack: ``[protocol, number, kind, fields, layout]``, where ``layout``
lists name, dtype and shape of the arrays whose raw bytes are the other frames, in order. A reply carries the
number of its request. `decode` checks everything against `bt_tasksim.engines.remote.schema` before anything
is done with a message, so what it returns is well formed, finite and of the right shapes.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgpack
import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.images import CameraModel, Image
from bt_tasksim.engines.remote.plain import LARGEST, from_plain, shown, to_plain
from bt_tasksim.engines.remote.schema import (
    DTYPES,
    IMAGE,
    LARGEST_HEADER,
    LARGEST_SIDE,
    MOST_FRAMES,
    MOST_IMAGES,
    PROTOCOL,
    SCHEMA,
    ArraySpec,
    Frame,
    array_specs,
)

LARGE = 1 << 16
"""Bytes from which an array is sent and kept without a copy."""


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


def encode(message: Message, sizes: Mapping[str, int]) -> list[Frame]:
    """The frames of a message: bytes, or views of large arrays, which must not change until they are sent.

    Raises:
        InputError: It is not as the schema says, such as a state with NaN in it.
    """
    specs = array_specs(message.kind, len(message.images))
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


def decode(frames: Sequence[Frame], kinds: Collection[str], sizes: Mapping[str, int]) -> Message:
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
        arrays = _arrays(kind, layout, frames[1:], array_specs(kind, len(cameras)), dict(sizes))
        return Message(number, kind, fields, arrays, tuple(_images(cameras, arrays)))
    except InputError as error:
        raise BadMessageError(str(error), number) from None


def _header(frames: Sequence[Frame]) -> tuple[int, str, Any, list[Any]]:
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


def _image_arrays(images: Sequence[Image]) -> dict[str, Array]:
    return {f"{part} {i}": getattr(image, part) for i, image in enumerate(images) for part in IMAGE}


def _cameras(plain: object) -> tuple[CameraModel, ...]:
    """The cameras of a message's images, taken out of its fields."""
    cameras = plain.pop("cameras", []) if isinstance(plain, dict) else None
    if not isinstance(cameras, list) or len(cameras) > MOST_IMAGES:
        raise InputError(f"a message has at most {MOST_IMAGES} images with their cameras")
    return tuple(from_plain(CameraModel, camera, "'camera'") for camera in cameras)


def _images(cameras: Sequence[CameraModel], arrays: dict[str, Array]) -> list[Image]:
    found = []
    for i, camera in enumerate(cameras):
        colour, depth, taken = (arrays.pop(f"{part} {i}", None) for part in IMAGE)
        assert colour is not None, "an image without colour was refused"
        if colour.shape[:2] != (camera.height, camera.width):
            raise InputError(f"an image of {colour.shape} is not what its camera {shown(camera.name)} gives")
        found.append(Image(camera, colour, depth, None if taken is None else float(taken)))
    return found


def _arrays(
    kind: str,
    layout: list[Any],
    buffers: Sequence[Frame],
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


def _array(name: str, buffer: Frame, spec: ArraySpec, shape: tuple[int, ...]) -> Array:
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


def _contiguous(value: Array | float, dtype: np.dtype[Any]) -> Array:
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
