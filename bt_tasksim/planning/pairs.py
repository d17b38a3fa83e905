"""Shapes that move with the joints of a model, and which of them may not touch which.

Pinocchio moves them, and a tree of their boxes tells coal which of them to compare (J. Pan, S. Chitta and
D. Manocha, "FCL: a general purpose library for collision and proximity queries", ICRA 2012; coal is its
heir).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.boxes import BoxPairs, box_of
from bt_tasksim.planning.things import Held, Leave, Thing, Touch
from bt_tasksim.robot.kinematics.models import se3

_TOUCHING = 1e-6
"""Metres apart at which bodies count as touching: of two that lie in one another, centre in centre or aside
along a diagonal, coal may say that they are 2e-12 m apart when it is not asked for points of contact."""


_OFTEN = 24
"""Questions about one posture each from which on all pairs are compared: to look at boxes is for many."""
_FEW = 12
"""Pairs up to which a tree of boxes is not worth it."""


class _Work(NamedTuple):
    """The shapes with what is found of them, and the tree of boxes, where there is one."""

    shapes: Any
    found: Any
    tree: Any


class Carrier(NamedTuple):
    """With which frame a joint moves, and where ``(4, 4)`` it is in that."""

    frame: int
    placement: Array


class Pairs:
    """Pairs of shapes that are asked about. All are added before the first question.

    Only those are compared whose boxes have come near each other, see `bt_tasksim.planning.boxes`; after many
    questions about one posture each, all of them are.

    Args:
        model: Pinocchio's model of the joints.
        shapes: Its geometry to begin with.
        names: Names of the shapes in it.
        leave: What may touch.
        frames: Numbers of the frames with which these move.
        boxes: Boxes about these ``(n, 4, 4)`` in their frames, see `box_of`.
        carriers: With what joints move to which shapes are added, by their number.
        data: Gives what Pinocchio writes into, for the thread that asks; by default these pairs' own.
    """

    def __init__(
        self,
        model: pin.Model,
        shapes: Any,
        names: Iterable[str],
        leave: Leave | None,
        frames: Sequence[int],
        boxes: Array,
        carriers: Mapping[int, Carrier],
        data: Callable[[], Any] | None = None,
    ) -> None:
        self._model, self._shapes, self._names, self._leave = model, shapes, list(names), leave or Leave()
        self._keys = list(self._names)
        self._first = len(self._names)
        self._added: list[tuple[int, Any, Any]] = []  # a shape's joint, where it is on that, and itself
        self._frames, self._boxes, self._carriers = list(frames), [boxes], carriers
        self._data = _own(model) if data is None else data
        self._compared: list[tuple[int, int]] = []
        self._within: list[float] = []
        self._asked = 0
        self._work: _Work | None = None
        self._work_shapes: Any = None

    def add(
        self, name: str, joint: int, placement: Any, shapes: Sequence[Any], boxes: Array, key: str = ""
    ) -> range:
        """Add shapes that move with a joint, with ``boxes (n, 4, 4)`` about them there; their numbers."""
        first, carrier, count = len(self._names), self._carriers[joint], len(shapes)
        self._added += [(joint, placement, shape) for shape in shapes]
        self._boxes.append(carrier.placement @ boxes)
        self._names += [name] * count
        self._keys += [key or name] * count
        self._frames += [carrier.frame] * count
        return range(first, first + count)

    def add_held(self, held: Held | None, joint: int, tool: Any) -> range:
        """Add what is in the hand, if anything, where ``tool`` is the tool's placement on its joint."""
        if held is None:
            return range(0)
        placement, shapes = tool * se3(held.grip), [convex(piece) for piece in held.pieces]
        boxes = np.array([box_of(shape, placement.homogeneous) for shape in shapes]).reshape(-1, 4, 4)
        return self.add(held.name, joint, placement, shapes, boxes)

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
            solids = self.add(thing.name, 0, *thing.solids, thing.known_as)
            movers = [i for i in robot if not (thing.name in leave.hand and i in hand)]
            if thing.name not in leave.held:
                movers += held
            self.compare([(i, k) for i in movers for k in solids])

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
        before = len(self._compared)
        self._compared += pairs
        self._within += [max(margin, _TOUCHING)] * (len(self._compared) - before)

    def near(self, frames: Array) -> Array:
        """Whether ``(m,)`` any pair is near where frames are at placements ``(m, f, 4, 4)``.

        All pairs that are near in one of them are compared from now on.
        """
        if not self._compared:
            return np.zeros(len(frames), bool)
        found = self._looked_at.near(frames)
        if not found.any():
            return np.zeros(len(frames), bool)
        self._compare_too(found.any(axis=0))
        near: Array = found.any(axis=1)
        return near

    def _compare_too(self, pairs: Array) -> None:
        """Compare pairs ``(k,)``, as booleans, from now on."""
        if (pairs & ~self._active).any():
            self._active |= pairs
            self._work = None

    @cached_property
    def _active(self) -> Array:
        """Which pairs ``(k,)`` are compared, in the order of `BoxPairs.pairs`."""
        return np.zeros(len(self._compared), bool)

    @cached_property
    def _looked_at(self) -> BoxPairs:
        """The boxes of the pairs."""
        pairs = np.array(self._compared, int).reshape(-1, 2)
        return BoxPairs(np.concatenate(self._boxes), np.array(self._frames), pairs, np.array(self._within))

    @property
    def _working(self) -> _Work:
        """What Pinocchio needs for the pairs that are compared."""
        if self._work is None:
            self._work = self._made()
        return self._work

    def _made(self) -> _Work:
        """What it needs, made anew."""
        shapes = self._work_shapes
        if shapes is None:
            shapes = self._work_shapes = self._shapes.copy()
            for k, added in enumerate(self._added):
                called = f"{self._names[self._first + k]} {self._first + k}"
                shapes.addGeometryObject(pin.GeometryObject(called, *added))
        # One at a time Pinocchio adds pairs a hundred times as slowly: it looks for each among all others.
        pairs = np.sort(self._looked_at.pairs[self._active], axis=1)
        first, second = pairs.T
        compared = np.zeros((shapes.ngeoms,) * 2, bool)
        compared[first, second] = True
        shapes.setCollisionPairs(compared)
        found = shapes.createData()
        margins = np.full(compared.shape, _TOUCHING)
        margins[first, second] = margins[second, first] = self._looked_at.margins[self._active]
        found.setSecurityMargins(shapes, margins)
        tree = None
        if len(pairs) > _FEW:
            tree = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(self._model, shapes, found)
        return _Work(shapes, found, tree)

    def free(self, q: Array, frames: Callable[[], Array]) -> bool:
        """Nothing touches for Pinocchio's ``q``.

        Args:
            q: The joints.
            frames: Gives the placements ``(1, f, 4, 4)`` of the frames for them.
        """
        if self._asked <= _OFTEN:
            self._asked += 1
            if self._asked > _OFTEN:
                self._compare_too(np.ones(len(self._compared), bool))
            elif not self.near(frames())[0]:
                return True
        return self.clear(q)

    def clear(self, q: Array) -> bool:
        """Nothing touches for Pinocchio's ``q``, of what has come near."""
        work = self._working
        if work.tree is None:
            return not pin.computeCollisions(self._model, self._data(), work.shapes, work.found, q, True)
        return not pin.computeCollisions(self._model, self._data(), work.tree, q, True)

    def touches(self, q: Array, frames: Array) -> list[Touch]:
        """What touches for Pinocchio's ``q``, by names for people, in the order in which it was added."""
        return list(dict.fromkeys((self._names[i], self._names[k]) for i, k in self._touching(q, frames)))

    def keys(self, q: Array, frames: Array) -> list[Touch]:
        """The same by keys, which tell things of one name apart."""
        return list(dict.fromkeys((self._keys[i], self._keys[k]) for i, k in self._touching(q, frames)))

    def _touching(self, q: Array, frames: Array) -> list[tuple[int, int]]:
        if not self.near(frames)[0]:
            return []
        work = self._working
        pin.computeCollisions(self._model, self._data(), work.shapes, work.found, q, False)
        pairs = zip(work.shapes.collisionPairs, work.found.collisionResults, strict=True)
        touching = {(p.first, p.second) for p, result in pairs if result.isCollision()}
        return [pair for pair in self._compared if tuple(sorted(pair)) in touching] if touching else []


def _own(model: pin.Model) -> Callable[[], Any]:
    data = model.createData()
    return lambda: data
