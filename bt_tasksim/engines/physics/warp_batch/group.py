"""Worlds of one structure: those that go on together, and a few beside them for what concerns only some.

A world that begins anew, or in which something falls, is copied to the side and back: what is done there in
more steps costs the others nothing, and changes nothing in them.

All contacts of worlds that are stepped together stand in one list. Where it was too short in a period, which
takes a world with far more than its share, that period is done anew in smaller and smaller groups aside; so
worlds beside an overfull one do not feel it, and it has its fault alone as in any company.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType

import numpy as np
import warp as wp

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.mujoco_model import BodyNumbers
from bt_tasksim.engines.physics.warp_batch.meshes import HullStore
from bt_tasksim.engines.physics.warp_batch.report import Columns
from bt_tasksim.engines.physics.warp_batch.structure import Prepared, idle
from bt_tasksim.engines.physics.warp_batch.worlds import WarpWorlds

ASIDE = (1, 4, 32)
"""Worlds that there is room for at the side: as few as do."""
GROWTH = 1.25


class WarpGroup:
    """Worlds of one structure, each in a slot.

    Args:
        library: MuJoCo Warp.
        device: Where.
        first: One of the worlds.
        bodies: Which bodies are read.
        hulls: Where the hulls are.
    """

    def __init__(
        self, library: ModuleType, device: wp.Device, first: Prepared, bodies: BodyNumbers, hulls: HullStore
    ) -> None:
        self._library, self._device, self._first, self._idle = library, device, first, idle(first)
        self.bodies, self._hulls = bodies, hulls
        self.timing = first.timing
        self._meshes = self._enter_hulls(first)
        self._rooms: dict[int, Array] = {}
        self._free: list[int] = []
        self._main: WarpWorlds | None = None
        self._sides: dict[int, WarpWorlds] = {}

    @property
    def room(self) -> int:
        """How many worlds there is room for."""
        return 0 if self._main is None else self._main.count

    @property
    def columns(self) -> Columns:
        """Where things are in a report."""
        assert self._main is not None, "worlds have entered"
        return self._main.columns

    def enter(self, worlds: list[Prepared]) -> list[int]:
        """Worlds begin; their slots."""
        while len(self._free) < len(worlds):
            self._grow(len(worlds) - len(self._free))
        slots = [self._free.pop() for _ in worlds]
        meshes = np.array([self._enter_hulls(world) for world in worlds])
        self._rooms |= dict(zip(slots, meshes, strict=True))
        self._hulls.flush()
        assert self._main is not None
        self._main.load(np.array(slots), worlds, meshes)
        return slots

    def leave(self, slot: int) -> None:
        """A world ends, and its slot is free."""
        assert self._main is not None
        self._rest(self._main, np.array([slot]))
        for room in self._rooms.pop(slot).tolist():
            if room >= 0:
                self._hulls.leave(room)
        self._free.append(slot)

    def look(self, slots: Array) -> Array:
        """Read worlds ``(k,)`` as they stand; reports ``(k, columns)``."""
        return self._aside(slots, lambda side, rows: side.look(rows))

    def period(self, slots: Array, fine: Array) -> Array:
        """Let worlds go on by one control period.

        Args:
            slots: Which ones ``(k,)``.
            fine: Of these, the ones that do so in fine steps ``(k,)``.

        Returns:
            What is read then, ``(k, columns)``.
        """
        assert self._main is not None
        reports, usual = np.zeros((len(slots), self.columns.width), np.int32), slots[~fine]
        if 2 * len(usual) > self._main.count or len(usual) > ASIDE[-1]:
            reports[~fine] = self._together(self._main, usual)
        else:  # the most of them stand still
            reports[~fine] = self._aside(usual, lambda side, rows: side.period(rows, fine=False))
        reports[fine] = self._aside(slots[fine], lambda side, rows: side.period(rows, fine=True))
        self._rest(self._main, slots[self.full(reports)])
        return reports

    def full(self, reports: Array) -> Array:
        """Which of the worlds with these reports ``(k, columns)`` were too full: they are here no more."""
        assert self._main is not None
        return self._main.full(reports)

    def write(self, slots: Array, name: str, values: Array) -> None:
        """Write numbers ``(k, n)`` into a part of the state of worlds ``(k,)``, such as ``ctrl``."""
        assert self._main is not None
        self._main.write(slots, name, values)

    def _together(self, main: WarpWorlds, slots: Array) -> Array:
        """An ordinary period where the worlds are, or aside if their contacts lacked room."""
        reports = main.period(slots, fine=False)
        if not main.crowded(reports):
            return np.asarray(reports[slots])
        main.undo()
        return self._aside(slots, lambda side, rows: side.period(rows, fine=False))

    def _aside(self, slots: Array, what: Callable[[WarpWorlds, Array], Array]) -> Array:
        reports = np.zeros((len(slots), self.columns.width), np.int32)
        for first in range(0, len(slots), ASIDE[-1]):
            some = slots[first : first + ASIDE[-1]]
            reports[first : first + len(some)] = self._beside(some, what)
        return reports

    def _beside(self, some: Array, what: Callable[[WarpWorlds, Array], Array]) -> Array:
        main, side, there = self._main, self._side(len(some)), np.arange(len(some))
        assert main is not None
        main.copy_to(some, side, there)
        reports = what(side, there)[there]
        if len(some) > 1 and side.crowded(reports):
            self._rest(side, there)
            half = len(some) // 2
            return np.concatenate([self._beside(some[:half], what), self._beside(some[half:], what)])
        side.state.copy_to(there, main.state, some)
        self._rest(side, there[side.full(reports)])
        return reports

    def _rest(self, worlds: WarpWorlds, rows: Array) -> None:
        """Nothing goes on in these rows any more, nothing goes wild there, and nothing touches."""
        if len(rows):
            worlds.load(rows, [self._idle] * len(rows), np.tile(self._meshes, (len(rows), 1)))

    def _side(self, worlds: int) -> WarpWorlds:
        count = next(count for count in ASIDE if count >= worlds)
        if count not in self._sides:
            self._hulls.flush()
            self._sides[count] = self._made(count, self._idle)
        return self._sides[count]

    def _grow(self, lacking: int) -> None:
        """Make room for some more worlds."""
        before, n = self._main, 0 if self._main is None else self._main.count
        count = n + lacking if before is None else math.ceil(GROWTH * (n + lacking))
        self._hulls.flush()
        self._main = self._made(count, self._idle)
        if before is not None:
            before.copy_to(np.arange(n), self._main, np.arange(n))
        self._free += range(count - 1, n - 1, -1)

    def apart(self, count: int) -> WarpWorlds:
        """Worlds of this structure apart from those of the group, all as the first one."""
        return self._made(count, self._first)

    def _made(self, count: int, alike: Prepared) -> WarpWorlds:
        made = WarpWorlds(self._library, self._device, self._first, self.bodies, self._hulls, count)
        made.load(np.arange(count), [alike] * count, np.tile(self._meshes, (count, 1)))
        return made

    def _enter_hulls(self, world: Prepared) -> Array:
        """Numbers of the geoms' hulls in the store ``(n_geoms,)``, -1 for none."""
        mesh = np.asarray(world.world.model.geom_dataid)
        return np.array([-1 if k < 0 else self._hulls.enter(world.hulls[k]) for k in mesh.tolist()])
