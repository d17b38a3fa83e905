"""What is known and what is asked at one instant.

`Observation` is what a real robot can see, `Hidden` what only a simulator knows, `Command` what a tree asks
for, `WorldState` what the physics engine hands on to rendering and post-process. All are plain bundles of
arrays with leading batch dimensions ``(...)``; names and other facts that do not change during an episode
stand in `WorldModel`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.joints import JointModel
from bt_tasksim.core.poses import Array


def read_only(values: Array) -> Array:
    """The same numbers, which cannot be written to by this name."""
    if not isinstance(values, np.ndarray):
        return values
    seen = values.view()
    seen.setflags(write=False)
    return seen


class KnownGeometry(Protocol):
    """The geometry that an object is taken to have; made when somebody asks."""

    @property
    def pieces(self) -> tuple[Array, ...]:
        """Corners ``(n, 3)`` of convex pieces that together are the solid, object's frame, metres."""

    @property
    def outer(self) -> Array:
        """Corners ``(n, 3)`` of their convex hull, likewise."""

    @property
    def hollow(self) -> Array:
        """Where something may lie within it ``(k, 6)``, see `bt_tasksim.scene.hollows.hollow`."""

    @property
    def grips(self) -> Any:
        """Where two fingers may hold it: `bt_tasksim.scene.grips.Grips`."""

    @property
    def given(self) -> Sequence[Any]:
        """Those of them that somebody gave; where there are any, it is held there and nowhere else."""


@dataclass(frozen=True)
class ObjectModel:
    """What is known beforehand about an object, by its category.

    Attributes:
        name: The object's name in the scene.
        kind: Its category, such as ``box`` or ``cup``.
        extent: Full nominal bounding-box size ``(3,)`` in its own frame, metres. The frame's origin is the
            box's centre, z points up when the object stands.
        symmetry: Order of the rotational symmetry about z (2: looks the same after half a turn); 0 for a
            body of revolution.
        grasp_axes: Directions ``(k, 3)`` in the object's frame along which two fingers may close on it,
            best first; a body of revolution has one and may turn it about z at will.
        grasp_widths: Widths ``(k,)`` in metres between the surfaces along these directions.
        cubic: The object looks the same on each of its faces (a cube), so any face may be down.
        solid: Its geometry as it is known; None where nothing but the box is.
        joint: How it moves, where it is a part of a fixture; None for what is free.
    """

    name: str
    kind: str
    extent: tuple[float, float, float]
    symmetry: int
    grasp_axes: tuple[tuple[float, float, float], ...]
    grasp_widths: tuple[float, ...]
    cubic: bool = False
    solid: KnownGeometry | None = None
    joint: JointModel | None = None


FURNITURE = "furniture"
"""Name under which boxes and places are kept clear of that belong to no fixture."""
HOLE = "hole"
"""Kind of places that things are pushed into along one line, which may point anywhere."""


def is_container(kind: str) -> bool:
    """Whether things are put into a place of this kind, and not onto it."""
    return kind == "bin"


@dataclass(frozen=True)
class PlaceModel:
    """A surface or a container of the scene, calibrated beforehand.

    Attributes:
        name: Its name.
        kind: ``table``, ``board``, ``spot``, ``bin`` or ``hole``.
        pose: Pose ``(7,)`` in the robot base frame; origin on the surface, where a thing placed without an
            offset stands; z out of the surface. Of a hole the origin is at its stop, and z points out of it.
        extent: Full size ``(2,)`` along x and y, metres, centred on ``centre``.
        centre: Centre ``(2,)`` of the surface in the place's own frame, metres.
        height: Free height above the surface, metres (to the next board); walls' height for a bin, and how
            deep a hole is.
        access: Unit vector ``(3,)``, robot base frame: the direction in which a hand comes to objects here.
        fixture: Name of the fixture it belongs to; empty where nothing carries it, such as a goal in the air.
        exit: Unit vector ``(3,)``, robot base frame: the way in which a lifted object leaves the fixture.
        clearance: Distance in metres along ``exit`` after which a hand and what it holds are clear of the
            fixture.
    """

    name: str
    kind: str
    pose: Array
    extent: tuple[float, float]
    centre: tuple[float, float]
    height: float
    access: Array
    exit: Array
    fixture: str
    clearance: float

    def __post_init__(self) -> None:
        for name in ("pose", "access", "exit"):  # everybody who looks at a world has the same ones
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def container(self) -> bool:
        """Things are put into it, and not onto it."""
        return is_container(self.kind)

    @property
    def carries(self) -> bool:
        """It is of some furniture, and things may stand on it or in it."""
        return bool(self.fixture) and self.kind != HOLE

    @property
    def rim(self) -> float:
        """Metres above its origin that a thing has to be lifted over."""
        return self.height if self.container else 0.0


