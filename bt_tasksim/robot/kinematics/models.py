"""Pinocchio models of a robot description: the whole robot, and its arm alone."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin

from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.urdf_visuals import read_urdf

_ENDLESS = 1e3
"""rad, which a joint without limits does not reach."""
_XYZQUAT, _WXYZ = np.array([0, 1, 2, 4, 5, 6, 3]), np.array([0, 1, 2, 6, 3, 4, 5])


def se3(pose: Array) -> pin.SE3:
    """Pinocchio's form of a pose ``(7,)``; its quaternion is normalised.

    Raises:
        InputError: The quaternion is nowhere near a unit one.
    """
    p = np.asarray(pose, float)
    q = p[3:]
    square = float(q.dot(q))
    if not 0.25 < square < 4.0:
        raise InputError(
            f"a tool pose needs a unit quaternion (w x y z) behind its position, found {p.tolist()}"
        )
    if abs(square - 1.0) > 1e-9:
        p = np.concatenate([p[:3], p[3:] / np.sqrt(square)])
    return pin.XYZQUATToSE3(p[_XYZQUAT])


def free_flyer(pose: Array) -> Array:
    """A pose ``(7,)`` as Pinocchio's coordinates ``(7,)`` have it, the quaternion x y z w."""
    return np.asarray(pose, float)[_XYZQUAT]


def pose_of(placement: pin.SE3) -> Array:
    """The pose ``(7,)`` of a placement in Pinocchio's form."""
    found: Array = pin.SE3ToXYZQUAT(placement)[_WXYZ]
    return found


def full_model(robot: RobotDescription) -> tuple[pin.Model, Array]:
    """The whole robot with its root at the base link, and where each of ``robot.joints`` is in its ``q``.

    Raises:
        InputError: The description names what the URDF has not, or the URDF is unreadable.
    """
    try:
        model = _model(robot.urdf)
    except (ValueError, RuntimeError) as error:
        raise InputError(
            f"robot file '{robot.source}': the URDF '{robot.urdf}' is unreadable: {error}"
        ) from error
    base = model.frames[body_index(model, robot.base_link, robot)]
    if base.parentJoint != 0:
        raise InputError(f"robot file '{robot.source}': base_link '{robot.base_link}' moves with a joint")
    shift = base.placement.inverse()
    for i in range(1, model.njoints):
        if model.parents[i] == 0:
            model.jointPlacements[i] = shift * model.jointPlacements[i]
    for frame in model.frames:
        if frame.parentJoint == 0:
            frame.placement = shift * frame.placement
    link = model.frames[body_index(model, robot.tool_link, robot)]
    placement = link.placement * se3(robot.tool_pose)
    model.addFrame(pin.Frame("tool", link.parentJoint, placement, pin.FrameType.OP_FRAME))
    order = []
    for name in robot.joints:
        if not model.existJointName(name):
            known = list(model.names)[1:]
            raise InputError(
                f"robot file '{robot.source}': the URDF has no joint '{name}'{nearest(name, known)}"
            )
        joint = model.joints[model.getJointId(name)]
        if joint.nq != 1:
            raise InputError(f"robot file '{robot.source}': joint '{name}' is not a hinge or slide")
        order.append(joint.idx_q)
    for name in [robot.wrist_link, *robot.pad_links, *(link for tip in robot.tips for link in tip.links)]:
        body_index(model, name, robot)
    return model, np.array(order)


def _model(urdf: Path) -> pin.Model:
    """Pinocchio's model, every joint of which has one coordinate.

    Joints that turn without end would have two, cosine and sine. The robot's file gives limits to those that
    it moves, so here they are hinges like others.
    """
    root = read_urdf(urdf)
    endless = [joint for joint in root.findall("joint") if joint.get("type") == "continuous"]
    if not endless:
        return pin.buildModelFromUrdf(str(urdf))
    root = copy.deepcopy(root)
    for joint in root.findall("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = ElementTree.SubElement(joint, "limit")
            wide = {"lower": str(-_ENDLESS), "upper": str(_ENDLESS), "effort": "0", "velocity": "0"}
            limit.attrib.update(
                {**wide, **{k: v for k, v in limit.attrib.items() if k in ("effort", "velocity")}}
            )
    return pin.buildModelFromXML(ElementTree.tostring(root, encoding="unicode"))


def arm_model(robot: RobotDescription, full: pin.Model) -> pin.Model:
    """The arm alone, with every other joint locked.

    Raises:
        InputError: The joints are not listed from the base on.
    """
    locked = [i for i in range(1, full.njoints) if full.names[i] not in robot.arm_joints]
    model = pin.buildReducedModel(full, locked, pin.neutral(full))
    names = tuple(model.names)[1:]
    if names != robot.arm_joints:
        raise InputError(
            f"robot file '{robot.source}': arm.joints should be listed from the base on: {', '.join(names)}"
        )
    return model


def body_index(model: pin.Model, name: str, robot: RobotDescription) -> int:
    """Index of a link's frame.

    Raises:
        InputError: There is no such link.
    """
    if not model.existBodyName(name):
        known = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
        raise InputError(f"robot file '{robot.source}': the URDF has no link '{name}'{nearest(name, known)}")
    return int(model.getBodyId(name))
