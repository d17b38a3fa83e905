"""Shapes that move with the joints of a model, and which of them may not touch which.

Pinocchio moves them, and a tree of their boxes tells coal which of them to compare (J. Pan, S. Chitta and
D. Manocha, "FCL: a general purpose library for collision and proximity queries", ICRA 2012; coal is its
heir).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.things import Held, Leave, Thing, Touch, shapes_of
from bt_tasksim.robot.kinematics.models import se3

_TOUCHING = 1e-6
"""Metres apart at which bodies count as touching: of two that lie in one another, centre in centre or aside
along a diagonal, coal may say that they are 2e-12 m apart when it is not asked for points of contact."""


class _Work(NamedTuple):
    """What Pinocchio writes into, and the tree of boxes."""

    data: Any
    found: Any
    tree: Any


class Pairs:
    """Pairs of shapes that are asked about. All are added before the first question.

    Args:
        model: Pinocchio's model of the joints.
        shapes: Its geometry to begin with, to which it adds.
        names: Names of the shapes in it.
        leave: What may touch.
    """

    def __init__(self, model: pin.Model, shapes: Any, names: Iterable[str], leave: Leave | None) -> None:
        self._model, self._shapes, self._names, self._leave = model, shapes, list(names), leave or Leave()
        self._keys = list(self._names)
        self._compared: list[tuple[int, int]] = []
        self._margins: dict[tuple[int, int], float] = {}

    def add(self, name: str, joint: int, placement: Any, shapes: Iterable[Any], key: str = "") -> range:
        """Add shapes that move with a joint; their numbers."""
        first = self._shapes.ngeoms
        for shape in shapes:
            called = f"{name} {self._shapes.ngeoms}"
            self._shapes.addGeometryObject(pin.GeometryObject(called, joint, placement, shape))
            self._names.append(name)
            self._keys.append(key or name)
        return range(first, self._shapes.ngeoms)

    def add_held(self, held: Held | None, joint: int, tool: Any) -> range:
        """Add what is in the hand, if anything, where ``tool`` is the tool's placement on its joint."""
        if held is None:
            return range(0)
        return self.add(held.name, joint, tool * se3(held.grip), map(convex, held.pieces))

    def stand(
        self, things: Iterable[Thing], robot: Sequence[int], hand: Collection[int], held: Sequence[int]
    ) -> None:
        """Things stand around.

        Args:
            things: The things.
            robot: Numbers of the robot's shapes that are compared with them.
            hand: Numbers of those that are the hand's.
            held: Numbers of the shapes of what is held.
        """
        leave = self._leave
        for thing in things:
            shapes = shapes_of(thing)
            for shape in shapes:
                shape.setSweptSphereRadius(thing.margin)
            solids = self.add(thing.name, 0, se3(thing.pose), shapes, thing.key)
            movers = [i for i in robot if not (thing.name in leave.hand and i in hand)]
            if thing.name not in leave.held:
                movers += held
            self.compare((i, k) for i in movers for k in solids)

    def compare(self, pairs: Iterable[tuple[int, int]], margin: float = _TOUCHING) -> None:
        """Compare pairs of shapes, by number, unless they may touch.

        Args:
            pairs: The pairs.
            margin: Metres from each other within which they count as touching.
        """
        left = set(self._leave.pairs)
        if left:
            names, keys = self._names, self._keys
            pairs = [(i, k) for i, k in pairs if not {(names[i], names[k]), (names[i], keys[k])} & left]
        pairs = list(pairs)
        self._compared += pairs
        if margin > _TOUCHING:
            self._margins |= dict.fromkeys(pairs, margin)

    @cached_property
    def _work(self) -> _Work:
        # One at a time Pinocchio adds pairs a hundred times as slowly: it looks for each among all others.
        compared = np.zeros((self._shapes.ngeoms,) * 2, bool)
        compared[tuple(np.sort(self._compared, axis=1).T) if self._compared else ([], [])] = True
        self._shapes.setCollisionPairs(compared)
        found = self._shapes.createData()
        margins = np.full(compared.shape, _TOUCHING)
        for (i, k), margin in self._margins.items():
            margins[i, k] = margins[k, i] = margin
        found.setSecurityMargins(self._shapes, margins)
        tree = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(self._model, self._shapes, found)
        return _Work(self._model.createData(), found, tree)

    def free(self, q: Array) -> bool:
        """Nothing touches for Pinocchio's ``q``."""
        work = self._work
        touched: bool = pin.computeCollisions(self._model, work.data, work.tree, q, True)
        return not touched

    def touches(self, q: Array) -> list[Touch]:
        """What touches for Pinocchio's ``q``, by names for people, in the order in which it was added."""
        return list(dict.fromkeys((self._names[i], self._names[k]) for i, k in self._touching(q)))

    def keys(self, q: Array) -> list[Touch]:
        """The same by keys, which tell things of one name apart."""
        return list(dict.fromkeys((self._keys[i], self._keys[k]) for i, k in self._touching(q)))

    def _touching(self, q: Array) -> list[tuple[int, int]]:
        data, found, _ = self._work
        pin.computeCollisions(self._model, data, self._shapes, found, q, False)
        pairs = zip(self._shapes.collisionPairs, found.collisionResults, strict=True)
        touching = {(p.first, p.second) for p, result in pairs if result.isCollision()}
        return [pair for pair in self._compared if tuple(sorted(pair)) in touching] if touching else []

    def first(self, q: Array) -> Touch | None:
        """The first of what touches for Pinocchio's ``q``; None where nothing does."""
        return None if self.free(q) else next(iter(self.touches(q)), None)

    def placement(self, joint: int) -> Any:
        """Where a joint is for the ``q`` that was asked about last."""
        return self._work.data.oMi[joint]
