"""Boxes about shapes that move with frames: which pairs of shapes are so near that they have to be compared.

A box is upright in the frame of its shape, and looked at as the upright box about it in the base's frame. All
pairs in all postures are looked at together. Of two shapes whose boxes are apart nobody has to ask coal, and
what it needs for a pair takes longer to make than to use.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

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


class BoxPairs:
    """Pairs of boxes in frames.

    Args:
        boxes: Boxes ``(n, 4, 4)`` in their frames, see `box_of`.
        frames: Numbers ``(n,)`` of the frames; 0 is the base's, which stands still.
        pairs: Numbers ``(k, 2)`` of boxes.
        margins: Metres ``(k,)`` within which their shapes count as touching.

    Attributes:
        pairs: The pairs: those of which both move, then those of which one does, then those of which none
            does, which always count as near.
        margins: Their margins.
    """

    def __init__(self, boxes: Array, frames: Array, pairs: Array, margins: Array) -> None:
        moves = frames > 0
        first, second = moves[pairs].T
        movers = first.astype(int) + second
        order = np.argsort(-movers, kind="stable")
        self.pairs, self.margins = pairs[order], margins[order]
        self._both, moved = int((movers == 2).sum()), int((movers > 0).sum())
        self._still, order = len(pairs) - moved, order[:moved]
        self._moving, self._frames = boxes[moves], frames[moves]
        places = np.cumsum(moves) - 1
        ends = pairs[order].T
        mover, other = np.where(first[order], ends, ends[::-1])
        room = (margins[order] + _SLACK)[:, None]
        self._first, self._second = places[mover], places[other[: self._both]]
        half, self._middle = _upright(boxes[other[self._both :]])
        self._room_both, self._room = room[: self._both], room[self._both :] + half

    def near(self, frames: Array) -> Array:
        """Whether ``(m, k)`` boxes of pairs come near each other where frames are at ``(m, f, 4, 4)``.

        Where a frame is nowhere, all of its pairs do.
        """
        half, middle = _upright(frames.take(self._frames, axis=1) @ self._moving)
        room, apart = half.take(self._first, axis=1), middle.take(self._first, axis=1)
        both = self._both
        if both:
            room[:, :both] += half.take(self._second, axis=1)
            room[:, :both] += self._room_both
            apart[:, :both] -= middle.take(self._second, axis=1)
        room[:, both:] += self._room
        apart[:, both:] -= self._middle
        far = np.abs(apart, out=apart) > room
        near: Array = ~(far[..., 0] | far[..., 1] | far[..., 2])
        return near if not self._still else np.pad(near, ((0, 0), (0, self._still)), constant_values=True)


def _upright(boxes: Array) -> tuple[Array, Array]:
    """Half the sizes and the middles, both ``(..., 3)``, of the upright boxes about boxes ``(..., 4, 4)``."""
    axes = np.abs(boxes[..., :3, :3])
    return axes[..., 0] + axes[..., 1] + axes[..., 2], boxes[..., :3, 3]


_STILL = np.eye(4)
"""Where the base is."""


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
        found[:, 0] = here = _STILL
        if len(joints) == 1:
            for i, step in enumerate(steps[0], 1):
                found[0, i] = here = here.dot(step)
            return found
        for i in range(joints.shape[1]):
            np.matmul(found[:, i], steps[:, i], out=found[:, i + 1])
        return found


def _moved(model: pin.Model, i: int) -> tuple[Array, Array, Array]:
    """A joint's placement ``(4, 4)`` in the frame of the one before: always, by its sine, by its cosine.

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
