"""One world as a search for ways looks at it: numbers of one row, with names."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.resting import at_rest
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, constant
from bt_tasksim.core.transfer import fetched
from bt_tasksim.core.world import ObjectModel, WorldModel
from bt_tasksim.planning.collision import OWN
from bt_tasksim.planning.surroundings import adrift, pieces_of, things_of
from bt_tasksim.planning.things import Held, Leave, Thing
from bt_tasksim.planning.ways import WayFinder
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.spatial_laws import Hollow, PlacedObject, beyond_hollow

AT_HAND = 0.05
"""Metres beyond its own size within which the hand may hold an object."""
WITHIN = 0.003
"""Metres outside a hollow at which something may seem to be that lies in it."""
PALM = 0.005
"""Metres that a palm keeps from what its fingers close on, since the estimate may be wrong."""


def nearly(name: str) -> str:
    """What an object is called together with the room around it."""
    return f"the room around {name}"


class WorldView(NamedTuple):
    """What is known and seen of one world, in NumPy.

    Attributes:
        robot: The robot.
        world: What is known beforehand.
        objects: Estimated poses ``(7,)`` by name; NaN where one was never seen.
        tool: Tool pose ``(7,)``.
        arm: The arm's joints ``(n_arm,)``.
        hand: The hand's joints ``(n_hand,)``.
        adrift: Objects that are seen no more, and were last seen as they fell: nobody keeps clear of them.
    """

    robot: RobotDescription
    world: WorldModel
    objects: Mapping[str, Array]
    tool: Array
    arm: Array
    hand: Array
    adrift: Collection[str] = ()

    def model(self, name: str) -> ObjectModel:
        """What is known beforehand of an object."""
        return self.world.object(name)

    def held(self, name: str, grip: Array | None = None) -> Held:
        """An object as what the hand holds, by default as it now lies there.

        Args:
            name: The object.
            grip: Its pose ``(7,)`` in the tool frame.
        """
        if grip is None:
            grip = poses.relative(self.tool, self.objects[name])
        return Held(name, grip, pieces_of(self.model(name)))

    def contents(self, name: str) -> list[str]:
        """Names of what seems to lie in the hollow of an object, and moves with it."""
        model, pose = self.model(name), self.objects[name]
        boxes = np.zeros((0, 6)) if model.solid is None else model.solid.hollow
        if not len(boxes) or not np.isfinite(pose).all():
            return []
        hollow = Hollow(pose[None], boxes[None])
        found = []
        for other, at in self.objects.items():
            if other != name and np.isfinite(at).all():
                corners = np.concatenate(pieces_of(self.model(other)))
                body = PlacedObject(at[None], corners[None], np.array([self.model(other).cubic]))
                if float(beyond_hollow(body, hollow)[0]) <= WITHIN:
                    found.append(other)
        return found

    def things(
        self, without: Collection[str] = (), closer: float = 0.0, taken: str = "", palm: bool = True
    ) -> list[Thing]:
        """Furniture and objects, ``closer`` as of `things_of`.

        Around what is ``taken`` no room is kept; but, unless ``palm`` is false, it is there twice, and around
        the second one, which is called `nearly` it, there is some: fingers may be excepted from that, and a
        palm not.
        """
        apart = {*without, *self.adrift} - {taken}
        others = {name: pose for name, pose in self.objects.items() if name not in apart}
        found = things_of(self.world, others, closer)
        if taken not in others:
            return found
        around = [replace(t, name=nearly(taken), margin=PALM) for t in found if palm and t.name == taken]
        return [*(replace(t, margin=0.0) if t.name == taken else t for t in found), *around]

    def finder(
        self,
        without: Collection[str] = (),
        *,
        held: Held | None = None,
        leave: Leave | None = None,
        closer: float = 0.0,
        hand: Array | None = None,
        taken: str = "",
        palm: bool = True,
        own: float = OWN,
    ) -> WayFinder:
        """Ways from where the arm is.

        Args:
            without: Objects that are not looked at.
            held: What is in the hand; what lies in that moves with it.
            leave: What may touch.
            closer: Share from 0 to 1 by which one may come closer to things than usual.
            hand: The hand's joints ``(n_hand,)``, by default the present ones.
            taken: An object around which no room is kept: the hand closes on it.
            palm: Around that there is room that only fingers may enter, see `things`.
            own: Metres that the robot's own bodies keep from each other.
        """
        within = () if held is None or held.name not in self.objects else self.contents(held.name)
        return WayFinder(
            self.robot,
            self.arm,
            self.hand if hand is None else hand,
            self.things([*without, *within], closer, taken, palm),
            held,
            leave,
            own,
        )


def host_numbers(arrays: Sequence[Array]) -> tuple[Array, ...]:
    """Arrays of any library in NumPy, to a billionth of their units.

    Libraries may differ in the last bit of what they compute, and a search goes quite another way for it.
    """
    return tuple(np.round(np.asarray(values, float), 9) for values in fetched(arrays))


def views(seen: Seen) -> list[WorldView]:
    """Each world of a batch by itself."""
    observation, columns = seen.observation, seen.world.columns
    arrays = (seen.objects, observation.tool_pose, observation.arm_position, observation.hand_position)
    objects, tool, arm, hand = (np.asarray(values, float) for values in fetched(arrays))
    (held,) = fetched([seen.opposed()])
    found = []
    for k in range(len(tool)):
        world = seen.world.model_of(k)
        estimates = {model.name: objects[k, columns[model.name]] for model in world.objects}
        gone = _adrift(world, estimates, tool[k] if held[k] else None)
        found.append(WorldView(seen.robot, world, estimates, tool[k], arm[k], hand[k], gone))
    return found


def _adrift(world: WorldModel, estimates: Mapping[str, Array], holds: Array | None) -> frozenset[str]:
    """Objects in the air, see `adrift`, but for what a hand that holds something has at its tool ``(7,)``.

    Parts of fixtures are none: their joints bear them.
    """
    known = {name: pose for name, pose in estimates.items() if np.isfinite(pose).all()}
    loose = {name: pose for name, pose in known.items() if world.object(name).joint is None}
    free = (name for name, pose in loose.items() if holds is None or _beyond(world.object(name), pose, holds))
    asked = list(free)
    return adrift(things_of(world, known), asked) if asked else frozenset()


def _beyond(model: ObjectModel, pose: Array, tool: Array) -> bool:
    return bool(np.linalg.norm(pose[:3] - tool[:3]) > AT_HAND + max(model.extent))


def put_down(seen: Seen) -> Seen:
    """The same view with what seems to stand right on what it stands on, see `at_rest`: nothing is held."""
    (objects,) = fetched([seen.objects])
    columns, corrected = seen.world.columns, np.array(objects, float)
    for k in range(len(corrected)):
        world = seen.world.model_of(k)
        own = [columns[model.name] for model in world.objects]
        corrected[k, own] = at_rest(world, corrected[k, own])
    return seen.believing(constant(corrected, seen.objects))
