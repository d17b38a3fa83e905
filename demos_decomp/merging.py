"""Several demonstrations of one activity: which tasks are the same one, and what their parameters are.

Tasks of one object are aligned over the demonstrations, object by object, so that activities with several
objects may come in any order. Parameters get a mean and a standard deviation.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.concept.task import Task
from bt_tasksim.demos_decomp.concepts import goes_to, quantity_of
from bt_tasksim.demos_decomp.log import Floats
from bt_tasksim.demos_decomp.parameters import PATH_POINTS, simplified_path, unit

Column = dict[str, Task]
"""One task as it was seen in the demonstrations that have it, by their names."""


def aligned(demonstrations: Mapping[str, Sequence[Task]]) -> list[Column]:
    """Finds which tasks of the demonstrations are the same one.

    Args:
        demonstrations: Tasks in order, by the demonstration's name.

    Returns:
        Columns; every task is in exactly one. Those of one object are in an order that all demonstrations
        agree with.
    """
    targets = dict.fromkeys(str(t.parameters["target"]) for tasks in demonstrations.values() for t in tasks)
    columns: list[Column] = []
    for target in targets:
        chains = {
            name: [task for task in tasks if task.parameters["target"] == target]
            for name, tasks in demonstrations.items()
        }
        columns += _aligned_chains({name: chain for name, chain in chains.items() if chain})
    return columns


def identity(task: Task) -> Hashable:
    """What two tasks must have in common to be the same one."""
    return (task.concept, task.parameters["target"], *goes_to(task).items())


def _aligned_chains(chains: Mapping[str, Sequence[Task]]) -> list[Column]:
    """Aligns sequences one after the other, the most common one first (progressive alignment)."""
    shapes = {name: tuple(identity(task) for task in chain) for name, chain in chains.items()}
    count = Counter(shapes.values())
    order = sorted(chains, key=lambda name: (-count[shapes[name]], -len(shapes[name])))
    columns: list[Column] = []
    for name in order:
        merged: list[Column] = []
        i = j = 0
        keys = [identity(next(iter(column.values()))) for column in columns]
        for a, b in [*_common(keys, shapes[name]), (len(columns), len(chains[name]))]:
            merged += columns[i:a]
            merged += [{name: task} for task in chains[name][j:b]]
            if a < len(columns):
                merged.append({**columns[a], name: chains[name][b]})
            i, j = a + 1, b + 1
        columns = merged
    return columns


def _common(first: Sequence[Hashable], second: Sequence[Hashable]) -> list[tuple[int, int]]:
    """Index pairs of the longest common subsequence."""
    length = np.zeros((len(first) + 1, len(second) + 1), dtype=int)
    for i in reversed(range(len(first))):
        for j in reversed(range(len(second))):
            same = first[i] == second[j]
            length[i, j] = length[i + 1, j + 1] + 1 if same else max(length[i + 1, j], length[i, j + 1])
    pairs = []
    i = j = 0
    while i < len(first) and j < len(second):
        if first[i] == second[j]:
            pairs.append((i, j))
            i, j = i + 1, j + 1
        elif length[i + 1, j] >= length[i, j + 1]:
            i += 1
        else:
            j += 1
    return pairs


def merged_parameters(tasks: Sequence[Task]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Parameters of one task that was seen several times.

    Args:
        tasks: The sightings, of one concept and target.

    Returns:
        The parameters (numbers: mean; unit vectors: mean direction; axes without a sense: mean axis; names:
        the most frequent; via-points: those of the most typical path, each averaged with the points of the
        other paths that correspond to it), and their uncertainty by name: standard deviations in the
        parameter's own unit and shape, or for names that differ the share of each. With a single sighting
        the uncertainty is empty.
    """
    values: dict[str, Any] = {}
    spread: dict[str, Any] = {}
    for name in dict.fromkeys(name for task in tasks for name in task.parameters):
        seen = [task.parameters[name] for task in tasks if name in task.parameters]
        quantity = quantity_of(tasks[0].concept, name)
        if isinstance(seen[0], str):
            count = Counter(seen)
            values[name] = count.most_common(1)[0][0]
            if len(count) > 1:
                spread[name] = {key: number / len(seen) for key, number in count.items()}
        elif quantity is not None and quantity.kind == "points":
            values[name], deviation = _merged_points(name, tasks)
            if len(tasks) > 1:
                spread[name] = deviation
        else:
            stack = np.array(seen, dtype=float)
            if quantity is not None and quantity.two_sided:
                values[name], stack = _mean_axis(stack)
            else:
                mean = stack.mean(axis=0)
                values[name] = unit(mean) if quantity is not None and quantity.unit_vector else mean
            if len(seen) > 1:
                spread[name] = stack.std(axis=0, ddof=1)
    return values, spread


def _mean_axis(axes: Floats) -> tuple[Floats, Floats]:
    """Mean ``(3,)`` of axes ``(n, 3)`` without a sense, and the axes turned to its side."""
    first = np.linalg.eigh(axes.T @ axes)[1][:, -1]
    first = first * np.sign(first[int(np.argmax(np.abs(first)))])
    return first, axes * np.where(axes @ first < 0, -1.0, 1.0)[:, None]


def _merged_points(name: str, tasks: Sequence[Task]) -> tuple[list[Floats], list[Floats]]:
    """Points on a way and their standard deviations ``(3,)``; the most typical of the paths leads."""
    paths = [task.path for task in tasks if task.path is not None]
    if len(paths) < 2:
        return list(tasks[0].parameters.get(name, [])), []
    matches = [[_correspondence(a, b) for b in paths] for a in paths]
    misfit = [
        sum(float(np.linalg.norm(a - b[m], axis=1).mean()) for b, m in zip(paths, row, strict=True))
        for a, row in zip(paths, matches, strict=True)
    ]
    leader = int(np.argmin(misfit))
    points = simplified_path(paths[leader])
    found = [[path[m[i]] for path, m in zip(paths, matches[leader], strict=True)] for i in points]
    return [np.mean(f, axis=0) for f in found], [np.std(f, axis=0, ddof=1) for f in found]


def _correspondence(leader: Floats, follower: Floats) -> list[int]:
    """For each point of a path the index of the point of another path that corresponds to it.

    Dynamic time warping (Sakoe and Chiba, 1978) over evenly spaced points; both paths keep their order.
    """
    distance = np.linalg.norm(leader[:, None] - follower[None], axis=2)
    total = np.full((len(leader) + 1, len(follower) + 1), np.inf)
    total[0, 0] = 0.0
    for i in range(len(leader)):
        for j in range(len(follower)):
            total[i + 1, j + 1] = distance[i, j] + min(total[i, j], total[i, j + 1], total[i + 1, j])
    match: dict[int, list[int]] = {}
    i, j = len(leader), len(follower)
    while i > 0 and j > 0:
        match.setdefault(i - 1, []).append(j - 1)
        step = int(np.argmin([total[i - 1, j - 1], total[i - 1, j], total[i, j - 1]]))
        i, j = i - (step != 2), j - (step != 1)
    return [min(match[k], key=lambda j: float(distance[k, j])) for k in range(PATH_POINTS)]
