"""Parts of fixtures in MuJoCo: bodies on a hinge or slide with friction, damping and a spring."""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING

from bt_tasksim.engines.physics.mujoco_contacts import SOLIMP, SOLREF
from bt_tasksim.scene.joints import Joint

if TYPE_CHECKING:
    import mujoco as mj

STICKING = [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""Impedance of friction: the most that MuJoCo has, so that a part creeps by a hundredth of a millimetre a
second under the force that just moves it. With MuJoCo's own it is a centimetre a second."""


def add_part_joint(mujoco: ModuleType, body: mj.MjsBody, name: str, joint: Joint) -> None:
    """The joint of a part, in a body that stands where its value is 0. A latch is the engine's to apply."""
    kinds = mujoco.mjtJoint
    made = body.add_joint(name=name, type=kinds.mjJNT_HINGE if joint.turns else kinds.mjJNT_SLIDE)
    made.pos, made.axis = joint.origin, joint.axis
    made.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    made.range = joint.limits
    made.solref_limit, made.solimp_limit = list(SOLREF), list(SOLIMP)
    made.frictionloss = joint.friction
    made.solimp_friction = STICKING
    made.damping = _set(made.damping, joint.damping)
    made.stiffness = _set(made.stiffness, joint.stiffness)
    made.springref = joint.rest


def _set(like: object, value: float) -> object:
    """A number, or the first of a list of coefficients where MuJoCo takes polynomials."""
    try:
        n = len(like)  # type: ignore[arg-type]
    except TypeError:
        return value
    return [value, *[0.0] * (n - 1)]
