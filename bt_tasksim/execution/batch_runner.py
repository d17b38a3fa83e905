"""Episodes of one tree in many worlds at once: each world takes the next seed when its episode has ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.batch_leaves import leaf_in_batch
from bt_tasksim.concept.context import Context
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.status import STATUSES
from bt_tasksim.concept.world_context import WorldContext
from bt_tasksim.core.batch_leaf import INVALID, RUNNING
from bt_tasksim.core.closing import Closing
from bt_tasksim.core.errors import BtTasksimError, InputError, NoDrawError, NotToldApartError
from bt_tasksim.core.outcomes import FAILED, TIME_OVER, Outcome
from bt_tasksim.core.poses import Array
from bt_tasksim.core.transfer import Index
from bt_tasksim.core.world import Hidden, Observation, WorldModel
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.execution.blackboard import WorldBlackboard
from bt_tasksim.execution.clear_start import clear_draw
from bt_tasksim.execution.laws import laws_of
from bt_tasksim.execution.leaf_errors import no_status, set_up
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.result import Result
from bt_tasksim.execution.runner import LONGEST, NOT_JUDGED, QUIET, SETTLE, Runner
from bt_tasksim.execution.worlds import BatchWorlds, Unreached, hidden_of
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.moments import Moments
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.scene.success import Overlap, at_rest, evaluate_success

IDLE, TICKING, SETTLING = range(3)


@dataclass
class _Episode:
    """An episode in one of the worlds."""

    seed: int
    configuration: ActorConfiguration
    world: WorldModel
    began: float
    moments: Moments
    status: Status = Status.INVALID
    outcome: Outcome | None = None
    leaf: str = ""
    steps: int = 0
    sim_time: float = 0.0


@dataclass(frozen=True)
class BatchStep:
    """What is seen before a tick of some worlds, as a recorder gets it.

    Attributes:
        rows: Which worlds ``(k,)``.
        seeds: Seeds of their episodes ``(k,)``.
        observation: What is seen in all worlds ``(N, ...)``; it counts for ``rows`` alone.
    """

    rows: Array
    seeds: tuple[int, ...]
    observation: Observation


class BatchRunner(Closing):
    """Runs one tree in one scene, in many worlds at once; behind ``with`` it closes itself.

    What becomes of a seed does not depend on the others, nor on how many worlds or threads there are: it is
    what `Runner` makes of it.

    Args:
        build: Makes the tree.
        scene: The scene.
        options: Which engines, see `bt_tasksim.execution.worlds.why_alone`.
        worlds: How many worlds, N.
        threads: How many threads step them.
        longest: Seconds of an episode after which it is stopped.
        like: An array of the library, type and device in which concepts, observations and joints are
            computed; by default what `bt_tasksim.execution.laws.laws_of` says of the options.

    Raises:
        InputError: The tree, the scene or the options do not fit, or there are no worlds or threads.
    """

    def __init__(
        self,
        build: Callable[[], Behaviour],
        scene: WorldSource,
        options: EngineOptions | None = None,
        worlds: int = 64,
        threads: int = 1,
        longest: float = LONGEST,
        like: Array | None = None,
    ) -> None:
        if not callable(build):
            raise InputError(
                f"a BatchRunner makes a tree for each world: give it what makes one, such as your function "
                f"build, not {f'the tree {build.name!r}' if isinstance(build, Behaviour) else repr(build)}"
            )
        if worlds < 1 or threads < 1:
            raise InputError(f"a batch has one world and one thread at least, found {worlds} and {threads}")
        self.scene, self.longest, self.options = scene, longest, options or EngineOptions()
        self._build = build
        self.robot = load_robot(scene.robot)
        with WorldBlackboard() as board:
            self.tree = build()
        like = laws_of(self.options) if like is None else like
        self.worlds = BatchWorlds(self.robot, self.options, worlds, threads, like)
        self.context = Context(self.robot, worlds, like)
        self.context.ask_hidden = self.worlds.hidden
        with board:
            set_up(self.tree, context=self.context)
        self.batch = BatchTree(
            self.tree,
            worlds,
            lambda leaf: leaf_in_batch(leaf, self.context),
            build=build,
            contexts=partial(WorldContext, self.context),
        )
        self._episodes: list[_Episode | None] = [None] * worlds
        self._phase = np.full(worlds, IDLE)
        self._quiet, self._left = np.zeros(worlds, int), np.zeros(worlds, int)
        self._steps, self._longest = np.zeros(worlds, int), np.zeros(worlds, int)
        self._watches, self._looked = False, np.zeros(worlds, bool)
        self._record: Callable[[BatchStep], None] | None = None
        self.control_steps = 0
        """Control periods of all worlds so far, those included in which things come to rest."""

    @property
    def policies(self) -> dict[str, str]:
        """Policy in use by leaf."""
        leaves = (leaf for leaf in self.tree.iterate() if isinstance(leaf, ConceptNode))
        return {leaf.name: leaf.policy_in_use.name for leaf in leaves}

    def run(
        self,
        seeds: Iterable[int],
        stream: str = "evaluation",
        record: Callable[[BatchStep], None] | None = None,
    ) -> Iterator[tuple[int, Result | BtTasksimError]]:
        """One episode for each seed.

        Args:
            seeds: Seeds of the draws.
            stream: Stream of draws.
            record: Called before every tick.

        Yields:
            A seed and what became of it, in the order in which episodes end; an error where there is no
            result.

        Raises:
            InputError: The scene or the tree is no good, or these are no seeds.
        """
        if not isinstance(seeds, Iterable):
            raise InputError(f"run takes seeds, such as range(20) or [7], found {seeds!r}")
        self._record = record
        return self._run(iter(seeds), stream)

    def _run(self, waiting: Iterator[int], stream: str) -> Iterator[tuple[int, Result | BtTasksimError]]:
        try:
            yield from self._fill(waiting, stream)
            while (self._phase != IDLE).any():
                yield from self._period(waiting, stream)
        finally:
            self._phase[:] = IDLE
            self.batch.reset(np.arange(self.context.worlds))

    def close(self) -> None:
        """Let go of worlds and threads."""
        self.worlds.close()

    # ---- one control period ------------------------------------------------------------------------------

    def _period(self, waiting: Iterator[int], stream: str) -> Iterator[tuple[int, Result | BtTasksimError]]:
        """Tick, judge what has come to rest, begin anew there, and let all others go on by one period."""
        self._look()
        try:
            self._tick()
            written = self.context.written
        except BtTasksimError as error:
            yield from self._alone(error, stream)
            yield from self._fill(waiting, stream)
            return
        rested = self._rested()
        yield from self._judged(rested)
        begun: list[int] = []
        yield from self._begin(rested, waiting, stream, begun)
        on = self._phase != IDLE
        on[begun] = False
        going = np.flatnonzero(on)
        unreached: list[Unreached] = []
        if len(going):
            index = Index(going)
            tool, hand = (None if part is None else index.of(part) for part in (written.tool, written.hand))
            unreached = self.worlds.step(tool, hand, going)
            self.control_steps += len(going)
            self._steps[going] += self._phase[going] == TICKING
            self._left[going] -= 1
            yield from self._broken(going)
            on &= self._phase != IDLE
        refused = {miss.row: self.context.refusal(miss.row, miss.error) for miss in unreached}
        on[begun] = True
        self._observe(on)
        self.context.refused.update(refused)

    def _observe(self, on: Array) -> None:
        """Look at worlds ``on (N,)``, boolean, in which the next tick comes.

        Worlds that rest were looked at before, and are looked at with the others: nothing has changed there,
        and all worlds together take less than some of them, which have to be put among the others.
        """
        rows = np.flatnonzero(on)
        if not len(rows):
            return
        self._looked |= on
        observed = self.worlds.observe(self.context.rows if self._looked.all() else rows)
        self.context.advance(observed, rows)

    def _look(self) -> None:
        """Look whether goals that have to be true once are so now."""
        if not self._watches:
            return
        watched = {
            row: episode
            for row, episode in enumerate(self._episodes)
            if episode is not None and episode.moments.open
        }
        if not watched:
            return
        hidden = self.worlds.hidden(np.array(list(watched)))
        for k, episode in enumerate(watched.values()):
            episode.moments.look(_state_of(episode, hidden, k))

    def _tick(self) -> None:
        """Tick all worlds whose tree has not ended; those whose tree ends now come to rest."""
        rows = np.flatnonzero(self._phase == TICKING)
        if not len(rows):
            return
        if self._record is not None:
            seeds = tuple(episode.seed for row in rows if (episode := self._episodes[row]) is not None)
            self._record(BatchStep(rows, seeds, self.context.observation))
        status = self.batch.tick(rows, self.context.times[rows])
        if self.batch.unknown and (status == INVALID).any():
            raise no_status(self.tree)  # alone, that world says which leaf it is
        ended = (status != RUNNING) | (self._steps[rows] >= self._longest[rows])
        for k in np.flatnonzero(ended).tolist():
            row = int(rows[k])
            episode = self._episodes[row]
            assert episode is not None
            if status[k] != RUNNING:
                self._ended(row, episode, STATUSES[int(status[k])])
            else:
                self.batch.reset(np.array([row]))
                episode.outcome = TIME_OVER(limit=self.longest)
                self._settle(row, episode)

    def _ended(self, row: int, episode: _Episode, status: Status) -> None:
        episode.status = status
        if status == Status.FAILURE:
            node, outcome = self.batch.speaker(row), self.batch.outcome(row)
            episode.outcome = outcome or FAILED(text="the tree failed, and no node says why")
            episode.leaf = "" if node is None else node.name
        self._settle(row, episode)

    def _settle(self, row: int, episode: _Episode) -> None:
        episode.sim_time, episode.steps = float(self.context.times[row]), int(self._steps[row])
        self._phase[row], self._quiet[row] = SETTLING, 0
        self._left[row] = round(SETTLE * episode.configuration.control_frequency)

    def _rested(self) -> Array:
        """The worlds whose outcome is to be judged now."""
        rows = np.flatnonzero(self._phase == SETTLING)
        if not len(rows):
            return rows
        quiet = at_rest(self.worlds.hidden(rows).velocities)
        self._quiet[rows] = np.where(quiet, self._quiet[rows] + 1, 0)
        return rows[(self._quiet[rows] >= QUIET) | (self._left[rows] <= 0)]

    def _judged(self, rows: Array) -> Iterator[tuple[int, Result | BtTasksimError]]:
        """The results of worlds that have come to rest."""
        if not len(rows):
            return
        hidden = self.worlds.hidden(rows)
        for k, row in enumerate(rows.tolist()):
            episode = self._episodes[row]
            assert episode is not None
            self._phase[row], self._episodes[row] = IDLE, None
            yield episode.seed, self._result(episode, hidden, k, self.worlds.physics.deepest_pair(row))

    def _result(self, episode: _Episode, hidden: Hidden, row: int, overlap: Overlap | None) -> Result:
        drawn, status, state = episode.configuration, episode.status, _state_of(episode, hidden, row)
        verdict = evaluate_success(drawn, episode.world, state, episode.moments, overlap)
        outcome = verdict.outcome if status == Status.SUCCESS else episode.outcome
        return Result(
            status=status,
            success=status == Status.SUCCESS and verdict.success,
            outcome=outcome or NOT_JUDGED(),
            leaf=episode.leaf,
            verdict=verdict,
            seed=episode.seed,
            control_steps=episode.steps,
            sim_time=episode.sim_time,
            wall_time=time.perf_counter() - episode.began,
            policies=self.policies,
            configuration=drawn,
        )

    # ---- beginning and breaking off ---------------------------------------------------------------------

    def _fill(self, waiting: Iterator[int], stream: str) -> Iterator[tuple[int, Result | BtTasksimError]]:
        """Begin in all worlds that are idle, and look."""
        begun: list[int] = []
        yield from self._begin(np.flatnonzero(self._phase == IDLE), waiting, stream, begun)
        on = np.zeros(self.context.worlds, bool)
        on[begun] = True
        self._observe(on)

    def _begin(
        self, rows: Array, waiting: Iterator[int], stream: str, begun: list[int]
    ) -> Iterator[tuple[int, Result | BtTasksimError]]:
        """Begin the next seeds in worlds ``rows``; those that have begun are added to ``begun``."""
        free = rows.tolist()
        while free:
            wanted = [(row, seed) for row, seed in zip(free, waiting)]  # noqa: B905  # seeds may be fewer
            if not wanted:
                return
            drawn, worlds, without = self._drawn(wanted, stream)
            yield from without
            if not drawn:
                continue
            self._episodes_of(drawn, worlds)
            taken = np.array([row for row, _ in drawn])
            self._looked[taken] = False
            self.worlds.reset(taken, worlds)
            failed = self.worlds.errors(taken)
            for row, seed in drawn:
                if row in failed:
                    self._phase[row], self._episodes[row] = IDLE, None
                    yield seed, failed[row]
                else:
                    begun.append(row)
            there = {row for row, _ in drawn}
            free = [row for row, _ in wanted if row in failed or row not in there]

    def _drawn(
        self, wanted: Sequence[tuple[int, int]], stream: str
    ) -> tuple[list[tuple[int, int]], list[ActorConfiguration], list[tuple[int, BtTasksimError]]]:
        """Rows and seeds that have a world, these worlds, and the seeds that have none."""
        drawn: list[tuple[int, int]] = []
        worlds: list[ActorConfiguration] = []
        without: list[tuple[int, BtTasksimError]] = []
        for row, seed in wanted:
            try:
                worlds.append(clear_draw(self.scene, seed, stream, self.robot))
                drawn.append((row, seed))
            except NoDrawError as error:
                without.append((seed, error))
        return drawn, worlds, without

    def _episodes_of(self, drawn: Sequence[tuple[int, int]], worlds: Sequence[ActorConfiguration]) -> None:
        tips = [tip.name for tip in self.robot.tips]
        models = [world.world_model(tips, self.robot.opening) for world in worlds]
        rows = np.array([row for row, _ in drawn])
        self.batch.reset(rows)
        self.batch.renew(rows)
        self.context.begin(models, rows)
        now = time.perf_counter()
        for (row, seed), configuration, model in zip(drawn, worlds, models, strict=True):
            moments = Moments(configuration, model)
            self._episodes[row] = _Episode(seed, configuration, model, now, moments)
            self._phase[row], self._steps[row] = TICKING, 0
            self._longest[row] = round(self.longest * configuration.control_frequency)
            self._watches = self._watches or moments.open

    def _broken(self, rows: Array) -> Iterator[tuple[int, Result | BtTasksimError]]:
        """The worlds that have failed in the last step."""
        for row, error in self.worlds.errors(rows).items():
            episode = self._episodes[row]
            assert episode is not None
            self.batch.reset(np.array([row]))
            self._phase[row], self._episodes[row], self._looked[row] = IDLE, None, False
            yield episode.seed, error

    def _alone(self, error: BtTasksimError, stream: str) -> Iterator[tuple[int, Result | BtTasksimError]]:
        """A leaf has raised in one of the worlds: all that were under way are run again, one by one.

        Raises:
            InputError: It was the tree or the scene that is no good.
        """
        if isinstance(error, InputError):
            raise error
        seeds = [episode.seed for episode in self._episodes if episode is not None]
        self.batch.reset(np.arange(self.context.worlds))
        self._phase[:], self._episodes = IDLE, [None] * self.context.worlds
        with Runner(self._build, self.scene, self.options, longest=self.longest) as runner:
            for seed in seeds:
                try:
                    if self.batch.unknown:
                        runner.plant(self._build)
                    yield seed, runner.run(seed, stream)
                except (NoDrawError, NotToldApartError) as found:
                    yield seed, found
                except InputError:
                    raise
                except BtTasksimError as found:
                    yield seed, found


def _state_of(episode: _Episode, hidden: Hidden, row: int) -> Hidden:
    """The hidden state of one episode, by its row."""
    drawn = episode.configuration
    return hidden_of(hidden, row, len(drawn.objects), len(drawn.fixtures))
