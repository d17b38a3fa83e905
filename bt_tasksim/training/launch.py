"""One call to evaluate a tree."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.given import checked_policies
from bt_tasksim.execution.pipelines import EngineOptions, result_names
from bt_tasksim.execution.runner import LONGEST, Runner
from bt_tasksim.execution.session import engine_options
from bt_tasksim.execution.worlds import why_alone
from bt_tasksim.scene.configuration import check_seed
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.training.evaluation import (
    EvaluationInterrupted,
    episode,
    of_batch,
    policies_of,
    usual_batch,
)
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, Evaluation
from bt_tasksim.trees.load import with_policies

EPISODES = 20
"""Episodes, where nobody says how many."""


def evaluate(
    tree: Behaviour | Callable[[], Behaviour],
    scene: WorldSource,
    episodes: int = EPISODES,
    seed: int = 0,
    *,
    policy: Mapping[str, str] | None = None,
    progress: Callable[[EpisodeOutcome], None] | None = None,
    options: EngineOptions | None = None,
    longest: float = LONGEST,
    **engines: Any,
) -> Evaluation:
    """Run a tree in many draws of a scene, and count successes.

    Args:
        tree: What makes the tree, such as your function ``build``, and then many worlds are run at once; or
            the tree's root, and then it is one after the other. Outcomes are the same.
        scene: The scene.
        episodes: How many draws.
        seed: Seed of the first; the others follow it.
        policy: Policies by concept, as for `bt_tasksim.run`.
        progress: Called after every episode, in the order in which they end.
        options: Which engines; or name them by keyword, such as ``noise="none"``.
        longest: Seconds of an episode after which it is stopped.
        **engines: See `EngineOptions`.

    Returns:
        The outcomes in the order of the seeds; printed, it is the count and the reasons of failures.

    Raises:
        EvaluationInterrupted: By Ctrl-C; holds what there is.
        InputError: The tree, the scene, a policy or an option is no good.
        MachineError: A robot has failed, or an engine has gone away.
    """
    options = engine_options(
        options, engines, ("episodes", "seed", "policy", "progress", "options", "longest")
    )
    if episodes < 1:
        raise InputError(f"an evaluation needs at least one episode, found {episodes}")
    seeds = range(seed, seed + episodes)
    for end in (seeds[0], seeds[-1]):
        check_seed(end)
    made = with_policies(
        lambda: tree if isinstance(tree, Behaviour) else tree(), checked_policies(policy).items()
    )
    started, found = time.perf_counter(), dict[int, EpisodeOutcome]()
    with Runner(made() if isinstance(tree, Behaviour) else made, scene, options, longest=longest) as runner:
        at_once = not isinstance(tree, Behaviour) and not why_alone(options) and episodes > 1
        outcomes = _batch(made, runner, seeds) if at_once else _alone(tree, made, runner, seeds)

        def evaluation() -> Evaluation:
            names = result_names(options, runner.pipeline)
            ended = tuple(found[s] for s in seeds if s in found)
            taken = time.perf_counter() - started
            return Evaluation(
                runner.tree.name, runner.robot.name, *names, policies_of(runner), ended, taken, episodes
            )

        try:
            with closing(outcomes):
                for outcome in outcomes:
                    found[outcome.seed] = outcome
                    if progress is not None:
                        progress(outcome)
        except KeyboardInterrupt as stop:
            raise EvaluationInterrupted(evaluation()) from stop
        return evaluation()


def _batch(
    build: Callable[[], Behaviour], runner: Runner, seeds: Sequence[int]
) -> Generator[EpisodeOutcome, None, None]:
    worlds = min(usual_batch(runner.options), len(seeds))
    with BatchRunner(build, runner.scene, runner.options, worlds, longest=runner.longest) as batch:
        for seed, found in batch.run(seeds):
            yield of_batch(seed, found)


def _alone(
    tree: Any, build: Callable[[], Behaviour], runner: Runner, seeds: Sequence[int]
) -> Generator[EpisodeOutcome, None, None]:
    for seed in seeds:
        if not isinstance(tree, Behaviour):
            runner.plant(build)
        yield episode(runner, seed)
