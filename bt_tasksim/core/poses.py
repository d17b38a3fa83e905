"""Rigid-body poses and rotations as pure, batched functions.

A pose is ``(..., 7)``: position in metres and a unit quaternion ``w x y z``. Every function accepts any
array of the Python array API standard (NumPy, torch, ...) with any leading batch dimensions. A single
unbatched NumPy pose, which is what a tree in execution works with, takes a path in plain floats that
computes the same numbers several times faster.

Formulas: J. Sola, "Quaternion kinematics for the error-state Kalman filter", arXiv 1711.02508.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import array_api_compat
import array_api_compat.numpy
import numpy as np

Array = Any
"""An array of the Python array API standard, such as ``numpy.ndarray`` or ``torch.Tensor``."""

_EPS = 1e-12
_UP = [0.0, 0.0, 1.0]


def array_namespace(*arrays: Array) -> Any:
    """The functions that arrays come with, as `array_api_compat.array_namespace`; quick for NumPy's.

    Raises:
        TypeError: The arrays are of different libraries, or one is none.
    """
    for array in arrays:
        if not isinstance(array, _NUMPY):
            return array_api_compat.array_namespace(*arrays)
    return array_api_compat.numpy


_NUMPY = (np.ndarray, np.generic)


def _single(a: Array) -> bool:
    return type(a) is np.ndarray and a.ndim == 1


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
    """Plain numbers as an array of the same library, type and device as another one."""
    if type(like) is np.ndarray:
        return np.asarray(value, like.dtype)
    return array_namespace(like).asarray(value, dtype=like.dtype, device=like.device)


def clip(x: Array, low: Any, high: Any) -> Array:
    """``x (...)`` between bounds that broadcast against it."""
    if isinstance(x, _NUMPY):
        return np.minimum(np.maximum(x, low), high)
    return array_namespace(x).clip(x, constant(low, x), constant(high, x))


def quat_multiply(a: Array, b: Array) -> Array:
    """Hamilton product ``a * b`` of quaternions ``(..., 4)``."""
    if _single(a) and _single(b):
        return np.array(_mul(a.tolist(), b.tolist()))
    xp = array_namespace(a, b)
    aw, ax, ay, az = (a[..., i] for i in range(4))
    bw, bx, by, bz = (b[..., i] for i in range(4))
    return xp.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def quat_conjugate(q: Array) -> Array:
    """Inverse of unit quaternions ``(..., 4)``."""
    if _single(q):
        w, x, y, z = q.tolist()
        return np.array([w, -x, -y, -z])
    xp = array_namespace(q)
    return xp.concat([q[..., :1], -q[..., 1:]], axis=-1)


def norm(v: Array) -> Array:
    """Length ``(...)`` of vectors ``(..., n)``."""
    if _single(v):
        return np.float64(math.sqrt(v @ v))
    xp = array_namespace(v)
    return xp.sqrt(xp.sum(v * v, axis=-1))


def dot(a: Array, b: Array) -> Array:
    """Inner product ``(...)`` of vectors ``(..., n)``."""
    if _single(a) and _single(b):
        return np.float64(a @ b)
    xp = array_namespace(a, b)
    return xp.sum(a * b, axis=-1)


def composed(a: list[float], b: list[float]) -> list[float]:
    """`multiply` of two poses in plain floats."""
    x, y, z = _rot(a[3:], b[:3])
    return [a[0] + x, a[1] + y, a[2] + z, *_mul(a[3:], b[3:])]


def inverted(pose: list[float]) -> list[float]:
    """`inverse` of a pose in plain floats."""
    x, y, z, qw, qx, qy, qz = pose
    r = _rot([qw, -qx, -qy, -qz], [x, y, z])
    return [-r[0], -r[1], -r[2], qw, -qx, -qy, -qz]


def point(pose: list[float], local: Sequence[float]) -> list[float]:
    """A point given in the frame of one pose, in its parent, all in plain floats."""
    x, y, z = _rot(pose[3:], local)
    return [pose[0] + x, pose[1] + y, pose[2] + z]


def rotate(q: Array, v: Array) -> Array:
    """Vectors ``v (..., 3)`` rotated by unit quaternions ``q (..., 4)``; batch dimensions broadcast."""
    if _single(q) and _single(v):
        return np.array(_rot(q.tolist(), v.tolist()))
    xp = array_namespace(q, v)
    w, x, y, z = (q[..., i] for i in range(4))
    vx, vy, vz = (v[..., i] for i in range(3))
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return xp.stack(
        [vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx],
        axis=-1,
    )


def multiply(a: Array, b: Array) -> Array:
    """Composition ``a * b`` of poses ``(..., 7)``: the frame ``b``, given in ``a``, in ``a``'s parent."""
    if _single(a) and _single(b):
        return np.array(composed(a.tolist(), b.tolist()))
    xp = array_namespace(a, b)
    position = a[..., :3] + rotate(a[..., 3:], b[..., :3])
    rotation = quat_multiply(a[..., 3:], b[..., 3:])
    return xp.concat([position, rotation], axis=-1)