@dataclass(frozen=True)
class WorldModel:
    """The names and calibrated facts of an episode, the same for policy and robot.

    Attributes:
        objects: Models of the objects, in the order of the arrays in `Observation` and `Hidden`.
        places: Models of the places, by name.
        tips: Names of the fingertips, in the order of the arrays.
        opening: Widest distance between opposing fingertips, metres.
        control_period: Seconds from one tick to the next.
        obstacles: Boxes to keep clear of, see `Obstacle`.
    """

    objects: tuple[ObjectModel, ...]
    places: Mapping[str, PlaceModel]
    tips: tuple[str, ...]
    opening: float
    control_period: float
    obstacles: tuple[Obstacle, ...] = ()
    index: Mapping[str, int] = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "index", {model.name: i for i, model in enumerate(self.objects)})

    def object(self, name: str) -> ObjectModel:
        """The model of an object.

        Raises:
            InputError: No such object is in the scene.
        """
        return self.objects[self.object_index(name)]

    def object_index(self, name: str) -> int:
        """Position of an object in the arrays.

        Raises:
            InputError: No such object is in the scene.
        """
        try:
            return self.index[name]
        except KeyError:
            raise InputError(f"no object '{name}' in the scene{nearest(name, self.index)}") from None

    def place(self, name: str) -> PlaceModel:
        """The model of a place.

        Raises:
            InputError: No such place is in the scene.
        """
        try:
            return self.places[name]
        except KeyError:
            raise InputError(f"no place '{name}' in the scene{nearest(name, self.places)}") from None

    def thing_of(self, name: str) -> str:
        """The name under which an object, or the fixture of a place, is kept clear of."""
        place = self.places.get(name)
        return name if place is None else place.fixture or FURNITURE


@dataclass(frozen=True)
class Obstacle:
    """A box that hand, arm and held object keep clear of: ``pose (7,)`` and full ``size (3,)``, metres."""

    pose: Array
    size: tuple[float, float, float]
    fixture: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", read_only(self.pose))


@dataclass(frozen=True, slots=True)
class Observation:
    """What a robot can know at one instant; batch dimensions ``(...)``, SI units, robot base frame.

    The force features and the visual features are pairwise aligned: fingertip i has ``contacts[..., i]``
    and ``contact_force[..., i, :]`` on one side and ``contact_points[..., i, :]`` on the other; the wrist
    has ``wrench`` on one side and ``motion`` on the other, both in the tool frame.

    Attributes:
        time: ``(...)`` seconds since the episode began.
        arm_position: ``(..., n_arm)`` joint positions.
        arm_velocity: ``(..., n_arm)`` joint velocities.
        hand_position: ``(..., n_hand)`` joint positions of the hand.
        hand_effort: ``(..., n_hand)`` effort over its limit, in [-1, 1], by the drive's own law.
        closure: ``(...)`` how far the hand is closed: 0 open, 1 shut.
        tool_pose: ``(..., 7)`` of the tool frame: z the approach axis, y the closing axis.
        tips: ``(..., n_tips, 3)`` positions of the fingertips.
        contacts: ``(..., n_tips)`` boolean, the fingertip touches something.
        contact_force: ``(..., n_tips, 3)`` force on each fingertip, N.
        wrench: ``(..., 6)`` external force (N) and torque (Nm) at the tool origin in the tool frame, the
            hand's own weight removed.
        objects: ``(..., n_objects, 7)`` estimated poses.
        contact_points: ``(..., n_tips, 3)`` the point of the nearest object, as estimated, that each
            fingertip would touch.
        motion: ``(..., 6)`` estimated twist of the nearest object relative to the tool, tool frame.
    """

    time: Array
    arm_position: Array
    arm_velocity: Array
    hand_position: Array
    hand_effort: Array
    closure: Array
    tool_pose: Array
    tips: Array
    contacts: Array
    contact_force: Array
    wrench: Array
    objects: Array
    contact_points: Array
    motion: Array


