"""By how much the twin differs from the simulation: a data file, and a world drawn with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bt_tasksim import poses
from bt_tasksim.data_file import check_keys, number, positive, vector
from bt_tasksim.errors import InputError
from bt_tasksim.poses import Array
from bt_tasksim.resources import asset
from bt_tasksim.robot import Drive, RobotDescription
from bt_tasksim.scene import ActorConfiguration

_FACTORS = ("object_mass", "object_friction", "pad_friction", "drive_stiffness", "drive_damping")
_SIZES = ("joint_position", "joint_velocity", "joint_effort", "tip_force", "state_latency", "command_latency")
_RATES = ("control_rate", "object_rate", "camera_rate")
_WRENCH = ("force", "torque", "force_bias", "torque_bias")
_POSE = ("position", "rotation", "position_bias", "rotation_bias")


@dataclass(frozen=True)
class Gap:
    """Stated differences; see ``assets/twin/gap.yaml`` for units.

    Attributes:
        factors: Low and high, by name.
        sizes: Standard deviations of noise and latencies, by name.
        rates: Hz, by name.
        wrench: Standard deviations of the wrist's sensor.
        object_pose: Standard deviations of the tracking system.
    """

    factors: Mapping[str, tuple[float, float]]
    sizes: Mapping[str, float]
    rates: Mapping[str, int]
    wrench: Mapping[str, float]
    object_pose: Mapping[str, float]

    def world(
        self, robot: RobotDescription, configuration: ActorConfiguration, rng: np.random.Generator
    ) -> tuple[RobotDescription, ActorConfiguration]:
        """Robot and world with factors drawn."""

        def draw(name: str) -> float:
            return float(rng.uniform(*self.factors[name]))

        def drive(usual: Drive) -> Drive:
            stiffness, damping = draw("drive_stiffness"), draw("drive_damping")
            return replace(usual, stiffness=usual.stiffness * stiffness, damping=usual.damping * damping)

        objects = tuple(
            replace(o, mass=o.mass * draw("object_mass"), friction=o.friction * draw("object_friction"))
            for o in configuration.objects
        )
        pads = replace(robot.pads, friction=robot.pads.friction * draw("pad_friction"))
        other = replace(
            robot, pads=pads, arm_drive=drive(robot.arm_drive), hand_drive=drive(robot.hand_drive)
        )
        rate = self.rates["control_rate"]
        return other, replace(configuration, objects=objects, control_frequency=rate, physics_frequency=rate)

    def biases(self, n_objects: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Biases of one world: of the wrench ``(6,)`` and of the objects' poses ``(n, 6)`` (m, rad)."""
        wrench, pose = self.wrench, self.object_pose
        force = rng.standard_normal(6) * np.repeat([wrench["force_bias"], wrench["torque_bias"]], 3)
        turned = np.repeat([pose["position_bias"], pose["rotation_bias"]], 3)
        return force, rng.standard_normal((n_objects, 6)) * turned


def load_gap(file: str = "") -> Gap:
    """The differences of a file, by default of the bundled one.

    Raises:
        InputError: It lacks or misstates something.
    """
    path = Path(file) if file else asset("twin", "gap.yaml")
    try:
        data: Any = yaml.safe_load(path.read_text())
        needed: dict[str, Any] = dict.fromkeys((*_FACTORS, *_SIZES, *_RATES))
        check_keys(
            data, "", {**needed, "wrench": dict.fromkeys(_WRENCH), "object_pose": dict.fromkeys(_POSE)}
        )
        factors = {name: _range(data[name], name) for name in _FACTORS}
        sizes = {name: _size(data[name], name) for name in _SIZES}
        rates = {name: round(positive(data[name], name)) for name in _RATES}
        if 1000 % rates["control_rate"]:
            raise InputError(f"control_rate should divide 1000, found {rates['control_rate']}")
        return Gap(
            factors,
            sizes,
            rates,
            {key: _size(data["wrench"][key], f"wrench.{key}") for key in _WRENCH},
            {key: _size(data["object_pose"][key], f"object_pose.{key}") for key in _POSE},
        )
    except yaml.YAMLError as error:
        raise InputError(f"'{path}' is not YAML: {' '.join(str(error).split())}") from error
    except (InputError, OSError) as error:
        raise InputError(f"the twin's file '{path}': {error}") from error


def _range(values: Any, what: str) -> tuple[float, float]:
    low, high = vector(values, 2, what).tolist()
    if not 0.0 < low <= high:
        raise InputError(f"{what} should be two factors above 0, the lower one first, found {values!r}")
    return low, high


def _size(value: Any, what: str) -> float:
    if number(value, what) < 0.0:
        raise InputError(f"{what} should not be negative, found {value!r}")
    return float(value)


def displaced(pose: Array, error: Array) -> Array:
    """Poses ``(..., 7)`` with errors ``(..., 6)`` in metres and as rotation vectors, base frame."""
    turned = poses.quat_multiply(poses.from_rotation_vector(error[..., 3:]), pose[..., 3:])
    return np.concatenate([pose[..., :3] + error[..., :3], turned], axis=-1)


def error_in_object(pose: Array, error: Array) -> Array:
    """Errors ``(n, 6)`` given in the base frame, as frames ``(n, 7)`` in each object's own."""
    return poses.multiply(poses.inverse(pose), displaced(pose, error))
