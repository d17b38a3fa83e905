"""A robot's bodies: convex shapes that move with its joints, from the collision shapes of its URDF.

Shapes that are not convex count as their convex hulls. Which of the robot's own bodies are to be kept apart
is found by sampling postures, as MoveIt's setup assistant does: neighbours, pairs that always touch, and
pairs that touch in the rest posture are not asked about.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.errors import InputError, NoVolumeError
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.boxes import ArmFrames, box_of, carriers
from bt_tasksim.planning.pairs import Carrier
from bt_tasksim.planning.scratch import Scratch
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.models import arm_model, full_model
from bt_tasksim.robot.urdf_links import load_links

_POSTURES = 400
"""Random postures by which pairs of bodies are told apart."""
_ALWAYS = 0.8
"""Share of them from which on two bodies touch by the way that they are built."""
_AT_REST = 0.004
"""Metres from each other within which two bodies in the rest posture count as touching."""
_MOST_CORNERS = 200
"""Corners of a hull; of a finer one a sample is taken, with what it leaves out added around it."""


_KEPT = 1000
"""Widths of the hand for which boxes are kept, some MB."""


class _Scratch(Scratch):
    """What each thread has of its own.

    Attributes:
        framed: Joints that were asked about last, and the frames' placements for them.
        boxes: Boxes about the bodies, by the positions of the hand's joints.
        hands: The hand's bodies, by the same.
    """

    def __init__(self) -> None:
        self.framed: tuple[bytes, Array] = b"", np.empty(0)
        self.boxes: dict[bytes, Array] = {}
        self.hands: dict[bytes, list[tuple[str, Any, Any, Array]]] = {}


class RobotBodies:
    """The bodies of a robot.

    Args:
        robot: The robot.

    Attributes:
        model: Pinocchio's model of all joints, with a frame ``tool``.
        order: Where each of the robot's joints is in the model's ``q``.
        shapes: The bodies alone, as Pinocchio's geometry.
        links: Name of the link of each body ``(n,)``.
        hand: Booleans ``(n,)``: it belongs to the hand.
        fingers: Booleans ``(n,)``: a joint of the hand moves it.
        moves: Booleans ``(n,)``: the arm moves it.
        apart: Pairs of bodies ``(k, 2)`` that are to be kept apart.
        own_pairs: The same as plain numbers.
        movers: Numbers of the bodies that the arm moves.
        hands: Numbers of those that belong to the hand.
        before_tool: Numbers of others that what bears the tool does not carry.
        frames: The frames that the arm moves, see `ArmFrames`.
        of_frames: Number of the frame of each body ``(n,)``.
        carriers: With which frame joints move to which things are added: the base, and what bears the tool.

    Raises:
        InputError: The description does not fit its URDF.
    """

    def __init__(self, robot: RobotDescription) -> None:
        self.robot = robot
        self.model, self.order = full_model(robot)
        self.shapes = _shapes(robot, self.model)
        self.links = [self.model.frames[g.parentFrame].name for g in self.shapes.geometryObjects]
        below = _below(robot)
        self.hand = np.array([link in below for link in self.links], bool)
        moved = {self.model.getJointId(name) for name in robot.hand_joints}
        self.fingers = np.array([g.parentJoint in moved for g in self.shapes.geometryObjects], bool)
        fixed = [g.parentJoint == 0 for g in self.shapes.geometryObjects]
        self.moves = ~np.array(fixed, bool)
        self.tool_joint = self.model.frames[self.model.getFrameId("tool")].parentJoint
        self.tool_placement = self.model.frames[self.model.getFrameId("tool")].placement
        self.apart = self._kept_apart()
        self.own_pairs = [(i, k) for i, k in self.apart.tolist()]
        parents = [g.parentJoint for g in self.shapes.geometryObjects]
        self.movers, self.hands = (np.flatnonzero(which).tolist() for which in (self.moves, self.hand))
        self.before_tool = [i for i in np.flatnonzero(~self.hand).tolist() if parents[i] != self.tool_joint]
        self._carriers = carriers(self.model, robot.arm_joints)
        self.frames = ArmFrames(arm_model(robot, self.model))
        self._scratch = _Scratch()  # a robot's bodies are made once for all threads
        self._rests: Array = np.linalg.inv(self.frames(robot.rest[None])[0])
        self._own_boxes: Array = np.array(
            [box_of(g.geometry, np.eye(4)) for g in self.shapes.geometryObjects]
        )
        self.of_frames = [self._carriers[g.parentJoint] for g in self.shapes.geometryObjects]
        self.carriers = {joint: self._carrier(joint) for joint in {0, self.tool_joint}}

    @property
    def data(self) -> pin.Data:
        """What Pinocchio writes into, of this thread."""
        return self._scratch.data(self.model)

    def framed(self, arm: Array) -> Array:
        """The frames' placements ``(1, f, 4, 4)`` for joints of the arm ``(n_arm,)``, not to be written."""
        asked, (last, found) = arm.tobytes(), self._scratch.framed
        if asked != last:
            found = self.frames(arm[None])
            self._scratch.framed = asked, found
        return found

    def boxes(self, hand: Array) -> Array:
        """Boxes about the bodies ``(n, 4, 4)`` in their frames, see `box_of`.

        Args:
            hand: Positions ``(n_hand,)`` of the hand's joints.
        """
        found: Array = self._kept(hand, self._scratch.boxes, self._boxes)
        return found

    def hand_bodies(self, hand: Array) -> Sequence[tuple[str, Any, Any, Array]]:
        """Links of the hand, their placements in the tool frame, their shapes, and boxes about them there.

        Args:
            hand: Positions ``(n_hand,)`` of the hand's joints.
        """
        found: Sequence[tuple[str, Any, Any, Array]] = self._kept(
            hand, self._scratch.hands, self._hand_bodies
        )
        return found

    def _hand_bodies(self, hand: Array) -> list[tuple[str, Any, Any, Array]]:
        placed, found = self._placed(hand), []
        tool = self.data.oMi[self.tool_joint] * self.tool_placement
        for i in self.hands:
            at, shape = tool.actInv(placed[i]), self.shapes.geometryObjects[i].geometry
            found.append((self.links[i], at, shape, at.homogeneous @ self._own_boxes[i]))
        return found

    @staticmethod
    def _kept(hand: Array, kept: dict[bytes, Any], make: Callable[[Array], Any]) -> Any:
        """What is made of the hand's joints ``(n_hand,)``, if it is not there already."""
        asked = hand.tobytes()
        if asked not in kept:
            if len(kept) >= _KEPT:
                kept.clear()
            kept[asked] = make(hand)
        return kept[asked]

    def _boxes(self, hand: Array) -> Array:
        placed = np.array([at.homogeneous for at in self._placed(hand)])
        found: Array = self._rests[self.of_frames] @ placed @ self._own_boxes
        return found

    def _placed(self, hand: Array) -> Sequence[pin.SE3]:
        """Where each of the bodies is with the arm at rest; so is this thread's data."""
        data, placed = self.data, self.shapes.createData()
        q = self.configuration(self.robot.rest, hand)
        pin.updateGeometryPlacements(self.model, data, self.shapes, placed, q)
        found: Sequence[pin.SE3] = placed.oMg
        return found

    def _carrier(self, joint: int) -> Carrier:
        """With which of the arm's frames a joint moves that the hand's joints do not move."""
        data, frame = self.model.createData(), self._carriers[joint]
        pin.forwardKinematics(self.model, data, self.configuration(self.robot.rest, self.robot.hand_open))
        return Carrier(frame, self._rests[frame] @ data.oMi[joint].homogeneous)

    def configuration(self, arm: Array, hand: Array) -> Array:
        """Pinocchio's ``q`` for joints of the arm ``(n_arm,)`` and of the hand ``(n_hand,)``."""
        q = np.array(pin.neutral(self.model))
        q[self.order] = np.concatenate([arm, hand])
        return q

    def _kept_apart(self) -> Array:
        robot, shapes = self.robot, self.shapes.copy()
        joints = [g.parentJoint for g in shapes.geometryObjects]
        pairs = [
            (i, j)
            for i in range(shapes.ngeoms)
            for j in range(i + 1, shapes.ngeoms)
            if joints[i] != joints[j] and not (self.hand[i] and self.hand[j])
        ]
        for i, j in pairs:
            shapes.addCollisionPair(pin.CollisionPair(i, j))
        data, found = self.model.createData(), shapes.createData()
        rng = np.random.default_rng(0)
        postures = rng.uniform(robot.arm_lower, robot.arm_upper, (_POSTURES, len(robot.arm_joints)))
        touched = np.zeros(len(pairs))
        for arm in postures:
            q = self.configuration(arm, robot.hand_open)
            pin.computeCollisions(self.model, data, shapes, found, q, False)
            touched += [result.isCollision() for result in found.collisionResults]
        found.setSecurityMargins(shapes, np.full((shapes.ngeoms,) * 2, _AT_REST))
        pin.computeCollisions(
            self.model, data, shapes, found, self.configuration(robot.rest, robot.hand_open), False
        )
        at_rest = np.array([result.isCollision() for result in found.collisionResults], bool)
        kept = (touched > 0) & (touched < _ALWAYS * _POSTURES) & ~at_rest
        kept &= np.array([not self._neighbours(joints[i], joints[j]) for i, j in pairs], bool)
        return np.array([pair for pair, keep in zip(pairs, kept, strict=True) if keep], int).reshape(-1, 2)

    def _neighbours(self, a: int, b: int) -> bool:
        """Whether a joint carries another one, or the one that does: their limits keep their bodies apart."""
        for low, high in ((a, b), (b, a)):
            carrier = self.model.parents[high]
            if low in (carrier, self.model.parents[carrier]) and low != 0:
                return True
        return False


