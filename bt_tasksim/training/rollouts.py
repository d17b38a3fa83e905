"""Episodes collected over worker processes, the same whatever their number.

A rollout is a fixed number of environments. Each runs its own episodes for a fixed number of decisions, with
its own seeds, in whichever worker is free: so the number of workers changes the time and nothing else.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

import numpy as np

from bt_tasksim.core.errors import BtTasksimError, InputError, MachineError
from bt_tasksim.core.interrupts import held_back
from bt_tasksim.core.poses import Array
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import split_action

EnvMaker = Callable[[], Any]
"""Builds an environment in a worker process."""


@dataclass(frozen=True)
class EnvironmentRollout:
    """What one environment brought back; ``n`` decisions.

    Attributes:
        features: ``(n, n_features)`` as the concept gave them.
        actions: ``(n, n_actions)`` as drawn, before they were cut off.
        rewards: ``(n,)``.
        starts: ``(n,)`` boolean, the decision is the first one of its episode.
        cut: Features ``(k, n_features)`` after decisions ``cut_at (k,)`` at which an episode was truncated.
        cut_at: See ``cut``; the environment's last decision is among them unless its episode ended there.
        ends: For each episode that ended: success, decisions, return and reason.
        redrawn: Draws in which the subtree was never active.
    """

    features: Array
    actions: Array
    rewards: Array
    starts: Array
    cut: Array
    cut_at: Array
    ends: list[tuple[bool, int, float, str]]
    redrawn: int


@dataclass(frozen=True)
class RolloutTask:
    """What a worker is to do: an environment of a rollout, or the evaluation of one draw."""

    kind: str
    network: dict[str, Array]
    std: Array
    seed: tuple[int, ...]
    decisions: int
    stage: int | None
    draw: int = 0


def collect(env: Any, task: RolloutTask) -> EnvironmentRollout:
    """One environment: episodes until there are enough decisions."""
    network = Network.from_arrays(task.network)
    env.stage = task.stage
    rng = np.random.default_rng(task.seed)
    noise = rng.standard_normal((task.decisions, network.outputs)).astype(np.float32) * task.std
    draws = rng.integers(2**31, size=task.decisions + 1).tolist()
    before = env.redrawn
    features, info = env.reset(seed=draws[0])
    rows, actions, rewards, starts, ends = [], [], [], [True], []
    cut, cut_at = [], []
    total, length, episode = 0.0, 0, 0
    for k in range(task.decisions):
        action = network(features) + noise[k]
        rows.append(features)
        actions.append(action)
        features, reward, terminated, truncated, info = env.step(np.minimum(np.maximum(action, -1.0), 1.0))
        rewards.append(reward)
        total, length = total + reward, length + 1
        over = terminated or truncated
        if truncated or (k == task.decisions - 1 and not over):
            cut.append(features)
            cut_at.append(k)
        if over:
            ends.append((bool(info["is_success"]), length, total, _kind(info)))
            total, length, episode = 0.0, 0, episode + 1
            if k < task.decisions - 1:
                features, info = env.reset(seed=draws[episode])
        starts.append(over)
    return EnvironmentRollout(
        features=np.array(rows, np.float32),
        actions=np.array(actions, np.float32),
        rewards=np.array(rewards, np.float32),
        starts=np.array(starts[:-1]),
        cut=np.array(cut, np.float32).reshape(len(cut), network.inputs),
        cut_at=np.array(cut_at, np.int64),
        ends=ends,
        redrawn=env.redrawn - before,
    )


def judge_draw(env: Any, task: RolloutTask) -> tuple[int, bool, str]:
    """One held-apart draw with the policy's own decisions: its seed, whether it succeeded, and the reason."""
    network = Network.from_arrays(task.network)
    env.stage = None
    stream, env.stream = env.stream, "validation"
    try:
        features, info = env.reset(seed=task.draw, options={"draw": task.draw})
        nearer = 0.0
        while True:
            motion, done = split_action(network(features), network.signal_std)
            nearer += float(done)
            action = np.append(motion, 1.0 if nearer >= 1.0 else -1.0)
            features, _, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                return task.draw, bool(info["is_success"]), _kind(info)
    except InputError as error:
        return task.draw, False, str(error)
    finally:
        env.stream = stream


def _kind(info: dict[str, Any]) -> str:
    """A countable reason for the end of an episode."""
    if info["is_success"]:
        return "success"
    if info["discarded"]:
        return "discarded"
    part = next((p for p in ("violated", "timeout") if info["reward"][p] != 0.0), "")
    return part or ("follower failed" if info["status"] == "SUCCESS" else "failed")


class Workers:
    """Worker processes that each keep one environment.

    They are forked, so the environment's maker may hold a tree; a worker ends when its parent is gone.

    Args:
        make: Builds the environment.
        count: How many.
    """

    def __init__(self, make: EnvMaker, count: int) -> None:
        context = multiprocessing.get_context("fork")
        self._pipes: list[Connection] = []
        self._processes: list[Any] = []
        for _ in range(count):
            mine, theirs = context.Pipe()
            process = context.Process(target=_work, args=(make, theirs, [*self._pipes, mine]), daemon=True)
            with held_back():
                process.start()
            theirs.close()
            self._pipes.append(mine)
            self._processes.append(process)

    def each(self, tasks: Sequence[RolloutTask]) -> Iterator[tuple[int, Any]]:
        """The tasks' numbers and results, in the order in which they are done.

        Raises:
            BtTasksimError: A worker found an error.
            MachineError: A worker ended.
        """
        waiting = list(enumerate(tasks))[::-1]
        busy: dict[Connection, int] = {}
        idle = list(self._pipes)
        try:
            while waiting or busy:
                while waiting and idle:
                    pipe = idle.pop()
                    number, task = waiting.pop()
                    pipe.send(task)
                    busy[pipe] = number
                for ready in wait(list(busy)):
                    assert isinstance(ready, Connection)
                    kind, result = ready.recv()
                    if kind == "error":
                        raise result
                    idle.append(ready)
                    yield busy.pop(ready), result
        except (EOFError, ConnectionError, BrokenPipeError) as error:
            raise MachineError("a worker process ended; is there enough memory?") from error

    def close(self) -> None:
        """End the workers."""
        for pipe in self._pipes:
            with contextlib.suppress(OSError):
                pipe.close()
        for process in self._processes:
            process.join(timeout=2.0)
            if process.is_alive():
                process.kill()
                process.join()


def _work(make: EnvMaker, pipe: Connection, others: list[Connection]) -> None:
    os.environ["OMP_NUM_THREADS"] = "1"
    for other in others:
        other.close()
    parent, env = os.getppid(), None
    while os.getppid() == parent:
        try:
            if not pipe.poll(1.0):
                continue
            task = pipe.recv()
        except (EOFError, OSError):
            break
        try:
            if env is None:
                env = make()
            pipe.send(("done", collect(env, task) if task.kind == "environment" else judge_draw(env, task)))
        except BtTasksimError as error:
            own = InputError if isinstance(error, InputError) else MachineError
            pipe.send(("error", own(str(error))))
        except BrokenPipeError:
            break
        except Exception as error:
            pipe.send(("error", MachineError(f"{error!r}: {traceback.format_exc(limit=-3)}")))
    os._exit(0)
