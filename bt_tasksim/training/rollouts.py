"""Episodes collected in batches of worlds, the same whatever their size and the number of processes.

A rollout is a fixed number of environments, each of which is a row of episodes with a fixed number of
decisions in all. Every episode has its own seeds, in a world of its own beside others, so it does not matter
when and where it runs: those of one environment go on side by side, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core.fleet import Fleet
from bt_tasksim.core.poses import Array
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import Action, split_action
from bt_tasksim.training.collectors import Collecting, Collector, DrawTask, RolloutTask
from bt_tasksim.training.drawn_worlds import Draws
from bt_tasksim.training.episode_batch import EpisodeBatch

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
    """Do tasks in the worlds of a batch: each that is free takes an episode of the task that is next in turn.

    Yields:
        The index of a task and its result, as they are done; these depend on nothing but the task.
    """
    collectors: dict[int, Collector[Any]] = {}
    networks: dict[int, Network] = {}  # by the identity of their arrays, of which tasks share one
    for index, task in enumerate(tasks):
        if id(task.network) not in networks:
            networks[id(task.network)] = Network.from_arrays(task.network)
        collectors[index] = task.collector(networks[id(task.network)])
    free = list(range(batch.count))[::-1]
    going: dict[int, tuple[int, Collecting]] = {}  # by world: a task and an episode of it

    def begin() -> None:
        """Begin episodes as long as there are worlds, one of each task, and then the next ones."""
        wanting = list(collectors)
        while free and wanting:
            for index in wanting.copy():
                episode = collectors[index].next() if free else None
                if episode is None:
                    wanting.remove(index)
                    continue
                row, wanted = free.pop(), episode.begin()
                going[row] = index, episode
                rng = np.random.default_rng(wanted.seed)
                batch.begin(row, Draws(rng, wanted.draw, wanted.stream, wanted.stage))

    try:
        begin()
        while collectors:
            asked: list[tuple[int, Array]] = []
            touched: set[int] = set()
            for event in batch.go_on():
                index, episode = going[event.row]
                touched.add(index)
                if event.error is not None:
                    episode.failed(event.error)
                elif event.paid is None:
                    episode.began(event.redrawn)
                else:
                    episode.paid(event.features, sum(event.paid.values()), event.ending)
                if event.error is None and event.ending is None:
                    asked.append((event.row, event.features))
            for index in sorted(touched):
                if collectors[index].done:
                    yield index, collectors.pop(index).result()
            left = [
                row
                for row, (index, episode) in going.items()
                if index in touched and not (index in collectors and collectors[index].counts(episode))
            ]
            for row in left:
                batch.leave(row)
                del going[row]
            free += sorted(left, reverse=True)
            _decide(batch, going, collectors, [(row, seen) for row, seen in asked if row in going])
            begin()
    finally:
        for row in going:
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
    going: Mapping[int, tuple[int, Collecting]],
    collectors: Mapping[int, Collector[Any]],
    asked: Sequence[tuple[int, Array]],
) -> None:
    """Decide in all worlds ``asked``, each with what it sees: one call for each network."""
    groups: dict[int, tuple[Network, list[tuple[int, Array]]]] = {}
    for row, features in asked:
        network = collectors[going[row][0]].network
        groups.setdefault(id(network), (network, []))[1].append((row, features))
    for network, group in groups.values():
        rows = np.array([row for row, _ in group])
        outputs = network(np.stack([features for _, features in group]))
        actions = [
            going[row][1].action(features, output)
            for (row, features), output in zip(group, outputs, strict=True)
        ]
        motion, terminate = split_action(np.stack(actions), network.signal_std)
        batch.act(rows, Action(motion.astype(np.float64), terminate))
