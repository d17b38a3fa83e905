"""What is read from the contacts of a world of SAPIEN."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.engines.body_contacts import BodyContacts, Row
from bt_tasksim.engines.physics.rolling import rolling_damping
from bt_tasksim.engines.physics.sapien_overlap import TOO_DEEP, least_overlap
from bt_tasksim.engines.physics.sapien_robot import SKIN
from bt_tasksim.engines.physics.sapien_world import DAMPING, World

if TYPE_CHECKING:
    import sapien
    from sapien import physx

TOUCH_DISTANCE = 0.002
"""Metres of separation beyond which a contact of PhysX carries no force and counts for nothing."""
SUPPORT_DISTANCE = 5e-4
"""Metres of separation within which two bodies touch."""
DEEP = 1e-3
"""Metres of overlap that are not believed before it is looked how deep the shapes are."""
_UNKNOWN = ("none", 0)
_Pairs = list[tuple[tuple[str, int], tuple[str, int], list[Any]]]
"""What two bodies are and where they meet, of objects on each other and on fixtures."""
_LYING, _ROBOT = ("object", "fixture"), ("base", "arm", "hand")


class Touch(NamedTuple):
    """What touches what at one instant.

    Attributes:
        tip_force: Contact force, three numbers, on each fingertip, N.
        hand_force: Force of the robot on each object, N.
        hand_distance: Metres between the robot and each object; infinite where it is far.
        support: Objects and the objects and fixtures that they touch, by index.
        touched: Whether the robot touches each object.
    """

    tip_force: list[list[float]]
    hand_force: list[float]
    hand_distance: list[float]
    support: set[tuple[int, int]]
    touched: list[bool]


class ContactReader:
    """Reads the contacts of one world, and remembers the deepest overlap.

    Args:
        world: The world, with its robot.
        n_tips: Number of fingertips.
        skin: Metres at which what touches the hand comes to rest before it.

    Attributes:
        penetration: The deepest overlap so far, metres.
        deepest_pair: Names of its bodies, metres, and seconds since the episode began; None before any.
        before: Where bodies near the hand, and its own, were before the last step; none, where nobody asked.
        made_up: Something touched the robot when contacts were read last that is not there.
        nothing: What is read where nothing touches anything.
    """

    def __init__(self, world: World, n_tips: int, skin: float = SKIN) -> None:
        self._world, self._n_tips, self._skin = world, n_tips, skin
        n = len(world.objects)
        self.nothing = Touch([[0.0] * 3] * n_tips, [0.0] * n, [math.inf] * n, set(), [False] * n)
        self._last, self._undisturbed = self.nothing, 0
        self.penetration = 0.0
        self.deepest_pair: tuple[str, str, float, float] | None = None
        self.before: Mapping[physx.PhysxRigidBaseComponent, sapien.Pose] = {}
        self.made_up = False

    def read_depth(self, time: float) -> _Pairs:
        """Remember the deepest overlap, also between the ends of periods: fingers close within one.

        Returns:
            What lies on what, for `resist_rolling`: to ask for points again costs as much as a step.
        """
        known, lying = self._world.bodies, []
        for contact in self._world.system.get_contacts():
            points = contact.points
            separation = min([point.separation for point in points])
            if separation > TOUCH_DISTANCE:
                continue
            first, second = contact.bodies
            a, b = known.get(first, _UNKNOWN), known.get(second, _UNKNOWN)
            if -separation > self.penetration and a[0] != "base" and b[0] != "base":
                self._note_depth(contact, -separation, time)
            if a[0] in _LYING and b[0] in _LYING:
                lying.append((a, b, points))
        return lying

    def within_reach(self, objects: Collection[int]) -> bool:
        """PhysX looks for contacts of one of these objects with something that is not the robot."""
        known = self._world.bodies
        for contact in self._world.system.get_contacts():
            (kind_a, i), (kind_b, j) = (known.get(body, _UNKNOWN) for body in contact.bodies)
            if (kind_a == "object" and i in objects and kind_b in _LYING) or (
                kind_b == "object" and j in objects and kind_a in _LYING
            ):
                return True
        return False

    def read(self, time: float, step: float, asleep: bool = False) -> Touch:
        """What touches what, and the deepest overlap.

        Args:
            time: Seconds since the episode began.
            step: Seconds of the last physics step, over which impulses are forces.
            asleep: All objects are, and were when contacts were read last: then PhysX adds no contact but the
                robot's, and takes none away.
        """
        contacts = self._world.system.get_contacts()
        self.made_up = False
        if not contacts:
            self._undisturbed = 0
            return self.nothing
        if asleep and len(contacts) == self._undisturbed:
            return self._last
        self._undisturbed = len(contacts)
        known, n = self._world.bodies, len(self._world.objects)
        on_tip: list[list[tuple[float, float, float]]] = [[] for _ in range(self._n_tips)]
        on_object: list[list[float]] = [[] for _ in range(n)]
        distance = [math.inf] * n
        support: set[tuple[int, int]] = set()
        for contact in contacts:
            bodies = contact.bodies
            kind_a, i = known.get(bodies[0], _UNKNOWN)
            kind_b, j = known.get(bodies[1], _UNKNOWN)
            if kind_a == "base" or kind_b == "base":
                continue
            by_a, by_b = kind_a == "hand" or kind_a == "arm", kind_b == "hand" or kind_b == "arm"
            if by_a or by_b:
                self._undisturbed = 0
            points = contact.points
            separation = min([point.separation for point in points])
            if separation > TOUCH_DISTANCE:
                continue
            if -separation > self.penetration:
                self._note_depth(contact, -separation, time)
            if not (by_a or by_b):  # what stands on what needs no forces
                if separation < SUPPORT_DISTANCE:
                    if kind_a == "object":
                        support.add((i, j))
                    if kind_b == "object":
                        support.add((j, i))
                continue
            if -separation > TOO_DEEP and self._overlap(contact, -separation) < -separation - TOO_DEEP:
                self.made_up = True
                continue
            rate = 1.0 / step
            if by_b:
                kind_a, kind_b, i, j, rate = kind_b, kind_a, j, i, -rate
            x = y = z = 0.0
            for point in points:
                px, py, pz = point.impulse.tolist()
                x, y, z = x + px, y + py, z + pz
            x, y, z = x * rate, y * rate, z * rate  # the impulse acts on the first body
            if kind_a == "hand" and i >= 0:
                on_tip[i].append((x, y, z))
            if kind_b == "hand" and j >= 0:
                on_tip[j].append((-x, -y, -z))
            if kind_b == "object":
                on_object[j].append(math.sqrt(x * x + y * y + z * z))
                distance[j] = min(distance[j], max(separation - self._skin, 0.0))
        # PhysX lists contacts in an order of its own, so sums must not depend on it: `math.fsum` is exact.
        try:
            tip_force = [
                [math.fsum(axis) for axis in zip(*forces, strict=True)] if forces else [0.0, 0.0, 0.0]
                for forces in on_tip
            ]
            hand_force = [math.fsum(forces) for forces in on_object]
        except (ValueError, OverflowError):
            raise MachineError(f"SAPIEN's contact forces are not finite after {time:.2f} s") from None
        touched = [force > 0.0 for force in hand_force]
        self._last = Touch(tip_force, hand_force, distance, support, touched)
        return self._last

    def points(self) -> BodyContacts:
        """Where bodies touch; PhysX's normals point from the second body to the first."""
        known, rows = self._world.bodies, list[Row]()
        for contact in self._world.system.get_contacts():
            one, other = contact.bodies
            robot = any(known.get(body, _UNKNOWN)[0] in _ROBOT for body in (one, other))
            rows += [
                (
                    one.entity.name,
                    other.entity.name,
                    robot,
                    np.array(point.position, float),
                    np.array(point.normal, float),
                )
                for point in contact.points
                if point.separation < SUPPORT_DISTANCE
            ]
        return BodyContacts.of(rows)

    def _overlap(self, contact: physx.PhysxContact, said: float) -> float:
        return least_overlap(contact, said, self._world.scene.timestep, self.before)

    def _note_depth(self, contact: physx.PhysxContact, deep: float, time: float) -> None:
        if deep > DEEP:
            deep = self._overlap(contact, deep)
        if deep > self.penetration:
            bodies = contact.bodies
            self.penetration = deep
            self.deepest_pair = (bodies[0].entity.name, bodies[1].entity.name, deep, time)