def inverse(pose: Array) -> Array:
    """Inverse of poses ``(..., 7)``."""
    if _single(pose):
        return np.array(inverted(pose.tolist()))
    xp = array_namespace(pose)
    q = quat_conjugate(pose[..., 3:])
    return xp.concat([-rotate(q, pose[..., :3]), q], axis=-1)


def transform(pose: Array, point: Array) -> Array:
    """Points ``(..., 3)`` given in the frame ``pose (..., 7)``, in its parent."""
    if _single(pose) and _single(point):
        p = pose.tolist()
        r = _rot(p[3:], point.tolist())
        return np.array([p[0] + r[0], p[1] + r[1], p[2] + r[2]])
    return pose[..., :3] + rotate(pose[..., 3:], point)


def normalise(q: Array) -> Array:
    """Quaternions ``(..., 4)`` scaled to unit length."""
    xp = array_namespace(q)
    return q / xp.sqrt(xp.sum(q * q, axis=-1, keepdims=True))


def unit_pose(pose: Any) -> Array:
    """A pose ``(7,)`` with its quaternion scaled to unit length, as files give a few digits only."""
    out = np.array(pose, float)
    out[3:] /= float(np.linalg.norm(out[3:]))
    return out


def z_axis(q: Array) -> Array:
    """Where the z axis points: unit vectors ``(..., 3)`` of rotations ``(..., 4)``."""
    return rotate(q, constant([0.0, 0.0, 1.0], q))


def tilt(q: Array, before: Array | None = None) -> Array:
    """Angle ``(...)`` in radians between the z axis of rotations ``(..., 4)`` and the vertical.

    Args:
        q: The rotations.
        before: Other ones, whose z axes count instead of the vertical.
    """
    if _single(q) and (before is None or _single(before)):
        a, b = _rot(q.tolist(), _UP), _UP if before is None else _rot(before.tolist(), _UP)
        return np.float64(math.acos(min(max(a[0] * b[0] + a[1] * b[1] + a[2] * b[2], -1.0), 1.0)))
    up = z_axis(q)
    cosine = up[..., 2] if before is None else dot(z_axis(before), up)
    return array_namespace(q).acos(clip(cosine, -1.0, 1.0))


def rotation_vector(q: Array) -> Array:
    """Rotation vector ``(..., 3)`` in radians, of length at most pi, of unit quaternions ``(..., 4)``."""
    if _single(q):
        w, x, y, z = q.tolist()
        if w < 0:
            w, x, y, z = -w, -x, -y, -z
        s = math.sqrt(x * x + y * y + z * z)
        k = 2 * math.atan2(s, w) / s if s > _EPS else 2.0
        return np.array([k * x, k * y, k * z])
    xp = array_namespace(q)
    q = xp.where(q[..., :1] < 0, -q, q)
    s = xp.sqrt(xp.sum(q[..., 1:] ** 2, axis=-1, keepdims=True))
    small = s < _EPS
    k = xp.where(
        small, xp.full_like(s, 2.0), 2 * xp.atan2(s, q[..., :1]) / xp.where(small, xp.ones_like(s), s)
    )
    return k * q[..., 1:]


def from_rotation_vector(v: Array) -> Array:
    """Unit quaternions ``(..., 4)`` of rotation vectors ``(..., 3)`` in radians."""
    if _single(v):
        x, y, z = v.tolist()
        a = math.sqrt(x * x + y * y + z * z)
        k = math.sin(a / 2) / a if a > _EPS else 0.5
        return np.array([math.cos(a / 2), k * x, k * y, k * z])
    xp = array_namespace(v)
    a = xp.sqrt(xp.sum(v * v, axis=-1, keepdims=True))
    small = a < _EPS
    k = xp.where(small, xp.full_like(a, 0.5), xp.sin(a / 2) / xp.where(small, xp.ones_like(a), a))
    return xp.concat([xp.cos(a / 2), k * v], axis=-1)


