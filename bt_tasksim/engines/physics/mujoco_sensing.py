"""What is read from MuJoCo's state: contacts, forces, motions, and the wrench at the wrist."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.body_contacts import BodyContacts, Row
from bt_tasksim.engines.physics.mujoco_contacts import Body

if TYPE_CHECKING:
    import mujoco as mj


@dataclass(frozen=True, eq=False)
class Near:
    """What is near what at one instant.

    Attributes:
        hand_distance: Metres between the robot and each object; infinite out of reach.
        support: Objects and the objects and fixtures that they touch, by index.
    """

    hand_distance: list[float]
    support: set[tuple[int, int]]


@dataclass(frozen=True, eq=False)
class Forces:
    """Contact forces at one instant, or their mean.

    Attributes:
        tips: Force, three numbers, on each fingertip, friction included, base frame, N.
        hand: Of each object the sum over the robot's links of the magnitude of each one's force on it, N.
    """

    tips: list[list[float]]
    hand: list[float]

    @classmethod
    def mean(cls, samples: Sequence[Forces]) -> Forces:
        """The mean of some instants."""
        n = len(samples)
        tips = zip(*(sample.tips for sample in samples), strict=True)
        hands = zip(*(sample.hand for sample in samples), strict=True)
        return cls(
            [[sum(axis) / n for axis in zip(*tip, strict=True)] for tip in tips],
            [sum(hand) / n for hand in hands],
        )


class ContactReader:
    """Reads the contacts of a model. They are few, and MuJoCo lists them in an order of the state alone.

    Args:
        bodies: What each geom belongs to.
        geom_body: Number of the body that carries each geom.
        n_tips: Number of fingertips.
        n_objects: Number of objects.
        n_fixtures: Number of fixtures.
    """

    def __init__(
        self, bodies: tuple[Body, ...], geom_body: Array, n_tips: int, n_objects: int, n_fixtures: int
    ) -> None:
        self._bodies = bodies
        self._carrier: list[int] = np.asarray(geom_body).tolist()
        self._judged = [body.role != "base" for body in bodies]
        self._robot = [body.role == "link" for body in bodies]
        self._n_tips, self._n_objects = n_tips, n_objects

    def deeper(self, data: mj.MjData, than: float) -> tuple[float, str, str] | None:
        """The deepest overlap in metres and the names of the two bodies, if it is deeper than that.

        The robot's base does not count.
        """
        distances = data.contact.dist.tolist()
        if not distances or -min(distances) <= than:
            return None
        found, deepest = None, -than
        for distance, (a, b) in zip(distances, data.contact.geom.tolist(), strict=True):
            if distance < deepest and self._judged[a] and self._judged[b]:
                found, deepest = (self._bodies[a].name, self._bodies[b].name), distance
        return None if found is None else (-deepest, *found)

    def near(self, data: mj.MjData) -> Near:
        """What is near what, from the contacts that were last looked for."""
        distances = [math.inf] * self._n_objects
        support: set[tuple[int, int]] = set()
        for (a, b), distance in zip(data.contact.geom.tolist(), data.contact.dist.tolist(), strict=True):
            one, two = self._bodies[a], self._bodies[b]
            if one.role == "base" or two.role == "base":
                continue
            for me, other in ((one, two), (two, one)):
                if me.role != "object":
                    continue
                if other.role == "link":
                    distances[me.index] = min(distances[me.index], max(distance, 0.0))
                else:
                    support.add((me.index, other.index))
        return Near(distances, support)

    def points(self, data: mj.MjData) -> BodyContacts:
        """Where bodies touch, from the contacts that were last looked for.

        MuJoCo's normals, the first rows of its frames, point from the first body to the second.
        """
        rows = list[Row]()
        for (a, b), place, frame in zip(
            data.contact.geom.tolist(), data.contact.pos, data.contact.frame, strict=True
        ):
            one, two = self._bodies[a], self._bodies[b]
            robot = not {"link", "base"}.isdisjoint((one.role, two.role))
            rows.append((one.name, two.name, robot, np.array(place), -np.array(frame[:3])))
        return BodyContacts.of(rows)

    def forces(self, data: mj.MjData) -> Forces:
        """The forces of the contacts that forces were last computed for.

        With elliptic cones the solver's forces are those along the axes of the contact's frame; its first
        axis points from the first body to the second.
        """
        tips = [[0.0] * 3 for _ in range(self._n_tips)]
        by_link: defaultdict[tuple[int, int], list[float]] = defaultdict(lambda: [0.0] * 3)
        contact, robot = data.contact, self._robot
        pairs = zip(contact.efc_address.tolist(), contact.geom.tolist(), strict=True)
        kept = [(k, at, a, b) for k, (at, (a, b)) in enumerate(pairs) if at >= 0 and (robot[a] or robot[b])]
        if not kept:
            return Forces(tips, [0.0] * self._n_objects)
        frames, forces = contact.frame, data.efc_force  # each costs a copy
        for k, at, a, b in kept:
            n, s, t = forces[at : at + 3].tolist()
            nx, ny, nz, sx, sy, sz, tx, ty, tz = frames[k].tolist()
            x, y, z = nx * n + sx * s + tx * t, ny * n + sy * s + ty * t, nz * n + sz * s + tz * t
            for sign, me, other in ((-1.0, a, b), (1.0, b, a)):
                body = self._bodies[me]
                if body.tip >= 0:
                    _add(tips[body.tip], sign * x, sign * y, sign * z)
                if body.role == "object" and robot[other]:
                    _add(by_link[self._carrier[other], body.index], sign * x, sign * y, sign * z)
        hand = [0.0] * self._n_objects
        for link, k in sorted(by_link):
            x, y, z = by_link[link, k]
            hand[k] += math.sqrt(x * x + y * y + z * z)
        return Forces(tips, hand)


def _add(total: list[float], x: float, y: float, z: float) -> None:
    total[0] += x
    total[1] += y
    total[2] += z


def wrist_wrenches(felt: Array, tool_pose: Array) -> Array:
    """External wrenches ``(n, 6)`` at the tool origin in the tool frame.

    What the hand's own acceleration takes is in them, as a sensor at the wrist has it. MuJoCo gives torque
    and force that the wrist's parent exerts on it, about the robot's centre of mass. The world's on the
    hand is its opposite: nothing here has weight but objects.

    Args:
        felt: ``(n, 16)``, after ``mj_rnePostConstraint``: torque and force on the wrist's body, the centre
            of mass of the robot, the pose of the body that carries the tool.
        tool_pose: Pose ``(7,)`` of the tool in that body.
    """
    torque, force, centre, body = felt[:, :3], felt[:, 3:6], felt[:, 6:9], felt[:, 9:]
    tool = poses.multiply(body, tool_pose)
    moment = poses.cross(tool[:, :3] - centre, force) - torque
    back = poses.quat_conjugate(tool[:, 3:])[:, None]
    return poses.rotate(back, np.stack([-force, moment], axis=1)).reshape(-1, 6)


def mean_wrenches(felt: Array, counts: Array, tool_pose: Array) -> Array:
    """External wrenches ``(k, 6)`` of worlds: of each the mean of the steps in which it was felt.

    Args:
        felt: Of all steps, world after world ``(n, 16)``, see `wrist_wrenches`.
        counts: How many steps each world has ``(k,)``.
        tool_pose: See `wrist_wrenches`.
    """
    each = wrist_wrenches(felt, tool_pose)
    first, total = np.cumsum(counts) - counts, np.zeros((len(counts), 6))
    for step in range(counts.max()):  # one after the other: NumPy's sums have an order of their own
        there = counts > step
        total[there] += each[first[there] + step]
    return total / counts[:, None]


def object_velocities(moving: Array, rotation: Array, com: Array) -> Array:
    """Velocities ``(n, 6)`` of centres of mass and angular, base frame.

    Args:
        moving: What MuJoCo has ``(n, 6)``: the origin's velocity in the world's frame and the angular one in
            the body's.
        rotation: Of the bodies ``(n, 4)``.
        com: Centres of mass ``(n, 3)`` in the bodies' frames.
    """
    turning, lever = poses.rotate(rotation, moving[:, 3:]), poses.rotate(rotation, com)
    return np.concatenate([moving[:, :3] + poses.cross(turning, lever), turning], axis=-1)
