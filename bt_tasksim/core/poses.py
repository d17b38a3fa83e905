"""Rigid-body poses and rotations as pure, batched functions.

A pose is ``(..., 7)``: position in metres and a unit quaternion ``w x y z``. Every function accepts any
array of the Python array API standard (NumPy, torch, ...) with any leading batch dimensions, and what it
gives for one row does not depend on the others, to the last bit: products of small matrices are stacked
(`numpy.matmul` takes them one by one) and packed, and nothing is summed over a batch.

Formulas: J. Sola, "Quaternion kinematics for the error-state Kalman filter", arXiv 1711.02508.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import array_api_compat
import numpy as np

Array = Any
"""An array of the Python array API standard, such as ``numpy.ndarray`` or ``torch.Tensor``."""

_EPS = 1e-12
_SAME = 1e-9
"""Sine of the angle between directions that are the same, or opposite."""
_UP = [0.0, 0.0, 1.0]


def array_namespace(*arrays: Array) -> Any:
    """The functions that arrays come with: NumPy's own, or what `array_api_compat.array_namespace` gives.

    Raises:
        TypeError: The arrays are of different libraries, or one is none.
    """
    for array in arrays:
        if not isinstance(array, _NUMPY):
            return array_api_compat.array_namespace(*arrays)
    return np


_NUMPY = (np.ndarray, np.generic)


def _mul(a: list[float], b: list[float]) -> list[float]:
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]


def _rot(q: list[float], v: Sequence[float]) -> list[float]:
    w, x, y, z = q
    vx, vy, vz = v
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return [
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    ]


def constant(value: Any, like: Array) -> Array:
    """Plain numbers as an array of the same library, type and device as another one; not to be written.

    Few numbers are kept there, so that constants of a law go to a device once.
    """
    if type(like) is np.ndarray:
        return np.asarray(value, like.dtype)
    return _there(value, like, like.dtype)


def indices(value: np.ndarray, like: Array) -> Array:
    """Fixed whole numbers in the library and on the device of another array, see `constant`."""
    return value if type(like) is np.ndarray else _there(value, like, None)


def _there(value: Any, like: Array, dtype: Any) -> Array:
    xp = array_namespace(like)
    if isinstance(value, _PLAIN):
        plain = np.asarray(value)
        if plain.size <= _FEW:
            return _kept(xp, plain.tobytes(), plain.dtype.str, plain.shape, dtype, like.device)
    return xp.asarray(value, dtype=dtype, device=like.device)


@lru_cache(maxsize=4096)
def _kept(xp: Any, data: bytes, kind: str, shape: tuple[int, ...], dtype: Any, device: Any) -> Array:
    """Numbers on a device."""
    value = np.frombuffer(data, kind).reshape(shape).copy()
    return xp.asarray(value, dtype=dtype, device=device)


_PLAIN = (bool, int, float, list, tuple, np.ndarray, np.generic)
_FEW = 64


def host(array: Array) -> np.ndarray:
    """An array, or a number, in NumPy's form, wherever it is; what is not NumPy's may be a view."""
    if isinstance(array, np.ndarray):
        return array
    if array_api_compat.is_torch_array(array):
        return np.asarray(array.detach().cpu().numpy())
    try:
        return np.asarray(array)
    except (TypeError, RuntimeError, ValueError):  # it is on another device
        pass
    try:
        return np.from_dlpack(array)
    except (BufferError, RuntimeError, ValueError):  # and NumPy cannot look into that one's memory
        return np.from_dlpack(array_api_compat.to_device(array, "cpu"))


def clip(x: Array, low: Any, high: Any) -> Array:
    """``x (...)`` between bounds that broadcast against it."""
    xp = array_namespace(x)
    return xp.minimum(xp.maximum(x, constant(low, x)), constant(high, x))


def apply(matrices: Array, vectors: Array) -> Array:
    """Matrices ``(..., m, n)`` times vectors ``(..., n)``; batch dimensions broadcast.

    NumPy multiplies each row of a batch for itself. Other libraries make one product of all rows where the
    matrix is common to them, in which a row's last bits depend on how many there are: there the products are
    added up in order.
    """
    if isinstance(vectors, np.ndarray):
        return np.matmul(_packed(matrices, 2), _packed(vectors, 1)[..., None])[..., 0]
    return total(matrices * vectors[..., None, :])


def quat_multiply(a: Array, b: Array) -> Array:
    """Hamilton product ``a * b`` of quaternions ``(..., 4)``."""
    return apply(_gathered(a, _LEFT, _LEFT_SIGNS), b)


def quat_conjugate(q: Array) -> Array:
    """Inverse of unit quaternions ``(..., 4)``."""
    return q * constant(_CONJUGATE, q)


def norm(v: Array) -> Array:
    """Length ``(...)`` of vectors ``(..., n)``."""
    return array_namespace(v).sqrt(dot(v, v))


def dot(a: Array, b: Array) -> Array:
    """Inner product ``(...)`` of vectors ``(..., n)``."""
    return total(a * b)


def total(values: Array) -> Array:
    """Sum ``(...)`` over the last axis, from the first number on.

    A library's own order depends on how long an axis is and how it lies.
    """
    out = values[..., 0]
    for k in range(1, values.shape[-1]):
        out = out + values[..., k]
    return out


def mean(values: Array) -> Array:
    """Mean ``(...)`` over the last axis, added up as `total` does."""
    return total(values) / values.shape[-1]


def composed(a: list[float], b: list[float]) -> list[float]:
    """`multiply` of two poses in plain floats."""
    x, y, z = _rot(a[3:], b[:3])
    return [a[0] + x, a[1] + y, a[2] + z, *_mul(a[3:], b[3:])]


def turned(a: list[float], b: list[float]) -> list[float]:
    """`quat_multiply` of two quaternions in plain floats."""
    return _mul(a, b)


def inverted(pose: list[float]) -> list[float]:
    """`inverse` of a pose in plain floats."""
    x, y, z, qw, qx, qy, qz = pose
    r = _rot([qw, -qx, -qy, -qz], [x, y, z])
    return [-r[0], -r[1], -r[2], qw, -qx, -qy, -qz]


def point(pose: list[float], local: Sequence[float]) -> list[float]:
    """A point given in the frame of one pose, in its parent, all in plain floats."""
    x, y, z = _rot(pose[3:], local)
    return [pose[0] + x, pose[1] + y, pose[2] + z]


def rotated(q: list[float], v: Sequence[float]) -> list[float]:
    """`rotate` of one vector in plain floats."""
    return _rot(q, v)


def rotate(q: Array, v: Array) -> Array:
    """Vectors ``v (..., 3)`` rotated by unit quaternions ``q (..., 4)``; batch dimensions broadcast."""
    xp = array_namespace(q, v)
    cross_matrix = _gathered(q, _CROSS, _CROSS_SIGNS)
    once = xp.matmul(cross_matrix, _packed(v, 1)[..., None])
    twice = q[..., :1] * once[..., 0] + xp.matmul(cross_matrix, once)[..., 0]
    return v + (twice + twice)


def multiply(a: Array, b: Array) -> Array:
    """Composition ``a * b`` of poses ``(..., 7)``: the frame ``b``, given in ``a``, in ``a``'s parent."""
    position = a[..., :3] + rotate(a[..., 3:], b[..., :3])
    rotation = quat_multiply(a[..., 3:], b[..., 3:])
    return array_namespace(a, b).concat([position, rotation], axis=-1)


