"""An arm as a chain of joints: where its tool is, and how it moves with each joint, for many rows at once.

All arrays in here have their rows last, ``(..., N)``: whatever a joint or an axis is, the worlds of one
operation lie side by side. Every operation acts on each row by itself, so a row's numbers do not depend on
the others.

The joints' frames are turned so that each joint moves about, or along, its own z axis. Going from the tool
back to the base gives the tool as each joint sees it, and that is all that the Jacobian in the tool's frame
needs (D. E. Orin and W. W. Schrader, "Efficient computation of the Jacobian for robot manipulators", Int. J.
Robotics Research 3(4), 1984).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from bt_tasksim.core.poses import Array, array_namespace, constant, from_matrix
from bt_tasksim.robot.kinematics.linear import total
from bt_tasksim.robot.kinematics.rows import chosen, some

_NEARLY_PI = 3e-2
"""rad from half a turn, within which the axis is read from the symmetric part of a rotation matrix."""


@dataclass(frozen=True)
class Chain:
    """The constants of an arm of ``n`` joints.

    Attributes:
        before: ``(n, 3, 3, 1)`` rotation of each joint's frame in that of the one before it.
        offset: ``(n, 3, 4, 1)`` its position there in the last column; else zeros.
        turns: ``(n, 1)`` one for a hinge, zero for a slide.
        tool: ``(3, 4, 1)`` the tool in the last joint's frame.
        slides: There is a slide.
    """

    before: Array
    offset: Array
    turns: Array
    tool: Array
    slides: bool

    @classmethod
    def of(cls, model: pin.Model, frame: str, like: Array) -> Chain:
        """The chain of a model whose joints follow one another.

        Args:
            model: The arm alone; hinges and slides.
            frame: Name of the frame that is the tool.
            like: An array of the library, type and device that the chain is for.
        """
        last, offset, before, turns = np.eye(3), [], [], []
        for i in range(1, model.njoints):
            joint = model.joints[i]
            data = joint.createData()
            joint.calc(data, np.zeros(1))
            motion = np.asarray(data.S, float).reshape(6)
            turn = bool(np.any(motion[3:]))
            own = _turned_to(motion[3:] if turn else motion[:3])
            placement = model.jointPlacements[i]
            before.append(last.T @ placement.rotation @ own)
            offset.append(np.column_stack([np.zeros((3, 3)), last.T @ placement.translation]))
            turns.append(float(turn))
            last = own
        tool = model.frames[model.getFrameId(frame)].placement
        end = last.T @ np.column_stack([tool.rotation, tool.translation])
        return cls(
            constant(np.array(before)[..., None], like),
            constant(np.array(offset)[..., None], like),
            constant(np.array(turns)[:, None], like),
            constant(end[..., None], like),
            not all(turns),
        )

    def seen(self, q: Array) -> Array:
        """The tool as the base sees it, and then each joint: rotation and position ``(n + 1, 3, 4, N)``.

        Args:
            q: Joints ``(n, N)``.
        """
        xp = array_namespace(q)
        n, rows = q.shape
        angle = q * self.turns if self.slides else q
        c, s = xp.cos(angle)[:, None, :], xp.sin(angle)[:, None, :]
        x, y, z = self.before[:, :, 0, ...], self.before[:, :, 1, ...], self.before[:, :, 2, ...]
        offset = self.offset
        axes = xp.empty((n, 3, 3, 1, rows), dtype=q.dtype, device=q.device)
        axes[:, 0, :, 0, :], axes[:, 1, :, 0, :], axes[:, 2, :, 0, :] = c * x + s * y, c * y - s * x, z
        if self.slides:
            way = (q - angle)[:, None, None, :] * z[:, :, None, :]
            offset = xp.concat([xp.zeros_like(way)] * 3 + [way], axis=2) + offset
        out = xp.empty((n + 1, 3, 4, rows), dtype=q.dtype, device=q.device)
        out[n, ...] = self.tool
        here = out[n, ...]
        for i in range(n - 1, -1, -1):
            terms = axes[i, ...] * here[:, None, ...]
            moved = terms[0, ...] + terms[1, ...]
            moved += terms[2, ...]
            moved += offset[i, ...]
            out[i, ...] = here = moved
        return out

    def jacobian(self, seen: Array) -> Array:
        """Transposed Jacobian ``(n, 6, N)`` of the tool's origin, tool frame: linear, then angular.

        Args:
            seen: What `seen` says.
        """
        xp = array_namespace(seen)
        joints = seen[1:, ...]
        turning = joints[:, 2, :3, ...]
        moving = joints[:, 0, 3:, ...] * joints[:, 1, :3, ...]
        moving = moving - joints[:, 1, 3:, ...] * joints[:, 0, :3, ...]
        if self.slides:
            hinge = self.turns[:, None, :]
            moving, turning = hinge * moving + (1.0 - hinge) * turning, hinge * turning
        return xp.concat([moving, turning], axis=1)


def _turned_to(axis: Array) -> Array:
    """A rotation matrix ``(3, 3)`` whose z axis is a unit vector ``(3,)``; exact for the axes themselves."""
    i = int(np.argmax(np.abs(axis)))
    aside = np.roll(np.eye(3)[i], 1)
    x = aside - axis * float(axis @ aside)
    x = x / math.sqrt(float(x @ x))
    return np.column_stack([x, np.cross(axis, x), axis])


def placements(poses: Array) -> Array:
    """Rotation and position ``(3, 4, N)`` of poses ``(7, N)``, with quaternions of any length."""
    xp = array_namespace(poses)
    q = poses[3:, ...]
    products = q[:, None, ...] * q[None, :, ...]
    square = total(q * q)
    flat = xp.reshape(products * (2.0 / square), (16, q.shape[1]))
    whole, one, sign = (constant(x, poses) for x in (_WHOLE, _ONE, _SIGN))
    rotation = whole + one * chosen(flat, _FIRST) + sign * chosen(flat, _SECOND)
    return xp.concat([xp.reshape(rotation, (3, 3, q.shape[1])), poses[:3, None, ...]], axis=1)


def turned(placements: Array, vectors: Array) -> Array:
    """Vectors ``(k, 3, N)`` given in the frames of placements ``(3, 4, N)``, in their parent's."""
    x, y, z = (placements[:, i, ...] * vectors[:, i : i + 1, ...] for i in range(3))
    return x + y + z


