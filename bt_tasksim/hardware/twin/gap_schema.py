"""What may stand in the file of the twin's differences from the simulation."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from bt_tasksim.core.typed_file import Model, Number, sized

Std = Annotated[Number, Field(ge=0.0, le=1e3)]
"""A standard deviation."""
Factor = Annotated[Number, Field(gt=0.0, le=1e3)]
Latency = Annotated[Number, Field(ge=0.0, le=10.0)]
Rate = Annotated[int, Field(ge=1, le=1000)]
"""Hz."""


def _in_order(factors: tuple[float, float]) -> tuple[float, float]:
    if factors[0] > factors[1]:
        raise ValueError("should be two factors, the lower one first")
    return factors


Factors = Annotated[tuple[Factor, Factor], Field(strict=False), sized(2), AfterValidator(_in_order)]
"""Lowest and highest factor."""


class WrenchError(Model):
    """Standard deviations of the wrist's sensor."""

    force: Std
    """Noise, N."""
    torque: Std
    """Noise, Nm."""
    force_bias: Std
    """N."""
    torque_bias: Std
    """Nm."""


class PoseError(Model):
    """Standard deviations of the tracking system."""

    position: Std
    """Noise, m."""
    rotation: Std
    """Noise, rad."""
    position_bias: Std
    """m."""
    rotation_bias: Std
    """rad."""


class GapFile(Model):
    """How the twin differs from the simulation in which trees are written and policies are trained."""

    object_mass: Factors
    """Of each object."""
    object_friction: Factors
    """Of each object."""
    pad_friction: Factors
    """Of the finger pads."""
    drive_stiffness: Factors
    """Of arm and hand each."""
    drive_damping: Factors
    """Of arm and hand each."""
    joint_position: Std
    """Noise, rad or m."""
    joint_velocity: Std
    """Noise, rad/s or m/s."""
    joint_effort: Std
    """Noise, Nm or N."""
    wrench: WrenchError
    """The wrist's sensor."""
    tip_force: Std
    """Noise, N."""
    object_pose: PoseError
    """The tracking system."""
    state_latency: Latency
    """From the sensor to the topic, s."""
    command_latency: Latency
    """From the topic to the drive, s."""
    control_rate: Rate
    """Of the controllers, joint states, wrench and fingertips, Hz; divides 1000."""
    object_rate: Rate
    """Of objects' poses, Hz."""
    camera_rate: Rate
    """Of pictures, Hz."""
