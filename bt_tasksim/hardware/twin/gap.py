"""By how much the twin differs from the simulation: a data file, and a world drawn with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.resources import asset
from bt_tasksim.core.typed_file import load_typed
from bt_tasksim.hardware.twin.gap_schema import GapFile
from bt_tasksim.robot.description import Drive, RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

_FACTORS = ("object_mass", "object_friction", "pad_friction", "drive_stiffness", "drive_damping")
_SIZES = ("joint_position", "joint_velocity", "joint_effort", "tip_force", "state_latency", "command_latency")
_RATES = ("control_rate", "object_rate", "camera_rate")


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
    content, document = load_typed(GapFile, file or asset("twin", "gap.yaml"), "the twin's file")
    if 1000 % content.control_rate:
        raise document.named(("control_rate",), f"should divide 1000, found {content.control_rate}")
    values = content.model_dump()
    return Gap(
        {name: values[name] for name in _FACTORS},
        {name: values[name] for name in _SIZES},
        {name: values[name] for name in _RATES},
        values["wrench"],
        values["object_pose"],
    )


def displaced(pose: Array, error: Array) -> Array:
    """Poses ``(..., 7)`` with errors ``(..., 6)`` in metres and as rotation vectors, base frame."""
    turned = poses.quat_multiply(poses.from_rotation_vector(error[..., 3:]), pose[..., 3:])
    return np.concatenate([pose[..., :3] + error[..., :3], turned], axis=-1)


def error_in_object(pose: Array, error: Array) -> Array:
    """Errors ``(n, 6)`` given in the base frame, as frames ``(n, 7)`` in each object's own."""
    return poses.multiply(poses.inverse(pose), displaced(pose, error))
