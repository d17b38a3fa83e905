"""What the leaves of a tree read and write during a tick, in as many worlds as the tree is ticked in.

Each tree has one `Context`, handed to its leaves through ``setup(context=...)``; nothing is process-global.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.beliefs import Beliefs, Believed
from bt_tasksim.concept.planner import Planner
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.bundles import Rows
from bt_tasksim.core.culprit import place_of
from bt_tasksim.core.errors import BtTasksimError, CommandConflictError, LeafError, UnreachableError
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.facts_table import FactsTable
from bt_tasksim.core.outcomes import OUT_OF_REACH, Outcome
from bt_tasksim.core.plain import shown
from bt_tasksim.core.poses import Array, array_namespace, constant, host
from bt_tasksim.core.transfer import Index, fetched, sent
from bt_tasksim.core.world import Command, Hidden, Observation, WorldModel
from bt_tasksim.robot.description import RobotDescription

NO_EPISODE = "no episode has begun: a tree with concepts is ticked by a Runner"
NOBODY = -1
TOOL = 7
"""Numbers of a tool target."""
OFTEN = 64
"""Sets of worlds that a context keeps in mind."""
_T = TypeVar("_T", Observation, Hidden)


@dataclass(frozen=True)
class Refusal:
    """A command of the last tick that an engine could not carry out, in one world.

    Attributes:
        leaf: The leaf that wrote it; None where nobody knows.
        outcome: Why.
    """

    leaf: Behaviour | None
    outcome: Outcome


@dataclass(frozen=True)
class Written:
    """What the leaves have written in a tick, in all worlds.

    Attributes:
        tool: Tool targets ``(N, 7)``, NaN where nobody wrote one; None where nobody wrote any. Behind them,
            where a leaf wrote one, the arm's postures: ``(N, 7 + n_arm)``, NaN in other worlds.
        hand: Hand targets ``(N, 1 + n_synergies)``, likewise.
    """

    tool: Array | None
    hand: Array | None

    def of_world(self, world: int) -> Command:
        """The command of one world, by its row, in NumPy: a part is None where nobody wrote it."""
        parts = (None if part is None else host(part[world, ...]) for part in (self.tool, self.hand))
        tool, hand = (None if part is None or np.isnan(part[0]) else part for part in parts)
        if tool is None or len(tool) == TOOL or np.isnan(tool[TOOL]):
            return Command(None if tool is None else tool[:TOOL], hand)
        return Command(tool[:TOOL], hand, tool[TOOL:])


class Context:
    """The one place through which a tree's leaves read observations and write commands.

    Args:
        robot: The robot that the tree commands.
        worlds: In how many worlds the tree is ticked.
        like: An array of the library, type and device in which concepts are computed, and in which
            observations come and commands go; by default NumPy. Numbers of worlds, clocks, and who wrote what
            are NumPy's in any case.
    """

    def __init__(self, robot: RobotDescription, worlds: int = 1, like: Array | None = None) -> None:
        self.robot = robot
        self.worlds = worlds
        self.like: Array = np.empty(0) if like is None else like
        self.rows: Array = np.arange(worlds)
        self._table = FactsTable(worlds, self.like)
        self._beliefs = Beliefs(worlds)
        self._believed: Believed | None = None
        self._latest: Observation | None = None
        self._observation: Observation | None = None
        self.ask_hidden: Callable[[Array | None], Hidden | None] = lambda rows: None
        """Asks for the hidden state ``(k, ...)`` of worlds ``rows (k,)``, or of all, the objects of each in
        its own order; None where nobody knows it."""
        self.planner: Planner | None = None
        """Plans beside a robot's loop; None where time stands still meanwhile."""
        self.times: Array = np.zeros(worlds)
        """Seconds ``(N,)`` since each episode began."""
        self._refused: dict[int, Refusal] = {}
        self._held: dict[tuple[str, str], Array] = {}
        self._dead_ends: dict[tuple[str, str], Array] = {}
        self._succeeded: dict[int, tuple[Any, Array]] = {}  # by identity of the model, which it keeps alive
        most = {"tool": TOOL + len(robot.arm_joints), "hand": 1 + len(robot.synergies)}
        self._parts = {name: _Part(name, worlds, self.like, n) for name, n in most.items()}
        self._indices: dict[bytes, Index] = {}

    @property
    def refused(self) -> dict[int, Refusal]:
        """What could not be carried out of the last tick's commands, by world."""
        return self._refused

    @property
    def looked(self) -> Observation | None:
        """The observation of this tick ``(N, ...)``, the objects of each world in its own order."""
        return self._latest

    @property
    def facts_table(self) -> FactsTable:
        """What is known beforehand of the worlds, as they begin one by one."""
        return self._table

    @property
    def now(self) -> float:
        """Seconds since the first world's episode began."""
        return float(self.times[0])

    @property
    def world(self) -> WorldFacts:
        """What is known beforehand of the worlds.

        Raises:
            RuntimeError: The tree is ticked outside an episode.
        """
        facts = self.facts_table.facts
        if facts is None:
            raise RuntimeError(NO_EPISODE)
        return facts

    @property
    def observation(self) -> Observation:
        """The observation of this tick ``(N, ...)``, whose objects have the columns of `world`.

        Raises:
            RuntimeError: The tree is ticked outside an episode.
        """
        if self._observation is None:
            if self._latest is None:
                raise RuntimeError(NO_EPISODE)
            self._observation = self.facts_table.arranged(self._latest)
        return self._observation

    @property
    def beliefs(self) -> Beliefs:
        """What estimates are corrected by."""
        return self._beliefs

    @property
    def believed(self) -> Believed:
        """Gives the poses at which the objects are taken to be at this tick, in the columns of `world`."""
        if self._believed is None:
            seen = self.observation.objects
            self._believed = Believed(seen, self.beliefs.corrections(list(self.world.columns), seen))
        return self._believed

    def hidden(self, rows: Array | None = None) -> Hidden | None:
        """The hidden state ``(k, ...)``, in the columns of `world`; None where nobody knows it.

        Args:
            rows: Of which worlds ``(k,)``; by default of all.
        """
        found = self.ask_hidden(rows)
        return None if found is None else self.in_columns(found, rows)

    def in_columns(self, bundle: _T, rows: Array | None = None) -> _T:
        """An observation or a hidden state whose objects have the columns of `world`, see `Order.arranged`.

        Args:
            bundle: Of worlds ``(k, ...)``, the objects of each in its own order.
            rows: Which worlds ``(k,)``; by default all.
        """
        return self.facts_table.arranged(bundle, rows)

    def begin(self, models: Sequence[WorldModel], rows: Array | None = None) -> None:
        """Begin episodes; `advance` comes next.

        Args:
            models: What is known of these worlds.
            rows: Which worlds ``(k,)``; by default all.
        """
        rows = self.rows if rows is None else rows
        self.facts_table.replace(rows, models)
        self.beliefs.begin(rows, models)
        self._observation = self._believed = None
        for held in self._held.values():
            held[rows] = False
        for count in self._dead_ends.values():
            count[rows] = 0
        for _, succeeded in self._succeeded.values():
            succeeded[rows] = False
        for row in rows.tolist():
            self.refused.pop(row, None)

    def advance(self, observation: Observation, rows: Array | None = None) -> None:
        """Go on to the next tick: a new observation, and an empty command.

        Args:
            observation: Of all worlds ``(N, ...)``, the objects of each in the order of its `WorldModel`.
            rows: The worlds ``(k,)`` that have gone on; by default all. The others are as they were, in the
                middle of a tick.
        """
        self._latest, self._observation, self._believed = observation, None, None
        self.beliefs.see(observation)
        self.times = host(observation.time)
        rows = self.rows if rows is None else rows
        for part in self._parts.values():
            part.clear(rows)
        if self.refused:
            for row in rows.tolist():
                self.refused.pop(row, None)

    def write(self, command: Command, rows: Array, leaf: Behaviour) -> None:
        """Write commands ``(k, ...)``, or a part of them, for worlds ``rows (k,)``.

        Raises:
            CommandConflictError: Another leaf has written the same part in this tick.
            LeafError: A part is not a row of numbers of its length; says where the leaf's class makes it.
        """
        size = self.times.dtype.itemsize
        if command.tool is not None:
            tool = command.tool if command.posture is None else _with_posture(command, leaf)
            self._parts["tool"].write(tool, self.index(rows), leaf, size)
        if command.hand is not None:
            self._parts["hand"].write(command.hand, self.index(rows), leaf, size)

    def tool_writer(self, world: int = 0) -> Behaviour | None:
        """The leaf that has commanded the tool in this tick, in one world."""
        return self.writer_of("tool", world)

    def writer_of(self, part: str, world: int = 0) -> Behaviour | None:
        """The leaf that has written a part of the command, ``tool`` or ``hand``, in this tick."""
        return self._parts[part].writer(world)

    def written_in(self, world: int) -> Written:
        """What the leaves have written in this tick in one world ``(1, ...)``, in NumPy.

        Raises:
            LeafError: A part is not finite; names the leaf that wrote it.
        """
        return Written(*(part.of_world(world) for part in self._parts.values()))

    def refusal(self, world: int, error: BtTasksimError) -> Refusal:
        """What `refused` is to say where an engine could not carry out what was written in this tick.

        It is asked for before `advance`, which forgets who wrote what.

        Args:
            world: The world, by its row.
            error: Why not.

        Raises:
            BtTasksimError: The error itself, where it is not about reach.
        """
        if not isinstance(error, UnreachableError):
            raise error
        outcome = OUT_OF_REACH(what=error, distance=error.distance, angle=error.angle)
        return Refusal(self.tool_writer(world), outcome)

    def withdraw(self, leaf: Behaviour, rows: Array) -> None:
        """Drop what a leaf has written in this tick: it was interrupted, and others may act instead."""
        for part in self._parts.values():
            part.withdraw(leaf, rows)

    @property
    def written(self) -> Written:
        """What the leaves have written in this tick.

        Raises:
            LeafError: A part is not finite; names the leaf that wrote it.
        """
        parts = {name: part for name, part in self._parts.items() if part.values is not None}
        for part, finite in zip(parts.values(), fetched([p.finite() for p in parts.values()]), strict=True):
            part.check(finite)
        return Written(*(part.values for part in self._parts.values()))

    @property
    def command(self) -> Command:
        """What the leaves have written in this tick for the first world, see `written`."""
        return self.written.of_world(0)

    def reach(self, goal: str, target: str, rows: Array) -> None:
        """A concept has reached a goal (such as ``holding``) that later ones may have to maintain."""
        self._goal(goal, target)[rows] = True

    def end(self, goal: str, target: str, rows: Array) -> None:
        """A concept has ended a goal."""
        self._goal(goal, target)[rows] = False

    def reached(self, goal: str, target: str, rows: Array) -> Array:
        """Boolean ``(k,)``: an earlier concept reached this goal and none has ended it."""
        return self._goal(goal, target)[rows]

    def led_nowhere(self, goal: str, target: str, row: int, counts: float = 1.0) -> None:
        """A concept has not done its part with a goal as an earlier one has reached it.

        Args:
            goal: The goal.
            target: The object that it is about.
            row: The world.
            counts: As how many times it counts.
        """
        if (goal, target) not in self._dead_ends:
            self._dead_ends[goal, target] = np.zeros(self.worlds)
        self._dead_ends[goal, target][row] += counts

    def dead_ends(self, goal: str, target: str, rows: Array) -> Array:
        """How often ``(k,)`` that was so in the episode, in whole times."""
        counts = self._dead_ends.get((goal, target))
        return np.zeros(len(rows), np.int64) if counts is None else np.floor(counts[rows]).astype(np.int64)

    def note(self, model: Any, succeeded: bool, rows: Array) -> None:
        """A concept has succeeded, or has begun anew or been stopped."""
        if succeeded and id(model) not in self._succeeded:
            self._succeeded[id(model)] = model, np.zeros(self.worlds, bool)
        if id(model) in self._succeeded:
            self._succeeded[id(model)][1][rows] = succeeded

    def succeeded(self, models: Sequence[Any], rows: Array) -> Array:
        """Booleans ``(k, n)``: which of ``n`` concepts have succeeded, and were not stopped since.

        Of those that py_trees ticks world by world in a batch nobody says it.
        """
        out = np.zeros((len(rows), len(models)), bool)
        for k, model in enumerate(models) if self._succeeded else ():
            if id(model) in self._succeeded:
                out[:, k] = self._succeeded[id(model)][1][rows]
        return out

    def _goal(self, goal: str, target: str) -> Array:
        if (goal, target) not in self._held:
            self._held[goal, target] = np.zeros(self.worlds, bool)
        return self._held[goal, target]

    def seen(self, rows: Array, elapsed: Array) -> Seen:
        """The view of this tick's observation of some worlds.

        Args:
            rows: Which ``(k,)``, ascending.
            elapsed: Seconds ``(k,)`` since the concept became active, in NumPy.
        """
        observation, facts, (since,) = self.observation, self.world, sent([elapsed], self.like)
        if len(rows) == self.worlds:
            return Seen(observation, facts, self.robot, since, believed=self.believed)
        index = self.index(rows)
        picked: Observation = Rows(observation, index.of)  # type: ignore[assignment]
        taken, believed = self.facts_table.taken(index), self.believed
        return Seen(picked, taken, self.robot, since, believed=lambda: index.of(believed()))

    def index(self, rows: Array) -> Index:
        """What picks some worlds ``(k,)``; numbers that are asked for often go to a device once."""
        if isinstance(self.like, np.ndarray):
            return Index(rows)
        key = rows.tobytes()
        if key not in self._indices:
            if len(self._indices) >= OFTEN:
                self._indices.clear()
            self._indices[key] = Index(rows)
        return self._indices[key]