def inverse(pose: Array) -> Array:
    """Inverse of poses ``(..., 7)``."""
    q = quat_conjugate(pose[..., 3:])
    return array_namespace(pose).concat([-rotate(q, pose[..., :3]), q], axis=-1)


def relative(frame: Array, pose: Array) -> Array:
    """Poses ``(..., 7)``, given in the parent of ``frame (..., 7)``, as seen from that frame."""
    back = quat_conjugate(frame[..., 3:])
    position = rotate(back, pose[..., :3] - frame[..., :3])
    return array_namespace(frame, pose).concat([position, quat_multiply(back, pose[..., 3:])], axis=-1)


def transform(pose: Array, point: Array) -> Array:
    """Points ``(..., 3)`` given in the frame ``pose (..., 7)``, in its parent."""
    return pose[..., :3] + rotate(pose[..., 3:], point)


def localise(pose: Array, point: Array) -> Array:
    """Points ``(..., 3)`` given in the parent of the frame ``pose (..., 7)``, as seen from that frame."""
    return rotate(quat_conjugate(pose[..., 3:]), point - pose[..., :3])


def normalise(q: Array) -> Array:
    """Quaternions ``(..., 4)`` scaled to unit length."""
    return q / norm(q)[..., None]


def unit(v: Array) -> Array:
    """Vectors ``(..., n)``, none of them zero, scaled to unit length."""
    return v / norm(v)[..., None]


