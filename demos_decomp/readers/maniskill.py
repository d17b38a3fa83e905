"""Reads ManiSkill's trajectory files (``trajectory.h5`` beside ``trajectory.json``) as demonstrations.

The files hold joint positions and actor poses in ManiSkill's world. The hand's pose follows from the joint
positions and the Panda's URDF, which is taken from the installed package mani_skill without importing it;
all poses are brought into the robot base frame. Sizes of actors are not in the files: they are known here
for some environments and otherwise judged from the height at which the actor rests.
"""

from __future__ import annotations

import functools
import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from bt_tasksim import poses
from bt_tasksim.errors import InputError, MachineError
from demos_decomp.log import Demonstration, Floats, Log, Surface, Track, checked_log
from demos_decomp.log_file import opened

ROBOTS = {"panda": "panda_v2.urdf", "panda_wristcam": "panda_v3.urdf"}
TOOL = "panda_hand_tcp"
CONTROL_RATE = 20.0
TABLE = Surface(pose=np.array([-0.12, 0.0, 0.0, 1.0, 0, 0, 0]), extent=np.array([1.209, 2.418]), kind="table")
"""ManiSkill's table in ManiSkill's world."""

SIZES = {
    "PickCube-v1": {"cube": (0.04, 0.04, 0.04)},
    "StackCube-v1": {"cubeA": (0.04, 0.04, 0.04), "cubeB": (0.04, 0.04, 0.04)},
    "PushCube-v1": {"obj": (0.04, 0.04, 0.04)},
    "PullCube-v1": {"obj": (0.04, 0.04, 0.04)},
    "LiftPegUpright-v1": {"peg": (0.24, 0.05, 0.05)},
}

_NOT_OBJECTS = ("goal", "table", "ground")


def is_maniskill(path: Path) -> bool:
    """Whether a file is an HDF5 file with ManiSkill's trajectories in it."""
    if not h5py.is_hdf5(path):
        return False
    with opened(path) as file:
        return any(name.startswith("traj_") for name in file)


def read_maniskill(path: Path) -> Log:
    """Reads a trajectory file.

    Args:
        path: ``trajectory.h5``; ``trajectory.json`` must lie beside it.

    Returns:
        One demonstration for each trajectory, in the order of their numbers.

    Raises:
        InputError: A file is missing or damaged, has no states, or shows a robot that is not known here.
        MachineError: The package mani_skill, which brings the robot's URDF, is not installed.
    """
    about = _description(path.with_suffix(".json"), path)
    try:
        environment = str(about["env_info"]["env_id"])
        settings = about["env_info"].get("env_kwargs", {})
        seeds = {int(e["episode_id"]): e.get("episode_seed") for e in about["episodes"]}
        rate = float(settings.get("control_freq") or CONTROL_RATE)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"'{path.with_suffix('.json')}' has no env_info and episodes: {error}") from error
    with opened(path) as file:
        numbers = sorted(int(name[5:]) for name in file if name[:5] == "traj_" and name[5:].isdigit())
        shown = tuple(
            _demonstration(file[f"traj_{number}"], path, number, environment, seeds.get(number), rate)
            for number in numbers
        )
    log = Log("maniskill", shown, str(about.get("source_desc", "")), str(path))
    return checked_log(log, f"'{path}'")


def _description(path: Path, trajectory: Path) -> Any:
    if not path.exists():
        raise InputError(
            f"'{trajectory}' needs '{path.name}' beside it, which says what robot and task it shows"
        )
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"'{path}' is not valid JSON: {error}") from error


def _demonstration(
    group: Any, path: Path, number: int, environment: str, seed: int | None, rate: float
) -> Demonstration:
    where = f"'{path}': traj_{number}/env_states"
    if "env_states/articulations" not in group or "env_states/actors" not in group:
        raise InputError(f"{where} is missing; record the trajectories with env states")
    states = group["env_states"]
    robots = [name for name in states["articulations"] if name in ROBOTS]
    if not robots:
        seen = ", ".join(states["articulations"])
        raise InputError(f"{where} shows no robot that is known here ({', '.join(ROBOTS)}) but {seen}")
    state = states["articulations"][robots[0]][()].astype(np.float64)
    to_base = poses.inverse(state[:, :7])
    joints = state[:, 13 : 13 + (state.shape[1] - 13) // 2]
    objects = {}
    for name, actor in states["actors"].items():
        if not name.startswith(_NOT_OBJECTS):
            pose = poses.multiply(to_base, actor[()][:, :7].astype(np.float64))
            objects[name] = Track(pose, "box", _size(environment, name, pose))
    table = Surface(poses.multiply(to_base[0], TABLE.pose), TABLE.extent, TABLE.kind)
    return Demonstration(
        name=f"{number:03d}",
        time=np.arange(len(state)) / rate,
        hand_pose=tool_poses(robots[0], joints),
        hand_opening=joints[:, -2:].sum(axis=1),
        objects=objects,
        places={"table": table},
        task=environment,
        seed=None if seed is None else int(seed),
    )


def tool_poses(robot: str, joints: Floats) -> Floats:
    """Poses ``(T, 7)`` of the Panda's tool frame in its base frame, for joint positions ``(T, 9)``.

    Raises:
        MachineError: The package mani_skill is not installed.
    """
    import pinocchio

    model, data, frame = _robot(ROBOTS[robot])
    found = np.empty((len(joints), 7))
    for i, row in enumerate(joints):
        pinocchio.forwardKinematics(model, data, row)
        placed = pinocchio.updateFramePlacement(model, data, frame)
        x, y, z, qx, qy, qz, qw = pinocchio.SE3ToXYZQUAT(placed)
        found[i] = x, y, z, qw, qx, qy, qz
    return found


@functools.cache
def _robot(urdf: str) -> tuple[Any, Any, int]:
    import pinocchio

    package = find_spec("mani_skill")
    if package is None or package.origin is None:
        raise MachineError(
            "reading ManiSkill trajectories needs the robot files of the package mani_skill; "
            "install bt-tasksim[sim]"
        )
    path = Path(package.origin).parent / "assets" / "robots" / "panda" / urdf
    model = pinocchio.buildModelFromUrdf(str(path))
    return model, model.createData(), model.getFrameId(TOOL)


def _size(environment: str, name: str, pose: Floats) -> Floats:
    known = SIZES.get(environment, {}).get(name)
    edge = float(np.clip(2 * pose[0, 2], 0.01, 0.2))
    return np.array(known if known else (edge, edge, edge))
