"""Boxes about shapes that move with frames: which pairs of shapes are so near that they have to be compared.

A box is upright in the frame of its shape, and looked at as the upright box about it in the base's frame. All
pairs in all postures are looked at together. Of two shapes whose boxes are apart nobody has to ask coal, and
what it needs for a pair takes longer to make than to use.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from bt_tasksim.core.poses import Array

_SLACK = 1e-5
"""Metres, beside their margins, within which boxes count as near: far more than coal is wrong by."""


def box_of(shape: Any, placement: Array) -> Array:
    """The box about one of coal's shapes, with what is swept about it: half its axes, and its middle.

    Args:
        shape: The shape.
        placement: Where it is ``(4, 4)`` in a frame.

    Returns:
        ``(4, 4)``, in that frame.
    """
    shape.computeLocalAABB()
    box = shape.aabb_local
    low, high = box.min_, box.max_
    found: Array = placement.copy()
    found[:3, 3] += placement[:3, :3].dot(0.5 * (low + high))
    found[:, :3] *= 0.5 * (high - low)
    return found


class Boxes(NamedTuple):
    """Pairs of boxes in frames, some of which move.

    Attributes:
        still: Boxes ``(s, 4, 4)`` in the base's frame, see `box_of`.
        moving: Boxes ``(n, 4, 4)`` in frames that move.
        frames: Numbers ``(n,)`` of these.
        first, second: Numbers ``(k,)`` of the boxes of each pair, those that move before those that do not.
        margins: Metres ``(k, 1)`` within which their shapes count as near.
    """

    still: tuple[Array, Array]
    moving: Array
    frames: Array
    first: Array
    second: Array
    margins: Array

    @classmethod
    def of(cls, boxes: Array, frames: Array, pairs: Array, margins: Array) -> Boxes:
        """Those of all shapes.

        Args:
            boxes: Boxes ``(n, 4, 4)`` in their frames.
            frames: Numbers ``(n,)`` of the frames; 0 is the base's.
            pairs: Numbers ``(k, 2)`` of boxes.
            margins: Metres ``(k,)`` within which their shapes count as touching.
        """
        moves = frames > 0
        places = np.empty(len(frames), int)
        order = np.concatenate([np.flatnonzero(moves), np.flatnonzero(~moves)])
        places[order] = np.arange(len(order))
        first, second = places[pairs].T
        still = _upright(boxes[~moves])
        return cls(still, boxes[moves], frames[moves], first, second, (margins + _SLACK)[:, None])

    def near(self, frames: Array) -> Array:
        """Whether ``(m, k)`` boxes of pairs come near each other where frames are at ``(m, f, 4, 4)``."""
        half, middle = _upright(frames.take(self.frames, axis=1) @ self.moving)
        m, more = len(frames), self.still[0].shape
        half = np.concatenate([half, np.broadcast_to(self.still[0], (m, *more))], axis=1)
        middle = np.concatenate([middle, np.broadcast_to(self.still[1], (m, *more))], axis=1)
        room = half.take(self.first, axis=1)
        room += half.take(self.second, axis=1)
        room += self.margins
        apart = middle.take(self.first, axis=1)
        apart -= middle.take(self.second, axis=1)
        near = np.abs(apart, out=apart) <= room
        found: Array = near[..., 0] & near[..., 1] & near[..., 2]
        return found


def _upright(boxes: Array) -> tuple[Array, Array]:
    """Half the sizes and the middles, both ``(..., 3)``, of the upright boxes about boxes ``(..., 4, 4)``."""
    axes = np.abs(boxes[..., :3, :3])
    return axes[..., 0] + axes[..., 1] + axes[..., 2], boxes[..., :3, 3]


class ArmFrames:
    """Where the base and the joints of an arm are, for many postures together.

    Args:
        model: Pinocchio's model of the arm alone, whose joints follow one another.
    """

    def __init__(self, model: pin.Model) -> None:
        joints = [_moved(model, i) for i in range(1, model.njoints)]
        self._fixed, self._first, self._second = (np.array(part) for part in zip(*joints, strict=True))
        self._slides = ~self._second.any(axis=(1, 2))

    def __call__(self, joints: Array) -> Array:
        """Placements ``(m, n_arm + 1, 4, 4)`` for joints ``(m, n_arm)``, the base's first."""
        sine, cosine = np.sin(joints), np.cos(joints)
        if self._slides.any():
            sine = np.where(self._slides, joints, sine)
        steps = self._fixed + sine[..., None, None] * self._first + cosine[..., None, None] * self._second
        found = np.empty((joints.shape[0], joints.shape[1] + 1, 4, 4))
        found[:, 0] = np.eye(4)
        for i in range(joints.shape[1]):
            np.matmul(found[:, i], steps[:, i], out=found[:, i + 1])
        return found


def _moved(model: pin.Model, i: int) -> tuple[Array, Array, Array]:
    """A joint's placement in the frame of the one before: ``(4, 4)`` at all times, by its sine, by its cosine.

    Of a slide there is no cosine, and in place of the sine stands how far it is out.
    """
    joint = model.joints[i]
    data = joint.createData()
    joint.calc(data, np.zeros(1))
    motion, placement = np.asarray(data.S, float).reshape(6), model.jointPlacements[i].homogeneous
    fixed, first, second = np.eye(4), np.zeros((4, 4)), np.zeros((4, 4))
    if motion[3:].any():
        x, y, z = motion[3:]
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        fixed[:3, :3] += cross @ cross
        first[:3, :3], second[:3, :3] = cross, -cross @ cross
    else:
        first[:3, 3] = motion[:3]
    return placement @ fixed, placement @ first, placement @ second


def carriers(model: pin.Model, names: Sequence[str]) -> list[int]:
    """For each joint of a model the number, from 1, of the arm's joint that moves it; 0 where none does.

    Args:
        model: Pinocchio's model of the whole robot.
        names: The arm's joints from the base on.
    """
    found = [0] * model.njoints
    for i in range(1, model.njoints):
        name = model.names[i]
        found[i] = names.index(name) + 1 if name in names else found[model.parents[i]]
    return found