def poses_of(placements: Array) -> Array:
    """Poses ``(N, 7)`` of placements ``(3, 4, N)``; of the two quaternions the one that Eigen gives."""
    xp = array_namespace(placements)
    rotation = xp.permute_dims(placements[:, :3, ...], (2, 0, 1))
    q = from_matrix(rotation)
    q = xp.where((q[:, :1] < -0.5), -q, q)
    return xp.concat([xp.permute_dims(placements[:, 3, ...], (1, 0)), q], axis=-1)


# A rotation matrix, row by row: whole + one * q_a q_b + sign * q_c q_d, the products times two.
_WHOLE = np.eye(3).reshape(9, 1)
_FIRST = np.array([10, 6, 7, 6, 5, 11, 7, 11, 5])
_SECOND = np.array([15, 3, 2, 3, 15, 1, 2, 1, 10])
_ONE = np.array([-1.0, 1, 1, 1, -1, 1, 1, 1, -1]).reshape(9, 1)
_SIGN = np.array([-1.0, -1, 1, 1, -1, -1, -1, 1, -1]).reshape(9, 1)


def difference(here: Array, there: Array) -> Array:
    """The way ``(6, N)`` from one placement to another ``(3, 4, N)`` in the frame of the first.

    Position in metres, then the rotation vector of length at most pi.
    """
    xp = array_namespace(here, there)
    rows = here.shape[-1]
    gap = xp.concat([there[:, :3, ...], there[:, 3:, ...] - here[:, 3:, ...]], axis=1)
    way = here[0, :3, None, ...] * gap[0, ...]
    way += here[1, :3, None, ...] * gap[1, ...]
    way += here[2, :3, None, ...] * gap[2, ...]
    flat = xp.reshape(way, (12, rows))
    skew = chosen(flat, _LEFT) - chosen(flat, _RIGHT)
    sine = xp.sqrt(total(skew * skew) + _LEAST)  # both are twice what they are called
    cosine = flat[0, ...] + flat[5, ...] + flat[10, ...] - 1.0
    angle = xp.atan2(sine, cosine)
    turn = (angle / sine) * skew
    half = angle > math.pi - _NEARLY_PI
    if some(half):
        turn = xp.where(half, _half_turn(way, skew, angle), turn)
    return xp.concat([way[:, 3, ...], turn], axis=0)


_LEAST = 1e-37
"""Keeps a sine of zero from being divided by; nothing beside any other, and a number in float32, too."""
_LEFT, _RIGHT = np.array([9, 2, 4]), np.array([6, 8, 1])


def _half_turn(way: Array, skew: Array, angle: Array) -> Array:
    """Rotation vectors ``(3, N)`` of rotation matrices in ``way (3, 4, N)`` of nearly half a turn."""
    xp = array_namespace(way)
    cosine = xp.cos(angle)
    size = xp.stack([way[i, i, ...] - cosine for i in range(3)], axis=0)  # (1 - cosine) axis_i^2
    best = xp.argmax(size, axis=0)
    axis = xp.zeros_like(size)
    for i in range(3):
        row = xp.stack([way[i, j, ...] + way[j, i, ...] for j in range(3)], axis=0)
        row = xp.concat(
            [row[:i, ...], 2.0 * size[i : i + 1, ...], row[i + 1 :, ...]], axis=0
        )  # along the axis
        axis = xp.where(best == i, row, axis)
    axis = axis / xp.sqrt(total(axis * axis) + _LEAST)  # other rows may have no turn at all
    along = total(skew * axis)
    return xp.where(along < 0.0, -axis, axis) * angle