@dataclass(frozen=True, slots=True)
class Hidden:
    """The physics state, known in simulation only; batch dimensions ``(...)``, robot base frame.

    Attributes:
        time: ``(...)`` seconds since the episode began.
        objects: ``(..., n_objects, 7)`` true poses.
        velocities: ``(..., n_objects, 6)`` linear (m/s) and angular (rad/s) velocities.
        hand_force: ``(..., n_objects)`` sum of the magnitudes of the hand's contact forces on each object, N.
        hand_distance: ``(..., n_objects)`` metres between the hand and the object; 0 where they touch, and
            never more than the physics engine looks for (its contact offset): then infinity.
        support: ``(..., n_objects, n_bodies)`` boolean: each object touches each static body or other object;
            the bodies are `WorldModel.objects` first and then the fixtures in the order of the configuration.
        penetration: ``(...)`` deepest overlap of any two bodies seen since the episode began, metres.
        tool_pose: ``(..., 7)`` true tool pose.
    """

    time: Array
    objects: Array
    velocities: Array
    hand_force: Array
    hand_distance: Array
    support: Array
    penetration: Array
    tool_pose: Array


@dataclass(frozen=True, slots=True)
class Command:
    """What is asked of the robot for one control period; a part that is None was not written.

    Attributes:
        tool: ``(..., 7)`` tool-pose target, robot base frame.
        hand: ``(..., 1 + n_synergies)`` closure in [0, 1], then the synergies that the robot declares.
        posture: ``(..., n_arm)`` joints to hold the tool with, as a planned way gives them; NaN, or None,
            where the kinematics engine may choose. It belongs to ``tool`` and counts for nothing without it.
    """

    tool: Array | None = None
    hand: Array | None = None
    posture: Array | None = None

    def over(self, other: Command) -> Command:
        """This command, with the parts that it lacks taken from ``other``."""
        held = other if self.tool is None else self
        return Command(held.tool, other.hand if self.hand is None else self.hand, held.posture)


@dataclass(frozen=True, slots=True)
class JointTarget:
    """What the kinematics engine asks of the joints: positions and velocities at the period's end.

    Attributes:
        position: ``(..., n_joints)`` in the robot's joint order (arm, then hand).
        velocity: ``(..., n_joints)``.
        validity: Seconds after which a real robot that has heard nothing newer holds by itself.
    """

    position: Array
    velocity: Array
    validity: float = math.inf


@dataclass(frozen=True, slots=True)
class WorldState:
    """What a physics engine (or a robot's sensors) reports after each control period.

    Object arrays are the truth in simulation, and None on a real robot.

    Attributes:
        time: ``(...)`` seconds since the episode began.
        joint_position: ``(..., n_joints)`` in the robot's joint order.
        joint_velocity: ``(..., n_joints)``.
        joint_effort: ``(..., n_joints)`` by the drives' own law, N or Nm.
        tip_force: ``(..., n_tips, 3)`` contact force on each fingertip, robot base frame, N.
        wrench: ``(..., 6)`` external wrench at the tool origin in the tool frame.
        tool_pose: ``(..., 7)``.
        tips: ``(..., n_tips, 3)`` positions of the fingertips.
        objects: ``(..., n_objects, 7)`` or None.
        velocities: ``(..., n_objects, 6)`` or None.
    """

    time: Array
    joint_position: Array
    joint_velocity: Array
    joint_effort: Array
    tip_force: Array
    wrench: Array
    tool_pose: Array
    tips: Array
    objects: Array | None = None
    velocities: Array | None = None