def resist_rolling(world: World, lying: _Pairs, step: float, hand_force: list[float]) -> None:
    """Rolling and spinning resistance of what lies free, for the next steps; PhysX itself knows none.

    It is PhysX's own damping, set anew for each step: unlike a torque, that lets things fall asleep.

    Args:
        world: The world.
        lying: What lies on what, see `ContactReader.read_depth`.
        step: Seconds of the last physics step, over which impulses are forces.
        hand_force: Force of the robot on each object, N.
    """
    loads: list[list[list[float]]] = [[] for _ in world.objects]
    rate = 1.0 / step
    for (kind_a, i), (kind_b, j), points in lying:
        x = y = z = 0.0
        for point in points:
            px, py, pz = point.impulse.tolist()
            x, y, z = x + px, y + py, z + pz
        if kind_a == "object":
            loads[i].append([rate * x, rate * y, rate * z])
        if kind_b == "object":
            loads[j].append([rate * x, rate * y, rate * z])
    for k, body in enumerate(world.objects):
        spin = body.angular_velocity.tolist()
        damping = DAMPING
        if loads[k] and hand_force[k] == 0.0 and math.hypot(*spin) > 0.0:
            axes, inertia = world.inertia[k]
            turn = poses.inverted(poses.composed([0.0, 0.0, 0.0, *body.entity_pose.q.tolist()], axes))
            damping += rolling_damping(
                poses.point(turn, spin), inertia, [poses.point(turn, force) for force in loads[k]]
            )
        body.set_angular_damping(damping)
