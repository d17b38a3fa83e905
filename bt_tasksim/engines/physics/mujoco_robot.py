"""A robot in a MuJoCo model: its links, joints and drives, from its URDF and its data file."""

from __future__ import annotations

from functools import lru_cache
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.mujoco_contacts import FRICTION, TIMESTEP, Body, ContactSurface, Solid
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.mesh_hulls import mesh_hull
from bt_tasksim.robot.urdf_links import Inertial, LinkJoint, load_links, root_pose, still_links
from bt_tasksim.robot.urdf_visuals import LinkVisual, load_collisions

if TYPE_CHECKING:
    import mujoco as mj

MIMIC_SOLREF = (2 * TIMESTEP, 1.0)
"""Time constant in seconds and damping ratio of what ties a joint to the one that it follows."""
MIMIC_SOLIMP = (0.99, 0.999, 0.001, 0.5, 2.0)


def add_robot(mujoco: ModuleType, spec: mj.MjSpec, robot: RobotDescription) -> list[Solid]:
    """Add a robot to a ``mujoco.MjSpec``; returns its shapes.

    Bodies are named ``robot/`` and the link, joints and drives by the joint. Links carry no weight, for
    nothing does in this model but objects.

    Raises:
        InputError: The URDF cannot be read, or lacks what the robot's file names.
    """
    links = load_links(robot.urdf)
    known = {item.link for item in links}
    named = {robot.tool_link, robot.wrist_link, *robot.pad_links, *(k for t in robot.tips for k in t.links)}
    for name in sorted(named - known):
        raise InputError(f"robot file '{robot.source}': the URDF has no link '{name}'{nearest(name, known)}")
    joints = {item.joint for item in links if item.moves}
    for name in robot.joints:
        if name not in joints:
            raise InputError(
                f"robot file '{robot.source}': the URDF has no joint '{name}'{nearest(name, joints)}"
            )
    armature = dict(zip(robot.joints, drive_armature(robot).tolist(), strict=True))
    bodies: dict[str, Any] = {}
    for item in links:
        parent = bodies[item.parent] if item.parent else spec.worldbody
        pose = np.array(item.pose) if item.parent else root_pose(links, robot.base_link)
        body = parent.add_body(name=f"robot/{item.link}", pos=pose[:3], quat=pose[3:])
        bodies[item.link] = body
        if item.inertial is not None:
            set_inertia(body, *_principal(item.inertial))
        if item.moves:
            _add_joint(mujoco, body, item, armature.get(item.joint, 0.0))
    for item in links:
        if item.mimic is not None:
            _add_mimic(mujoco, spec, item)
    _add_drives(mujoco, spec, robot)
    return _add_shapes(mujoco, spec, robot, links, bodies)


def drive_armature(robot: RobotDescription) -> Array:
    """Armature ``(n_joints,)`` of the joints: that of the robot's file, and no less than damping * step.

    With less, a drive at its force limit would turn its joint round within one step, and back in the next.
    """
    arm = np.full(len(robot.arm_joints), robot.arm_drive.armature)
    hand = np.full(len(robot.hand_joints), robot.hand_drive.armature)
    return np.maximum(np.concatenate([arm, hand]), robot.drive_array("damping") * TIMESTEP)


def set_inertia(body: mj.MjsBody, mass: float, frame: Array, moments: Array) -> None:
    """Set a body's mass (kg), inertial frame ``(7,)`` and principal moments ``(3,)`` (kg m^2)."""
    body.mass = mass
    body.ipos, body.iquat = frame[:3], frame[3:]
    body.inertia = moments
    body.explicitinertial = True


@lru_cache(maxsize=256)
def _principal(inertial: Inertial) -> tuple[float, Array, Array]:
    xx, yy, zz, xy, xz, yz = inertial.inertia
    moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    turn = poses.pose((0.0, 0.0, 0.0), poses.from_matrix(axes))
    return inertial.mass, poses.multiply(np.array(inertial.pose), turn), moments


