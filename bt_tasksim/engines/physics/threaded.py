"""Simulated worlds, stepped by threads, and the laws of their states over all of them at once.

MuJoCo lets go of the interpreter's lock while it steps, so threads step several of its worlds at a time.
SAPIEN 3.0 does not: there a second thread gains nothing, and a second process, with a batch of its own, twice
as much. What each world reports of itself is plain and raw; positions of tool and tips, efforts and wrenches
are computed from that for all worlds together, with operations whose result for one row does not depend on
the others.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import ClassVar, Generic, Protocol, TypeVar

import numpy as np

from bt_tasksim.core.bundles import taken
from bt_tasksim.core.errors import BtTasksimError, MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, JointTarget, WorldState
from bt_tasksim.engines.batch import PhysicsBatch
from bt_tasksim.engines.body_contacts import BodyContacts
from bt_tasksim.engines.physics.layout import Layout, put, rows_for, wider_support
from bt_tasksim.engines.physics.shutting import shutting
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

FALLING = (0.1, 1.5)
"""Speeds in m/s and rad/s of an object that the hand does not touch, from which an engine takes finer steps:
a tilted object that lands spins so fast that it would be millimetres deep within an ordinary one."""


class SimulatedWorld(Protocol):
    """One world of a batch, which one thread at a time works on.

    Attributes:
        n_objects: Number of its objects.
        n_fixtures: Number of its fixtures.
    """

    n_objects: int
    n_fixtures: int

    @property
    def deepest_pair(self) -> tuple[str, str, float, float] | None:
        """Names of the bodies that overlapped most, metres, and seconds; None before any."""

    def drive_to(self, position: list[float], velocity: list[float]) -> None:
        """Tell the drives where all joints shall be at the end of the next period, and how fast."""

    def advance(self) -> None:
        """Go on by one control period.

        Raises:
            MachineError: It cannot go on.
        """

    def read(self) -> None:
        """Take the readings of this instant.

        Raises:
            MachineError: They are no numbers.
        """

    def contact_points(self) -> BodyContacts | None:
        """Where bodies touch at this instant; None where nobody says it."""

    def note_motion(self, falling: bool, spin: float) -> None:
        """How objects that the hand does not touch move, as it was read last.

        Args:
            falling: One is faster than `FALLING`.
            spin: The fastest turns at, rad/s.
        """


W = TypeVar("W", bound=SimulatedWorld)
T = TypeVar("T")


class ThreadedBatch(PhysicsBatch, Generic[W]):
    """A batch of simulated worlds, each an object of its own.

    Args:
        robot: The robot.
        worlds: How many there are; at least 1.
        threads: How many threads step them; at least 1.

    Attributes:
        library: What simulates, as errors name it.
        robot: The robot.
        simulated: The worlds by row; None before the first reset.
    """

    library: ClassVar[str]

    def __init__(self, robot: RobotDescription, worlds: int, threads: int) -> None:
        super().__init__(worlds)
        self.robot = robot
        self.simulated: list[W | None] = [None] * worlds
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads - 1, "physics") if threads > 1 else None
        self._stiffness = robot.drive_array("stiffness")
        self._damping = robot.drive_array("damping")
        self._limit = robot.drive_array("force_limit")
        joints = (worlds, len(robot.joints))
        self._position, self._velocity = np.zeros(joints), np.zeros(joints)
        self._most = (0, 0)  # objects and fixtures
        self._state: WorldState | None = None
        self._hidden: Hidden | None = None

    def deepest_pair(self, row: int) -> tuple[str, str, float, float] | None:
        """See `PhysicsBatch.deepest_pair`."""
        world = self.simulated[row]
        return None if world is None else world.deepest_pair

    # ---- what an engine adds ----------------------------------------------------------------------------

    @abstractmethod
    def _build(self, row: int, configuration: ActorConfiguration, start: Array) -> W:
        """A fresh world, with its joints at ``start (n_joints,)``.

        Raises:
            InputError: It cannot be built.
        """

    @abstractmethod
    def _read(self, rows: Array, worlds: list[W], layout: Layout) -> tuple[WorldState, Hidden]:
        """States ``(k, ...)`` of these worlds, in fresh arrays, from the readings that they took last."""

    def _effort(self, rows: Array, q: Array, v: Array) -> Array:
        """Efforts ``(k, n_joints)`` of the drives by their own law, which simulators do not report."""
        effort = self._stiffness * (self._position[rows] - q) + self._damping * (self._velocity[rows] - v)
        return np.minimum(np.maximum(effort, -self._limit), self._limit)

    # ---- the batch --------------------------------------------------------------------------------------

    def reset(self, rows: Array, configurations: Sequence[ActorConfiguration]) -> None:
        """See `PhysicsBatch.reset`."""
        robot, rows = self.robot, np.asarray(rows, int)

        def build(job: tuple[int, ActorConfiguration]) -> None:
            row, configuration = job
            start = np.array(configuration.joint_position or np.concatenate([robot.rest, robot.hand_open]))
            self._position[row], self._velocity[row] = start, 0.0
            self.simulated[row] = self.errors[row] = None
            try:
                self.simulated[row] = self._build(row, configuration, start)
            except BtTasksimError as error:
                self.errors[row] = error

        self._share(build, list(zip(rows.tolist(), configurations, strict=True)))
        self._begin(rows)
        if len(np.unique(rows)) == self.worlds:  # nothing is left of what was: no wider than these need
            self._most, self._state, self._hidden = (0, 0), None, None
        fresh = [world for row in rows.tolist() if (world := self.simulated[row]) is not None]
        self._widen(
            max((world.n_objects for world in fresh), default=0),
            max((world.n_fixtures for world in fresh), default=0),
        )
        self._look(rows)
        self._gather(rows)

    def step(self, target: JointTarget, rows: Array) -> None:
        """See `PhysicsBatch.step`."""
        rows = np.asarray(rows)
        position, velocity = np.asarray(target.position, float), np.asarray(target.velocity, float)
        finite = np.isfinite(position).all(axis=1) & np.isfinite(velocity).all(axis=1)
        for k in np.flatnonzero(~finite).tolist():
            self.errors[rows[k]] = self.errors[rows[k]] or MachineError(
                f"the joint target is not finite: {position[k]}, {velocity[k]}"
            )
        if any(self.errors):
            going = np.array([self.errors[row] is None for row in rows.tolist()], bool)
            rows, position, velocity = rows[going], position[going], velocity[going]
        if self._state is not None:
            position = shutting(self.robot, position, self._state.joint_position[rows])
        self._position[rows], self._velocity[rows] = position, velocity

        self._go_on(
            [
                (row, world, to, speed)
                for row, to, speed in zip(rows.tolist(), position.tolist(), velocity.tolist(), strict=True)
                if (world := self.simulated[row]) is not None
            ]
        )
        self._gather(rows)

    def state(self, rows: Array) -> WorldState:
        """See `PhysicsBatch.state`."""
        assert self._state is not None, "no world was ever reset"
        state: WorldState = taken(self._state, rows)
        return state

    def hidden(self, rows: Array) -> Hidden:
        """See `PhysicsBatch.hidden`."""
        assert self._hidden is not None, "no world was ever reset"
        hidden: Hidden = taken(self._hidden, rows)
        return hidden

    def close(self) -> None:
        """See `PhysicsBatch.close`."""
        if self._pool is not None:
            self._pool.shutdown()
        self.simulated = [None] * self.worlds

    def _begin(self, rows: Array) -> None:
        """What is to be done with worlds that were just built; by default nothing."""

    def _go_on(self, worlds: Sequence[tuple[int, W, list[float], list[float]]]) -> None:
        """Let worlds go on by one control period, to positions and at velocities of their joints, and read.

        By default one after the other: what one world needs is in the processor's cache then.
        """

        def go_on(job: tuple[int, W, list[float], list[float]]) -> None:
            row, world, position, velocity = job
            try:
                world.drive_to(position, velocity)
                world.advance()
                world.read()
            except BtTasksimError as error:
                self.errors[row] = error

        self._share(go_on, worlds)

    def _look(self, rows: Array) -> None:
        """Read worlds that have begun."""
        for row in rows.tolist():
            world = self.simulated[row]
            if world is None or self.errors[row] is not None:
                continue
            try:
                world.read()
            except BtTasksimError as error:
                self.errors[row] = error

    def _share(self, work: Callable[[T], None], jobs: Sequence[T]) -> None:
        """Do all jobs, each by the thread that is free for it."""
        left = iter(jobs)  # one for all: taking the next one is a single step of the interpreter

        def some() -> None:
            for job in left:
                work(job)

        others = [self._pool.submit(some) for _ in jobs[1 : self._threads]] if self._pool else []
        try:
            some()
        finally:
            for other in others:
                other.result()

    def _widen(self, objects: int, fixtures: int) -> None:
        """Make the arrays of all worlds as wide as the one with the most needs."""
        n, m = self._most
        objects, fixtures = self._most = max(n, objects), max(m, fixtures)
        if (objects, fixtures) == (n, m) or self._state is None or self._hidden is None:
            return

        def wider(values: Array) -> Array:
            room = np.full((self.worlds, objects, *values.shape[2:]), np.nan)
            room[:, :n] = values
            return room

        state, hidden = self._state, self._hidden
        both = {"objects": wider(state.objects), "velocities": wider(state.velocities)}
        self._state = replace(state, **both)
        self._hidden = replace(
            hidden,
            **both,
            hand_force=wider(hidden.hand_force),
            hand_distance=wider(hidden.hand_distance),
            support=wider_support(hidden.support, n, objects, fixtures),
        )

    def _gather(self, rows: Array) -> None:
        """Take the readings of those worlds of these rows that have not failed into the arrays of all."""
        fine = [row for row in rows.tolist() if self.errors[row] is None and self.simulated[row] is not None]
        worlds = [world for row in fine if (world := self.simulated[row]) is not None]
        if not worlds:
            return
        rows = np.array(fine, int)
        layout = Layout(np.array([world.n_objects for world in worlds]), *self._most)
        with np.errstate(invalid="ignore", over="ignore"):  # of worlds that blew up
            state, hidden = self._read(rows, worlds, layout)
        finite = layout.finite(state)
        if not finite.all():
            for k in np.flatnonzero(~finite).tolist():
                when = f"after {state.time[k]:.2f} s: see the last target"
                self.errors[rows[k]] = MachineError(f"{self.library}'s state is no longer finite {when}")
            rows, worlds = rows[finite], [world for world, fine in zip(worlds, finite, strict=True) if fine]
            state, hidden = (taken(bundle, np.flatnonzero(finite)) for bundle in (state, hidden))
        if len(rows) == self.worlds and (rows[:-1] < rows[1:]).all():
            self._state, self._hidden = state, hidden
        else:
            if self._state is None or self._hidden is None:
                self._state, self._hidden = rows_for(state, self.worlds), rows_for(hidden, self.worlds)
            put(self._state, rows, state)
            put(self._hidden, rows, hidden)
        self._note_motion(worlds, state, hidden)

    @staticmethod
    def _note_motion(worlds: list[W], state: WorldState, hidden: Hidden) -> None:
        assert state.velocities is not None
        free = hidden.hand_force == 0.0
        moving = np.where(free[..., None], state.velocities, 0.0)
        u, v, w, x, y, z = np.moveaxis(moving * moving, -1, 0)
        speed, spin = np.sqrt(u + v + w), np.sqrt(x + y + z)
        falling = ((speed > FALLING[0]) | (spin > FALLING[1])).any(axis=1)
        fastest = spin.max(axis=1, initial=0.0)
        for world, falls, turns in zip(worlds, falling.tolist(), fastest.tolist(), strict=True):
            world.note_motion(falls, turns)
