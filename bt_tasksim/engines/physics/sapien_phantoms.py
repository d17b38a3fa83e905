"""Contacts that PhysX makes up are undone: they throw small things out of a hand.

Between convex meshes, or one and a box, that are near each other and do not touch, PhysX now and then reports
that they are millimetres deep in each other, along a direction that has nothing to do with where they are: in
a scene with nothing but a box and a plate of 1.3 x 15 x 23 mm about one pose in 18 of 60 places with 8 mm
between them and in 1 with 1 mm, and in none without its persistent manifolds, without which boxes make up
contacts. It then parts them at a metre a second. Of nine failures in 180 random tasks with the SO-100 four
began so, with bowls and a star of 18 to 49 g.

Such a contact is told by the speed that it gives within one step, and by how deep the shapes truly are
(`bt_tasksim.engines.physics.sapien_overlap`). What it has thrown goes back to where it was, with the speed
that it had, less that with which it nears what it does touch. Where a table bears the thing it is the robot
that is thrown, by hundreds of newtons; it goes on as it went. Nothing feels such a contact, either, see
`bt_tasksim.engines.physics.sapien_contacts`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.sapien_overlap import TOO_DEEP, DeepestPlace, Solids, deepest_place
from bt_tasksim.engines.physics.sapien_sinking import without_nearing
from bt_tasksim.engines.physics.sapien_world import World

if TYPE_CHECKING:
    import sapien
    from sapien import physx

KICK = (0.05, 12.0)
"""Metres a second, and the same for each second of a step, that a thing is thrown with in one, at least: more
than gravity gives it."""
JOLT = 0.15
"""Radians a second by which a joint of an arm is thrown in a step, at least: near things arms are gentle."""
TOUCHES = 0.0003
"""Metres within which shapes truly meet."""


def among_meshes(world: World) -> list[int]:
    """The objects that contacts are made up of: all, but boxes in a world where fingertips are boxes, too."""
    tips = [body for body, (kind, tip) in world.bodies.items() if kind == "hand" and tip >= 0]
    boxes = [all(map(_is_box, body.get_collision_shapes())) for body in [*tips, *world.objects]]
    bare = all(boxes[: len(tips)])
    return [k for k, box in enumerate(boxes[len(tips) :]) if not (bare and box)]


def _is_box(shape: physx.PhysxCollisionShape) -> bool:
    from sapien import physx

    return isinstance(shape, physx.PhysxCollisionShapeBox)


class Before(NamedTuple):
    """An object before a step: its number, where it was, and how it moved, in m/s and ``(3,)`` in rad/s."""

    which: int
    pose: sapien.Pose
    linear: list[float]
    angular: Array


class Phantoms:
    """Watches things near a hand in one world.

    Args:
        world: The world.
        known: What is known already of shapes.
        articulation: The robot, if any.
        arm: Which of its joints are the arm's.
    """

    def __init__(
        self,
        world: World,
        known: Solids,
        articulation: physx.PhysxArticulation | None = None,
        arm: Sequence[int] = (),
    ) -> None:
        self._world, self._known = world, known
        self._articulation, self._arm = articulation, list(arm)
        self._position, self._velocity = np.zeros(0), list[float]()
        self._after: dict[int, list[float]] = {}  # speeds after the last step, by object
        self._moves: list[float] | None = None  # the robot's

    def forget(self) -> None:
        """Something else than a step has changed how things move."""
        self._after.clear()
        self._moves = None

    def look(self, near: Sequence[int]) -> list[Before]:
        """How these objects are before a step."""
        if not near:
            self.forget()
            return []
        objects, after, found = self._world.objects, self._after, []
        for k in near:
            body = objects[k]
            linear = after[k] if k in after else body.linear_velocity.tolist()
            found.append(Before(k, body.entity_pose, linear, body.angular_velocity))
        if self._articulation is not None:
            self._position = self._articulation.get_qpos()
            moves = self._moves
            self._velocity = self._articulation.get_qvel().tolist() if moves is None else moves
        return found

    def undo(self, before: Sequence[Before], seconds: float) -> None:
        """Undo what contacts that are none have done in the step since, which was so long."""
        if not before:
            return
        least, objects, after = _least(seconds), self._world.objects, dict[int, list[float]]()
        kicked = []
        for each in before:
            after[each.which] = now = objects[each.which].linear_velocity.tolist()
            if math.dist(now, each.linear) >= least:
                kicked.append(each)
        self._after, self._moves = after, None
        if kicked:
            self._undo_kicks(kicked, seconds)
        if self._articulation is not None:
            self._moves = velocity = self._articulation.get_qvel().tolist()
            was = self._velocity
            if max([abs(velocity[k] - was[k]) for k in self._arm], default=0.0) >= JOLT:
                self._undo_robot(self._articulation, before, seconds)

    def _undo_kicks(self, kicked: Sequence[Before], seconds: float) -> None:
        """Undo what contacts that are none have done to objects, if they have thrown them."""
        for each in kicked:
            body = self._world.objects[each.which]
            if math.dist(body.linear_velocity.tolist(), each.linear) < _least(seconds):
                continue  # since another one that it touches goes on as it went
            met = list(self._met(body, each.pose))
            if not any(made_up for made_up, _, _ in met):
                continue
            self.forget()
            body.entity.set_pose(each.pose)  # only now: PhysX forgets the friction of what is moved so
            body.set_linear_velocity(each.linear)
            body.set_angular_velocity(each.angular)
            for _, true, bodies in sorted(met, key=lambda found: -found[1].depth):
                if true.depth > -TOUCHES:
                    without_nearing(self._world, bodies, true)

    def _undo_robot(
        self, articulation: physx.PhysxArticulation, before: Sequence[Before], seconds: float
    ) -> None:
        """The same for the robot, which goes on as it went before the step, and for what threw it."""
        near = {self._world.objects[each.which]: each for each in before}
        threw = [each for each in self._world.system.get_contacts() if self._is_suspect(each, near)]
        if not threw:
            return
        position, velocity = articulation.get_qpos(), articulation.get_qvel()
        self.forget()
        was = np.array(self._velocity, np.float32)
        articulation.set_qpos(self._position)  # to look where its links were
        made_up = [contact for contact in threw if self._is_made_up(contact, near)]
        if not made_up:
            articulation.set_qpos(position)
            articulation.set_qvel(velocity)
            return
        articulation.set_qpos(self._position + seconds * was)
        articulation.set_qvel(was)
        for contact in made_up:
            for body in contact.bodies:
                if body in near:
                    body.entity.set_pose(near[body].pose)
                    body.set_linear_velocity(near[body].linear)
                    body.set_angular_velocity(near[body].angular)

    def _is_suspect(self, contact: physx.PhysxContact, near: Mapping[Any, Before]) -> bool:
        """It is one of the robot with one of these objects, and deeper than they are in each other now."""
        kinds = [self._world.bodies.get(body, ("", 0))[0] for body in contact.bodies]
        if not {"hand", "arm"} & set(kinds) or not any(body in near for body in contact.bodies):
            return False
        said = -min(point.separation for point in contact.points)
        if said < TOO_DEEP or not any(np.any(point.impulse) for point in contact.points):
            return False
        true = deepest_place(contact, self._known)
        return true is not None and said - max(true.depth, 0.0) > TOO_DEEP

    def _is_made_up(self, contact: physx.PhysxContact, near: Mapping[Any, Before]) -> bool:
        """The two were not so deep in each other before the step, either; the robot is where it was then."""
        body = next(body for body in contact.bodies if body in near)
        true = deepest_place(contact, self._known, (body, near[body].pose))
        said = -min(point.separation for point in contact.points)
        return true is not None and said - max(true.depth, 0.0) > TOO_DEEP

    def _met(
        self, body: physx.PhysxRigidDynamicComponent, before: sapien.Pose
    ) -> Iterator[tuple[bool, DeepestPlace, Sequence[Any]]]:
        """Of each contact that pushes an object: whether it is made up, what is true, and the bodies.

        Args:
            body: The object.
            before: Where it was before the step.
        """
        for contact in self._world.system.get_contacts():
            if not any(other == body for other in contact.bodies):
                continue
            if not any(np.any(point.impulse) for point in contact.points):
                continue
            true = deepest_place(contact, self._known, (body, before))
            if true is not None:
                said = -min(point.separation for point in contact.points)
                yield said - max(true.depth, 0.0) > TOO_DEEP, true, contact.bodies


def _least(seconds: float) -> float:
    """Metres a second by which something is thrown at least in a step so long, see `KICK`."""
    return KICK[0] + KICK[1] * seconds
