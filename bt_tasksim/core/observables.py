"""Observables: what a robot can know at one instant, each with its shape, its unit and its gap.

The gap says how much it differs between simulation and reality. A learned policy looks at observables with a
small gap. Those with a large one serve as limits, where only being far above matters. Sources: K. Sasabuchi
et al., arXiv 2301.01382, and its released code, where a grasp sees contacts as yes or no, and a door the
direction of the force and not its size; J. Tan et al., "Sim-to-real: learning agile locomotion for quadruped
robots", RSS 2018, on drives and latency.
"""

from __future__ import annotations

import dataclasses
from typing import ClassVar, Literal

from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import part, parts, register
from bt_tasksim.core.world import Observation

FIELDS = tuple(field.name for field in dataclasses.fields(Observation))
"""Observables that every `Observation` holds; the others are computed from it when they are asked for."""


class Observable:
    """An observable; a subclass announces itself with ``@register("observable", NAME)`` and overrides `read`.

    Args:
        name: The name that it is announced under.
    """

    shape: ClassVar[str]
    """Its shape, with leading batch dimensions, such as ``(..., n_tips, 3)``."""
    unit: ClassVar[str]
    """SI unit; empty for yes or no, 1 for a ratio. Quaternions of poses have none."""
    gap: ClassVar[Literal["small", "large"]]
    """How much it differs between simulation and reality."""
    why: ClassVar[str]
    """Why the gap is as large as it is."""
    error: ClassVar[str] = "none: simulated readings are ideal"
    """How a simulated reading errs."""

    def __init__(self, name: str) -> None:
        self.name = name

    def read(self, observation: Observation, world: WorldFacts) -> Array:
        """Its value; pure and batched. By default the observation's field of its name."""
        value: Array = getattr(observation, self.name)
        return value


def observable(name: str) -> Observable:
    """The observable of a name.

    Raises:
        InputError: There is none; says which names are near.
    """
    found: Observable = part("observable", name)(name)
    return found


def observables() -> dict[str, Observable]:
    """All observables by name."""
    return {name: kind(name) for name, kind in parts("observable").items()}


@register("observable", "time")
class Time(Observable):
    """Seconds since the episode began."""

    shape = "(...)"
    unit = "s"
    gap = "small"
    why = "both count control periods"


@register("observable", "arm_position")
class ArmPosition(Observable):
    """Joint positions of the arm; metres for sliding joints."""

    shape = "(..., n_arm)"
    unit = "rad"
    gap = "small"
    why = "encoders"


@register("observable", "arm_velocity")
class ArmVelocity(Observable):
    """Joint velocities of the arm."""

    shape = "(..., n_arm)"
    unit = "rad/s"
    gap = "large"
    why = "encoders give it noisy and late, and drives differ in damping and friction"


@register("observable", "hand_position")
class HandPosition(Observable):
    """Joint positions of the hand; metres for sliding joints."""

    shape = "(..., n_hand)"
    unit = "rad"
    gap = "small"
    why = "encoders"


@register("observable", "hand_effort")
class HandEffort(Observable):
    """Effort over its limit, in [-1, 1], by the drive's own law."""

    shape = "(..., n_hand)"
    unit = "1"
    gap = "large"
    why = "a drive's law knows no gear friction; real motor currents do"


@register("observable", "closure")
class Closure(Observable):
    """How far the hand is closed: 0 open, 1 shut."""

    shape = "(...)"
    unit = "1"
    gap = "small"
    why = "encoders of the hand"


@register("observable", "tool_pose")
class ToolPose(Observable):
    """Pose of the tool frame: z the approach axis, y the closing axis."""

    shape = "(..., 7)"
    unit = "m"
    gap = "small"
    why = "encoders and a calibrated arm"


@register("observable", "tips")
class Tips(Observable):
    """Positions of the fingertips."""

    shape = "(..., n_tips, 3)"
    unit = "m"
    gap = "small"
    why = "encoders and a calibrated hand"


@register("observable", "contacts")
class Contacts(Observable):
    """The fingertip touches something."""

    shape = "(..., n_tips)"
    unit = ""
    gap = "small"
    why = "yes or no, whatever the sensor's gain"


@register("observable", "contact_force")
class ContactForce(Observable):
    """Force on each fingertip."""

    shape = "(..., n_tips, 3)"
    unit = "N"
    gap = "large"
    why = "simulated contacts are stiffer than pads, and tactile sensors drift"


@register("observable", "wrench")
class Wrench(Observable):
    """External force and torque at the tool origin in the tool frame."""

    shape = "(..., 6)"
    unit = "N, Nm"
    gap = "large"
    why = "simulated contacts are stiffer than real ones"


@register("observable", "objects")
class Objects(Observable):
    """Estimated poses of the objects."""

    shape = "(..., n_objects, 7)"
    unit = "m"
    gap = "small"
    why = "an estimate with a stated error in both"
    error = "the noise model of the perception engine"


@register("observable", "contact_points")
class ContactPoints(Observable):
    """Point of the nearest object that each fingertip would touch, as estimated."""

    shape = "(..., n_tips, 3)"
    unit = "m"
    gap = "small"
    why = "from the estimate"
    error = "as objects"


@register("observable", "motion")
class Motion(Observable):
    """Estimated twist of the nearest object relative to the tool, tool frame."""

    shape = "(..., 6)"
    unit = "m/s, rad/s"
    gap = "small"
    why = "from the estimate"
    error = "as objects"
