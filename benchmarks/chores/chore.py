"""What a chore is: things in a part of the table, what should be true of them, and the leaves that do it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, SpotSpec

TABLE = (0.5, 0.0)
"""Origin of the table's own frame in the robot base frame, metres."""


@dataclass(frozen=True)
class Slot:
    """A part of the table.

    Attributes:
        name: Its name, which names in it begin with.
        centre: Its middle ``(2,)``, robot base frame, metres.
        heading: Of furniture that stands in it and faces the robot, radians.
        front: It is far enough from the robot for what opens towards it.
    """

    name: str
    centre: tuple[float, float]
    heading: float
    front: bool = False

    def on_table(self, x: float, y: float) -> tuple[float, float]:
        """A point given from its middle, in the table's frame."""
        return self.centre[0] - TABLE[0] + x, self.centre[1] - TABLE[1] + y


LEFT = Slot("left", (0.46, 0.30), 0.55)
RIGHT = Slot("right", (0.46, -0.30), -0.55)
FRONT = Slot("front", (0.62, 0.0), 0.0, front=True)
SLOTS = (LEFT, RIGHT, FRONT)


@dataclass(frozen=True)
class Chore:
    """One chore in one slot.

    Attributes:
        kind: Its kind, a name in `KINDS`.
        words: What is to be done, in few words.
        leaves: Makes its leaves anew, in order.
        goals: What should be true at the end.
        objects: Its objects, by name.
        fixtures: Its furniture.
        spots: Its marked spots.
    """

    kind: str
    words: str
    leaves: Callable[[], Sequence[Behaviour]]
    goals: Sequence[Goal]
    objects: Mapping[str, ObjectSpec] = field(default_factory=dict)
    fixtures: Sequence[FixtureSpec] = ()
    spots: Sequence[SpotSpec] = ()


Maker = Callable[[Slot, np.random.Generator], Chore]
KINDS: dict[str, Maker] = {}
"""What makes a chore of each kind."""
IN_FRONT: set[str] = set()
"""Kinds that need a slot in front of the robot."""
NEEDED: dict[str, tuple[Slot, ...]] = {}
"""Which other slots a kind needs for itself: for a place beside its furniture, or for a door that swings."""


def kind(front: bool = False, needs: tuple[Slot, ...] = ()) -> Callable[[Maker], Maker]:
    """A decorator that announces a kind by the name of what makes it.

    Args:
        front: See `IN_FRONT`.
        needs: See `NEEDED`.
    """

    def announce(make: Maker) -> Maker:
        KINDS[make.__name__] = make
        if front:
            IN_FRONT.add(make.__name__)
        NEEDED[make.__name__] = needs
        return make

    return announce