def unit_pose(pose: Any) -> Array:
    """A pose ``(7,)`` with its quaternion scaled to unit length, as files give a few digits only."""
    out = np.array(pose, float)
    out[3:] /= float(np.linalg.norm(out[3:]))
    return out


def z_axis(q: Array) -> Array:
    """Where the z axis points: unit vectors ``(..., 3)`` of rotations ``(..., 4)``."""
    return rotate(q, constant(_UP, q))


def tilt(q: Array, before: Array | None = None) -> Array:
    """Angle ``(...)`` in radians between the z axis of rotations ``(..., 4)`` and the vertical.

    Args:
        q: The rotations.
        before: Other ones, whose z axes count instead of the vertical.
    """
    up = z_axis(q)
    cosine = up[..., 2] if before is None else dot(z_axis(before), up)
    return array_namespace(q).acos(clip(cosine, -1.0, 1.0))


def rotation_vector(q: Array) -> Array:
    """Rotation vector ``(..., 3)`` in radians, of length at most pi, of unit quaternions ``(..., 4)``."""
    xp = array_namespace(q)
    sine = norm(q[..., 1:])
    flipped, small = q[..., 0] < 0.0, sine < _EPS
    angle = 2.0 * xp.atan2(sine, xp.abs(q[..., 0]))
    factor = xp.where(small, xp.full_like(sine, 2.0), angle / xp.where(small, xp.ones_like(sine), sine))
    return xp.where(flipped, -factor, factor)[..., None] * q[..., 1:]


def from_rotation_vector(v: Array) -> Array:
    """Unit quaternions ``(..., 4)`` of rotation vectors ``(..., 3)`` in radians."""
    xp = array_namespace(v)
    angle = norm(v)
    small = angle < _EPS
    half = xp.sin(angle / 2) / xp.where(small, xp.ones_like(angle), angle)
    factor = xp.where(small, xp.full_like(angle, 0.5), half)
    return xp.concat([xp.cos(angle / 2)[..., None], factor[..., None] * v], axis=-1)


def angle_between(a: Array, b: Array) -> Array:
    """Smallest rotation angle ``(...)`` in radians between unit quaternions ``(..., 4)``."""
    between = quat_multiply(quat_conjugate(a), b)
    xp = array_namespace(between)
    return 2.0 * xp.atan2(norm(between[..., 1:]), xp.abs(between[..., 0]))


def interpolate(a: Array, b: Array, fraction: Array) -> Array:
    """Poses between ``a`` and ``b (..., 7)``: straight in position, slerp in rotation.

    Args:
        a: Poses ``(..., 7)`` at fraction 0.
        b: Poses ``(..., 7)`` at fraction 1.
        fraction: ``(...)``, usually in [0, 1].
    """
    xp = array_namespace(a, b)
    share = constant(fraction, a)[..., None]
    turn = rotation_vector(quat_multiply(quat_conjugate(a[..., 3:]), b[..., 3:]))
    rotation = quat_multiply(a[..., 3:], from_rotation_vector(share * turn))
    position = a[..., :3] + share * (b[..., :3] - a[..., :3])
    return xp.concat([position, rotation], axis=-1)


def shortest_turn(a: Array, b: Array, aside: Array | None = None) -> Array:
    """Rotation vectors ``(..., 3)`` of the shortest turns of unit vectors ``(..., 3)`` onto others, radians.

    Args:
        a: The unit vectors.
        b: Where they are to point.
        aside: Unit vectors at right angles to ``a`` about which those turn that point straight away from
            ``b``; by default some.
    """
    xp = array_namespace(a, b)
    about = cross(a, b)
    length = norm(about)
    same = length <= _SAME
    angle = xp.atan2(length, dot(a, b))
    turn = about * (angle / xp.where(same, xp.ones_like(length), length))[..., None]
    return xp.where(same[..., None], angle[..., None] * (_across(a) if aside is None else aside), turn)


def _across(a: Array) -> Array:
    """Unit vectors ``(..., 3)`` at right angles to others."""
    xp = array_namespace(a)
    x, y, z = (xp.abs(a[..., k : k + 1]) for k in range(3))
    along_x, along_y, along_z = (constant(axis, a) for axis in _AXES.tolist())
    least = xp.where(y <= z, along_y, along_z)
    return unit(cross(a, xp.where((x <= y) & (x <= z), along_x, least)))


