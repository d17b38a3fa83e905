"""Evaluation: many episodes of one tree on seeded draws, over worker processes.

Every episode has a fresh world drawn from its seed alone, so results do not depend on the number of workers
or on the order of the episodes.
"""

from __future__ import annotations

import contextlib
import json
import math
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from py_trees.common import Status

from bt_tasksim.concept.plugins import load_all
from bt_tasksim.core.errors import BtTasksimError, InputError, LostEngine, MachineError, Terminated
from bt_tasksim.core.files import check_writable, write_text
from bt_tasksim.core.interrupts import ending, terminable
from bt_tasksim.core.outcomes import outcome_of_error
from bt_tasksim.core.plugins import loaded
from bt_tasksim.core.workers import Workers
from bt_tasksim.execution.pipelines import EngineOptions, result_names
from bt_tasksim.scene.configuration import check_seed
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, Evaluation

if TYPE_CHECKING:
    from bt_tasksim.execution.runner import Runner


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


class EvaluationFile:
    """Keeps an evaluation in a file while it is made: give it to `evaluate` as ``keep``.

    Args:
        path: Where to; what is there stays until the first episode has ended.

    Raises:
        InputError: The folder does not exist, or the path is a folder or a device.
        MachineError: It is not writable.
    """

    EVERY = 2.0
    """Seconds between two writings: what a killed evaluation loses at most."""

    def __init__(self, path: str | Path) -> None:
        check_writable(path)
        self.path = path
        self._written = -math.inf

    def __call__(self, evaluation: Evaluation, last: bool) -> None:
        """Write what there is, if it is time.

        Args:
            evaluation: What there is.
            last: There will be no more.
        """
        now = time.monotonic()
        if last or now - self._written >= self.EVERY:
            self._written = now
            # A disk that is full now may not be so at the end, when it counts.
            with contextlib.nullcontext() if last else contextlib.suppress(MachineError):
                write_text(self.path, json.dumps(evaluation.to_json(), indent=2, allow_nan=False) + "\n")


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
    workers: int = 1,
    progress: Callable[[EpisodeOutcome], None] | None = None,
    stream: str = "evaluation",
    keep: Callable[[Evaluation, bool], None] | None = None,
    stopped: Callable[[Evaluation], None] | None = None,
) -> Evaluation:
    """Run one episode for each seed.

    Args:
        job: What to run.
        seeds: Seeds of the episodes.
        workers: Worker processes; 1 runs in this process.
        progress: Called after every episode, in the order in which they end.
        stream: Stream of draws.
        keep: Called after every episode with what there is, and at the end with true, however it comes.
        stopped: Called with what there is where an error ends it after an episode.

    Returns:
        The outcomes in the order of the seeds.

    Raises:
        EvaluationInterrupted: By Ctrl-C; holds what there is.
        EvaluationTerminated: By SIGTERM or SIGHUP; likewise.
        InputError: The tree, scene, robot or engines are no good, or there are no seeds.
        LostEngine: An engine in another process has gone away.
        MachineError: A robot has failed, or a worker process ended.
    """
    if not seeds:
        raise InputError("an evaluation needs at least one episode")
    if workers < 1:
        raise InputError(f"an evaluation needs at least one worker, found {workers}")
    if workers > 1 and job.options.remote:
        raise InputError("an engine in another process serves one client at a time: evaluate with 1 worker")
    for seed in seeds:
        check_seed(seed)
    started = time.perf_counter()
    runner = _runner(job)  # errors show here, before any process starts
    engines, perception = result_names(job.options, runner.pipeline)
    found: dict[int, EpisodeOutcome] = {}

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
        )

    def ended(outcome: EpisodeOutcome) -> None:
        found[outcome.seed] = outcome
        if progress is not None:
            progress(outcome)
        if keep is not None and len(found) < len(seeds):
            keep(evaluation(), False)

    with closing(runner.pipeline):  # what serves one client at a time is free for the next one
        try:
            with terminable():
                _run_all(runner, job, seeds, workers, ended, stream)
            if keep is not None:
                keep(evaluation(), True)
        except KeyboardInterrupt as stop:
            with ending():
                if keep is not None and found:
                    keep(evaluation(), True)
            kind = EvaluationTerminated if isinstance(stop, Terminated) else EvaluationInterrupted
            raise kind(evaluation()) from stop
        except BtTasksimError:
            if found and keep is not None:
                with contextlib.suppress(BtTasksimError):  # the first error is the one to tell
                    keep(evaluation(), True)
            if found and stopped is not None:
                stopped(evaluation())
            raise
    return evaluation()


def _run_all(
    runner: Runner,
    job: Job,
    seeds: Sequence[int],
    workers: int,
    ended: Callable[[EpisodeOutcome], None],
    stream: str,
) -> None:
    """Run all episodes, in this process or in others."""
    if workers == 1:
        for seed in seeds:
            ended(episode(runner, seed, stream))
        return
    with Workers(partial(_runner, job), min(workers, len(seeds)), "spawn") as pool:
        for _, outcome in pool.each([_EpisodeTask(seed, stream) for seed in seeds]):
            ended(outcome)


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


@dataclass(frozen=True)
class _EpisodeTask:
    """One episode, for a worker that keeps a runner."""

    seed: int
    stream: str

    def run(self, runner: Runner, /) -> EpisodeOutcome:
        return episode(runner, self.seed, self.stream)


def _runner(job: Job) -> Runner:
    from bt_tasksim.execution.runner import Runner
    from bt_tasksim.trees.load import load_source

    load_all(job.plugins)
    source = load_source(job.tree, job.robot, job.scene, job.policies, job.options.own_world())
    return Runner(source.build(), source.scene, job.options)


def _name(job: Job) -> str:
    return Path(job.tree).stem if job.tree.endswith((".py", ".xml")) else job.tree


def _policies(runner: Runner) -> dict[str, str]:
    from bt_tasksim.concept.leaf import ConceptNode

    return {
        leaf.name: leaf.policy_in_use.name for leaf in runner.tree.iterate() if isinstance(leaf, ConceptNode)
    }
