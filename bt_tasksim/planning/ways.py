"""Collision-free ways for a hand that carries something, among boxes.

The hand and what it holds are boxes that move with the tool; coal answers whether they touch an obstacle. A
straight way is tried first, then the way out of and into fixtures along their access, then a shortest path
on a lattice of tool positions (Hart, Nilsson and Raphael, "A formal basis for the heuristic determination of
minimum cost paths", 1968, by networkx). Everything is deterministic.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import networkx as nx
import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Obstacle

MARGIN = 0.012
"""Metres of free space kept around everything."""
_STEP = 0.02
_CELL = 0.05


@dataclass(frozen=True)
class Carried:
    """What moves with the tool.

    Attributes:
        hand: Boxes ``(pose (7,), full size (3,))`` in the tool frame.
        extent: Full size ``(3,)`` of the held object's bounding box, metres.
        grip: Pose ``(7,)`` of the object in the tool frame.
    """

    hand: Sequence[tuple[Array, tuple[float, float, float]]]
    extent: tuple[float, float, float]
    grip: Array


def clear_path(
    start: Array,
    goal: Array,
    carried: Carried,
    obstacles: Sequence[Obstacle],
    exits: tuple[Array, Array] | None = None,
) -> list[Array]:
    """Tool poses from start to goal, joined by clear straight lines.

    Args:
        start: Tool pose ``(7,)``.
        goal: Tool pose ``(7,)``.
        carried: What moves with the tool.
        obstacles: What to keep clear of.
        exits: Displacements ``(3,)`` that take the tool out of the fixture it starts in and out of the one
            it ends in.

    Raises:
        NoWayError: No way was found.
    """
    checker = _Checker(carried, obstacles)
    if checker.clear(start, goal):
        return [start, goal]
    if exits is not None:
        out, into = start.copy(), goal.copy()
        out[:3] += exits[0]
        into[:3] += exits[1]
        middle = [p for p, e in ((out, exits[0]), (into, exits[1])) if float(np.abs(e).sum()) > 0]
        for way in _between(start, middle, goal):
            if checker.clear_way(way):
                return way
    return _lattice(start, goal, checker)


def _between(start: Array, middle: list[Array], goal: Array) -> list[list[Array]]:
    plain = [start, *middle, goal]
    ways = [plain]
    high = max(float(p[2]) for p in plain) + 0.05
    lifted = []
    for p in middle or (start, goal):
        q = p.copy()
        q[2] = high
        lifted.append(q)
    ways.append([start, *lifted, goal])
    return ways


class _Checker:
    """Says whether the hand and what it holds touch an obstacle.

    Which boxes are so far from an obstacle that they cannot touch it is seen for many tool poses at once;
    coal is asked about the others.
    """

    def __init__(self, carried: Carried, obstacles: Sequence[Obstacle]) -> None:
        import coal

        self._coal = coal
        boxes = [*carried.hand, (carried.grip, carried.extent)]
        self._local = np.array([poses.unit_pose(pose) for pose, _ in boxes])
        self._moving = [coal.Box(*(float(s) for s in size)) for _, size in boxes]
        self._radius = np.array([np.linalg.norm(size) / 2 for _, size in boxes])
        sizes = [np.asarray(o.size, float) + 2 * MARGIN for o in obstacles]
        self._fixed = [
            (coal.Box(*size.tolist()), coal.Transform3s(poses.to_matrix(o.pose[3:]), o.pose[:3]))
            for size, o in zip(sizes, obstacles, strict=True)
        ]
        self._half = np.array(sizes).reshape(-1, 3) / 2
        self._at = np.array([o.pose for o in obstacles]).reshape(-1, 7)
        self._request, self._result = coal.CollisionRequest(), coal.CollisionResult()

    def free(self, tools: Array) -> Array:
        """Boolean ``(n,)``: nothing is touched at tool poses ``(n, 7)``."""
        coal = self._coal
        boxes = poses.multiply(tools[:, None], self._local)
        local = np.abs(poses.localise(self._at[:, None, None], boxes[None, ..., :3]))
        beyond = np.maximum(local - self._half[:, None, None], 0.0)
        near = poses.norm(beyond) <= self._radius
        free = np.ones(len(tools), bool)
        for k, i, j in zip(*(index.tolist() for index in np.nonzero(near)), strict=True):
            if free[i]:
                frame = coal.Transform3s(poses.to_matrix(boxes[i, j, 3:]), boxes[i, j, :3])
                self._result.clear()
                free[i] = not coal.collide(
                    self._moving[j], frame, *self._fixed[k], self._request, self._result
                )
        return free

    def clear(self, a: Array, b: Array) -> bool:
        length = float(np.linalg.norm(b[:3] - a[:3])) + 0.1 * float(poses.angle_between(a[3:], b[3:]))
        n = max(2, int(np.ceil(length / _STEP)) + 1)
        # The ends are where the object is lifted from and put down: there it may be near its support.
        return bool(self.free(poses.interpolate(a[None], b[None], np.linspace(0.0, 1.0, n))).all())

    def clear_way(self, way: Sequence[Array]) -> bool:
        return all(self.clear(a, b) for a, b in itertools.pairwise(way))


def _lattice(start: Array, goal: Array, checker: _Checker) -> list[Array]:
    low = np.minimum(start[:3], goal[:3]) - 0.35
    high = np.maximum(start[:3], goal[:3]) + 0.35
    low[2] = max(low[2], 0.02)
    counts = np.ceil((high - low) / _CELL).astype(int) + 1
    span = max(float(np.linalg.norm(goal[:3] - start[:3])), 1e-6)

    def poses_at(cells: Array) -> Array:
        p = low + _CELL * cells
        f = np.clip((p - start[:3]) @ (goal[:3] - start[:3]) / span**2, 0.0, 1.0)
        return np.concatenate([p, poses.interpolate(start[None], goal[None], f)[:, 3:]], axis=-1)

    def pose_at(cell: tuple[int, ...]) -> Array:
        found: Array = poses_at(np.array([cell]))[0]
        return found

    cells = list(itertools.product(*(range(n) for n in counts)))
    free = {c for c, is_free in zip(cells, checker.free(poses_at(np.array(cells))), strict=True) if is_free}
    graph: nx.Graph[Any] = nx.Graph()
    moves = [m for m in itertools.product((-1, 0, 1), repeat=3) if m > (0, 0, 0)]
    for cell in sorted(free):
        for move in moves:
            other = tuple(c + m for c, m in zip(cell, move, strict=True))
            if other in free:
                graph.add_edge(cell, other, weight=float(np.linalg.norm(move)))
    for end in (start, goal):
        key = "start" if end is start else "goal"
        near = sorted(free, key=lambda c: float(np.linalg.norm(low + _CELL * np.array(c) - end[:3])))[:20]
        for cell in near:
            if checker.clear(end, pose_at(cell)):
                graph.add_edge(key, cell, weight=float(np.linalg.norm(pose_at(cell)[:3] - end[:3])) / _CELL)
    try:
        way = _clear_cells(graph, start, goal, pose_at, checker)
    except (nx.NetworkXNoPath, nx.NodeNotFound) as error:
        ends = (np.round(p[:3], 3).tolist() for p in (start, goal))
        raise NoWayError(
            f"no way for the hand from {' to '.join(map(str, ends))} m that keeps {1000 * MARGIN:.0f} mm "
            f"clear of the fixtures: give via-points, or move the fixtures apart"
        ) from error
    return _shortcut(way, checker)


def _clear_cells(
    graph: nx.Graph[Any],
    start: Array,
    goal: Array,
    pose_at: Callable[[tuple[int, ...]], Array],
    checker: _Checker,
) -> list[Array]:
    """The shortest way through free cells whose joining lines are clear too; these are checked on demand."""
    clear: set[tuple[Any, Any]] = set()
    while True:
        cells = nx.shortest_path(graph, "start", "goal", weight="weight")
        way = [start, *(pose_at(c) for c in cells[1:-1]), goal]
        pairs = zip(itertools.pairwise(cells), itertools.pairwise(way), strict=True)
        fresh = [(edge, line) for edge, line in pairs if edge not in clear]
        blocked = [edge for edge, line in fresh if not checker.clear(*line)]
        if not blocked:
            return way
        clear.update(edge for edge, _ in fresh if edge not in blocked)
        graph.remove_edges_from(blocked)


def _shortcut(way: list[Array], checker: _Checker) -> list[Array]:
    out, i = [way[0]], 0
    while i < len(way) - 1:
        j = len(way) - 1
        while j > i + 1 and not checker.clear(way[i], way[j]):
            j -= 1
        out.append(way[j])
        i = j
    return out
