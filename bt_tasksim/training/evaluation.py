"""Evaluation: many episodes of one tree on seeded draws, over worker processes.

Every episode has a fresh world drawn from its seed alone, so results do not depend on the number of workers
or on the order of the episodes.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from py_trees.common import Status

from bt_tasksim.concept.batch_leaves import leaf_in_batch
from bt_tasksim.concept.plugins import load_all
from bt_tasksim.core.closing import Closing
from bt_tasksim.core.cluster import Cluster
from bt_tasksim.core.cluster_process import LOCAL
from bt_tasksim.core.errors import (
    BtTasksimError,
    InputError,
    LostEngine,
    MachineError,
    NoDrawError,
    NotToldApartError,
    Terminated,
)
from bt_tasksim.core.fleet import Fleet, Here
from bt_tasksim.core.identity import differing, identity
from bt_tasksim.core.interrupts import ending, terminable
from bt_tasksim.core.outcomes import outcome_of_error
from bt_tasksim.core.plugins import loaded
from bt_tasksim.core.workers import Workers
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.given import checked_longest
from bt_tasksim.execution.pipelines import EngineOptions, result_names
from bt_tasksim.execution.result import Result
from bt_tasksim.execution.runner import LONGEST, Runner
from bt_tasksim.execution.worlds import check_memory, most_processes, most_worlds, why_alone
from bt_tasksim.scene.configuration import check_seed
from bt_tasksim.training.evaluation_file import EvaluationFile, KeptEvaluation
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, Evaluation
from bt_tasksim.training.on_cluster import actor_memory, check_cluster

SHARE = 16
"""Episodes that a member of a fleet takes at a time; a lost one loses the one that it was at."""
BATCH = 64
"""Worlds that run at once, unless somebody says otherwise."""
MANY = 200
"""Episodes from which a process for each core is sooner done, though it takes some seconds to begin."""
SHARES = 8
"""Episodes for each world of a batch that a member takes at a time: at a share's end its worlds run empty."""


@dataclass(frozen=True)
class Job:
    """What a worker process needs to build its own runner.

    Attributes:
        tree: Name or file of the tree.
        scene: Name or file of the scene, or None for the tree's own.
        robot: Name or file of the robot, or None for the scene's own.
        options: Which engines.
        policies: Concepts and the policies that their leaves take, whatever the tree itself says.
        plugins: Plugins that the process loads first, by default those of this process.
        batch: How many worlds are run at once in each process, by default `usual_batch`. Outcomes do not
            depend on it.
        threads: How many threads step them.
        longest: Seconds of an episode after which it is stopped; kept as a float.

    Raises:
        InputError: The longest time is no positive number, there is no world or thread, or these engines have
            no worlds in batches.
    """

    tree: str
    scene: str | None = None
    robot: str | None = None
    options: EngineOptions = field(default_factory=EngineOptions)
    policies: tuple[tuple[str, str], ...] = ()
    plugins: tuple[str, ...] = field(default_factory=loaded)
    batch: int | None = None
    threads: int = 1
    longest: float = LONGEST

    def __post_init__(self) -> None:
        object.__setattr__(self, "longest", checked_longest(self.longest))
        batch = 1 if self.batch is None else self.batch
        if self.batch == 1 and self.options.laws == "torch":
            raise InputError("--laws torch is for batches of worlds: give a --batch of 2 or more, or none")
        if batch < 1 or self.threads < 1:
            raise InputError(f"a batch has one world and one thread at least, found {batch}, {self.threads}")
        if batch > 1 and (alone := why_alone(self.options)):
            raise InputError(f"these episodes cannot be run in a batch: {alone}")


