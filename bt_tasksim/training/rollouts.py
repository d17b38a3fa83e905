"""Episodes collected in batches of worlds, the same whatever their size and the number of processes.

A rollout is a fixed number of environments. Each runs its own episodes for a fixed number of decisions, with
its own seeds, in a world of its own beside others: so what it comes to does not depend on these.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core.fleet import Fleet
from bt_tasksim.core.poses import Array
from bt_tasksim.policy.network import Network
from bt_tasksim.training.collectors import Collector, DrawTask, RolloutTask
from bt_tasksim.training.episode_batch import Draws, EpisodeBatch

AnyTask = RolloutTask | DrawTask


@dataclass(frozen=True)
class TaskShare:
    """What a process does side by side.

    Attributes:
        tasks: The tasks.
    """

    tasks: Sequence[AnyTask]

    def __str__(self) -> str:
        return f"a share of {len(self.tasks)} environments or draws"


def in_batch(batch: EpisodeBatch, tasks: Sequence[AnyTask], /) -> Iterator[tuple[int, Any]]:
    """Do tasks in the worlds of a batch: each world takes the next one when it has done one.

    Yields:
        The index of a task and its result, as they are done; these depend on nothing but the task.
    """
    waiting = iter(enumerate(tasks))
    collectors: dict[int, tuple[int, Collector[Any]]] = {}
    networks: dict[int, Network] = {}  # by the identity of their arrays, of which tasks share one
    done: list[tuple[int, Any]] = []

    def next_task(row: int) -> None:
        """A world takes the next task, if there is one."""
        collectors.pop(row, None)
        for index, task in waiting:
            collector = task.collector()
            collector.network = networks.setdefault(id(task.network), collector.network)
            collectors[row] = index, collector
            if next_episode(row):
                return

    def next_episode(row: int) -> bool:
        """The collector of a world goes on, or is done."""
        index, collector = collectors[row]
        wanted = collector.begin()
        if wanted is None:
            done.append((index, collector.result()))
            return False
        rng = np.random.default_rng(wanted.seed)
        batch.begin(row, Draws(rng, wanted.draw, wanted.stream, wanted.stage))
        return True

    for row in range(batch.count):
        next_task(row)
    try:
        while collectors:
            asked: list[tuple[int, Array]] = []
            for event in batch.go_on():
                row, (_, collector) = event.row, collectors[event.row]
                over = event.ending is not None or event.error is not None
                if event.error is not None:
                    collector.failed(event.error)
                elif event.paid is None:
                    collector.began(event.redrawn)
                else:
                    reward = sum(event.paid.values())
                    said = None if event.ending is None else event.ending.info(event.paid)
                    truncated = event.ending is not None and event.ending.truncated
                    over = collector.paid(event.features, reward, said, truncated) or over
                if not over:
                    asked.append((row, event.features))
                elif not next_episode(row):
                    batch.leave(row)
                    next_task(row)
            yield from done
            done.clear()
            _decide(batch, collectors, asked)
    finally:
        for row in collectors:
            batch.leave(row)


def side_by_side(batch: EpisodeBatch, shares: Sequence[TaskShare], /) -> Iterator[tuple[int, list[Any]]]:
    """Work for a fleet whose members keep a batch of worlds: do shares of tasks."""
    for index, share in enumerate(shares):
        done = dict(in_batch(batch, share.tasks))
        yield index, [done[k] for k in range(len(share.tasks))]


def results(fleet: Fleet[EpisodeBatch], tasks: Sequence[AnyTask], members: int) -> list[Any]:
    """The results of tasks, in their order.

    Args:
        fleet: Does them.
        tasks: The tasks.
        members: How many it has; each gets an equal share, so that its worlds have something to do.
    """
    shares = [TaskShare(tasks[k::members]) for k in range(min(members, len(tasks)))]
    out: list[Any] = [None] * len(tasks)
    for k, found in fleet.spread(side_by_side, shares):
        out[k::members] = found
    return out


def _decide(
    batch: EpisodeBatch,
    collectors: Mapping[int, tuple[int, Collector[Any]]],
    asked: Sequence[tuple[int, Array]],
) -> None:
    """Decide in all worlds ``asked``, each with what it sees: one call for each network."""
    groups: dict[int, list[tuple[int, Array]]] = {}
    for row, features in asked:
        groups.setdefault(id(collectors[row][1].network), []).append((row, features))
    for group in groups.values():
        rows = np.array([row for row, _ in group])
        outputs = collectors[group[0][0]][1].network(np.stack([features for _, features in group]))
        actions = [
            collectors[row][1].action(features, output)
            for (row, features), output in zip(group, outputs, strict=True)
        ]
        batch.decide(rows, np.stack(actions))
