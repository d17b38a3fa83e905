"""What a URDF says of a robot, as far as it can be told: arm, hand, limits, and where the fingertips may be.

A first guess, to be looked at: ``bt-tasksim check`` says what does not fit.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.urdf_links import LinkJoint, joint_speeds, load_links
from bt_tasksim.robot.urdf_visuals import LinkVisual, load_collisions

ENDLESS = 3.1
"""Radians to either side for a joint without limits."""
SPEED, ACCELERATION = 1.0, 10.0
"""rad/s where the URDF states no speed, and rad/s^2."""
END = 0.15
"""Part of a finger's length, at its end, whose middle is taken for its tip."""
DEPTH = 0.035
"""Metres."""
HELD = 0.7
"""Closure at which things are held."""
STRAIGHT = math.cos(math.radians(25.0))
"""A direction nearer than this to an axis of its link is that axis."""


def guess(urdf: Path) -> dict[str, Any]:
    """The fields of a robot's file that its URDF tells; rest posture and closing axis are not good yet.

    Args:
        urdf: The URDF.

    Raises:
        InputError: It cannot be read, or has no arm that ends in a hand.
    """
    links = load_links(urdf)
    arm, hand = _arm_and_hand(links, urdf)
    limits = {item.joint: item.limits or (-ENDLESS, ENDLESS) for item in links if item.moves}
    model = _Hand(links, hand, urdf)
    opened, closed = model.extremes(limits)
    tips = model.tips(opened)
    z = model.approach
    across = tips[1:].mean(axis=0) - tips[0]
    y = _snapped(across - (across @ z) * z)
    model.to_pads(opened, y)
    tips = model.tips(opened)
    held = {name: opened[name] + HELD * (closed[name] - opened[name]) for name in opened}
    groups = _sides(tips, y)
    middle = np.mean([model.tips(held)[group].mean(axis=0) for group in groups], axis=0)
    tool = poses.pose(middle, poses.frame_from_axes(z, y))
    corners = poses.localise(tool, model.corners(opened))
    low, high = corners.min(axis=0), corners.max(axis=0)
    speeds = joint_speeds(urdf)
    slides = all(item.kind == "prismatic" for item in hand)
    fingers = [finger.link for finger in model.fingers]
    return {
        "base_link": links[0].link,
        "arm": {
            "joints": [item.joint for item in arm],
            "lower": [limits[item.joint][0] for item in arm],
            "upper": [limits[item.joint][1] for item in arm],
            "velocity": [speeds.get(item.joint, SPEED) for item in arm],
            "acceleration": [ACCELERATION] * len(arm),
            "rest": [sum(limits[item.joint]) / 2 for item in arm],
            "drive": {"stiffness": 1000, "damping": 100, "force_limit": 100},
        },
        "hand": {
            "joints": [item.joint for item in hand],
            "open": [opened[item.joint] for item in hand],
            "closed": [closed[item.joint] for item in hand],
            "drive": {"stiffness": 1000, "damping": 100, "force_limit": 30, "armature": 0.25}
            if slides
            else {"stiffness": 100, "damping": 10, "force_limit": 3},
            "speed": 2.0,
        },
        "tool": {"link": model.link, "pose": tool.tolist(), "closing": [0.0, 1.0, 0.0]},
        "wrist_link": model.link,
        "tips": [
            {"name": f"finger_{k + 1}", "links": [finger.link], "point": finger.point.tolist()}
            for k, finger in enumerate(model.fingers)
        ],
        "opposition": groups,
        "opening": float(np.linalg.norm(np.diff([tips[group].mean(axis=0) for group in groups], axis=0))),
        "depth": DEPTH,
        "pads": {"links": fingers},
        "envelope": [{"position": ((low + high) / 2).tolist(), "size": (high - low).tolist()}],
        "task_mask": {4: [1, 1, 1, 0, 0, 1], 5: [1, 1, 1, 1, 0, 1]}.get(len(arm), [1] * 6),
    }


