"""Reads ManiSkill's trajectory files (``trajectory.h5`` beside ``trajectory.json``) as demonstrations.

The files hold joint positions and actor poses in ManiSkill's world. The hand's pose follows from the joint
positions and the Panda's URDF, which is taken from the installed package mani_skill without importing it;
all poses are brought into the robot base frame. Sizes of actors are not in the files: they are known here
for some environments and otherwise judged from the height at which the actor rests.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bt_tasksim.core import hdf5, poses
from bt_tasksim.core.bounded_text import read_text
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.hdf5 import Node
from bt_tasksim.core.json_text import parse_json
from bt_tasksim.core.registry import register
from bt_tasksim.demos_decomp.log import (
    FARTHEST,
    MOST_SAMPLES,
    SLOWEST,
    Demonstration,
    Floats,
    Log,
    Surface,
    Track,
    checked_log,
)
from bt_tasksim.demos_decomp.readers.base import LogReader

LARGEST_SIDECAR = 64 << 20
"""Bytes of the JSON file beside a trajectory."""
ROBOTS = {"panda": "panda_v2.urdf", "panda_wristcam": "panda_v3.urdf"}
TOOL = "panda_hand_tcp"
CONTROL_RATE = 20.0
MOST_RATE = 10_000.0
JOINTS = 9
"""Of the Panda: seven of the arm, two fingers."""
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


@register("log reader", "maniskill")
class ManiSkillTrajectories(LogReader):
    """ManiSkill's ``trajectory.h5`` with ``trajectory.json`` beside it."""

    title = "ManiSkill trajectory.h5"

    def recognises(self, path: Path) -> bool:
        """It is an HDF5 file with ManiSkill's trajectories in it."""
        if not hdf5.is_hdf5(path):
            return False
        return any(name.startswith("traj_") for name in hdf5.read(path, wanted=()).names())

    def read(self, path: Path) -> Log:
        """See `read_maniskill`."""
        return read_maniskill(path)


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
    recorded = _recording(path.with_suffix(".json"), path)
    file = hdf5.read(path, wanted=["traj_*/env_states/**"])
    names = sorted((int(n[5:]), n) for n in file.groups if re.fullmatch(r"traj_[0-9]{1,9}", n))
    shown = tuple(_demonstration(file.groups[n], path, n, number, recorded) for number, n in names)
    return checked_log(Log("maniskill", shown, recorded.description, str(path)), f"'{path}'")


@dataclass(frozen=True)
class _Recording:
    """What ``trajectory.json`` says: environment, description, samples per second, seeds by episode."""

    environment: str
    description: str
    rate: float
    seeds: Mapping[int, int | None]


def _recording(path: Path, trajectory: Path) -> _Recording:
    about = _description(path, trajectory)
    try:
        environment = about["env_info"]["env_id"]
        settings = about["env_info"].get("env_kwargs") or {}
        rate = settings.get("control_freq") or CONTROL_RATE
        seeds = {episode["episode_id"]: episode.get("episode_seed") for episode in about["episodes"]}
        description = about.get("source_desc") or ""
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"'{path}' has no env_info and episodes: {error}") from error
    for value, kinds, name, what in (
        (environment, str, "env_id", "text"),
        (description, str, "source_desc", "text"),
        (rate, int | float, "control_freq", "a number"),
        *((number, int, "episode_id", "a whole number") for number in seeds),
        *((seed, int | None, "episode_seed", "a whole number") for seed in seeds.values()),
    ):
        if not isinstance(value, kinds) or isinstance(value, bool):
            raise InputError(f"'{path}': {name} should be {what}, found {repr(value)[:60]}")
    if not 1.0 / SLOWEST <= rate <= MOST_RATE:
        raise InputError(
            f"'{path}': control_freq is {rate}; it should be from {1.0 / SLOWEST} to {MOST_RATE:g}"
        )
    return _Recording(environment, description, float(rate), seeds)


def _description(path: Path, trajectory: Path) -> Any:
    if not path.exists():
        raise InputError(
            f"'{trajectory}' needs '{path.name}' beside it, which says what robot and task it shows"
        )
    owner = f"'{path}'"
    return parse_json(read_text(path, owner, LARGEST_SIDECAR), owner)


def _demonstration(group: Node, path: Path, name: str, number: int, recorded: _Recording) -> Demonstration:
    where = f"'{path}': {name}/env_states"
    articulations, actors = group.group("env_states/articulations"), group.group("env_states/actors")
    if articulations is None or actors is None:
        raise InputError(f"{where} is missing; record the trajectories with env states")
    robots = [robot for robot in articulations.data if robot in ROBOTS]
    if not robots:
        seen = ", ".join(articulations.names()) or "none"
        raise InputError(f"{where} shows no robot that is known here ({', '.join(ROBOTS)}) but {seen}")
    state = _states(
        articulations.data[robots[0]], None, 13 + 2 * JOINTS, f"{where}/articulations/{robots[0]}"
    )
    base, joints = state[:, :7], state[:, 13 : 13 + JOINTS]
    to_base = poses.inverse(_poses(base, f"{where}/articulations/{robots[0]}"))
    objects = {}
    for thing, actor in actors.data.items():
        if not thing.startswith(_NOT_OBJECTS):
            at = f"{where}/actors/{thing}"
            pose = poses.multiply(to_base, _poses(_states(actor, len(state), 13, at)[:, :7], at))
            objects[thing] = Track(pose, "box", _size(recorded.environment, thing, pose))
    table = Surface(poses.multiply(to_base[0], TABLE.pose), TABLE.extent, TABLE.kind)
    seed = recorded.seeds.get(number)
    return Demonstration(
        name=f"{number:03d}",
        time=np.arange(len(state)) / recorded.rate,
        hand_pose=tool_poses(robots[0], joints),
        hand_opening=joints[:, -2:].sum(axis=1),
        objects=objects,
        places={"table": table},
        task=recorded.environment,
        seed=seed,
    )


def _states(values: NDArray[Any], count: int | None, width: int, where: str) -> Floats:
    """States ``(T, width)`` as they should be: numbers that a robot's motions can be.

    Args:
        values: As read.
        count: Rows that there should be; None for any number above one.
        width: Columns.
        where: For messages.
    """
    if values.dtype.kind not in "iuf":
        raise InputError(f"{where} does not hold numbers")
    if (
        values.ndim != 2
        or values.shape[1] != width
        or len(values) != (count or len(values))
        or len(values) < 2
    ):
        raise InputError(f"{where} has shape {values.shape} instead of ({count or 'at least 2'}, {width})")
    if len(values) > MOST_SAMPLES:
        raise InputError(f"{where} has {len(values)} samples, more than {MOST_SAMPLES}; split the log")
    states = values.astype(np.float64)
    used = np.abs(states[:, :7] if width == 13 else np.delete(states, np.s_[7:13], axis=1)[:, : 7 + JOINTS])
    wrong = np.flatnonzero(~(used <= FARTHEST).all(axis=1))
    if wrong.size:
        raise InputError(f"{where} has NaN, infinity or more than {FARTHEST:g} m or rad at index {wrong[0]}")
    return states


def _poses(rows: Floats, where: str) -> Floats:
    """Poses ``(T, 7)`` with quaternions of length one, as they were but for rounding."""
    lengths = np.linalg.norm(rows[:, 3:], axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1.0) > 0.05)
    if wrong.size:
        raise InputError(f"{where} has a quaternion of length {lengths[wrong[0]]:.3g} at index {wrong[0]}")
    return rows


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