class _Part:
    """One part of the command: the targets of all worlds, and which leaf wrote each."""

    def __init__(self, name: str, worlds: int, like: Array, most: int) -> None:
        self._name, self._worlds, self._like, self._most = name, worlds, like, most
        self._leaves: list[Behaviour] = []
        self._numbers: dict[int, int] = {}  # of leaves, by identity
        self._by: Array = np.full(worlds, NOBODY)
        self.values: Array = None

    def clear(self, rows: Array) -> None:
        if self.values is None:
            return
        if len(rows) == self._worlds:
            self._empty()
            return
        self._forget(rows)
        if (self._by == NOBODY).all():
            self._empty()

    def _empty(self) -> None:
        self._leaves, self._numbers = [], {}
        self._by, self.values = np.full(self._worlds, NOBODY), None

    def writer(self, world: int) -> Behaviour | None:
        number = int(self._by[world])
        return None if number == NOBODY else self._leaves[number]

    def write(self, values: Array, index: Index, leaf: Behaviour, size: int) -> None:
        """Write targets as floats of so many bytes: those of one world may not round another's."""
        rows = index.rows
        before = self._by[rows]
        if self.values is not None and (before != NOBODY).any():
            raise _conflict(self._name, self._leaves[int(before[before != NOBODY][0])], leaf)
        values = _floats(self._shaped(values, len(rows), leaf), size)
        if len(rows) == self._worlds:
            self.values = values
        else:
            if self.values is None:
                xp, shape = array_namespace(values), (self._worlds, values.shape[-1])
                self.values = xp.full(shape, np.nan, dtype=values.dtype, device=values.device)
            width = max(self.values.shape[-1], values.shape[-1])
            filling = np.nan if self._name == "tool" else 0.0
            self.values, values = widened(self.values, width, filling), widened(values, width, filling)
            index.put(self.values, values)
        if id(leaf) not in self._numbers:
            self._numbers[id(leaf)] = len(self._leaves)
            self._leaves.append(leaf)
        self._by[rows] = self._numbers[id(leaf)]

    def withdraw(self, leaf: Behaviour, rows: Array) -> None:
        number = self._numbers.get(id(leaf))
        if number is None or self.values is None:
            return
        mine = rows[self._by[rows] == number]
        if len(mine):
            self._forget(mine)

    def _forget(self, rows: Array) -> None:
        self.values = array_namespace(self.values).asarray(self.values, copy=True)
        Index(rows).put(self.values, np.nan)
        self._by[rows] = NOBODY

    def finite(self) -> Array:
        return _all_finite(self.values[:, :TOOL] if self._name == "tool" else self.values)

    def check(self, finite: np.ndarray) -> None:
        for world in np.flatnonzero(~finite & (self._by != NOBODY)).tolist():
            raise self._not_finite(world)

    def _not_finite(self, world: int) -> LeafError:
        leaf = self._leaves[int(self._by[world])]
        found = host(self.values[world, ...])
        return LeafError(f"leaf '{leaf.name}' commands a {self._name} target that is not finite: {found}")

    def of_world(self, world: int) -> Array:
        """The targets ``(1, n)`` of one world, in NumPy; None where nobody wrote any.

        Raises:
            LeafError: They are not finite; names the leaf that wrote them.
        """
        if self.writer(world) is None:
            return None
        found = host(self.values[world : world + 1, ...])
        if not np.isfinite(found[:, :TOOL] if self._name == "tool" else found).all():
            raise self._not_finite(world)
        return found

    def _shaped(self, values: Array, worlds: int, leaf: Behaviour) -> Array:
        """Targets as an array of numbers ``(k, n)``, where concepts are computed."""
        there = hasattr(values, "ndim") and (
            not isinstance(values, np.ndarray) or isinstance(self._like, np.ndarray)
        )
        try:
            found = values if there else constant(values, self._like)
            shape = tuple(found.shape) if _real(found) else ()
        except (TypeError, ValueError):
            found, shape = values, ()
        if len(shape) == 2 and shape[0] == worlds and self._fits(shape[1]):
            return found
        writer = type(getattr(leaf, "model", leaf))
        place = place_of(getattr(writer, "command", writer))
        where = f" ({place})" if place else ""
        wanted = WANTED[self._name].format(most=self._most)
        raise LeafError(f"leaf '{leaf.name}'{where} commands {self._name}={shown(repr(values))}: {wanted}")

    def _fits(self, width: int) -> bool:
        """Whether a target may have so many numbers."""
        return width in (TOOL, self._most) if self._name == "tool" else 0 < width <= self._most