def _arm_and_hand(links: tuple[LinkJoint, ...], urdf: Path) -> tuple[list[LinkJoint], list[LinkJoint]]:
    """The joints of the chain that the base carries, and those where it branches, or its last one."""
    arm: list[LinkJoint] = []
    link = links[0].link
    while len(following := _next_moving(links, link)) == 1:
        arm.append(following[0])
        link = following[0].link
    chain = {item.joint for item in arm}
    hand = [item for item in links if item.moves and item.joint not in chain]
    if not hand and len(arm) > 1:
        hand = [arm.pop()]
    if len(arm) < 2 or not hand:
        raise InputError(
            f"URDF '{urdf}': no chain of joints leads from '{links[0].link}' to one hand: leave --urdf away, "
            "and name arm and hand in the file by hand"
        )
    return arm, hand


def _next_moving(links: tuple[LinkJoint, ...], link: str) -> list[LinkJoint]:
    """The moving joints that a link carries, by fixed ones or at once."""
    out: list[LinkJoint] = []
    for item in links:
        if item.parent == link:
            out += [item] if item.moves else _next_moving(links, item.link)
    return out


class _Finger:
    """One fingertip: its link, and the middle of its end ``(3,)`` there."""

    def __init__(self, link: str, point: Array) -> None:
        self.link, self.point = link, point


class _Hand:
    """The hand's links and their shapes, in the frame of the link that carries them."""

    def __init__(self, links: tuple[LinkJoint, ...], hand: list[LinkJoint], urdf: Path) -> None:
        self._links = {item.link: item for item in links}
        self._joints = hand
        self.link = hand[0].parent
        below = [item for item in links if self._is_below(item.link)]
        self._shapes: dict[str, Array] = {}
        for part in load_collisions(urdf):
            if part.link == self.link or any(item.link == part.link for item in below):
                found = poses.transform(np.array(part.pose), _corners(part))
                before = self._shapes.get(part.link, np.empty((0, 3)))
                self._shapes[part.link] = np.concatenate([before, found])
        ends = [self._end(item, links) for item in _next_moving(links, self.link)]
        ends = [end for end in ends if end in self._shapes]
        if not ends or (len(ends) == 1 and self.link not in self._shapes):
            raise InputError(f"URDF '{urdf}': the fingers below '{self.link}' have no collision shapes")
        rest = dict.fromkeys((item.joint for item in hand), 0.0)
        middles = [self._at(end, rest, self._shapes[end]).mean(axis=0) for end in ends]
        self.approach = _snapped(np.mean(middles, axis=0))
        self.fingers = [_Finger(end, self._tip(end, rest)) for end in ([self.link] * (len(ends) == 1) + ends)]

    def extremes(self, limits: dict[str, tuple[float, float]]) -> tuple[dict[str, float], dict[str, float]]:
        """Positions by joint, open and closed: those ends of the limits that have tips far apart, and not."""
        free = [item for item in self._joints if item.mimic is None]
        opened = {item.joint: limits[item.joint][0] for item in free}
        for item in free:
            wide = [self._gap(opened | {item.joint: end}) for end in limits[item.joint]]
            opened[item.joint] = limits[item.joint][int(wide[1] > wide[0])]
        closed = {name: sum(limits[name]) - value for name, value in opened.items()}
        return self._all(opened), self._all(closed)

    def tips(self, joints: dict[str, float]) -> Array:
        """Where the fingertips are ``(n, 3)``."""
        return np.array([self._at(f.link, joints, f.point[None])[0] for f in self.fingers])

    def to_pads(self, joints: dict[str, float], y: Array) -> None:
        """Move every fingertip along the closing axis ``y (3,)`` to that side which faces the others."""
        tips = self.tips(joints)
        for k, finger in enumerate(self.fingers):
            others = np.delete(tips, k, axis=0).mean(axis=0)
            inwards = math.copysign(1.0, float((others - tips[k]) @ y)) * y
            found = self._at(finger.link, joints, self._shapes[finger.link])
            along = found @ self.approach
            end = found[along >= along.max() - END * float(np.ptp(along))]
            shift = (float((end @ inwards).max()) - float(tips[k] @ inwards)) * inwards
            corner = self._at(finger.link, joints, np.zeros((1, 3)))
            finger.point = finger.point + (self._at(finger.link, joints, np.eye(3)) - corner) @ shift

    def corners(self, joints: dict[str, float]) -> Array:
        """Corners ``(n, 3)`` of all shapes."""
        return np.concatenate([self._at(link, joints, found) for link, found in self._shapes.items()])

    def _is_below(self, link: str) -> bool:
        while link:
            link = self._links[link].parent
            if link == self.link:
                return True
        return False

    def _end(self, item: LinkJoint, links: tuple[LinkJoint, ...]) -> str:
        """The last link of a finger that has a shape, or else its first."""
        end, queue = item.link, [item.link]
        for other in links:
            if other.parent in queue:
                queue.append(other.link)
        for link in queue:
            end = link if link in self._shapes else end
        return end

    def _tip(self, link: str, joints: dict[str, float]) -> Array:
        found = self._at(link, joints, self._shapes[link])
        along = found @ self.approach
        last = along >= along.max() - END * float(np.ptp(along))
        middle: Array = self._shapes[link][last].mean(axis=0)
        return middle

    def _gap(self, joints: dict[str, float]) -> float:
        tips = self.tips(self._all(joints))
        return float(np.linalg.norm(tips[1:].mean(axis=0) - tips[0]))

    def _all(self, joints: dict[str, float]) -> dict[str, float]:
        """With those that mimic others."""
        out = dict(joints)
        for item in self._joints:
            if item.mimic is not None:
                out[item.joint] = item.mimic.offset + item.mimic.multiplier * out.get(item.mimic.joint, 0.0)
        return out

    def _at(self, link: str, joints: dict[str, float], points: Array) -> Array:
        """Points ``(n, 3)`` of a link, in the frame of the hand's link."""
        while link != self.link:
            item = self._links[link]
            position = joints.get(item.joint, 0.0)
            axis = np.array(item.axis)
            if item.kind == "prismatic":
                points = points + position * axis
            elif item.moves:
                points = poses.rotate(poses.from_rotation_vector(position * axis)[None], points)
            points = poses.transform(np.array(item.pose)[None], points)
            link = item.parent
        return points


