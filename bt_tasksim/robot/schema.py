"""What may stand in a robot's file."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from bt_tasksim.core.typed_file import (
    Direction,
    Model,
    Name,
    NotNegative,
    Number,
    Pose7,
    Positive,
    Quaternion,
    Share,
    Size3,
    Text,
    Vector3,
    sized,
)

MOST_JOINTS = 64
Names = Annotated[tuple[Text, ...], Field(strict=False, min_length=1, max_length=MOST_JOINTS)]
Joint = Annotated[Number, Field(ge=-1e3, le=1e3)]
"""A joint's position, rad or m."""
Joints = Annotated[tuple[Joint, ...], Field(strict=False, max_length=MOST_JOINTS)]
Speeds = Annotated[tuple[Positive, ...], Field(strict=False, max_length=MOST_JOINTS)]
Weight = Annotated[Number, Field(ge=0.0, le=1e3)]
Weights = Annotated[tuple[Weight, ...], Field(strict=False, max_length=MOST_JOINTS)]
Metre = Annotated[Number, Field(ge=-10.0, le=10.0)]
Reach = Annotated[tuple[Metre, Metre, Metre], Field(strict=False), sized(3)]
"""A point on or about the robot, m."""
Policy = Literal["stop", "clip"]


class DriveEntry(Model):
    """PD drives of a group of joints."""

    stiffness: Positive
    """N/m or Nm/rad."""
    damping: NotNegative
    """N s/m or Nm s/rad."""
    force_limit: NotNegative
    """Largest effort, N or Nm."""
    armature: NotNegative = 0.0
    """Inertia of the geared motor as the joint feels it, kg or kg m^2."""


class ArmEntry(Model):
    """The arm."""

    joints: Names
    """Names of its joints, from the base on."""
    lower: Joints
    """Lower position limits, by joint, rad."""
    upper: Joints
    """Upper position limits, by joint, rad."""
    velocity: Speeds
    """Velocity limits, by joint, rad/s."""
    acceleration: Speeds
    """Acceleration limits, by joint, rad/s^2."""
    rest: Joints
    """Rest posture, by joint, rad."""
    posture: Weights | None = None
    """Weights, by joint, of the pull towards the rest posture; by default 1 each."""
    drive: DriveEntry
    """Gains and limit of its drives."""


class HandEntry(Model):
    """The hand."""

    joints: Names
    """Names of all its joints, those that mimic others too."""
    open: Joints
    """Positions at closure 0, by joint, rad or m."""
    closed: Joints
    """Positions at closure 1, by joint, rad or m."""
    drive: DriveEntry
    """Gains and limit of its drives."""
    drive_scale: Annotated[dict[Text, Positive], Field(max_length=MOST_JOINTS)] | None = None
    """By joint: factor on the gains and the limit; by default 1."""
    speed: Positive
    """Fastest change of closure, 1/s."""
    press: NotNegative = 0.0
    """Force or torque, N or Nm, that each joint presses with at least once it is told to shut, however thin
    what it meets; 0 for hands without force control."""
    synergies: Annotated[dict[Name, Joints], Field(max_length=16)] | None = None
    """By name: displacements of the joints at value 1, rad or m."""


class ToolEntry(Model):
    """The tool frame."""

    link: Text
    """Link that carries it."""
    pose: Pose7
    """Position (m) and unit quaternion w x y z in that link: z approach, y closing axis."""
    closing: Direction
    """Direction of its y, tool straight ahead, in which the arm is farthest from its limits, base frame."""


class TipEntry(Model):
    """A fingertip."""

    name: Name
    """Its name."""
    links: Names
    """Links whose contacts count as its own."""
    point: Reach
    """The middle of its pad in the first of these links, m."""


class SurfaceEntry(Model):
    """Surface of the pads."""

    friction: Annotated[Number, Field(ge=0.0, le=10.0)]
    """Friction coefficient."""
    patch_radius: Share
    """Radius of the contact patch that resists twisting, m."""
    min_patch_radius: Share
    """The smallest such radius, m."""


class PadsEntry(Model):
    """The finger pads."""

    links: Names
    """Links that are pads."""
    surface: SurfaceEntry
    """Their surface."""


class EnvelopeEntry(Model):
    """A box about the hand or the end of the arm, for keeping clear of things."""

    position: Vector3
    """Its middle in the tool frame, m."""
    rotation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    """Unit quaternion w x y z in the tool frame."""
    size: Size3
    """Full size, m."""


class CameraEntry(Model):
    """A camera that stands still."""

    position: Vector3
    """Robot base frame, m."""
    look_at: Vector3
    """Point in the middle of the picture, robot base frame, m."""
    size: Annotated[
        tuple[Annotated[int, Field(ge=1, le=8192)], Annotated[int, Field(ge=1, le=8192)]],
        Field(strict=False),
        sized(2),
    ] = (640, 480)
    """Width and height, pixels."""
    field_of_view: Annotated[Number, Field(gt=0.0, lt=math.pi)] = math.radians(45.0)
    """Vertical opening angle, rad."""


