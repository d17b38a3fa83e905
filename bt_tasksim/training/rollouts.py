"""Episodes collected in batches of worlds, the same whatever their size and the number of processes.

Every episode has its own seeds, in a world of its own beside others, so it does not matter when and where it
runs.
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
from bt_tasksim.training.collectors import Collecting, EpisodeTask
from bt_tasksim.training.drawn_worlds import Draws
from bt_tasksim.training.episode_batch import EpisodeBatch


@dataclass(frozen=True)
class TaskShare:
    """What a process does side by side.

    Attributes:
        tasks: The episodes.
    """

    tasks: Sequence[EpisodeTask]

    def __str__(self) -> str:
        return f"a share of {len(self.tasks)} episodes"


@dataclass(frozen=True)
class _Going:
    """An episode in a world: the index of its task, what takes note of it, and who decides."""

    index: int
    episode: Collecting
    network: Network


def in_batch(batch: EpisodeBatch, tasks: Sequence[EpisodeTask], /) -> Iterator[tuple[int, Any]]:
    """Run episodes in the worlds of a batch: each that is free takes the next one.

    Yields:
        The index of a task and its result, as they are done; these depend on nothing but the task.
    """
    networks: dict[int, Network] = {}  # by the identity of their arrays, of which tasks share one
    for task in tasks:
        if id(task.network) not in networks:
            networks[id(task.network)] = Network.from_arrays(task.network)
    waiting = iter(enumerate(tasks))
    going: dict[int, _Going] = {}

    def begin(rows: Sequence[int]) -> None:
        for row, (index, task) in zip(rows, waiting):  # noqa: B905  # tasks may be fewer
            going[row] = _Going(index, task.episode(), networks[id(task.network)])
            wanted = going[row].episode.begin()
            rng = np.random.default_rng(wanted.seed)
            batch.begin(row, Draws(rng, wanted.draw, wanted.stream, wanted.stage))

    try:
        begin(range(batch.count))
        while going:
            asked: list[tuple[int, Array]] = []
            over: list[int] = []
            for event in batch.go_on():
                episode = going[event.row].episode
                if event.error is not None:
                    episode.failed(event.error)
                elif event.paid is None:
                    episode.began(event.redrawn)
                else:
                    episode.paid(event.features, sum(event.paid.values()), event.ending)
                if episode.result is None:
                    asked.append((event.row, event.features))
                else:
                    over.append(event.row)
            for row in over:
                done = going.pop(row)
                yield done.index, done.episode.result
            _decide(batch, going, asked)
            begin(over)
    finally:
        for row in going:
            batch.leave(row)


def side_by_side(batch: EpisodeBatch, shares: Sequence[TaskShare], /) -> Iterator[tuple[int, list[Any]]]:
    """Work for a fleet whose members keep a batch of worlds: do shares of tasks."""
    for index, share in enumerate(shares):
        done = dict(in_batch(batch, share.tasks))
        yield index, [done[k] for k in range(len(share.tasks))]


def results(fleet: Fleet[EpisodeBatch], tasks: Sequence[EpisodeTask], members: int) -> list[Any]:
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


def _decide(batch: EpisodeBatch, going: Mapping[int, _Going], asked: Sequence[tuple[int, Array]]) -> None:
    """Decide in all worlds ``asked``, each with what it sees: one call for each network."""
    groups: dict[int, list[tuple[int, Array]]] = {}
    for row, features in asked:
        groups.setdefault(id(going[row].network), []).append((row, features))
    for group in groups.values():
        network = going[group[0][0]].network
        outputs = network(np.stack([features for _, features in group]))
        actions = [
            going[row].episode.action(features, output)
            for (row, features), output in zip(group, outputs, strict=True)
        ]
        motion, terminate = split_action(np.stack(actions), network.signal_std)
        batch.act(np.array([row for row, _ in group]), Action(motion.astype(np.float64), terminate))