def _sides(tips: Array, y: Array) -> list[list[int]]:
    """Numbers of the tips on either side of their middle, along the closing axis."""
    side = (tips - (tips[0] + tips[1:].mean(axis=0)) / 2) @ y
    groups = [[k for k, s in enumerate(side) if s < 0.0], [k for k, s in enumerate(side) if s >= 0.0]]
    return groups if all(groups) else [[0], list(range(1, len(tips)))]


def _snapped(direction: Array) -> Array:
    """A direction ``(3,)`` of length one; an axis where it is near to one."""
    unit = poses.unit(direction)
    k = int(np.argmax(np.abs(unit)))
    if abs(float(unit[k])) < STRAIGHT:
        return unit
    out = np.zeros(3)
    out[k] = math.copysign(1.0, unit[k])
    return out


def _corners(part: LinkVisual) -> Array:
    """Corners ``(n, 3)`` of a shape, or of the box about it, in its own frame."""
    from bt_tasksim.robot.mesh_hulls import mesh_hull

    if part.kind == "mesh":
        assert part.mesh is not None
        x, y, z = part.size
        return mesh_hull(part.mesh, (x, y, z))
    match part.kind:
        case "box":
            half = np.array(part.size) / 2
        case "sphere":
            half = np.full(3, part.size[0])
        case _:
            half = np.array([part.size[0], part.size[0], part.size[1] / 2])
    signs = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
    return signs * half