class JointPositionLimit(Model):
    """Position limits of the arm, within those of `arm`."""

    lower: Joints | None = None
    """By joint, rad."""
    upper: Joints | None = None
    """By joint, rad."""
    policy: Policy = "stop"
    """What happens beyond it."""


class JointLimit(Model):
    """A limit of each joint of the arm."""

    limit: Speeds | None = None
    """By joint, rad/s, rad/s^2 or rad."""
    policy: Policy = "stop"
    """What happens beyond it."""


class ToolLimit(Model):
    """A limit of the tool's motion."""

    linear: Positive
    """m/s or m/s^2."""
    angular: Positive
    """rad/s or rad/s^2."""
    policy: Policy = "stop"
    """What happens beyond it."""


class WorkspaceLimit(Model):
    """The box that the tool's origin stays in, robot base frame."""

    lower: Vector3
    """Lower corner, m."""
    upper: Vector3
    """Upper corner, m."""
    policy: Policy = "stop"
    """What happens beyond it."""


class WrenchLimit(Model):
    """External load on the tool."""

    force: Positive
    """N."""
    torque: Positive
    """About the tool's origin, Nm."""
    policy: Policy = "stop"
    """What happens beyond it."""


class TrackingLimit(Model):
    """Difference of a commanded and a measured arm joint."""

    limit: Positive
    """rad."""
    policy: Policy = "stop"
    """What happens beyond it."""


class TimingEntry(Model):
    """Times, each at most 0.2 s: a robot holds within 0.25 s of a fault."""

    stale: Positive = 0.1
    """s, after which joint states are too old to act on."""
    validity: Positive = 0.15
    """s, after which a command expires."""
    watchdog: Positive = 0.15
    """s without a sign of life from the runner, after which the robot is stopped."""


class SafetyEntry(Model):
    """What a real robot must never exceed."""

    joint_position: JointPositionLimit = JointPositionLimit()
    """Position limits, where narrower than the arm's."""
    joint_velocity: JointLimit = JointLimit()
    """Velocity limits, rad/s, where lower than the arm's."""
    joint_acceleration: JointLimit = JointLimit()
    """Acceleration limits, rad/s^2, where lower than the arm's."""
    step: JointLimit = JointLimit()
    """Largest joint step between successive commands, rad; by default 0.1 s at the velocity limit."""
    tool_velocity: ToolLimit
    """m/s and rad/s."""
    tool_acceleration: ToolLimit
    """m/s^2 and rad/s^2."""
    workspace: WorkspaceLimit
    """Where the tool's origin may be."""
    wrench: WrenchLimit
    """Forces on the tool."""
    tracking: TrackingLimit
    """How well the arm must follow."""
    timing: TimingEntry = TimingEntry()
    """How fast faults are noticed."""


class RobotFile(Model):
    """A robot arm with a hand: what its URDF does not say."""

    name: Name
    """Its name in results."""
    urdf: Text
    """`package:path` within that package's assets, or the path of a file in this file's folder or below."""
    base_link: Text
    """The link that stands at the robot base frame; it does not move."""
    arm: ArmEntry
    """The arm."""
    hand: HandEntry
    """The hand."""
    tool: ToolEntry
    """The tool frame."""
    wrist_link: Text
    """The link whose incoming joint carries the wrist's force sensor."""
    tips: Annotated[tuple[TipEntry, ...], Field(strict=False, min_length=1, max_length=32)]
    """The fingertips."""
    opposition: Annotated[
        tuple[Annotated[tuple[int, ...], Field(strict=False, min_length=1, max_length=32)], ...],
        Field(strict=False, min_length=2, max_length=32),
    ]
    """Groups of tips, by number from 0, that face each other."""
    opening: Annotated[Number, Field(gt=0.0, le=10.0)]
    """Widest distance between opposing fingertips, m."""
    depth: Annotated[Number, Field(ge=0.0, le=10.0)]
    """How far below the top of a thing the tool's origin may go, m."""
    task_mask: Annotated[
        tuple[Weight, Weight, Weight, Weight, Weight, Weight], Field(strict=False), sized(6)
    ] = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    """Weights of the tool pose's components: x, y, z, rotations about them, tool frame; 0 leaves one free."""
    pads: PadsEntry
    """The finger pads."""
    envelope: Annotated[tuple[EnvelopeEntry, ...], Field(strict=False, max_length=64)]
    """Boxes in the tool frame that hold the hand and the end of the arm."""
    solver_iterations: Annotated[int, Field(ge=1, le=255)] = 15
    """Position iterations of a physics engine that solves contacts by iteration."""
    cameras: Annotated[dict[Name, CameraEntry], Field(max_length=16)] | None = None
    """Cameras by name."""
    safety: SafetyEntry | None = None
    """What a real robot must never exceed; without it no real robot of this kind is driven."""
