"""What becomes of a concept from its begin to its end, in as many worlds as its tree is ticked in.

`Activation` holds the arrays that a running concept has besides its values: when it began, what it remembers,
how near to done its policy says it is. One tick is two steps: `Activation.judge` says in which worlds the
concept can go on, and `Activation.act` carries out what was decided there. A leaf of py_trees has one for a
single world, a batch of trees one for all of its worlds.

What is seen, remembered, decided and commanded is where the context has it, on a device if need be. Which
worlds go on, statuses, clocks and counts are NumPy's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.context import Context
from bt_tasksim.concept.contract import Contract
from bt_tasksim.concept.following import following
from bt_tasksim.concept.functions import ConceptFunctions, any_of, booleans, first_of, sequence_of
from bt_tasksim.concept.planner import PATIENCE, SOON, Plan
from bt_tasksim.concept.reporting import as_statement
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.batch_leaf import FAILURE, RUNNING, SUCCESS
from bt_tasksim.core.bundles import merged, taken
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import (
    CANNOT_START,
    DONE,
    GOAL_LOST,
    LIMIT_VIOLATED,
    NO_WAY,
    TIMED_OUT,
    Outcome,
    Possible,
    Statement,
    register_reason,
)
from bt_tasksim.core.poses import Array, array_namespace, host
from bt_tasksim.core.transfer import Index, fetched
from bt_tasksim.core.units import SECONDS
from bt_tasksim.policy.policy import Action

PLANNED_TOO_LONG = register_reason("planned_too_long", "no plan was there after {limit}", limit=SECONDS)
LOST_TICKS = 3
"""Ticks in a row without a maintained goal after which it counts as lost (contacts flicker)."""
LOSS = 0.5
"""As how many failures of what reached a goal its loss counts: once it may have been bad luck."""


class Judged(NamedTuple):
    """In which worlds a concept goes on at this tick, and what is seen there.

    Attributes:
        statuses: Of all worlds that were judged ``(k,)``: RUNNING where it goes on, else FAILURE.
        going: Positions ``(m,)`` among them of those that go on.
        rows: Numbers ``(m,)`` of these worlds.
        seen: What is seen in them.
        memory: What is remembered in them.
    """

    statuses: Array
    going: Array
    rows: Array
    seen: Seen
    memory: Any

    def at(self, positions: Array) -> Judged:
        """Some of the worlds that go on, by their position among them."""
        if len(positions) == len(self.going):
            return self
        return self._replace(
            going=self.going[positions],
            rows=self.rows[positions],
            seen=self.seen.at(positions),
            memory=taken(self.memory, positions),
        )


class Activation:
    """A concept as it runs in the worlds of a tree.

    Args:
        leaf: The leaf that stands for it in the tree; by it commands are told apart.
        model: What it does.
        context: The tree's.
    """

    def __init__(self, leaf: Behaviour, model: ConceptFunctions, context: Context) -> None:
        self._leaf, self._model, self._context = leaf, model, context
        self._contract = Contract(leaf, model)
        worlds = context.worlds
        self.activations: Array = np.zeros(worlds, np.int64)
        """How often it has begun ``(N,)``."""
        self.memory: Any = None
        """What it remembers ``(N, ...)``; None before it first began."""
        self.outcomes: dict[int, Outcome] = {}
        """How it ended when it was last active, by world."""
        self._started: Array = np.zeros(worlds)
        self._nearer: Array = np.zeros(worlds)
        self._lost: Array = np.zeros(worlds, np.int64)
        self._later: tuple[Any, ...] | None = None
        self._failures: Array = np.zeros(worlds, np.int64)
        self._plans: dict[int, Plan] = {}

    @property
    def plans(self) -> bool:
        """It waits for a plan, see `bt_tasksim.concept.planner`."""
        return bool(self._plans)

    def stopped(self, rows: Array) -> None:
        """It is stopped in worlds ``(k,)``, where it acts or has ended: what it has done counts no more."""
        self._context.note(self._model, False, rows)
        self._context.withdraw(self._leaf, rows)
        for row in rows.tolist() if self._plans else ():
            self._plans.pop(row, None)

    def elapsed(self, rows: Array) -> Array:
        """Seconds ``(k,)`` since it began."""
        return self._context.times[rows] - self._started[rows]

    def seen(self, rows: Array) -> Seen:
        """What is seen now."""
        found = self._context.seen(rows, self.elapsed(rows))
        if self._later is None:
            self._later = following(self._leaf)
        found.later, found.succeeded = self._later, self._context.succeeded(self._later, rows)
        model, context = self._model, self._context
        found.failures = self._failures[rows]
        for goal in model.reaches:
            found.failures = found.failures + context.dead_ends(goal, model.actor, rows)
        return found

    def judge(self, rows: Array, fresh: Array) -> Judged:
        """Begin where it begins, and see where it can go on.

        Args:
            rows: The worlds ``(k,)`` in which it is ticked, ascending.
            fresh: Boolean ``(k,)``: it begins there.
        """
        statuses = np.full(len(rows), RUNNING, np.int8)
        if self.outcomes:
            for row in rows.tolist():
                self.outcomes.pop(row, None)
        if fresh.any():
            begins = rows[fresh]
            self.activations[begins] += 1
            self._lost[begins], self._nearer[begins] = 0, 0.0
            self._context.note(self._model, False, begins)
            for row in begins.tolist() if self._plans else ():
                del self._plans[row]
        for row, refusal in self._context.refused.items():
            if refusal.leaf is self._leaf and row in rows:
                position = int(np.searchsorted(rows, row))
                self._fail(statuses, position, row, refusal.outcome)
        if fresh.any():
            self._begin(rows, fresh & (statuses == RUNNING), statuses)
        for row in sorted(self._plans):
            if row in rows:
                self._look_at_plan(row, int(np.searchsorted(rows, row)), statuses)
        judged = self._going(rows, statuses)
        if not len(judged.rows):
            return judged
        return self._kept(rows, judged)

    def act(self, judged: Judged, action: Action) -> Array:
        """Carry decisions out; the statuses ``(k,)`` of the worlds that were judged.

        Args:
            judged: What `judge` has found.
            action: One for each of the worlds in which it goes on.

        Raises:
            LeafError: A function of the concept gives what it should not, see `Contract`.
            InputError: A memory is not made as it was before.
        """
        model, context, statuses = self._model, self._context, judged.statuses
        if not len(judged.rows):
            return statuses
        nearer = self._nearer[judged.rows] + host(action.terminate)
        self._nearer[judged.rows] = nearer
        done = nearer >= 1.0
        planned = model.planned(judged.memory) if model.patient else 0.0
        patience = model.timeout + (host(planned) if getattr(planned, "ndim", 0) else planned)
        late = ~done & (self.elapsed(judged.rows) > patience)
        ended = done | late
        if ended.any():
            positions = np.flatnonzero(ended)
            ends = judged.at(positions)
            statuses[ends.going] = np.where(done[positions], SUCCESS, FAILURE)
            finished = judged.rows[done]
            self._failures[finished] = 0
            context.note(model, True, finished)
            self._failures[judged.rows[late]] += 1
            for row in judged.rows[late].tolist():
                self._led_nowhere(row)
            for goal in model.ends:
                context.end(goal, model.actor, finished)
            for goal in model.reaches:
                context.reach(goal, model.actor, finished)
            self._say_end(ends, done[positions])
            positions = np.flatnonzero(~ended)
            if not len(positions):
                return statuses
            judged, motion = judged.at(positions), Index(positions).of(action.motion)
        else:
            motion = action.motion
        found = model.carry_out(motion, judged.seen, judged.memory)
        command, after = self._contract.carried(found)
        context.write(command, judged.rows, self._leaf)
        if after is not judged.memory:
            giver = self._contract.giver("carry_out", "advance")
            self._remember(judged.rows, after, giver, judged.memory)
        return statuses

    def going_on(self, rows: Array) -> Judged:
        """Worlds that `judge` has found to go on at this tick, once more: their decisions have come.

        Args:
            rows: Which worlds ``(k,)``, ascending.
        """
        return self._going(rows, np.full(len(rows), RUNNING, np.int8))

    # ---- judging ----------------------------------------------------------------------------------------

    def _begin(self, rows: Array, fresh: Array, statuses: Array) -> None:
        """Begin in the worlds where it can."""
        positions = np.flatnonzero(fresh)
        if not len(positions):
            return
        context, model = self._context, self._model
        begins = rows[positions]
        anew = context.times[begins] <= self._started[begins]  # no clock goes back but for another episode
        self._failures[begins[anew]] = 0
        self._started[begins] = context.times[begins]
        seen = self.seen(begins)
        if context.planner is not None:
            for k, row in enumerate(begins.tolist()):
                self._plans[row] = context.planner.begin(self._beginning, seen.at(np.array([k])))
            return
        unmet = self._unmet(seen, len(begins))
        cannot = host(any_of(seen.tool, unmet))
        if cannot.any():
            unmet = [possible.on_host() for possible in unmet]
            for k in np.flatnonzero(cannot).tolist():
                why = first_of(unmet, k)
                self._fail(statuses, int(positions[k]), int(begins[k]), CANNOT_START(why))
            can = np.flatnonzero(~cannot)
            if not len(can):
                return
            begins, positions, seen = begins[can], positions[can], seen.at(can)
        try:
            self._remember(begins, model.begin(seen), "begin")
        except NoWayError:
            self._begin_each(begins, positions, seen, statuses)

    def _beginning(self, seen: Seen) -> Any:
        """What it begins with in one world, or why it cannot: asked beside a robot's loop."""
        why = first_of([possible.on_host() for possible in self._unmet(seen, 1)], 0)
        return self._model.begin(seen) if why is None else CANNOT_START(why)

    def _unmet(self, seen: Seen, worlds: int) -> Sequence[Possible]:
        """What may keep it from beginning, held to the contract."""
        unmet = sequence_of(self._model.initial_state(seen), self._contract.where("initial_state"))
        for possible in unmet:
            self._contract.answers(possible.applies, worlds, "initial_state")
        return unmet

    def _begin_each(self, begins: Array, positions: Array, seen: Seen, statuses: Array) -> None:
        """Begin world by world: in one of them at least there is no way."""
        for k, (row, position) in enumerate(zip(begins.tolist(), positions.tolist(), strict=True)):
            try:
                self._remember(np.array([row]), self._model.begin(seen.at(np.array([k]))), "begin")
            except NoWayError as error:
                self._no_way(statuses, position, row, error)

    def _no_way(self, statuses: Array, position: int, row: int, error: NoWayError) -> None:
        self._led_nowhere(row)
        self._fail(statuses, position, row, CANNOT_START(NO_WAY(what=error)))

    def _led_nowhere(self, row: int, counts: float = 1.0) -> None:
        """It came to nothing in a world with the goals that it maintains, as they were reached."""
        for goal in self._model.maintains:
            self._context.led_nowhere(goal, self._model.actor, row, counts)

    def _look_at_plan(self, row: int, position: int, statuses: Array) -> None:
        """Begin with the plan that was waited for in a world, if it is there; its clock begins then."""
        plan, planner, now = self._plans[row], self._context.planner, self._context.times[row]
        assert planner is not None
        if not plan.ready(SOON):
            if now - self._started[row] > PATIENCE:
                del self._plans[row]
                self._fail(statuses, position, row, CANNOT_START(PLANNED_TOO_LONG(limit=PATIENCE)))
            return
        del self._plans[row]
        seen = self.seen(np.array([row]))
        if plan.outdated(seen):
            self._plans[row] = planner.begin(self._beginning, seen, plan.anew + 1)
            return
        try:
            memory = plan.result()
        except NoWayError as error:
            self._no_way(statuses, position, row, error)
            return
        if isinstance(memory, Outcome):
            self._fail(statuses, position, row, memory)
            return
        self._started[row] = now
        self._remember(np.array([row]), memory, "begin")

    def _going(self, rows: Array, statuses: Array) -> Judged:
        """The worlds in which nothing has failed so far, and no plan is waited for."""
        going = np.flatnonzero(statuses == RUNNING)
        if self._plans:
            going = going[[row not in self._plans for row in rows[going].tolist()]]
        on = rows[going]
        memory = self.memory
        if memory is not None and len(on) < self._context.worlds:
            memory = taken(memory, self._context.index(on))
        return Judged(statuses, going, on, self.seen(on), memory)

    def _kept(self, rows: Array, judged: Judged) -> Judged:
        """Those of them in which no limit is exceeded and no goal lost."""
        model, context, seen = self._model, self._context, judged.seen
        held = {goal: context.reached(goal, model.actor, judged.rows) for goal in model.maintains}
        asked = [goal for goal, worlds in held.items() if worlds.any()]
        exceeded_or_kept = [model.violated(seen, judged.memory)]
        self._contract.answers(
            exceeded_or_kept[0], len(judged.rows), self._contract.giver("violated", "limits")
        )
        for goal in asked:
            kept = model.maintained(goal, seen, judged.memory)
            self._contract.answers(kept, len(judged.rows), "maintained")
            exceeded_or_kept.append(kept)
        broken, *keeps = fetched(exceeded_or_kept)
        lost = np.zeros(len(judged.rows), bool)
        missing = np.zeros(len(judged.rows), bool)
        for goal, kept in zip(asked, keeps, strict=True):
            gone = held[goal] & ~kept & ~missing & ~broken
            missing |= gone
            over = gone & (self._lost[judged.rows] + 1 >= LOST_TICKS)
            for k in np.flatnonzero(over).tolist():
                measured = self._measured(judged, k)
                outcome = GOAL_LOST(measured, object=model.actor, goal=goal)
                self._led_nowhere(int(judged.rows[k]), LOSS)
                self._fail(judged.statuses, int(judged.going[k]), int(judged.rows[k]), outcome)
            context.end(goal, model.actor, judged.rows[over])
            lost |= over
        self._lost[judged.rows] = np.where(missing, self._lost[judged.rows] + 1, 0)
        if broken.any():
            limits = [limit.on_host() for limit in model.limits(seen, judged.memory)]
            for k in np.flatnonzero(broken).tolist():
                measured = self._measured(judged, k)
                exceeded = first_of(limits, k)
                outcome = LIMIT_VIOLATED(measured if exceeded is None else exceeded.with_detail(measured))
                self._led_nowhere(int(judged.rows[k]))
                self._fail(judged.statuses, int(judged.going[k]), int(judged.rows[k]), outcome)
        failed = broken | lost
        return judged.at(np.flatnonzero(~failed)) if failed.any() else judged

    def _remember(self, rows: Array, memory: Any, function: str, was: Any = None) -> None:
        """Keep what a function gave for some worlds; before that they remembered ``was``, if anything."""
        context = self._context
        with self._contract.kept(function):
            self.memory = merged(self.memory, context.index(rows), memory, context.worlds, was)

    # ---- saying -----------------------------------------------------------------------------------------

    def _measured(self, judged: Judged, position: int) -> Statement | None:
        """Where things stand in one world, by its position among those that go on."""
        one = judged.at(np.array([position]))
        said = self._explained(one)
        return None if said is None else said.at(0)

    def _explained(self, judged: Judged) -> Statement | None:
        found = self._model.explain(judged.seen, judged.memory)
        self._contract.words(found, len(judged.rows))
        return as_statement(found)

    def _say_end(self, ends: Judged, done: Array) -> None:
        """How it ended where it was done, or late."""
        said = self._explained(ends)
        said = None if said is None else said.on_host()
        elapsed = self.elapsed(ends.rows).tolist()
        for k, row in enumerate(ends.rows.tolist()):
            measured = None if said is None else said.at(k)
            if done[k]:
                self.outcomes[row] = DONE(measured, elapsed=elapsed[k])
            else:
                self.outcomes[row] = TIMED_OUT(measured, limit=self._model.timeout)

    def _fail(self, statuses: Array, position: int, row: int, why: Outcome) -> None:
        statuses[position] = FAILURE
        self.outcomes[row] = why
        self._failures[row] += 1


def no_action(judged: Judged, size: int) -> Action:
    """The middle of an action ``(m, size)``, and not done, for the worlds that go on."""
    tool = judged.seen.tool
    xp = array_namespace(tool)
    motion = xp.zeros((len(judged.rows), size), dtype=tool.dtype, device=tool.device)
    return Action(motion, booleans(tool, False))