def _all_finite(values: Array) -> Array:
    """Boolean ``(N,)``: all numbers of a row are finite."""
    xp = array_namespace(values)
    return xp.all(xp.isfinite(values), axis=-1)


def _real(values: Array) -> bool:
    """Whether these are real numbers, whatever their type."""
    if isinstance(values, np.ndarray):
        return values.dtype.kind in "fiub"
    xp = array_namespace(values)
    return bool(xp.isdtype(values.dtype, ("real floating", "integral", "bool")))


def _floats(values: Array, size: int) -> Array:
    """Numbers as floats of so many bytes."""
    xp = array_namespace(values)
    kind = xp.float64 if size == 8 else xp.float32
    return values if values.dtype == kind else xp.astype(values, kind)


def widened(values: Array, width: int, filling: float) -> Array:
    """Targets ``(k, n)`` with so many numbers.

    Args:
        values: The targets.
        width: How many numbers.
        filling: What those are that are missing: a hand target without synergies has them at zero, a tool
            target without a posture has none.
    """
    missing = width - values.shape[-1]
    if missing <= 0:
        return values
    xp = array_namespace(values)
    nothing = xp.full((values.shape[0], missing), filling, dtype=values.dtype, device=values.device)
    return xp.concat([values, nothing], axis=-1)


