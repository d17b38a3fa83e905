"""Robot descriptions: one data file a robot.

A file names the URDF and says which joints are arm and hand, where the tool frame is, which fingertips face
each other, and how closure in [0, 1] and the synergies map to hand joints. In simulation the URDF is that of
the installed mani_skill package (``mani_skill:robots/...``); on a robot computer it is a path of its own.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from array_api_compat import array_namespace

from bt_tasksim.errors import InputError, nearest
from bt_tasksim.poses import Array
from bt_tasksim.resources import asset


@dataclass(frozen=True)
class Drive:
    """PD drive gains of a group of joints: N/m or Nm/rad, and the same per second, and the effort limit.

    The armature is the inertia of the geared motor, reflected to the joint: kg or kg m^2. Light fingers need
    it: without it the solver leaves them millimetres deep in what they press on.
    """

    stiffness: float
    damping: float
    force_limit: float
    armature: float = 0.0


@dataclass(frozen=True)
class Tip:
    """A fingertip: the links whose contacts count as its own, and its point ``(3,)`` in the first of them."""

    name: str
    links: tuple[str, ...]
    point: tuple[float, float, float]


@dataclass(frozen=True)
class Pads:
    """Surface of the finger links: friction, and the contact patch in metres that resists twisting."""

    friction: float
    patch_radius: float
    min_patch_radius: float


@dataclass(frozen=True)
class RobotDescription:
    """A robot arm with a hand.

    Attributes:
        name: Its name.
        urdf: Path of the URDF file.
        base_link: Link that stands at the robot base frame.
        arm_joints: Names, from the base on.
        arm_lower: Lower position limits ``(n_arm,)`` rad.
        arm_upper: Upper position limits ``(n_arm,)`` rad.
        arm_velocity: Velocity limits ``(n_arm,)`` rad/s.
        arm_acceleration: Acceleration limits ``(n_arm,)`` rad/s^2.
        rest: Rest posture ``(n_arm,)``, which the inverse kinematics prefers.
        arm_drive: Gains.
        hand_joints: Names of all hand joints, mimics included.
        hand_open: Positions ``(n_hand,)`` at closure 0.
        hand_closed: Positions ``(n_hand,)`` at closure 1, mimics obeyed.
        hand_drive: Gains.
        hand_speed: Fastest change of closure, 1/s.
        synergies: Names of further hand motions.
        synergy_directions: ``(n_synergies, n_hand)`` joint displacements at synergy value 1.
        tool_link: Link that carries the tool frame.
        tool_pose: Pose ``(7,)`` of the tool frame in that link: z approach, y closing axis.
        wrist_link: Link whose incoming joint carries the wrist's force sensor.
        tips: The fingertips.
        opposition: Groups of indices of tips that face each other: an object is held when one of each group
            touches it.
        opening: Widest distance between opposing fingertips, metres.
        depth: Metres that fingertips may reach below the top of an object to hold it well.
        pads: Surface of the finger links.
        pad_links: Names of these links.
        task_mask: Weights ``(6,)`` of the tool pose's components in the inverse kinematics, tool frame
            (x, y, z, rotations about x, y, z): 0 leaves one free, for arms of fewer than six joints.
        envelope: Boxes ``(pose (7,), full size (3,))`` in the tool frame that hold the hand and the end of the
            arm, for keeping clear of obstacles.
        cameras: By name: pose, size and field of view; see the rendering engine.
        source: Path of the data file.
    """

    name: str
    urdf: Path
    base_link: str
    arm_joints: tuple[str, ...]
    arm_lower: Array
    arm_upper: Array
    arm_velocity: Array
    arm_acceleration: Array
    rest: Array
    arm_drive: Drive
    hand_joints: tuple[str, ...]
    hand_open: Array
    hand_closed: Array
    hand_drive: Drive
    hand_speed: float
    synergies: tuple[str, ...]
    synergy_directions: Array
    tool_link: str
    tool_pose: Array
    wrist_link: str
    tips: tuple[Tip, ...]
    opposition: tuple[tuple[int, ...], ...]
    opening: float
    depth: float
    pads: Pads
    pad_links: tuple[str, ...]
    task_mask: Array
    envelope: tuple[tuple[Array, tuple[float, float, float]], ...]
    cameras: Mapping[str, Any]
    source: Path

    @property
    def joints(self) -> tuple[str, ...]:
        """All joints in the order of every joint array: arm, then hand."""
        return self.arm_joints + self.hand_joints

    def hand_position(self, hand: Array) -> Array:
        """Hand joint positions ``(..., n_hand)`` for a hand command ``(..., 1 + n_synergies)``."""
        xp = array_namespace(hand)
        opened, closed = xp.asarray(self.hand_open), xp.asarray(self.hand_closed)
        out = opened + hand[..., :1] * (closed - opened)
        for i in range(min(len(self.synergies), hand.shape[-1] - 1)):
            out = out + hand[..., i + 1 : i + 2] * xp.asarray(self.synergy_directions[i])
        return out

    def closure(self, hand_position: Array) -> Array:
        """Closure ``(...)`` in [0, 1] of hand joint positions ``(..., n_hand)``: the least-squares fit."""
        span = self.hand_closed - self.hand_open
        xp = array_namespace(hand_position)
        weights = xp.asarray(span / float(span @ span))
        return xp.clip(xp.sum((hand_position - xp.asarray(self.hand_open)) * weights, axis=-1), 0.0, 1.0)


def load_robot(name: str) -> RobotDescription:
    """A bundled robot by name, or one from a data file by path.

    Raises:
        InputError: No such robot, its URDF is not to be found, or the file lacks or misstates something.
    """
    if name.endswith((".yaml", ".yml")):
        path = Path(name).resolve()
        if not path.is_file():
            raise InputError(f"no robot file '{name}'")
    else:
        path = asset("robots", f"{name}.yaml")
        if not path.is_file():
            known = [p.stem for p in asset("robots").glob("*.yaml")]
            raise InputError(f"unknown robot '{name}'{nearest(name, known)}")
    return _load(path)


@lru_cache(maxsize=32)
def _load(path: Path) -> RobotDescription:
    try:
        data = yaml.safe_load(path.read_text())
        return _description(data, path)
    except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"robot file '{path}': {type(error).__name__}: {error}") from error


def _description(data: Mapping[str, Any], path: Path) -> RobotDescription:
    arm, hand, tool = data["arm"], data["hand"], data["tool"]
    n_arm, n_hand = len(arm["joints"]), len(hand["joints"])
    synergies = hand.get("synergies", {})
    description = RobotDescription(
        name=str(data["name"]),
        urdf=_urdf_path(str(data["urdf"]), path),
        base_link=str(data["base_link"]),
        arm_joints=tuple(arm["joints"]),
        arm_lower=_vector(arm["lower"], n_arm, "arm.lower"),
        arm_upper=_vector(arm["upper"], n_arm, "arm.upper"),
        arm_velocity=_vector(arm["velocity"], n_arm, "arm.velocity"),
        arm_acceleration=_vector(arm["acceleration"], n_arm, "arm.acceleration"),
        rest=_vector(arm["rest"], n_arm, "arm.rest"),
        arm_drive=Drive(**{k: float(v) for k, v in arm["drive"].items()}),
        hand_joints=tuple(hand["joints"]),
        hand_open=_vector(hand["open"], n_hand, "hand.open"),
        hand_closed=_vector(hand["closed"], n_hand, "hand.closed"),
        hand_drive=Drive(**{k: float(v) for k, v in hand["drive"].items()}),
        hand_speed=float(hand["speed"]),
        synergies=tuple(synergies),
        synergy_directions=np.array(
            [_vector(v, n_hand, f"hand.synergies.{k}") for k, v in synergies.items()]
        ).reshape(len(synergies), n_hand),
        tool_link=str(tool["link"]),
        tool_pose=_vector(tool["pose"], 7, "tool.pose"),
        wrist_link=str(data["wrist_link"]),
        tips=tuple(
            Tip(str(t["name"]), tuple(t["links"]), tuple(_vector(t["point"], 3, "tips.point").tolist()))
            for t in data["tips"]
        ),
        opposition=tuple(tuple(int(i) for i in group) for group in data["opposition"]),
        opening=float(data["opening"]),
        depth=float(data["depth"]),
        pads=Pads(**{k: float(v) for k, v in data["pads"]["surface"].items()}),
        pad_links=tuple(data["pads"]["links"]),
        task_mask=_vector(data.get("task_mask", [1.0] * 6), 6, "task_mask"),
        envelope=tuple(
            (
                np.array([*_vector(b["position"], 3, "envelope.position"), 1.0, 0.0, 0.0, 0.0]),
                tuple(_vector(b["size"], 3, "envelope.size").tolist()),
            )
            for b in data["envelope"]
        ),
        cameras=data.get("cameras", {}),
        source=path,
    )
    if not np.all(description.arm_lower < description.arm_upper):
        raise InputError(f"robot file '{path}': arm.lower is not below arm.upper for every joint")
    for group in description.opposition:
        for i in group:
            if not 0 <= i < len(description.tips):
                raise InputError(f"robot file '{path}': opposition names tip {i} of {len(description.tips)}")
    return description


def _vector(values: Any, n: int, what: str) -> Array:
    array = np.asarray(values, float)
    if array.shape != (n,) or not np.all(np.isfinite(array)):
        raise ValueError(f"{what} should be {n} finite numbers, found {values!r}")
    array.setflags(write=False)
    return array


def _urdf_path(text: str, source: Path) -> Path:
    package, colon, inner = text.partition(":")
    if colon and len(package) > 1:
        spec = importlib.util.find_spec(package)
        if spec is None or not spec.submodule_search_locations:
            raise InputError(
                f"robot file '{source}': its URDF is in the package '{package}', which is not installed: "
                f"install it, or copy the file and set 'urdf' to a path of your own"
            )
        path = Path(next(iter(spec.submodule_search_locations))) / "assets" / inner
    else:
        path = (source.parent / text).resolve()
    if not path.is_file():
        raise InputError(f"robot file '{source}': no URDF at '{path}'")
    return path
