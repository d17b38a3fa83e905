"""Evaluation: many episodes of one tree on seeded draws, over worker processes.

Every episode has a fresh world drawn from its seed alone, so results do not depend on the number of workers
or on the order of the episodes.
"""

from __future__ import annotations

import multiprocessing
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, field
from typing import Any

from py_trees.common import Status

from bt_tasksim.engines.registry import EngineOptions, result_names
from bt_tasksim.engines.ros.address import is_ros
from bt_tasksim.errors import BtTasksimError, InputError, LostEngine, MachineError
from bt_tasksim.interrupts import held_back

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Job:
    """What a worker process needs to build its own runner.

    Attributes:
        tree: Name or file of the tree.
        scene: Name or file of the scene, or None for the tree's own.
        robot: Name or file of the robot, or None for the scene's own.
        options: Which engines.
        nodes: A Python file with concepts and conditions of one's own, for an XML tree.
        policies: Concepts and the policies that their leaves take, whatever the tree itself says.
    """

    tree: str
    scene: str | None = None
    robot: str | None = None
    options: EngineOptions = field(default_factory=EngineOptions)
    nodes: str | None = None
    policies: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Outcome:
    """One episode, in short.

    Attributes:
        seed: Its seed.
        success: The tree ended SUCCESS and the physics state agrees.
        status: The tree's status.
        reason: Short reason for failure.
        why: One sentence.
        control_steps: Control periods.
        position_error: Metres, NaN where no goal says so.
        angle_error: Radians, likewise.
        penetration: Deepest overlap of two bodies, metres.
        wall_time: Seconds it took.
    """

    seed: int
    success: bool
    status: str
    reason: str
    why: str
    control_steps: int
    position_error: float
    angle_error: float
    penetration: float
    wall_time: float


@dataclass(frozen=True)
class Evaluation:
    """The outcomes of an evaluation and what they were measured with."""

    scenario: str
    robot: str
    engines: str
    perception: str
    policies: dict[str, str]
    outcomes: tuple[Outcome, ...]
    seconds: float

    @property
    def successes(self) -> int:
        """Count of successful episodes."""
        return sum(o.success for o in self.outcomes)

    def to_json(self) -> dict[str, Any]:
        """The fields of ``evaluate --json``."""
        n = len(self.outcomes)
        failures = Counter(o.reason for o in self.outcomes if not o.success)
        return {
            "scenario": self.scenario,
            "robot": self.robot,
            "engines": self.engines,
            "perception": self.perception,
            "policies": self.policies,
            "episodes": n,
            "successes": self.successes,
            "success_rate": self.successes / n,
            "confidence_interval": list(wilson(self.successes, n)),
            "failures": dict(failures.most_common()),
            "failed_seeds": [o.seed for o in self.outcomes if not o.success],
            "seconds": round(self.seconds, 3),
            "control_steps": sum(o.control_steps for o in self.outcomes),
            "outcomes": [asdict(o) for o in self.outcomes],
        }


def wilson(successes: int, n: int) -> tuple[float, float]:
    """Wilson's confidence interval (95 %) of a success rate.

    Source: E. B. Wilson, "Probable inference, the law of succession, and statistical inference", J. American
    Statistical Association 22, 1927; computed by SciPy.
    """
    from scipy.stats import binomtest

    interval = binomtest(successes, n).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def evaluate(
    job: Job,
    seeds: Sequence[int],
    workers: int = 1,
    progress: Callable[[Outcome], None] | None = None,
    stream: str = "evaluation",
) -> Evaluation:
    """Run one episode for each seed.

    Args:
        job: What to run.
        seeds: Seeds of the episodes.
        workers: Worker processes; 1 runs in this process.
        progress: Called after every episode, in the order in which they end.
        stream: Stream of draws.

    Returns:
        The outcomes in the order of the seeds.

    Raises:
        InputError: The tree, scene, robot or engines are no good, or there are no seeds.
        LostEngine: An engine in another process has gone away.
        MachineError: A robot has failed.
    """
    if not seeds:
        raise InputError("an evaluation needs at least one episode")
    if workers < 1:
        raise InputError(f"an evaluation needs at least one worker, found {workers}")
    if workers > 1 and job.options.remote:
        raise InputError("an engine in another process serves one client at a time: evaluate with 1 worker")
    started = time.perf_counter()
    runner = _runner(job)  # errors show here, before any process starts
    with closing(runner.pipeline):  # what serves one client at a time is free for the next one
        found = _outcomes(runner, job, seeds, workers, progress, stream)
    engines, perception = result_names(job.options, runner.pipeline)
    return Evaluation(
        scenario=_name(job),
        robot=runner.robot.name,
        engines=engines,
        perception=perception,
        policies=_policies(runner),
        outcomes=tuple(found[s] for s in seeds),
        seconds=time.perf_counter() - started,
    )


def _outcomes(
    runner: Any,
    job: Job,
    seeds: Sequence[int],
    workers: int,
    progress: Callable[[Outcome], None] | None,
    stream: str,
) -> dict[int, Outcome]:
    """Outcomes by seed."""
    found: dict[int, Outcome] = {}
    if workers == 1:
        for seed in seeds:
            found[seed] = episode(runner, seed, stream)
            if progress is not None:
                progress(found[seed])
    else:
        with _one_thread_each(), held_back(spawning=True):
            pool = multiprocessing.get_context("spawn").Pool(
                min(workers, len(seeds)), initializer=_start, initargs=(job, stream)
            )
        with pool:
            for outcome in pool.imap_unordered(_work, seeds):
                found[outcome.seed] = outcome
                if progress is not None:
                    progress(outcome)
    return found


def episode(runner: Any, seed: int, stream: str = "evaluation") -> Outcome:
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
        if isinstance(error, MachineError) and (
            isinstance(error, LostEngine) or is_ros(runner.options.engines)
        ):
            raise  # an engine that is not there any more, or a robot, says nothing about the tree
        return Outcome(
            seed, False, Status.INVALID.name, type(error).__name__, str(error), 0, nan, nan, nan,
            time.perf_counter() - started,
        )  # fmt: skip
    v = result.verdict
    return Outcome(
        seed=seed,
        success=result.success,
        status=result.status.name,
        reason=result.reason,
        why=result.why,
        control_steps=result.control_steps,
        position_error=nan if v is None else v.position_error,
        angle_error=nan if v is None else v.angle_error,
        penetration=nan if v is None else v.penetration,
        wall_time=result.wall_time,
    )


_worker: dict[str, Any] = {}
"""A worker process's own runner; this process never fills it."""


def _start(job: Job, stream: str) -> None:
    _worker["runner"], _worker["stream"] = _runner(job), stream


def _work(seed: int) -> Outcome:
    return episode(_worker["runner"], seed, _worker["stream"])


def _runner(job: Job) -> Any:
    from bt_tasksim.runner import Runner
    from trees.load import load_source

    source = load_source(job.tree, job.robot, job.scene, job.nodes, job.policies)
    return Runner(source.build(), source.scene, job.options)


def _name(job: Job) -> str:
    from pathlib import Path

    return Path(job.tree).stem if job.tree.endswith((".py", ".xml")) else job.tree


def _policies(runner: Any) -> dict[str, str]:
    from bt_tasksim.concept import ConceptNode

    return {
        leaf.name: leaf.policy_in_use.name for leaf in runner.tree.iterate() if isinstance(leaf, ConceptNode)
    }


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Worker processes inherit one thread for linear algebra: they are the parallelism."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