def angle_between(a: Array, b: Array) -> Array:
    """Smallest rotation angle ``(...)`` in radians between unit quaternions ``(..., 4)``."""
    v = rotation_vector(quat_multiply(quat_conjugate(a), b))
    if _single(v):
        x, y, z = v.tolist()
        return np.float64(math.sqrt(x * x + y * y + z * z))
    xp = array_namespace(v)
    return xp.sqrt(xp.sum(v * v, axis=-1))


def interpolate(a: Array, b: Array, fraction: Array) -> Array:
    """Poses between ``a`` and ``b (..., 7)``: straight in position, slerp in rotation.

    Args:
        a: Poses ``(..., 7)`` at fraction 0.
        b: Poses ``(..., 7)`` at fraction 1.
        fraction: ``(...)``, usually in [0, 1].
    """
    if _single(a) and _single(b) and np.ndim(fraction) == 0:
        f = float(fraction)
        al, bl = a.tolist(), b.tolist()
        qa = al[3:]
        d = _mul([qa[0], -qa[1], -qa[2], -qa[3]], bl[3:])
        if d[0] < 0:
            d = [-c for c in d]
        s = math.sqrt(d[1] * d[1] + d[2] * d[2] + d[3] * d[3])
        h = f * math.atan2(s, d[0])
        k = math.sin(h) / s if s > _EPS else 0.0
        q = _mul(qa, [math.cos(h), k * d[1], k * d[2], k * d[3]])
        return np.array([al[i] + f * (bl[i] - al[i]) for i in range(3)] + q)
    xp = array_namespace(a, b)
    f = xp.asarray(fraction)[..., None]
    d = quat_multiply(quat_conjugate(a[..., 3:]), b[..., 3:])
    q = quat_multiply(a[..., 3:], from_rotation_vector(f * rotation_vector(d)))
    return xp.concat([a[..., :3] + f * (b[..., :3] - a[..., :3]), q], axis=-1)


def frame_from_axes(z: Array, y: Array) -> Array:
    """Unit quaternions ``(..., 4)`` of the frame with the given z axis and its y axis nearest to ``y``.

    Args:
        z: Vectors ``(..., 3)``, not zero.
        y: Vectors ``(..., 3)``, not parallel to ``z``.
    """
    xp = array_namespace(z, y)
    z = z / xp.sqrt(xp.sum(z * z, axis=-1, keepdims=True))
    y = y - z * xp.sum(y * z, axis=-1, keepdims=True)
    y = y / xp.sqrt(xp.sum(y * y, axis=-1, keepdims=True))
    x = cross(y, z)
    return from_matrix(xp.stack([x, y, z], axis=-1))


def cross(a: Array, b: Array) -> Array:
    """Cross product of vectors ``(..., 3)``."""
    if _single(a) and _single(b):
        (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
        return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
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
    rows = xp.stack(
        [
            xp.stack([1 + xx + yy + zz, wx, wy, wz], axis=-1),
            xp.stack([wx, 1 + xx - yy - zz, xy, xz], axis=-1),
            xp.stack([wy, xy, 1 - xx + yy - zz, yz], axis=-1),
            xp.stack([wz, xz, yz, 1 - xx - yy + zz], axis=-1),
        ],
        axis=-2,
    )
    best = xp.argmax(xp.stack([rows[..., i, i] for i in range(4)], axis=-1), axis=-1)
    chosen = rows[..., 0, :]
    for i in range(1, 4):
        chosen = xp.where((best == i)[..., None], rows[..., i, :], chosen)
    return normalise(chosen)


def to_matrix(q: Array) -> Array:
    """Rotation matrices ``(..., 3, 3)`` of unit quaternions ``(..., 4)``."""
    if _single(q):
        w, x, y, z = q.tolist()
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
    xp = array_namespace(q)
    eye = xp.eye(3, dtype=q.dtype)
    shape = (*q.shape[:-1], 3)
    return xp.stack([rotate(q, xp.broadcast_to(eye[i], shape)) for i in range(3)], axis=-1)


def yaw(angle: float) -> Array:
    """Unit quaternion ``(4,)`` of a rotation about z by ``angle`` radians."""
    return np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])


def pose(position: Array, rotation: Array | None = None) -> Array:
    """A NumPy pose ``(7,)`` of a position ``(3,)`` and a quaternion ``(4,)``, by default the identity."""
    q = np.array([1.0, 0.0, 0.0, 0.0]) if rotation is None else np.asarray(rotation, float)
    return np.concatenate([np.asarray(position, float), q])
