"""Activations of what stands under a `Train` node, in many worlds of one process at once.

Each world has an episode of its own, from the draw to the judgement. Worlds that wait for a decision stand
still in the middle of a tick, and all others tick and step together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack

import numpy as np
from gymnasium.error import ClosedEnvironmentError
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.status import STATUSES
from bt_tasksim.core.batch_leaf import INVALID, RUNNING, SUCCESS
from bt_tasksim.core.errors import BtTasksimError, InputError, LeafError, LostEngine, NoDrawError
from bt_tasksim.core.outcomes import INTERRUPTED, TIME_OVER, Outcome, outcome_of_error
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.pipeline_worlds import worlds_for
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import LONGEST
from bt_tasksim.policy.policy import Action, Policy, split_action
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.training.decision import Decision
from bt_tasksim.training.drawn_worlds import DrawnWorlds, Draws
from bt_tasksim.training.endings import BEGAN_ANEW, FOLLOWER_LATE, TREE_ENDED, ending_of
from bt_tasksim.training.happened import Happened, not_drawn, not_reached
from bt_tasksim.training.judge import Judgement, SignalOutcome
from bt_tasksim.training.learning_leaves import checked_actions
from bt_tasksim.training.learning_tree import LearningTree
from bt_tasksim.training.reward import Reward
from bt_tasksim.training.transitions import Transitions

IDLE, DRAWING, TICKING, WAITING, DECIDED, STEPPING = range(6)
"""What a world does next: nothing; a world is to be drawn; its tree is to be ticked; it is waited for a
decision, in the middle of a tick; which has come; a control period is due."""
BEFORE = -1
"""Number of the activation before the first decision."""
REDRAWS = 50
"""Draws in a row that may have no world, or in which the subtree may stay inactive."""
FAILURES = 50
"""Episodes in a row in which an engine may fail in a world; with more, it is not what was drawn."""


class EpisodeBatch:
    """Episodes of one tree in many worlds.

    What becomes of an episode does not depend on the other worlds, nor on when its decisions come.

    Args:
        tree: The tree, with one `Train` node at least.
        scene: The scene.
        train: Name of the `Train` node; by default the first one.
        options: Engines, in several worlds those that `bt_tasksim.execution.worlds.why_alone` has nothing
            against; by default SAPIEN with the noise model ``original``.
        reward: What is paid.
        longest: Seconds of an episode, earlier siblings included, after which it is truncated.
        policies: Policies of other leaves, by the leaf's name: what was trained before.
        worlds: How many, N.
        threads: How many threads step them.
        build: Makes one more tree of the same shape, for what in it has no form for many worlds, see
            `bt_tasksim.execution.batch.BatchTree`.

    Raises:
        InputError: There is no `Train` node, nothing under it can learn, or the leaves that learn differ in
            what they see or do; what is to learn stands below a behaviour that is not known; or there are to
            be several worlds, and the engines have no form for that, or something in the tree has none and
            there is no ``build``, or memory has no room for them.
    """

    def __init__(
        self,
        tree: Behaviour,
        scene: WorldSource,
        train: str | None = None,
        options: EngineOptions | None = None,
        reward: Reward | None = None,
        longest: float = LONGEST,
        policies: Mapping[str, Policy] | None = None,
        worlds: int = 8,
        threads: int = 1,
        build: Callable[[], Behaviour] | None = None,
    ) -> None:
        options = options or EngineOptions(noise="original")
        if not isinstance(tree, Behaviour):
            raise InputError(
                f"the first argument should be a tree, such as build(), found a {type(tree).__name__}; "
                "what makes one is given beside it, as build=build"
            )
        self.tree, self.longest = tree, longest
        self.reward = reward or Reward()
        self.robot = load_robot(scene.robot)
        with ExitStack() as stack:
            learning = LearningTree(tree, self.robot, train, policies or {}, worlds, build)
            stack.callback(learning.close)
            self.worlds = worlds_for(self.robot, options, worlds, threads)
            stack.callback(self.worlds.close)
            self._drawn = DrawnWorlds(self.worlds, scene, self.robot, learning.context)
            self._judgement = Judgement(learning.train, learning.batch, learning.context)
            self._open = stack.pop_all()
        self._learning, self.scene = learning, self._drawn.scene
        self.train, self.learners, self.layout = learning.train, learning.learners, learning.layout
        self.context, self.batch = learning.context, learning.batch
        self.observation_space, self.action_space = learning.observation_space, learning.action_space
        self.context.ask_hidden = self.worlds.hidden
        for number in self._judgement.nodes:
            self.batch.watch(number, self._watcher(number))
        n = self.observation_space.shape[0]
        self._phase = np.full(worlds, IDLE)
        self._activation: Array = np.full(worlds, BEFORE, np.int64)
        self._following = np.zeros(worlds, bool)
        self._left = np.zeros(worlds, np.int64)
        self._features: Array = np.zeros((worlds, n), np.float32)
        self._redrawn = np.zeros(worlds, np.int64)
        self._transitions: dict[int, Transitions] = {}
        self._happened: list[Happened] = []
        self._over: list[int] = []
        self._failed = np.zeros(worlds, np.int64)
        self._closed = False

    # ---- from outside -----------------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """How many worlds there are, N."""
        return self.context.worlds

    @property
    def waiting(self) -> Array:
        """The worlds ``(k,)`` in which a decision is waited for."""
        return np.flatnonzero(self._phase == WAITING)

    def decision(self, row: int) -> Decision | None:
        """What the leaf that is to act in a world sees and remembers; None where nothing is waited for."""
        return self._transitions[row].decision if self._phase[row] == WAITING else None

    def features(self) -> Array:
        """What each leaf saw at the last decision of its world ``(N, n)``."""
        return self._features.copy()

    def begin(self, row: int, draws: Draws) -> None:
        """Begin an episode in a world, whatever goes on there; `go_on` draws it.

        Raises:
            ClosedEnvironmentError: It is closed.
        """
        self.check_open()
        self._drop(np.array([row]))
        self._drawn.draw_from(row, draws)
        self._redrawn[row], self._phase[row] = 0, DRAWING

    def leave(self, row: int) -> None:
        """End the episode of a world where it is."""
        self._drop(np.array([row]))

    def decide(self, rows: Array, actions: Array) -> None:
        """Say what is to be done in worlds in which it is waited for.

        Args:
            rows: Which ``(k,)``.
            actions: Motions and completion signals ``(k, actions + 1)``.

        Raises:
            InputError: The actions have the wrong shape or are not finite.
            RuntimeError: In one of them no decision is waited for.
        """
        rows = np.asarray(rows)
        self.act(rows, split_action(checked_actions(actions, len(rows), *self.action_space.shape)))

    def act(self, rows: Array, action: Action) -> None:
        """`decide` with what a policy decides ``(k, ...)``: a programmed one may exceed an action's bounds.

        Raises:
            RuntimeError: In one of the worlds no decision is waited for.
            ClosedEnvironmentError: It is closed.
        """
        self.check_open()
        if not (self._phase[rows] == WAITING).all():
            raise RuntimeError("a decision for a world that does not wait for one: begin an episode first")
        self._learning.decide(rows, action)
        for k, row in enumerate(rows.tolist()):
            self._transitions[row].decided(action.motion[k])
        self._phase[rows] = DECIDED

    def go_on(self) -> list[Happened]:
        """Until something has happened in a world at least; nothing where all wait or are idle.

        Raises:
            BtTasksimError: A leaf has failed, an engine in another process is gone, or an engine fails in
                episode after episode.
        """
        try:
            while True:
                decided = np.flatnonzero(self._phase == DECIDED)
                if len(decided):
                    self._phase[decided] = TICKING
                    self._ticked(decided, self.batch.resume(decided))
                if self._happened:
                    found, self._happened = self._happened, []
                    return found
                fresh = self._begin(np.flatnonzero(self._phase == DRAWING))
                stepped = self._step(np.flatnonzero(self._phase == STEPPING))
                rows = np.union1d(fresh, stepped) if len(fresh) else stepped
                if len(rows):
                    self._phase[rows] = TICKING
                    self._ticked(rows, self.batch.tick(rows, self.context.times[rows]))
                elif not self._happened and not (self._phase == DRAWING).any():
                    return []
        except BaseException:
            self._drop(np.arange(self.count))
            raise

    def close(self) -> None:
        """Let go of engines; the tree can be run again."""
        if self._closed:
            return
        self._closed = True
        self._drop(np.arange(self.count))
        self._open.close()

    def check_open(self) -> None:
        """Refuse what comes after `close`.

        Raises:
            ClosedEnvironmentError: It is closed.
        """
        if self._closed:
            raise ClosedEnvironmentError(
                "the environment is closed, and its engines are gone: make a new one"
            )

    # ---- worlds -----------------------------------------------------------------------------------------

    def _begin(self, rows: Array) -> Array:
        """Draw worlds and begin in them; the rows in which that was possible."""
        if not len(rows):
            return rows
        drawn, failed = self._drawn.sample(rows)
        taken = np.array(list(drawn), int)
        self.batch.reset(taken)
        self.batch.renew(taken)
        if drawn:
            failed |= self._drawn.begin(drawn)
        for row, why in failed.items():
            if isinstance(why, NoDrawError):
                self._draw_again(row, why)
            else:
                self._none(row, why)
        self._leave()
        for row, world in drawn.items():
            self._left[row] = round(self.longest * world.control_frequency)
            self._judgement.tolerance[row] = world.tolerance
        fresh = np.array([row for row in drawn if row not in failed], int)
        self._activation[fresh], self._following[fresh] = BEFORE, False
        self._judgement.reset(fresh)
        if len(fresh):
            self._drawn.look(fresh)
        return fresh

    def _none(self, row: int, error: BtTasksimError) -> None:
        """There is no episode in a world."""
        self._phase[row] = IDLE
        draw, redrawn = int(self._drawn.seeds[row]), int(self._redrawn[row])
        self._happened.append(Happened(row, self._features[row], None, None, draw, redrawn, error))

    def _step(self, rows: Array) -> Array:
        """One control period; the worlds that have come through it."""
        if not len(rows):
            return rows
        self._left[rows] -= 1
        failed = self._drawn.step(rows)
        for row, error in failed.items():
            self._spoiled(row, error)
        if failed:
            self._leave()
            rows = rows[self._phase[rows] == STEPPING]
            if not len(rows):
                return rows
        self._drawn.look(rows)
        return rows

    def _spoiled(self, row: int, error: BtTasksimError) -> None:
        """An engine has failed in a world: its episode is discarded or, where none has begun, drawn again.

        Raises:
            BtTasksimError: It is not what was drawn in this world.
        """
        self._failed[row] += 1
        if isinstance(error, (InputError, LeafError, LostEngine)) or self._failed[row] > FAILURES:
            raise error
        if self._activation[row] == BEFORE:
            self._draw_again(row, error)
        else:
            self._end(row, SignalOutcome(False, "INVALID", outcome_of_error(error), discarded=True))

    # ---- within a tick ----------------------------------------------------------------------------------

    def _watcher(self, node: int) -> Callable[[Array, Array], Array | None]:
        def watch(rows: Array, status: Array) -> Array | None:
            return self._visited(node, rows, status)

        return watch

    def _visited(self, node: int, rows: Array, status: Array) -> Array | None:
        """A watched node has ended its tick; where the tick goes on."""
        judgement, over = self._judgement, len(self._over)
        following = self._following[rows]
        judgement.saw(node, rows, status)
        if following.any():
            for row, judged in judgement.ended(node, rows[following]).items():
                self._end(row, judged)
        if node == judgement.train:
            ended = rows[(status != RUNNING) & ~following]
            early = self._activation[ended] == BEFORE
            if early.any():  # nothing was decided
                judgement.reset(ended[early])
            for row in ended[~early].tolist():
                if self.batch.status[row, node] != SUCCESS:
                    self._end(row)
                elif judgement.follower is None:
                    self._end(row, judgement.by(node, row))
                else:
                    self._following[row] = True
        if len(self._over) == over:
            return None
        going: Array = ~np.isin(rows, self._over[over:])
        return going

    def _ticked(self, rows: Array, status: Array) -> None:
        """Ticks have ended, or stand still before a leaf that is to learn."""
        if self._over:
            on = ~np.isin(rows, self._over)
            rows, status = rows[on], status[on]
        at = self.batch.waits_at[rows]
        self._pending(rows[at >= 0])
        rows, status = rows[at < 0], status[at < 0]
        if len(rows):
            self._gone_on(rows, status)
        self._leave()

    def _gone_on(self, rows: Array, status: Array) -> None:
        """Ticks have ended, and no leaf that is to learn was about to act at their end."""
        batch, judgement = self.batch, self._judgement
        self._phase[rows] = STEPPING
        following, before = self._following[rows], self._activation[rows] == BEFORE
        ended, late = status != RUNNING, self._left[rows] <= 0
        stopped = batch.status[rows, judgement.train] != RUNNING
        if not (following | ended | late | (stopped & ~before)).any():
            return
        if following.any():
            for row, judged in judgement.unreached(rows[following]).items():
                self._end(row, judged)
            following &= self._phase[rows] == STEPPING
            for row in rows[following & ended].tolist():
                self._end(row, SignalOutcome(False, "INVALID", TREE_ENDED()))
            for row in rows[following & ~ended & late].tolist():
                self._end(row, SignalOutcome(False, "RUNNING", FOLLOWER_LATE(), discarded=True))
        acting = ~following & ~before & (self._phase[rows] == STEPPING)
        for row in rows[acting & stopped].tolist():
            self._end(row, cut=INTERRUPTED())
        for row in rows[acting & ~stopped & ended].tolist():
            self._end(row)
        for row in rows[acting & ~stopped & ~ended & late].tolist():
            self._end(row, cut=TIME_OVER(limit=self.longest))
        for row in rows[before & (ended | late)].tolist():
            self._draw_again(row)

    def _pending(self, rows: Array) -> None:
        """A leaf that is to learn is about to act in worlds ``(k,)``."""
        if not len(rows):
            return
        judgement, judged = self._judgement, self._following[rows]
        for row in rows[judged].tolist():
            self._end(row, SignalOutcome(False, "INVALID", BEGAN_ANEW(train=self.train.name)))
        rows = rows[~judged]
        first = rows[self._activation[rows] == BEFORE]
        if len(first):
            self._activation[first] = self._learning.activations(first)
            if judgement.follower is not None:
                judgement.reset(first)  # what it did in earlier rounds
        same = self._learning.activations(rows) == self._activation[rows]
        for row in rows[~same].tolist():
            self._end(row, cut=INTERRUPTED())
        rows = rows[same]
        self._phase[rows] = WAITING
        for waiting in self._learning.waiting(rows):
            self._features[waiting.rows] = waiting.features
            decided = zip(waiting.rows, waiting.decisions, waiting.features, waiting.costs, strict=True)
            for row, decision, features, cost in decided:
                self._waits(row, decision, features, cost)

    def _waits(self, row: int, decision: Decision, features: Array, cost: float) -> None:
        """A world waits for a decision: what the one before has paid."""
        transitions, paid = self._transitions.get(row), None
        if transitions is None:
            self._transitions[row] = Transitions(decision, self.reward.gamma, cost)
        else:
            paid = self.reward.pay(transitions.to(decision, cost))
        drawn, redrawn = int(self._drawn.seeds[row]), int(self._redrawn[row])
        self._happened.append(Happened(row, features, paid, None, drawn, redrawn))

    # ---- ends -------------------------------------------------------------------------------------------

    def _end(self, row: int, judged: SignalOutcome | None = None, cut: Outcome | None = None) -> None:
        """The episode of a world is over; at the end of the tick it is left."""
        transitions = self._transitions.pop(row)
        reasons = self.batch.reasons
        failed = reasons.speaker(self._judgement.train, row)
        ending = ending_of(
            cut,
            judged,
            self._learning.outcome(transitions.decision.leaf, row),
            None if failed is None else reasons.outcome_of(failed, row),
            self.reward.sufficient,
            STATUSES[int(self.batch.status[row, self._judgement.train])].name,
            float(self.context.times[row]),
        )
        if not ending.discarded:
            self._failed[row] = 0
        paid = self.reward.pay(transitions.to_end(ending.end, ending.kept))
        draw, redrawn = int(self._drawn.seeds[row]), int(self._redrawn[row])
        self._happened.append(Happened(row, self._features[row].copy(), paid, ending, draw, redrawn))
        self._phase[row] = IDLE
        self._over.append(row)

    def _draw_again(self, row: int, error: BtTasksimError | None = None) -> None:
        """The subtree was never active in a draw: it has no world, or an engine may have failed in it."""
        self._redrawn[row] += 1
        self._phase[row] = DRAWING
        self._over.append(row)
        if self._redrawn[row] < REDRAWS and not self._drawn.has_one_draw(row):
            return
        redrawn, draw = int(self._redrawn[row]), int(self._drawn.seeds[row])
        if isinstance(error, NoDrawError) and redrawn > 1:
            error = not_drawn(self.train.name, redrawn, error)
        self._none(row, error or not_reached(self.train.name, self.batch, row, redrawn, draw))

    def _leave(self) -> None:
        """End all nodes in worlds whose episode is over."""
        if self._over:
            self._clear(np.array(sorted(self._over)))
            self._over.clear()

    def _drop(self, rows: Array) -> None:
        """End the episodes of worlds ``(k,)`` where they are."""
        self._phase[rows] = IDLE
        for row in rows.tolist():
            self._transitions.pop(row, None)
        self._over = [row for row in self._over if row not in rows]
        self._happened = [event for event in self._happened if event.row not in rows]
        self._clear(rows)

    def _clear(self, rows: Array) -> None:
        active = rows[(self.batch.status[rows] != INVALID).any(axis=1) | (self.batch.waits_at[rows] >= 0)]
        self.batch.reset(active)
        if self.worlds.observation is not None:
            self.context.advance(self.worlds.observation, rows)  # what they have commanded is void
