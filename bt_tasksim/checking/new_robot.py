"""``bt-tasksim new robot``: a robot's file to begin with, filled in from its URDF where one is named."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bt_tasksim.checking.new_files import check_new, check_word, filled, named, write_new
from bt_tasksim.checking.urdf_guess import guess
from bt_tasksim.core import poses
from bt_tasksim.core.document import read_document
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import part
from bt_tasksim.robot.description import RobotDescription, described

EXAMPLE = "panda"
"""The robot whose file is the template where no URDF is named."""
AHEAD, UP = (0.4, 0.5, 0.6, 0.7), (0.25, 0.4, 0.55)
"""Where the tool may rest, in parts of the arm's length; it does where joints are far from their limits."""


def write_robot(name: str, folder: str | Path = ".", urdf: str | Path | None = None) -> str:
    """Write a robot's file, with a comment for every field.

    Args:
        name: Its name, lower-case words joined by underscores.
        folder: Where to; it is made where there is none.
        urdf: Its URDF, in this folder or below; by default the file is that of the Panda, to be changed.

    Returns:
        What was written, and what to do next.

    Raises:
        InputError: The name is no good, the file is there already, or nothing can be told from the URDF; then
            nothing is written.
        MachineError: The disk is full or not writable; then nothing is written.
    """
    check_word(name, "a robot", "my_arm")
    folder = Path(folder)
    path = folder / f"{name}.yaml"
    check_new(folder, {path: ""})
    if urdf is None:
        data: Any = read_document(part("robot", EXAMPLE), "robot file").value
        origin = "# The values are those of the Panda: put those of your own arm."
    else:
        data = _from_urdf(name, path, Path(urdf))
        origin = (
            f"# Made from {Path(urdf).name}: a guess where it says nothing, above all tool, tips and rest."
        )
    write_new(
        folder,
        {path: filled(("new_robot", "robot.yaml.txt"), named(name) | {"origin": origin} | _texts(data))},
    )
    return f"wrote {path}\nnext: put it right, and then: bt-tasksim check {path}"


def _from_urdf(name: str, path: Path, urdf: Path) -> dict[str, Any]:
    if not urdf.is_file():
        raise InputError(f"there is no URDF '{urdf}'")
    try:
        inside = urdf.resolve().relative_to(path.parent.resolve())
    except ValueError:
        raise InputError(
            f"a robot's file lies with its URDF, in its folder or above: give --out {urdf.parent}"
        ) from None
    data = guess(urdf.resolve()) | {"name": name, "urdf": inside.as_posix()}
    return _with_rest(data, path.resolve())


def _with_rest(data: dict[str, Any], path: Path) -> dict[str, Any]:
    """With a posture before the base in which the tool points down, where there is one, and how it closes."""
    from bt_tasksim.engines.kinematics.batch import BatchKinematics
    from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics

    robot = _robot(data, path)
    kinematics = PinocchioKinematics(robot)
    drawn = np.random.default_rng(0).uniform(robot.arm_lower, robot.arm_upper, (1000, len(robot.rest)))
    reach = float(np.quantile(np.linalg.norm(kinematics.forward(drawn)[:, :3], axis=-1), 0.9))
    places = [(ahead * reach, 0.0, up * reach) for up in UP for ahead in AHEAD]
    goals = np.array([robot.pointing_down(np.array(p), turn) for p in places for turn in (0.0, math.pi / 2)])
    joints, failures = BatchKinematics.of(robot, len(goals)).joints_at(goals)
    reached = np.flatnonzero(~failures.mask)
    if len(reached):
        slack = np.minimum(joints[reached] - robot.arm_lower, robot.arm_upper - joints[reached]).min(axis=-1)
        rest = joints[reached[int(np.argmax(slack))]]
        data["arm"]["rest"] = rest.tolist()
        data["tool"]["closing"] = _closing(kinematics.forward(rest))
        return data
    data["tool"]["closing"] = _closing(kinematics.forward(robot.rest))
    return data


def _closing(tool: Any) -> list[float]:
    """The tool's y at rest ``(3,)``, turned as if the tool were straight ahead on x."""
    y = poses.rotate(
        poses.yaw(-math.atan2(tool[1], tool[0])), poses.rotate(tool[3:], np.array([0.0, 1.0, 0.0]))
    )
    return [0.0, 1.0, 0.0] if math.hypot(*y[:2]) < 0.1 else (y / np.linalg.norm(y)).tolist()


def _robot(data: Mapping[str, Any], path: Path) -> RobotDescription:
    from bt_tasksim.robot.schema import RobotFile

    surface = {"friction": 1.0, "patch_radius": 0.01, "min_patch_radius": 0.005}
    return described(RobotFile.model_validate({**data, "pads": {**data["pads"], "surface": surface}}), path)


def _texts(data: Mapping[str, Any]) -> dict[str, str]:
    """What is put for each placeholder of the template."""
    out = {}
    for key, value in {"task_mask": [1] * 6, **data}.items():
        if key in ("tips", "envelope"):
            out[key] = "\n".join(f"  - {_flow(entry)}" for entry in value)
        elif key in ("arm", "hand", "tool", "pads"):
            out |= {f"{key}.{inner}": _flow(entry) for inner, entry in value.items()}
        elif key != "name":
            out[key] = _flow(value)
    return out


def _flow(value: Any) -> str:
    """A value as YAML in one line."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {_flow(inner)}' for key, inner in value.items())}}}"
    if isinstance(value, str):
        plain = value.replace("_", "").replace("-", "").replace("/", "").replace(".", "").replace(":", "")
        return value if plain.isalnum() and plain.isascii() and value[:1].isalpha() else json.dumps(value)
    if isinstance(value, Sequence):
        return f"[{', '.join(map(_flow, value))}]"
    return repr(round(value, 5) + 0.0) if isinstance(value, float) else repr(value)