def _add_joint(mujoco: ModuleType, body: mj.MjsBody, item: LinkJoint, armature: float) -> None:
    slides = item.kind == "prismatic"
    joint = body.add_joint(
        name=item.joint, type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
    )
    joint.axis = item.axis
    joint.armature = armature
    if item.limits is not None:
        joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        joint.range = item.limits


def _add_mimic(mujoco: ModuleType, spec: mj.MjSpec, item: LinkJoint) -> None:
    assert item.mimic is not None
    tie = spec.add_equality(name=f"mimic {item.joint}", type=mujoco.mjtEq.mjEQ_JOINT)
    tie.objtype = mujoco.mjtObj.mjOBJ_JOINT
    tie.name1, tie.name2 = item.joint, item.mimic.joint
    tie.data[:5] = [item.mimic.offset, item.mimic.multiplier, 0.0, 0.0, 0.0]
    tie.solref, tie.solimp = list(MIMIC_SOLREF), list(MIMIC_SOLIMP)


def _add_drives(mujoco: ModuleType, spec: mj.MjSpec, robot: RobotDescription) -> None:
    """Drives: force = control - stiffness * position - damping * velocity, within the limit."""
    gains = (robot.drive_array(what).tolist() for what in ("stiffness", "damping", "force_limit"))
    for name, stiffness, damping, limit in zip(robot.joints, *gains, strict=True):
        drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.gaintype, drive.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        drive.gainprm[0] = 1.0
        drive.biasprm[:3] = [0.0, -stiffness, -damping]
        drive.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        drive.forcerange = [-limit, limit]


def _add_shapes(
    mujoco: ModuleType,
    spec: mj.MjSpec,
    robot: RobotDescription,
    links: tuple[LinkJoint, ...],
    bodies: dict[str, Any],
) -> list[Solid]:
    still = still_links(links)
    tip_of = {name: i for i, tip in enumerate(robot.tips) for name in tip.links}
    neighbours: dict[str, set[str]] = {item.link: set() for item in links}
    for item in links:
        if item.parent:
            neighbours[item.link].add(item.parent)
    pads = ContactSurface(robot.pads.friction, robot.pads.min_patch_radius)
    solids = []
    for k, part in enumerate(load_collisions(robot.urdf)):
        name = f"robot/{part.link}/{k}"
        _add_shape(mujoco, spec, bodies[part.link], name, part)
        role = "base" if part.link in still else "link"
        body = Body(role, -1, part.link, tip_of.get(part.link, -1), frozenset(neighbours[part.link]))
        solids.append(Solid(name, body, pads if part.link in robot.pad_links else ContactSurface(FRICTION)))
    return solids


def _add_shape(mujoco: ModuleType, spec: mj.MjSpec, body: mj.MjsBody, name: str, part: LinkVisual) -> None:
    geom = body.add_geom(name=name, pos=part.pose[:3], quat=part.pose[3:], contype=0, conaffinity=0)
    kinds = mujoco.mjtGeom
    match part.kind:
        case "box":
            geom.type, geom.size = kinds.mjGEOM_BOX, [s / 2 for s in part.size]
        case "sphere":
            geom.type, geom.size[0] = kinds.mjGEOM_SPHERE, part.size[0]
        case "cylinder":
            geom.type = kinds.mjGEOM_CYLINDER
            geom.size[:2] = [part.size[0], part.size[1] / 2]
        case _:
            assert part.mesh is not None
            x, y, z = part.size
            geom.type, geom.meshname = kinds.mjGEOM_MESH, name
            add_hull(spec, name, mesh_hull(part.mesh, (x, y, z)))


def add_hull(spec: mj.MjSpec, name: str, vertices: Array) -> None:
    """Add the convex hull of points ``(n, 3)`` to a ``mujoco.MjSpec`` as a mesh."""
    spec.add_mesh(name=name, uservert=np.asarray(vertices, np.float32).ravel().tolist())