def frame_from_axes(z: Array, y: Array) -> Array:
    """Unit quaternions ``(..., 4)`` of the frame with the given z axis and its y axis nearest to ``y``.

    Args:
        z: Vectors ``(..., 3)``, not zero.
        y: Vectors ``(..., 3)``, not parallel to ``z``.
    """
    z = unit(z)
    y = unit(y - z * dot(y, z)[..., None])
    return from_matrix(array_namespace(z, y).stack([cross(y, z), y, z], axis=-1))


def cross(a: Array, b: Array) -> Array:
    """Cross product of vectors ``(..., 3)``."""
    xp = array_namespace(a, b)
    return xp.stack(
        [
            a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1],
            a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
            a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0],
        ],
        axis=-1,
    )


def from_matrix(m: Array) -> Array:
    """Unit quaternions ``(..., 4)`` of rotation matrices ``(..., 3, 3)``, stable at every angle."""
    xp = array_namespace(m)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    # The four candidates are the rows of 4 q q^T; the longest one is well conditioned.
    sizes = [1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz]
    ww, xx, yy, zz = sizes
    rows = [[ww, wx, wy, wz], [wx, xx, xy, xz], [wy, xy, yy, yz], [wz, xz, yz, zz]]
    best = xp.argmax(xp.stack(sizes, axis=-1), axis=-1)
    chosen = xp.stack(rows[0], axis=-1)
    for i in range(1, 4):
        here = best == i
        if not isinstance(here, np.ndarray) or here.any():
            chosen = xp.where(here[..., None], xp.stack(rows[i], axis=-1), chosen)
    return normalise(chosen)


def to_matrix(q: Array) -> Array:
    """Rotation matrices ``(..., 3, 3)`` of unit quaternions ``(..., 4)``."""
    turned = rotate(q[..., None, :], constant(_AXES, q))
    if isinstance(turned, np.ndarray):
        return np.ascontiguousarray(turned.swapaxes(-1, -2))
    xp = array_namespace(q)
    return xp.stack([turned[..., i, :] for i in range(3)], axis=-1)


def shifted(pose: Array, by: Array) -> Array:
    """Poses ``(..., 7)``, displaced by ``by (..., 3)`` metres along the axes of their parent."""
    xp = array_namespace(pose)
    return xp.concat([pose[..., :3] + by, pose[..., 3:]], axis=-1)


def yaw(angle: float) -> Array:
    """Unit quaternion ``(4,)`` of a rotation about z by ``angle`` radians."""
    return np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])


def pose(position: Array, rotation: Array | None = None) -> Array:
    """A NumPy pose ``(7,)`` of a position ``(3,)`` and a quaternion ``(4,)``, by default the identity."""
    q = np.array([1.0, 0.0, 0.0, 0.0]) if rotation is None else np.asarray(rotation, float)
    return np.concatenate([np.asarray(position, float), q])


def _gathered(q: Array, index: Array, signs: Array) -> Array:
    """Matrices ``(..., m, n)`` that are made of the numbers of quaternions ``(..., 4)`` with signs."""
    if isinstance(q, np.ndarray):
        return q.take(index, axis=-1) * signs.astype(q.dtype, copy=False)
    xp = array_namespace(q)
    flat = xp.take(q, indices(index.reshape(-1), q), axis=-1)
    return xp.reshape(flat, (*q.shape[:-1], *index.shape)) * constant(signs, q)


def _packed(values: Array, axes: int) -> Array:
    """The same numbers, the last axes of which lie side by side in memory.

    `numpy.matmul` adds up in another order where they do not, and how an array of one world lies may differ
    from how one of many does.
    """
    if isinstance(values, np.ndarray):
        step = values.itemsize
        for axis in range(1, axes + 1):
            if values.strides[-axis] != step:
                return np.ascontiguousarray(values)
            step *= values.shape[-axis]
    return values


_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_AXES = np.eye(3)
_LEFT = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]])
_LEFT_SIGNS = np.array([[1.0, -1, -1, -1], [1, 1, -1, 1], [1, 1, 1, -1], [1, -1, 1, 1]])
"""The matrix of the product with a quaternion on the left."""
_CROSS = np.array([[0, 3, 2], [3, 0, 1], [2, 1, 0]])
_CROSS_SIGNS = np.array([[0.0, -1, 1], [1, 0, -1], [-1, 1, 0]])
"""The matrix of the cross product with a quaternion's vector on the left."""
