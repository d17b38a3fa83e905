"""Robot descriptions: one data file a robot.

A file names the URDF and says which joints are arm and hand, where the tool frame is, which fingertips face
each other, and how closure in [0, 1] and the synergies map to hand joints. In simulation the URDF is that of
the installed mani_skill package (``mani_skill:robots/...``); on a robot computer it is a path of its own.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.beside import beside
from bt_tasksim.core.document import located
from bt_tasksim.core.errors import FieldError, InputError, nearest, within
from bt_tasksim.core.files import file_version
from bt_tasksim.core.named_data import named_data
from bt_tasksim.core.plain import shown, where_text
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.limits import SafetyLimits, read_limits
from bt_tasksim.robot.urdf_links import joint_depths, joint_limits, joint_speeds

if TYPE_CHECKING:
    from bt_tasksim.robot.schema import EnvelopeEntry, RobotFile

ROUNDED = 1e-3
"""Rad or m by which a robot file's joint positions may differ from its URDF's, which are often rounded."""
FASTER = 10.0
"""Times its URDF's speed above which a joint's speed is a mistake, mostly of units, and no better motor."""
SLANT = 0.05
"""Least horizontal part of the direction in which a hand closes, of length one."""


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
        hand_press: Force or torque, N or Nm, that joints press with at least once they are told to shut.
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
    hand_press: float
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

    @property
    def many_fingers(self) -> bool:
        """The hand has more than two fingertips: it holds by more points than two pads."""
        return len(self.tips) > 2

    def drive_array(self, what: str) -> Array:
        """A field of `Drive` for every joint ``(n_joints,)``, in the order of `joints`.

        Args:
            what: ``stiffness``, ``damping``, ``force_limit`` or ``armature``.
        """
        arm = np.full(len(self.arm_joints), getattr(self.arm_drive, what))
        return np.concatenate([arm, getattr(self.hand_drive, what) * self.hand_drive_scale])

    def hand_position(self, hand: Array) -> Array:
        """Hand joint positions ``(..., n_hand)`` for a hand command ``(..., 1 + n_synergies)``."""
        opened, span = self.hand_open.copy(), self.hand_closed - self.hand_open
        out = poses.constant(opened, hand) + hand[..., :1] * poses.constant(span, hand)
        for i in range(min(len(self.synergies), hand.shape[-1] - 1)):
            out = out + hand[..., i + 1 : i + 2] * poses.constant(self.synergy_directions[i].copy(), hand)
        return out

    def derived(self, name: str, make: Callable[[RobotDescription], Any]) -> Any:
        """Something that follows from this description alone, made when it is first asked for.

        Args:
            name: What it is.
            make: Makes it.
        """
        kept = self.__dict__.setdefault("_derived", {})
        if name not in kept:
            kept[name] = make(self)
        return kept[name]

    def __getstate__(self) -> dict[str, Any]:
        """What a copy has: what follows from the description is made anew, since not all can be copied."""
        return {name: value for name, value in self.__dict__.items() if name != "_derived"}

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
        opened, weights = self.hand_open.tolist(), self._closure_weights.tolist()
        fit = (hand_position[..., 0] - opened[0]) * weights[0]
        for i in range(1, len(weights)):  # a sum by a library may depend on how many rows there are
            fit = fit + (hand_position[..., i] - opened[i]) * weights[i]
        return poses.clip(fit, 0.0, 1.0)

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


def load_robot(name: str, urdf: Path | None = None) -> RobotDescription:
    """A robot by name, or one from a data file by path.

    What is registered as a ``robot`` is the path of its data file, or a `RobotDescription`.

    Args:
        name: The name, or the path.
        urdf: Its URDF, where the one that its file names is in a package that is not installed here.

    Raises:
        InputError: No such robot, its URDF is not to be found, or the file lacks or misstates something.
    """
    found = named_data("robot", name, RobotDescription)
    return found if isinstance(found, RobotDescription) else _load(found, file_version(found), urdf)


@lru_cache(maxsize=32)
def _load(path: Path, version: tuple[int, ...], urdf: Path | None) -> RobotDescription:
    """The robot in this version of a file."""
    from bt_tasksim.core.typed_file import load_typed
    from bt_tasksim.robot.schema import RobotFile

    data, document = load_typed(RobotFile, path, "robot file")
    with located(document):
        return _description(data, path, urdf)


def described(data: RobotFile, path: Path) -> RobotDescription:
    """The robot that a file's content describes.

    Args:
        data: The content.
        path: Where the file is, or is to be: its URDF is found from there.

    Raises:
        FieldError: Its URDF is not to be found, or it misstates something.
    """
    return _description(data, path)


def _description(data: RobotFile, path: Path, urdf: Path | None = None) -> RobotDescription:
    arm, hand, tool = data.arm, data.hand, data.tool
    n_arm, n_hand = len(arm.joints), len(hand.joints)
    synergies = hand.synergies or {}
    with within("urdf"):
        urdf = urdf or _urdf_path(data.urdf, path)
    robot = RobotDescription(
        name=data.name,
        urdf=urdf,
        base_link=data.base_link,
        arm_joints=arm.joints,
        arm_lower=_joints(arm.lower, n_arm, "arm", "lower"),
        arm_upper=_joints(arm.upper, n_arm, "arm", "upper"),
        arm_velocity=_joints(arm.velocity, n_arm, "arm", "velocity"),
        arm_acceleration=_joints(arm.acceleration, n_arm, "arm", "acceleration"),
        rest=_joints(arm.rest, n_arm, "arm", "rest"),
        posture=_joints(arm.posture or (1.0,) * n_arm, n_arm, "arm", "posture"),
        arm_drive=Drive(**dict(arm.drive)),
        hand_joints=hand.joints,
        hand_open=_joints(hand.open, n_hand, "hand", "open"),
        hand_closed=_joints(hand.closed, n_hand, "hand", "closed"),
        hand_drive=Drive(**dict(hand.drive)),
        hand_drive_scale=_scale(hand.drive_scale or {}, hand.joints),
        hand_speed=hand.speed,
        hand_press=hand.press,
        synergies=tuple(synergies),
        synergy_directions=np.array(
            [_joints(v, n_hand, "hand", "synergies", k) for k, v in synergies.items()]
        ).reshape(len(synergies), n_hand),
        tool_link=tool.link,
        tool_pose=_pose(tool.pose),
        closing=_fixed(np.array(tool.closing)),
        wrist_link=data.wrist_link,
        tips=tuple(Tip(tip.name, tip.links, tip.point) for tip in data.tips),
        opposition=data.opposition,
        opening=data.opening,
        depth=data.depth,
        pads=Pads(**dict(data.pads.surface)),
        pad_links=data.pads.links,
        task_mask=_fixed(np.array(data.task_mask)),
        envelope=tuple(_box(box, i) for i, box in enumerate(data.envelope)),
        solver_iterations=data.solver_iterations,
        cameras={k: v.model_dump(exclude_unset=True) for k, v in (data.cameras or {}).items()},
        safety=None,
        source=path,
    )
    _check(robot)
    _check_urdf(robot)
    if data.safety is None:
        return robot
    with within("safety"):
        return replace(robot, safety=read_limits(data.safety, arm))


def _check(robot: RobotDescription) -> None:
    """What is well formed and wrong nevertheless."""
    if len(set(robot.joints)) < len(robot.joints):
        raise FieldError("a joint is named twice in 'arm.joints' and 'hand.joints'", "arm", "joints")
    if not np.all(robot.arm_lower < robot.arm_upper):
        raise FieldError("'arm.lower' is not below 'arm.upper' for every joint", "arm", "lower")
    if not np.all((robot.arm_lower <= robot.rest) & (robot.rest <= robot.arm_upper)):
        raise FieldError("'arm.rest' is not within 'arm.lower' and 'arm.upper'", "arm", "rest")
    if np.array_equal(robot.hand_open, robot.hand_closed):
        raise FieldError("'hand.open' and 'hand.closed' are the same", "hand", "closed")
    if math.hypot(*robot.closing[:2]) < SLANT:
        raise FieldError(
            "'tool.closing' is parallel to the approach of a tool that points straight down: "
            "give the direction in which the hand closes, across it",
            "tool",
            "closing",
        )
    if not np.any(robot.task_mask > 0.0):
        raise FieldError("'task_mask' should have one positive weight at least", "task_mask")
    if np.count_nonzero(robot.task_mask) > len(robot.arm_joints):
        raise FieldError(
            f"an arm of {len(robot.arm_joints)} joints cannot follow {np.count_nonzero(robot.task_mask)} "
            f"components of a pose: set some of 'task_mask' to 0",
            "task_mask",
        )
    for k, group in enumerate(robot.opposition):
        for i in group:
            if not 0 <= i < len(robot.tips):
                raise FieldError(f"'opposition' names tip {i} of {len(robot.tips)}", "opposition", k)


def _check_urdf(robot: RobotDescription) -> None:
    """The arm is listed in its order, and no joint is sent to where its URDF does not let it go."""
    depths = joint_depths(robot.urdf)
    if all(joint in depths for joint in robot.arm_joints):
        order = sorted(robot.arm_joints, key=depths.__getitem__)
        if tuple(order) != robot.arm_joints:
            raise FieldError(
                f"'arm.joints' should be listed from the base on: {', '.join(order)}", "arm", "joints"
            )
    _check_positions(robot, robot.arm_joints, "arm", {"lower": robot.arm_lower, "upper": robot.arm_upper})
    _check_positions(robot, robot.hand_joints, "hand", {"open": robot.hand_open, "closed": robot.hand_closed})
    speeds = joint_speeds(robot.urdf)
    for i, (joint, value) in enumerate(zip(robot.arm_joints, robot.arm_velocity.tolist(), strict=True)):
        if value > FASTER * speeds.get(joint, np.inf):
            raise FieldError(
                f"'arm.velocity' lets joint '{joint}' move at {value:g}, and its URDF at {speeds[joint]:g}: "
                "give rad/s",
                "arm",
                "velocity",
                i,
            )


def _check_positions(
    robot: RobotDescription, joints: Sequence[str], group: str, fields: Mapping[str, Array]
) -> None:
    """Positions ``(n,)`` of joints, by field, are within the limits of their URDF."""
    limits = joint_limits(robot.urdf)
    for name, values in fields.items():
        for i, (joint, value) in enumerate(zip(joints, values.tolist(), strict=True)):
            lower, upper = limits.get(joint, (-np.inf, np.inf))
            if not lower - ROUNDED <= value <= upper + ROUNDED:
                raise FieldError(
                    f"'{group}.{name}' puts joint '{joint}' at {value:g}, and its URDF lets it go "
                    f"from {lower:g} to {upper:g}",
                    group,
                    name,
                    i,
                )


def _fixed(array: Array) -> Array:
    array.setflags(write=False)
    return array


def _joints(values: Sequence[float], n: int, *where: str) -> Array:
    """Values of joints ``(n,)``."""
    if len(values) != n:
        raise FieldError(
            f"'{where_text(where)}' should be {n} numbers, one for each of '{where[0]}.joints', "
            f"found {len(values)}",
            *where,
        )
    return _fixed(np.array(values))


def _scale(values: Mapping[str, float], joints: tuple[str, ...]) -> Array:
    out = np.ones(len(joints))
    for name, value in values.items():
        if name not in joints:
            raise FieldError(
                f"'hand.drive_scale' names '{shown(name)}', no joint of the hand{nearest(name, joints)}",
                "hand",
                "drive_scale",
                name,
            )
        out[joints.index(name)] = value
    return _fixed(out)


def _box(box: EnvelopeEntry, index: int) -> tuple[Array, tuple[float, float, float]]:
    if abs(math.hypot(*box.rotation) - 1.0) > 1e-3:
        raise FieldError(
            f"'envelope[{index}].rotation' should be a unit quaternion w x y z", "envelope", index, "rotation"
        )
    return _pose((*box.position, *box.rotation)), box.size


def _pose(values: Sequence[float]) -> Array:
    """A pose ``(7,)`` with its quaternion normalised, for files that give a few digits."""
    return _fixed(poses.unit_pose(values))


def _urdf_path(text: str, source: Path) -> Path:
    """The URDF: in an installed package, without importing it, or beside the robot's file."""
    package, colon, inner = text.partition(":")
    if not colon:
        path = beside(source.parent, text, "a URDF")
    else:
        spec = importlib.util.find_spec(package) if package.isidentifier() else None
        if spec is None or not spec.submodule_search_locations:
            raise InputError(
                f"its URDF is in the package '{shown(package)}', which is not installed: "
                f"install it, or copy the file and its meshes beside this one and set 'urdf' to its path"
            )
        path = beside(Path(next(iter(spec.submodule_search_locations))) / "assets", inner, "a URDF")
    if not path.is_file():
        raise InputError(f"no URDF at '{path}'")
    return path
