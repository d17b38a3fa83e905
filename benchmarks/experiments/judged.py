"""Episodes judged as in training: by what follows the grasp, its own sufficient goal included."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.workers import Workers
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.policy.files import load_policy
from bt_tasksim.policy.library import find_policy
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import PROGRAMMED, Action, LearnedPolicy, Policy, ProgrammedPolicy
from bt_tasksim.scene.scene import Scene
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.training.evaluation_outcomes import wilson

STREAM = "evaluation"


@dataclass(frozen=True)
class Draw:
    """What became of one draw.

    Attributes:
        seed: Its seed.
        success: The grasp was called done, and what follows agreed.
        done: The grasp was called done.
        end: Countable kind of end, as in a training's history.
        why: One sentence.
        decisions: How often the policy was asked.
        force: The hand's force on the object at the end, N.
    """

    seed: int
    success: bool
    done: bool
    end: str
    why: str
    decisions: int
    force: float


@dataclass(frozen=True)
class Case:
    """What a worker process needs: how a tree is built, its scene, and the policy of what is under Train.

    Attributes:
        build: Builds the tree; a function that can be pickled.
        scene: The scene.
        policy: ``programmed``, or a policy's name or folder.
        noise: Noise model of the estimate.
        stage: Number of the scene's stage that worlds are drawn from; None: the scene itself.
    """

    build: Callable[[], Behaviour]
    scene: Scene
    policy: str = PROGRAMMED
    noise: str = "original"
    stage: int | None = None


def judge(
    case: Case, seeds: Sequence[int], workers: int = 1, policy: Policy | None = None, stream: str = STREAM
) -> list[Draw]:
    """One episode for each seed, in their order.

    Args:
        case: What is run.
        seeds: Seeds of the draws.
        workers: Worker processes; 1 runs in this process.
        policy: A policy of one's own instead of the case's; in this process alone.
        stream: Stream of draws.
    """
    if workers <= 1 or policy is not None:
        env = _env(case, stream)
        chosen = policy or load(case.policy)
        try:
            return [episode(env, chosen, seed) for seed in seeds]
        finally:
            env.close()
    with Workers(lambda: (_env(case, stream), load(case.policy)), workers) as pool:
        found = dict(pool.spread(_episodes, seeds))
    return [found[k] for k in range(len(seeds))]


def _episodes(kept: tuple[EpisodeEnv, Policy], seeds: Sequence[int], /) -> Iterator[tuple[int, Draw]]:
    """Some of the draws, for a worker that keeps an environment and a policy."""
    for index, seed in enumerate(seeds):
        yield index, episode(*kept, seed)


def episode(env: EpisodeEnv, policy: Policy, seed: int) -> Draw:
    """One draw; the policy makes the decisions that an action of the environment stands for."""
    import numpy as np

    try:
        env.reset(seed=seed, options={"draw": seed})
    except InputError as error:
        return Draw(seed, False, False, "never began", str(error), 0, 0.0)
    decisions, nearer = 0, 0.0
    while True:
        decision = env.decision
        assert decision is not None
        action = policy.act(decision.leaf.model, decision.seen, decision.memory)
        nearer += float(action.terminate[0])
        motion = np.asarray(action.motion, np.float64)
        _, _, terminated, truncated, info = env.act(Action(motion, np.array([nearer >= 1.0])))
        decisions += 1
        if terminated or truncated:
            hidden = env.batch.worlds.hidden()
            force = 0.0 if hidden is None else float(hidden.hand_force[0, 0])
            done = info["status"] == "SUCCESS"
            assert env.ending is not None, "it is over"
            counted = env.ending.counted_as
            return Draw(seed, bool(info["is_success"]), done, counted, info["why"], decisions, force)


def load(name: str) -> Policy:
    """A policy by name or folder, or the programmed one.

    Raises:
        InputError: There is no such policy.
    """
    if name == PROGRAMMED:
        return ProgrammedPolicy()
    folder = find_policy(name)
    network, card = load_policy(folder)
    return LearnedPolicy(network, f"{folder.resolve().name}@{card.hash}")


def learned(network: Network, name: str) -> Policy:
    """A policy that has no folder."""
    return LearnedPolicy(network, name)


def counts(draws: Iterable[Draw]) -> dict[str, Any]:
    """Successes, and how far "done" can be trusted, with Wilson's intervals; ends by kind."""
    rows = list(draws)
    done = [d for d in rows if d.done]
    wins = sum(d.success for d in rows)
    return {
        "draws": len(rows),
        "successes": wins,
        "interval": interval(wins, len(rows)),
        "done": len(done),
        "done_right": sum(d.success for d in done),
        "done_interval": interval(sum(d.success for d in done), len(done)),
        "ends": dict(Counter(d.end for d in rows if not d.success).most_common()),
        "failed_seeds": [d.seed for d in rows if not d.success],
    }


def interval(wins: int, n: int) -> list[float]:
    """Wilson's interval; none of none is anything."""
    return [round(v, 4) for v in wilson(wins, n)] if n else [0.0, 1.0]


def plain(draws: Iterable[Draw]) -> list[dict[str, Any]]:
    """As plain data."""
    return [asdict(d) for d in draws]


def _env(case: Case, stream: str) -> EpisodeEnv:
    options = EngineOptions(noise=case.noise)
    return EpisodeEnv(case.build(), case.scene, options=options, stream=stream, stage=case.stage)
