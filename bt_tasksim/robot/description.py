"""Robot descriptions: one data file a robot.

A file names the URDF and says which joints are arm and hand, where the tool frame is, which fingertips face
each other, and how closure in [0, 1] and the synergies map to hand joints. In simulation the URDF is that of
the installed mani_skill package (``mani_skill:robots/...``); on a robot computer it is a path of its own.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bt_tasksim import poses
from bt_tasksim.data_file import check_keys as _check_keys
from bt_tasksim.data_file import names as _names
from bt_tasksim.data_file import number as _number
from bt_tasksim.data_file import vector as _vector
from bt_tasksim.errors import InputError, nearest
from bt_tasksim.poses import Array, array_namespace
from bt_tasksim.resources import asset
from bt_tasksim.safety.limits import SafetyLimits, read_limits


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
        posture: Weights ``(n_arm,)`` of the pull towards the rest posture, by joint; those of a redundant arm
            that would rather swing its elbow out than bend keep it in its plane.
        arm_drive: Gains.
        hand_joints: Names of all hand joints, mimics included.
        hand_open: Positions ``(n_hand,)`` at closure 0.
        hand_closed: Positions ``(n_hand,)`` at closure 1, mimics obeyed.
        hand_drive: Gains.
        hand_drive_scale: Factors ``(n_hand,)`` on the gains and limits of each hand joint: a thumb that
            stands against four fingers needs more than one of them.
        hand_speed: Fastest change of closure, 1/s.
        synergies: Names of further hand motions.
        synergy_directions: ``(n_synergies, n_hand)`` joint displacements at synergy value 1.
        tool_link: Link that carries the tool frame.
        tool_pose: Pose ``(7,)`` of the tool frame in that link: z approach, y closing axis.
        closing: Direction ``(3,)`` of the tool's closing axis in which the arm is farthest from its limits
            when the tool is straight ahead on the base's x axis, robot base frame.
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
        envelope: Boxes ``(pose (7,), full size (3,))`` in the tool frame that hold the hand and the end of
            the arm, for keeping clear of obstacles.
        solver_iterations: Position iterations of a physics engine that solves contacts by iteration: as many
            as keep the fingers from sinking into what they press on.
        cameras: By name: pose, size and field of view; see the rendering engine.
        safety: What a real robot must never exceed; None where the file does not say, and then no real robot
            of this kind is driven.
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
    posture: Array
    arm_drive: Drive
    hand_joints: tuple[str, ...]
    hand_open: Array
    hand_closed: Array
    hand_drive: Drive
    hand_drive_scale: Array
    hand_speed: float
    synergies: tuple[str, ...]
    synergy_directions: Array
    tool_link: str
    tool_pose: Array
    closing: Array
    wrist_link: str
    tips: tuple[Tip, ...]
    opposition: tuple[tuple[int, ...], ...]
    opening: float
    depth: float
    pads: Pads
    pad_links: tuple[str, ...]
    task_mask: Array
    envelope: tuple[tuple[Array, tuple[float, float, float]], ...]
    solver_iterations: int
    cameras: Mapping[str, Any]
    safety: SafetyLimits | None
    source: Path

    @property
    def joints(self) -> tuple[str, ...]:
        """All joints in the order of every joint array: arm, then hand."""
        return self.arm_joints + self.hand_joints

    def drive_array(self, what: str) -> Array:
        """A field of `Drive` for every joint ``(n_joints,)``, in the order of `joints`.

        Args:
            what: ``stiffness``, ``damping``, ``force_limit`` or ``armature``.
        """
        arm = np.full(len(self.arm_joints), getattr(self.arm_drive, what))
        return np.concatenate([arm, getattr(self.hand_drive, what) * self.hand_drive_scale])

    def hand_position(self, hand: Array) -> Array:
        """Hand joint positions ``(..., n_hand)`` for a hand command ``(..., 1 + n_synergies)``."""
        xp = array_namespace(hand)
        opened, closed = xp.asarray(self.hand_open), xp.asarray(self.hand_closed)
        out = opened + hand[..., :1] * (closed - opened)
        for i in range(min(len(self.synergies), hand.shape[-1] - 1)):
            out = out + hand[..., i + 1 : i + 2] * xp.asarray(self.synergy_directions[i])
        return out

    @cached_property
    def hand_range(self) -> tuple[Array, Array]:
        """Lowest and highest positions ``(n_hand,)`` that a hand command can ask for."""
        low = np.minimum(self.hand_open, self.hand_closed)
        high = np.maximum(self.hand_open, self.hand_closed)
        for direction in self.synergy_directions:
            low, high = low + np.minimum(direction, 0.0), high + np.maximum(direction, 0.0)
        return low, high

    def closure(self, hand_position: Array) -> Array:
        """Closure ``(...)`` in [0, 1] of hand joint positions ``(..., n_hand)``: the least-squares fit."""
        weights = self._closure_weights
        if type(hand_position) is np.ndarray and hand_position.ndim == 1:
            return np.float64(min(max(float((hand_position - self.hand_open) @ weights), 0.0), 1.0))
        xp = array_namespace(hand_position)
        fit = xp.sum((hand_position - xp.asarray(self.hand_open)) * xp.asarray(weights), axis=-1)
        return xp.clip(fit, 0.0, 1.0)

    def pointing_down(self, position: Array, turn: float = 0.0) -> Array:
        """The tool pose ``(7,)`` at a position ``(3,)``, pointing down, turned from its neutral orientation.

        Neutral is the closing axis of the rest posture, when the arm's base turns to the position.
        """
        heading = poses.yaw(math.atan2(position[1], position[0]) + turn)
        rotation = poses.frame_from_axes(np.array([0.0, 0.0, -1.0]), poses.rotate(heading, self.closing))
        return poses.pose(position, rotation)

    @cached_property
    def _closure_weights(self) -> Array:
        span = self.hand_closed - self.hand_open
        return span / float(span @ span)


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
        if not isinstance(data, dict):
            raise InputError("it should be a mapping of names to values")
        _check_keys(data, "", _KEYS, _OPTIONAL)
        description = _description(data, path)
        _check(description)
        return description
    except yaml.YAMLError as error:
        raise InputError(f"robot file '{path}' is not YAML: {' '.join(str(error).split())}") from error
    except KeyError as error:
        raise InputError(f"robot file '{path}' lacks {error}") from error
    except (TypeError, ValueError, AttributeError, IndexError, OSError) as error:
        raise InputError(f"robot file '{path}': {error}") from error


_KEYS: Mapping[str, Any] = {
    "name": None,
    "urdf": None,
    "base_link": None,
    "arm": dict.fromkeys(("joints", "lower", "upper", "velocity", "acceleration", "rest", "drive")),
    "hand": dict.fromkeys(("joints", "open", "closed", "drive", "speed")),
    "tool": {"link": None, "pose": None, "closing": None},
    "wrist_link": None,
    "tips": None,
    "opposition": None,
    "opening": None,
    "depth": None,
    "pads": {"links": None, "surface": {f.name: None for f in fields(Pads)}},
    "envelope": None,
}
_OPTIONAL: Mapping[str, Any] = {
    "task_mask": None,
    "cameras": None,
    "safety": None,
    "solver_iterations": None,
    "arm": {"posture": None},
    "hand": {"synergies": None, "drive_scale": None},
}


def _description(data: Mapping[str, Any], path: Path) -> RobotDescription:
    arm, hand, tool = data["arm"], data["hand"], data["tool"]
    arm_joints, hand_joints = _names(arm["joints"], "arm.joints"), _names(hand["joints"], "hand.joints")
    n_arm, n_hand = len(arm_joints), len(hand_joints)
    synergies = hand.get("synergies") or {}
    return RobotDescription(
        name=str(data["name"]),
        urdf=_urdf_path(str(data["urdf"]), path),
        base_link=str(data["base_link"]),
        arm_joints=arm_joints,
        arm_lower=_vector(arm["lower"], n_arm, "arm.lower"),
        arm_upper=_vector(arm["upper"], n_arm, "arm.upper"),
        arm_velocity=_vector(arm["velocity"], n_arm, "arm.velocity"),
        arm_acceleration=_vector(arm["acceleration"], n_arm, "arm.acceleration"),
        rest=_vector(arm["rest"], n_arm, "arm.rest"),
        posture=_vector(arm.get("posture", [1.0] * n_arm), n_arm, "arm.posture"),
        arm_drive=_drive(arm["drive"], "arm.drive"),
        hand_joints=hand_joints,
        hand_open=_vector(hand["open"], n_hand, "hand.open"),
        hand_closed=_vector(hand["closed"], n_hand, "hand.closed"),
        hand_drive=_drive(hand["drive"], "hand.drive"),
        hand_drive_scale=_scale(hand.get("drive_scale") or {}, hand_joints),
        hand_speed=_number(hand["speed"], "hand.speed"),
        synergies=tuple(synergies),
        synergy_directions=np.array(
            [_vector(v, n_hand, f"hand.synergies.{k}") for k, v in synergies.items()]
        ).reshape(len(synergies), n_hand),
        tool_link=str(tool["link"]),
        tool_pose=_pose(tool["pose"], "tool.pose"),
        closing=_vector(tool["closing"], 3, "tool.closing"),
        wrist_link=str(data["wrist_link"]),
        tips=tuple(_tip(t) for t in data["tips"]),
        opposition=tuple(tuple(int(i) for i in group) for group in data["opposition"]),
        opening=_number(data["opening"], "opening"),
        depth=_number(data["depth"], "depth"),
        pads=Pads(**{k: _number(v, f"pads.surface.{k}") for k, v in data["pads"]["surface"].items()}),
        pad_links=_names(data["pads"]["links"], "pads.links"),
        task_mask=_vector(data.get("task_mask", [1.0] * 6), 6, "task_mask"),
        envelope=tuple(_box(b) for b in data["envelope"]),
        solver_iterations=int(_number(data.get("solver_iterations", 15), "solver_iterations")),
        cameras=data.get("cameras") or {},
        safety=read_limits(data["safety"], data["arm"]) if "safety" in data else None,
        source=path,
    )


def _check(robot: RobotDescription) -> None:
    """What is well formed and wrong nevertheless."""
    if len(set(robot.joints)) < len(robot.joints):
        raise InputError("a joint is named twice in arm.joints and hand.joints")
    if not np.all(robot.arm_lower < robot.arm_upper):
        raise InputError("arm.lower is not below arm.upper for every joint")
    if not np.all((robot.arm_lower <= robot.rest) & (robot.rest <= robot.arm_upper)):
        raise InputError("arm.rest is not within arm.lower and arm.upper")
    if not (np.all(robot.arm_velocity > 0.0) and np.all(robot.arm_acceleration > 0.0)):
        raise InputError("arm.velocity and arm.acceleration should be positive")
    if np.array_equal(robot.hand_open, robot.hand_closed):
        raise InputError("hand.open and hand.closed are the same")
    if min(robot.hand_speed, robot.opening) <= 0.0:
        raise InputError("hand.speed and opening should be positive")
    if np.any(robot.task_mask < 0.0) or not np.any(robot.task_mask > 0.0):
        raise InputError("task_mask should hold no negative weight and one positive at least")
    if np.count_nonzero(robot.task_mask) > len(robot.arm_joints):
        raise InputError(
            f"an arm of {len(robot.arm_joints)} joints cannot follow {np.count_nonzero(robot.task_mask)} "
            f"components of a pose: set some of task_mask to 0"
        )
    if len(robot.opposition) < 2 or not all(robot.opposition):
        raise InputError("opposition should name two groups of tips at least, none of them empty")
    for group in robot.opposition:
        for i in group:
            if not 0 <= i < len(robot.tips):
                raise InputError(f"opposition names tip {i} of {len(robot.tips)}")


def _drive(values: Any, what: str) -> Drive:
    known = [f.name for f in fields(Drive)]
    _check_keys(values, f"{what}.", dict.fromkeys(known[:3]), dict.fromkeys(known[3:]))
    return Drive(**{k: _number(v, f"{what}.{k}") for k, v in values.items()})


def _scale(values: Mapping[str, Any], joints: tuple[str, ...]) -> Array:
    out = np.ones(len(joints))
    for name, value in values.items():
        if name not in joints:
            raise InputError(f"hand.drive_scale names '{name}'{nearest(str(name), joints)}")
        out[joints.index(name)] = _number(value, f"hand.drive_scale.{name}")
    out.setflags(write=False)
    return out


def _tip(values: Any) -> Tip:
    _check_keys(values, "tips.", dict.fromkeys(("name", "links", "point")))
    x, y, z = _vector(values["point"], 3, "tips.point").tolist()
    return Tip(str(values["name"]), _names(values["links"], "tips.links"), (x, y, z))


def _box(values: Any) -> tuple[Array, tuple[float, float, float]]:
    _check_keys(values, "envelope.", dict.fromkeys(("position", "size")), {"rotation": None})
    position = _vector(values["position"], 3, "envelope.position")
    rotation = values.get("rotation", [1.0, 0.0, 0.0, 0.0])
    x, y, z = _vector(values["size"], 3, "envelope.size").tolist()
    return _pose([*position, *rotation], "envelope.rotation"), (x, y, z)


def _pose(values: Any, what: str) -> Array:
    """A pose ``(7,)`` with its quaternion normalised, for files that give a few digits."""
    array = np.array(_vector(values, 7, what))
    length = float(np.linalg.norm(array[3:]))
    if abs(length - 1.0) > 1e-3:
        raise InputError(f"{what} should end with a unit quaternion (w x y z), found {values!r}")
    array[3:] /= length
    array.setflags(write=False)
    return array


def _urdf_path(text: str, source: Path) -> Path:
    package, colon, inner = text.partition(":")
    if colon and len(package) > 1:
        spec = importlib.util.find_spec(package)
        if spec is None or not spec.submodule_search_locations:
            raise InputError(
                f"its URDF is in the package '{package}', which is not installed: "
                f"install it, or copy the file and set 'urdf' to a path of your own"
            )
        path = Path(next(iter(spec.submodule_search_locations))) / "assets" / inner
    else:
        path = (source.parent / text).resolve()
    if not path.is_file():
        raise InputError(f"no URDF at '{path}'")
    return path
