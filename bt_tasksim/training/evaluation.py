"""Evaluation: many episodes of one tree on seeded draws, over worker processes.

Every episode has a fresh world drawn from its seed alone, so results do not depend on the number of workers
or on the order of the episodes.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from py_trees.common import Status

from bt_tasksim.concept.plugins import load_all
from bt_tasksim.core.cluster import Cluster, check_address
from bt_tasksim.core.errors import BtTasksimError, InputError, LostEngine, MachineError, Terminated
from bt_tasksim.core.fleet import Fleet, Here
from bt_tasksim.core.identity import identity
from bt_tasksim.core.interrupts import ending, terminable
from bt_tasksim.core.outcomes import outcome_of_error
from bt_tasksim.core.plugins import load_plugin, loaded
from bt_tasksim.core.workers import Workers
from bt_tasksim.execution.pipelines import EngineOptions, result_names
from bt_tasksim.scene.configuration import check_seed
from bt_tasksim.training.evaluation_file import EvaluationFile, KeptEvaluation
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, Evaluation

if TYPE_CHECKING:
    from bt_tasksim.execution.runner import Runner


SHARE = 16
"""Episodes that a member of a fleet takes at a time; a lost one loses the one that it was at."""
MEMORY = 500_000_000
"""Bytes that are reserved for an actor of a cluster; 350 MB were measured."""
MEMORY_WITH_PICTURES = 900_000_000
"""The same where pictures are drawn; 680 MB were measured."""


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
    """

    tree: str
    scene: str | None = None
    robot: str | None = None
    options: EngineOptions = field(default_factory=EngineOptions)
    policies: tuple[tuple[str, str], ...] = ()
    plugins: tuple[str, ...] = field(default_factory=loaded)


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
        if job.options.remote:
            raise InputError("an engine in another process serves one client at a time: leave --cluster away")
        check_address(cluster)
    for seed in seeds:
        check_seed(seed)
    started = time.perf_counter() - (kept.seconds if kept is not None else 0.0)
    versions = identity()  # before anybody edits a file
    runner = _runner(job)  # errors show here, before any process starts
    with closing(runner.pipeline):  # what serves one client at a time is free for the next one
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
                policies=_policies(runner),
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
                    with _fleet(job, runner, subject, workers, cluster, len(todo)) as fleet:
                        for _, outcome in fleet.spread(partial(episodes, stream=stream), todo, SHARE):
                            ended(outcome)
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
    job: Job, runner: Runner, subject: dict[str, str], workers: int | None, cluster: str | None, most: int
) -> Fleet[Runner]:
    """What runs the episodes, of which there are so many."""
    make = partial(_same_runner, job, subject)
    count = None if workers is None else min(workers, most)
    if cluster is not None:
        drawn = runner.pipeline.rendering is not None
        return Cluster(make, cluster, count, MEMORY_WITH_PICTURES if drawn else MEMORY)
    if count in (None, 1):
        return Here(runner)
    return Workers(make, count, "spawn")


def _same_runner(job: Job, subject: dict[str, str]) -> Runner:
    """A runner of its own for a member of a fleet, whose files may be others than those of this machine."""
    runner = _runner(job)
    stream = subject["stream of draws"]
    found = _subject(job, runner, stream)
    if others := [name for name in subject if found[name] != subject[name]]:
        raise InputError(f"another {' and another '.join(others)} is found there: have the same files there")
    return runner


def episodes(
    runner: Runner, seeds: Sequence[int], stream: str = "evaluation"
) -> Iterator[tuple[int, EpisodeOutcome]]:
    """Run a share of an evaluation; every member of a fleet does this.

    Args:
        runner: The runner.
        seeds: Seeds of the episodes.
        stream: Stream of draws.

    Yields:
        Index and outcome of each episode as it ends, whatever the order.

    Raises:
        InputError: See `episode`, as for the others.
        LostEngine: An engine in another process has gone away.
        MachineError: A robot has failed.
    """
    for index, seed in enumerate(seeds):
        yield index, episode(runner, seed, stream)


def episode(runner: Runner, seed: int, stream: str = "evaluation") -> EpisodeOutcome:
    """One episode; an error in it is a failure with the error as its reason.

    Raises:
        InputError: Tree or scene are no good.
        LostEngine: An engine in another process has gone away.
        MachineError: A robot has failed.
    """
    started = time.perf_counter()
    nan = float("nan")
    try:
        result = runner.run(seed, stream)
    except InputError:
        raise
    except BtTasksimError as error:
        if isinstance(error, MachineError) and (isinstance(error, LostEngine) or runner.options.real):
            raise  # an engine that is not there any more, or a robot, says nothing about the tree
        return EpisodeOutcome(
            seed, False, Status.INVALID.name, "", outcome_of_error(error), 0, nan, nan, nan,
            time.perf_counter() - started,
        )  # fmt: skip
    v = result.verdict
    return EpisodeOutcome(
        seed=seed,
        success=result.success,
        status=result.status.name,
        leaf=result.leaf,
        outcome=result.outcome,
        control_steps=result.control_steps,
        position_error=nan if v is None else v.position_error,
        angle_error=nan if v is None else v.angle_error,
        penetration=nan if v is None else v.penetration,
        wall_time=result.wall_time,
    )


def _runner(job: Job) -> Runner:
    from bt_tasksim.execution.runner import Runner
    from bt_tasksim.trees.load import load_source

    load_all(job.plugins)
    source = load_source(job.tree, job.robot, job.scene, job.policies, job.options.own_world())
    return Runner(source.build(), source.scene, job.options)


def _subject(job: Job, runner: Runner, stream: str) -> dict[str, str]:
    from bt_tasksim.training.subject import evaluation_subject

    files = {plugin: getattr(load_plugin(plugin), "__file__", None) for plugin in job.plugins}
    code = {f"plugin {Path(plugin).name}": file for plugin, file in files.items() if file is not None}
    if job.tree.endswith(".py"):
        code["tree"] = job.tree
    return evaluation_subject(runner.tree, runner.scene, job.options, _policies(runner), code, stream)


def _name(job: Job) -> str:
    return Path(job.tree).stem if job.tree.endswith((".py", ".xml")) else job.tree


def _policies(runner: Runner) -> dict[str, str]:
    from bt_tasksim.concept.leaf import ConceptNode

    return {
        leaf.name: leaf.policy_in_use.name for leaf in runner.tree.iterate() if isinstance(leaf, ConceptNode)
    }
