"""What keeps a thing that two soft pads hold from turning between them, which PhysX does not know.

A soft pad touches a patch and not a point, and so resists being twisted by up to two thirds of friction times
force times the patch's radius (R. D. Howe and M. R. Cutkosky, "Practical force-motion models for sliding
manipulation", Int. J. Robotics Research 15(6), 1996). PhysX's own patches do less. With SAPIEN's tolerances
an egg swings between two fingers like a pendulum without this law. With a length of 1 cm in
`bt_tasksim.engines.physx` it does not, and of 90 random tasks with the Panda and the SO-100 86 succeeded
without the law and 89 with it; with the 3 cm in use that was not counted again.

The resistance is that of a bristle that bends and slips (C. Canudas de Wit and others, "A new
model for control of systems with friction", IEEE Trans. Automatic Control 40(3), 1995).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.sapien_world import floats
from bt_tasksim.robot.description import Pads

if TYPE_CHECKING:
    from sapien import physx

STIFF, DAMPED = 0.25, 0.5
"""The bristle's stiffness and damping, as shares of the thing's inertia about the axis over the square of a
step, and over a step: so it is as stiff as steps of any length allow."""
PADS = 2
"""Fingertips of a hand that holds things between two pads; one with more of them holds by more points."""
PRESSED = 0.5
"""Newtons from which a fingertip holds."""


class Twist:
    """The pads' resistance in one world.

    Args:
        pads: The pads.
        opposition: Groups of fingertips that press against each other.
        hand: The link that carries the tool.
        closing: Unit vector ``(3,)`` along which the hand closes, in that link's frame.
        bodies: The objects.
        inertia: Frame of the principal axes and principal moments (kg m^2), by object.
    """

    def __init__(
        self,
        pads: Pads,
        opposition: Sequence[Sequence[int]],
        hand: physx.PhysxArticulationLinkComponent,
        closing: Array,
        bodies: Sequence[physx.PhysxRigidDynamicComponent],
        inertia: Sequence[tuple[list[float], list[float]]],
    ) -> None:
        self._most = 2.0 / 3.0 * pads.friction * pads.min_patch_radius
        self._opposition, self._hand, self._bodies, self._inertia = opposition, hand, bodies, inertia
        self._across = closing.tolist()
        self._held = -1
        self._turned = self._slipped = 0.0

    @property
    def holds(self) -> bool:
        """Something is held."""
        return self._held >= 0

    def let_go(self) -> None:
        """Nothing is held until the next look: what was read of the pads does not hold while they part.

        Until then they may be long off the thing, and what no longer touches it would turn it. A lid between
        open fingers was thrown shut at 4 rad/s.
        """
        self._held = -1

    def look(self, tip_force: Sequence[Sequence[float]], hand_force: Sequence[float]) -> None:
        """What is held, and how firmly, for the next steps.

        Args:
            tip_force: On each fingertip, N.
            hand_force: Of the robot on each object, N.
        """
        if len(tip_force) != PADS:
            return
        last, self._held = self._held, -1
        which = max(range(len(hand_force)), key=hand_force.__getitem__, default=-1)
        if which < 0 or hand_force[which] < PRESSED:
            return
        sides = [max([math.hypot(*tip_force[tip]) for tip in side], default=0.0) for side in self._opposition]
        if min(sides) < PRESSED:
            return
        body = self._bodies[which]
        hand, thing = _turn(self._hand), _turn(body)
        self._held = which
        if which != last:
            self._turned, self._slipped = 0.0, 0.0
            self._back = _back(poses.turned(_back(hand), thing))
        self._limit = self._most * sum(sides)
        self._axis = poses.rotated(hand, self._across)
        frame, moments = self._inertia[which]
        along = poses.rotated(_back(poses.turned(thing, frame[3:])), self._axis)
        self._moment = sum(a * a * moment for a, moment in zip(along, moments, strict=True))

    def resist(self, step: float) -> None:
        """Act for the next step of so many seconds.

        How far the thing has turned in the hand is seen from where both are: PhysX's speeds hold what parts
        bodies that overlap, too.
        """
        body = self._bodies[self._held]
        _, _, _, hw, hx, hy, hz = floats(self._hand.entity_pose)
        _, _, _, tw, tx, ty, tz = floats(body.entity_pose)
        # Written out, of quaternions: the thing's in the hand, and that times what it was when it was taken.
        rw, rx = hw * tw + hx * tx + hy * ty + hz * tz, hw * tx - hx * tw - hy * tz + hz * ty
        ry, rz = hw * ty + hx * tz - hy * tw - hz * tx, hw * tz - hx * ty + hy * tx - hz * tw
        bw, bx, by, bz = self._back
        w = rw * bw - rx * bx - ry * by - rz * bz
        a, b, c = self._across
        turned = (rw * bx + rx * bw + ry * bz - rz * by) * a
        turned += (rw * by - rx * bz + ry * bw + rz * bx) * b
        turned += (rw * bz + rx * by - ry * bx + rz * bw) * c
        turned *= 2.0 if w >= 0.0 else -2.0
        stiffness, damping = STIFF * self._moment / (step * step), DAMPED * self._moment / step
        torque = -stiffness * (turned - self._slipped) - damping * (turned - self._turned) / step
        if abs(torque) > self._limit:
            torque = math.copysign(self._limit, torque)
            most = self._limit / stiffness
            self._slipped = min(max(self._slipped, turned - most), turned + most)
        self._turned = turned
        x, y, z = self._axis
        body.add_force_torque([0.0, 0.0, 0.0], [torque * x, torque * y, torque * z])


def _turn(body: physx.PhysxRigidBaseComponent) -> list[float]:
    """Quaternion of a body."""
    return list(floats(body.entity_pose)[3:])


def _back(turn: list[float]) -> list[float]:
    """The inverse of a unit quaternion."""
    w, x, y, z = turn
    return [w, -x, -y, -z]