WANTED = {
    "tool": "a tool target is (worlds, 7): of each world 7 numbers, position, then quaternion w x y z; a "
    "posture beside it has a number for each arm joint",
    "hand": "a hand target is (worlds, n): of each world a row of numbers, the closure first and then "
    "this robot's synergies, {most} at most: hand=closure[..., None]",
}


def _with_posture(command: Command, leaf: Behaviour) -> Array:
    """The tool targets ``(k, 7)`` of a command and its postures ``(k, n_arm)``, side by side.

    Raises:
        LeafError: They are not arrays of as many rows.
    """
    tool, posture = command.tool, command.posture
    target, given = (tuple(getattr(part, "shape", ())) for part in (tool, posture))
    if len(given) != 2 or target != (given[0], TOOL):
        raise LeafError(
            f"leaf '{leaf.name}' commands a posture of shape {given} for tool targets of shape "
            f"{target}: postures are (worlds, arm joints), beside targets (worlds, 7)"
        )
    return array_namespace(tool, posture).concat([tool, posture], axis=-1)


def _conflict(part: str, first: Behaviour, second: Behaviour) -> CommandConflictError:
    return CommandConflictError(
        f"two leaves command the {part} in one tick: '{first.name}' and '{second.name}'"
    )


def one_world(bundle: _T) -> _T:
    """An observation, or a hidden state, of a single world, which has no axis of worlds, with one."""
    found: _T = Rows(bundle, lambda values: np.asarray(values)[None])  # type: ignore[assignment]
    return found


def only_world(bundle: _T, world: int) -> _T:
    """One world of an observation ``(N, ...)``, or of a hidden state, as that of a batch of one, in NumPy."""
    found: _T = Rows(bundle, lambda values: host(values[world : world + 1, ...]))  # type: ignore[assignment]
    return found