def usual_batch(options: EngineOptions, processes: int = 1) -> int:
    """How many worlds a process runs at once where nobody says it: what there is room for, and no more.

    Args:
        options: The engines; those that have no worlds in batches run one.
        processes: How many such processes there are on this machine.
    """
    begun = processes if processes > 1 else 0
    return 1 if why_alone(options) else max(1, min(BATCH, most_worlds(begun) // processes))


def usual_workers(options: EngineOptions, episodes: int, batch: int | None = None) -> int:
    """How many processes run an evaluation where nobody says it: more than one where that pays.

    Worlds on a device of their own (a GPU) are one process's.

    Args:
        options: The engines.
        episodes: How many episodes there are.
        batch: How many worlds each runs at once; None: as many as is usual.
    """
    if episodes < MANY or options.device != "cpu" or why_alone(options):
        return 1
    return min(os.cpu_count() or 1, most_processes(batch or BATCH))


class EvaluationInterrupted(KeyboardInterrupt):  # as KeyboardInterrupt, which it is
    """An evaluation was interrupted.

    Args:
        evaluation: The episodes that had ended.
    """

    def __init__(self, evaluation: Evaluation) -> None:
        super().__init__(f"{len(evaluation.outcomes)} of {evaluation.asked} episodes had ended")
        self.evaluation = evaluation


class EvaluationTerminated(EvaluationInterrupted, Terminated):
    """An evaluation was ended by SIGTERM or SIGHUP."""


def evaluate(
    job: Job,
    seeds: Sequence[int],
    workers: int | None = None,
    progress: Callable[[EpisodeOutcome], None] | None = None,
    stream: str = "evaluation",
    keep: EvaluationFile | None = None,
    stopped: Callable[[Evaluation], None] | None = None,
    kept: KeptEvaluation | None = None,
    cluster: str | None = None,
) -> Evaluation:
    """Run one episode for each seed.

    Args:
        job: What to run.
        seeds: Seeds of the episodes.
        workers: Worker processes; 1 runs in this process, and so does None. Of a cluster: the most actors;
            None for as many as it has room for.
        progress: Called after every episode, in the order in which they end; first for those that are kept.
        stream: Stream of draws.
        keep: Keeps every episode as it ends, and all of them at the end, however it comes.
        stopped: Called with what there is where an error ends it after an episode.
        kept: Go on from this: its episodes are not run again.
        cluster: Address of a Ray cluster, or ``local`` for one of this machine, see
            `bt_tasksim.core.cluster`.

    Returns:
        The outcomes in the order of the seeds.

    Raises:
        EvaluationInterrupted: By Ctrl-C; holds what there is.
        EvaluationTerminated: By SIGTERM or SIGHUP; likewise.
        InputError: The tree, scene, robot or engines are no good, or there are no seeds, or what is kept is
            of something else, or the cluster is of another version.
        NoDrawError: No world can be drawn with any of the seeds; where some have one, the others count as
            episodes without success.
        LostEngine: An engine in another process has gone away.
        MachineError: A robot has failed, a worker process ended, or the cluster does not answer.
    """
    if not seeds:
        raise InputError("an evaluation needs at least one episode")
    if workers is not None and workers < 1:
        raise InputError(f"an evaluation needs at least one worker, found {workers}")
    if workers is not None and workers > 1 and job.options.remote:
        raise InputError("an engine in another process serves one client at a time: evaluate with 1 worker")
    if cluster is not None:
        check_cluster(cluster, job.options)
    for seed in seeds:
        check_seed(seed)
    started = time.perf_counter() - (kept.seconds if kept is not None else 0.0)
    versions = identity()  # before anybody edits a file
    batch = usual_batch(job.options, 1 if cluster else workers or 1) if job.batch is None else job.batch
    job = replace(job, batch=batch)
    pictures = job.options.rendering or job.options.perception != "state"
    if cluster is None:
        processes = min(workers or 1, len(seeds))
        check_memory(batch * processes, processes if processes > 1 else 0, pictures)
    elif cluster == LOCAL:
        check_memory(batch, 1, pictures)
    player = Player(job)  # errors show here, before any process starts
    runner = player.runner
    with player:
        engines, perception = result_names(job.options, runner.pipeline)
        subject = _subject(job, runner, stream)
        if kept is not None:
            kept.check(subject, seeds)
        found = {outcome.seed: outcome for outcome in kept.outcomes} if kept is not None else {}
        todo = [seed for seed in dict.fromkeys(seeds) if seed not in found]

        def evaluation() -> Evaluation:
            return Evaluation(
                scenario=_name(job),
                robot=runner.robot.name,
                engines=engines,
                perception=perception,
                policies=policies_of(runner),
                outcomes=tuple(found[s] for s in seeds if s in found),
                seconds=time.perf_counter() - started,
                asked=len(seeds),
                subject=subject,
                versions=versions,
            )

        def ended(outcome: EpisodeOutcome) -> None:
            found[outcome.seed] = outcome
            if progress is not None:
                progress(outcome)
            if keep is not None and len(found) < len(seeds):
                keep.add(outcome, time.perf_counter() - started, evaluation)

        try:
            if progress is not None:
                for outcome in found.values():
                    progress(outcome)
            with terminable():
                if todo:
                    with _fleet(job, batch, player, subject, workers, cluster, len(todo)) as fleet:
                        share = max(SHARE, SHARES * batch)
                        for _, outcome in fleet.spread(partial(play, stream=stream), todo, share):
                            ended(outcome)
            if len(evaluation().undrawn) == len(found):
                raise NoDrawError(next(iter(found.values())).outcome.sentence)
            if keep is not None:
                keep.end(evaluation())
        except KeyboardInterrupt as stop:
            with ending():
                if keep is not None and found:
                    keep.end(evaluation())
            kind = EvaluationTerminated if isinstance(stop, Terminated) else EvaluationInterrupted
            raise kind(evaluation()) from stop
        except BtTasksimError:
            if found and keep is not None:
                with contextlib.suppress(BtTasksimError):  # the first error is the one to tell
                    keep.end(evaluation())
            if found and stopped is not None:
                stopped(evaluation())
            raise
        return evaluation()


def _fleet(
    job: Job,
    batch: int,
    player: Player,
    subject: dict[str, str],
    workers: int | None,
    cluster: str | None,
    most: int,
) -> Fleet[Player]:
    """What runs the episodes, of which there are so many."""
    make = partial(_same_player, job, subject)
    count = None if workers is None else min(workers, most)
    if cluster is not None:
        drawn = player.runner.pipeline.rendering is not None
        return Cluster(make, cluster, count, actor_memory(batch, drawn))
    if count in (None, 1):
        return Here(player)
    return Workers(make, count, "spawn")


def _same_player(job: Job, subject: dict[str, str]) -> Player:
    """A player of its own for a member of a fleet, whose files may be others than those of this machine."""
    player = Player(job)
    stream = subject["stream of draws"]
    found = _subject(job, player.runner, stream)
    if others := differing(subject, found):
        raise InputError(f"another {others} is found there: have the same files there")
    return player


class Player(Closing):
    """Plays the episodes of an evaluation: what each member of a fleet keeps.

    Args:
        job: What to run.

    Attributes:
        runner: Runs one world, and knows scene, robot and policies.

    Raises:
        InputError: The tree, scene, robot or engines are no good.
    """

    def __init__(self, job: Job) -> None:
        from bt_tasksim.trees.load import load_source

        load_all(job.plugins)
        source = load_source(job.tree, job.robot, job.scene, job.policies, job.options.own_world())
        self._job, self._build = job, source.build
        self.runner = Runner(source.build, source.scene, job.options, longest=job.longest)
        self._batch: BatchRunner | None = None
        context = self.runner.context
        tree = BatchTree(self.runner.tree, 1, lambda leaf: leaf_in_batch(leaf, context))
        self._remembers = bool(tree.unknown)  # such a node may: each episode has a new one

    def close(self) -> None:
        """Let go of the engines: what serves one client at a time is free for the next one."""
        self.runner.close()
        if self._batch is not None:
            self._batch.close()

    def play(self, seeds: Sequence[int], stream: str) -> Iterator[tuple[int, EpisodeOutcome]]:
        """One episode for each seed, in batches where there can be.

        Args:
            seeds: Seeds of the episodes.
            stream: Stream of draws.

        Yields:
            Index and outcome of each episode as it ends, whatever the order.

        Raises:
            InputError: Tree or scene are no good.
            LostEngine: An engine in another process has gone away.
            MachineError: A robot has failed.
        """
        batch = usual_batch(self._job.options) if self._job.batch is None else self._job.batch
        if batch == 1:
            for index, seed in enumerate(seeds):
                if self._remembers:
                    self.runner.plant(self._build)
                yield index, episode(self.runner, seed, stream)
            return
        if self._batch is None:
            job, scene = self._job, self.runner.scene
            worlds = min(batch, len(seeds))
            self._batch = BatchRunner(self._build, scene, job.options, worlds, job.threads, job.longest)
        index_of = {seed: index for index, seed in enumerate(seeds)}
        for seed, found in self._batch.run(seeds, stream):
            yield index_of[seed], of_batch(seed, found)


def play(player: Player, seeds: Sequence[int], stream: str) -> Iterator[tuple[int, EpisodeOutcome]]:
    """A share of an evaluation, see `Player.play`; every member of a fleet does this."""
    return player.play(seeds, stream)


def episode(runner: Runner, seed: int, stream: str = "evaluation") -> EpisodeOutcome:
    """One episode; an error in it is a failure with the error as its reason.

    So is a world that cannot be drawn with this seed, or whose objects perception cannot tell apart.

    Raises:
        InputError: Tree or scene are no good.
        LostEngine: An engine in another process has gone away.
        MachineError: A robot has failed.
    """
    started = time.perf_counter()
    try:
        return in_short(runner.run(seed, stream))
    except (NoDrawError, NotToldApartError) as error:
        return unfinished(seed, error, time.perf_counter() - started)
    except InputError:
        raise
    except BtTasksimError as error:
        if isinstance(error, MachineError) and (isinstance(error, LostEngine) or runner.options.real):
            raise  # an engine that is not there any more, or a robot, says nothing about the tree
        return unfinished(seed, error, time.perf_counter() - started)


def of_batch(seed: int, found: Result | BtTasksimError) -> EpisodeOutcome:
    """One episode of a batch; errors count as those in `episode`.

    Raises:
        InputError: Tree or scene are no good.
    """
    if isinstance(found, InputError) and not isinstance(found, NoDrawError | NotToldApartError):
        raise found
    return unfinished(seed, found, 0.0) if isinstance(found, BtTasksimError) else in_short(found)


def unfinished(seed: int, error: BtTasksimError, seconds: float) -> EpisodeOutcome:
    """An episode that an error has ended, after so many seconds."""
    nan = float("nan")
    outcome = outcome_of_error(error)
    return EpisodeOutcome(seed, False, Status.INVALID.name, "", outcome, 0, nan, nan, nan, seconds)


def in_short(result: Result) -> EpisodeOutcome:
    """A result, in short."""
    v, nan = result.verdict, float("nan")
    return EpisodeOutcome(
        seed=result.seed,
        success=result.success,
        status=result.status.name,
        leaf=result.leaf,
        outcome=result.outcome,
        control_steps=result.control_steps,
        position_error=nan if v is None else v.position_error,
        angle_error=nan if v is None else v.angle_error,
        penetration=nan if v is None else v.penetration,
        wall_time=result.wall_time,
        judged=result.judged,
        placements=() if v is None else tuple(placement.to_data() for placement in v.placements),
    )


def _subject(job: Job, runner: Runner, stream: str) -> dict[str, str]:
    from bt_tasksim.training.subject import evaluation_subject, own_code

    code = own_code(runner.tree, job.tree, job.plugins, runner.scene)
    subject = evaluation_subject(runner.tree, runner.scene, job.options, policies_of(runner), code, stream)
    if job.longest != LONGEST:  # earlier files say nothing of it
        subject["longest time of an episode"] = f"{_number(job.longest)} s"
    return subject


def _number(value: float) -> str:
    """A number as earlier files have it, where six digits say all of it; else with all its digits."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def _name(job: Job) -> str:
    return Path(job.tree).stem if job.tree.endswith((".py", ".xml")) else job.tree


def policies_of(runner: Runner) -> dict[str, str]:
    """Policy in use by leaf."""
    from bt_tasksim.concept.leaf import ConceptNode

    return {
        leaf.name: leaf.policy_in_use.name for leaf in runner.tree.iterate() if isinstance(leaf, ConceptNode)
    }