def bodies_of(robot: RobotDescription) -> RobotBodies:
    """The bodies of a robot, made once.

    Raises:
        InputError: The description does not fit its URDF.
    """
    found: RobotBodies = robot.derived("bodies", RobotBodies)
    return found


def _shapes(robot: RobotDescription, model: pin.Model) -> Any:
    """The robot's collision shapes, each convex, about a root at the base link.

    Raises:
        InputError: A shape cannot be read, or is no body.
    """
    folders = [str(robot.urdf.parent), str(robot.urdf.parent.parent)]
    plain = pin.buildModelFromUrdf(str(robot.urdf))
    try:
        found = pin.buildGeomFromUrdf(
            plain, str(robot.urdf), pin.GeometryType.COLLISION, package_dirs=folders
        )
    except ValueError as error:
        said = " ".join(str(error).split())
        raise InputError(f"the collision shapes of {robot.name} cannot be read: {said}") from error
    base = plain.frames[plain.getFrameId(robot.base_link)].placement
    shapes = pin.GeometryModel()
    for shape in found.geometryObjects:
        link = plain.frames[shape.parentFrame].name
        frame = model.getFrameId(link)
        joint = model.frames[frame].parentJoint
        placement = base.inverse() * shape.placement if joint == 0 else shape.placement
        try:
            body = _convex(shape.geometry)
        except (NoVolumeError, QhullError) as error:
            raise InputError(
                f"the collision shape '{shape.name}' of {robot.name} is no body: its corners lie in one plane"
            ) from error
        shapes.addGeometryObject(pin.GeometryObject(shape.name, joint, frame, placement, body))
    return shapes


def _convex(geometry: Any) -> Any:
    """A shape that is convex: itself, or its hull, with few corners."""
    if not isinstance(geometry, coal.BVHModelBase):
        return geometry
    vertices = np.array(geometry.vertices(), float).reshape(-1, 3)
    corners = vertices[ConvexHull(vertices).vertices]
    if len(corners) <= _MOST_CORNERS:
        return convex(corners)
    directions = np.random.default_rng(0).normal(size=(4 * _MOST_CORNERS, 3))
    few = corners[np.unique(np.argmax(directions @ corners.T, axis=1))]
    hull = ConvexHull(few)
    beyond = float(np.max(hull.equations[:, :3] @ corners.T + hull.equations[:, 3:], initial=0.0))
    shape = convex(few)
    shape.setSweptSphereRadius(max(beyond, 0.0))
    return shape


def _below(robot: RobotDescription) -> set[str]:
    """Names of the links that the wrist link carries, and its own."""
    parents: Mapping[str, str] = {item.link: item.parent for item in load_links(robot.urdf)}

    def carried(link: str) -> bool:
        while link:
            if link == robot.wrist_link:
                return True
            link = parents.get(link, "")
        return False

    return {link for link in parents if carried(link)}
