"""Convex parts of a solid: few, and together hardly more than the solid.

CoACD (Wei et al., "Approximate convex decomposition for 3D meshes with collision-aware concavity and tree
search", SIGGRAPH 2022) cuts the solid; then neighbours whose common hull adds least are joined.
"""

from __future__ import annotations

import heapq
import io
import json
import signal
import subprocess
import sys
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.meshes import TriangleMesh, mass_properties

MOST_PARTS = 32
"""Of one body: physics looks at the contacts of each."""
CONVEX = 1.05
"""A body whose hull has at most this many times its volume is taken for convex."""
_THRESHOLD = 0.035
"""Concavity, as a share of the size, at which CoACD stops: 0.05 adds 13 % to a mug's volume, this 8 %."""
_SEARCH = {"resolution": 200, "mcts_iterations": 12, "mcts_nodes": 6, "mcts_max_depth": 2}
"""How hard it searches for cuts: CoACD's defaults take several times as long for about the same volume."""
AT_ONCE = 2000
"""Triangles up to which it cuts in this process, without a limit; beyond, half a second more is nothing."""
MOST_SECONDS = 120
"""Seconds of computing that it has beyond that, see `bt_tasksim.scene.cutting`."""
MISSING = "meshes with hollows need the package coacd: install bt-tasksim with its extra 'sim'"
_JOINED = 0.002
"""Parts are joined where this adds at most this share of the solid's volume, up to `_FREE` in all."""
_FREE = 0.04
_APART = 1e-3
"""Distance, as a share of the size, from which parts are no neighbours."""


class _Part(NamedTuple):
    corners: Array
    volume: float
    low: Array
    high: Array


def convex_parts(body: TriangleMesh) -> tuple[Array, ...]:
    """Corners ``(n, 3)`` of convex parts whose union is about the body; the same body gives the same parts.

    Args:
        body: A closed surface.

    Raises:
        InputError: It is too rough or too fine to be cut in `MOST_SECONDS`.
        MachineError: The package that decomposes meshes is not installed.
    """
    vertices = np.ascontiguousarray(body.vertices, np.float64)
    faces = np.ascontiguousarray(body.faces, np.int32)
    return _parts(vertices.tobytes(), faces.tobytes())


@lru_cache(maxsize=256)
def _parts(vertices: bytes, faces: bytes) -> tuple[Array, ...]:
    points, triangles = np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(faces, np.int32).reshape(-1, 3)
    whole = _part(points)
    volume = mass_properties(TriangleMesh(points, triangles)).volume
    if whole.volume <= CONVEX * volume:
        return (_read_only(whole.corners),)
    middle, size = (whole.low + whole.high) / 2, float(np.max(whole.high - whole.low))
    cut = _cut((points - middle) / size, triangles)
    parts = _few([part for part in map(_part, cut) if part.volume > 0.0], volume / size**3)
    return tuple(_read_only(part.corners * size + middle) for part in parts)


def _cut(points: Array, triangles: Array) -> list[Array]:
    if len(triangles) > AT_ONCE:
        return _cut_apart(points, triangles)
    try:
        from bt_tasksim.scene import cutting
    except ImportError:
        raise MachineError(MISSING) from None
    return cutting.cut(points, triangles, _THRESHOLD, _SEARCH)


def _cut_apart(points: Array, triangles: Array) -> list[Array]:
    """The same in a process of its own, which is stopped where it takes too long.

    Raises:
        InputError: It was.
        MachineError: CoACD is not installed, or did not work.
    """
    if find_spec("coacd") is None:
        raise MachineError(MISSING)
    asked = io.BytesIO()
    np.savez(asked, points=points, triangles=triangles)
    how = json.dumps({"threshold": _THRESHOLD, "search": _SEARCH})
    program = Path(__file__).with_name("cutting.py")
    command = [sys.executable, "-I", str(program), str(MOST_SECONDS), how]
    done = subprocess.run(command, input=asked.getvalue(), capture_output=True, check=False)
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        raise InputError(
            f"a mesh of {len(triangles)} triangles cannot be cut into convex parts in {MOST_SECONDS} s: its "
            f"surface is too rough or too fine; give it fewer triangles, or a smoother surface"
        )
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise MachineError(f"CoACD did not cut a mesh: {said[-1] if said else f'exit {done.returncode}'}")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as parts:
        return [parts[name] for name in parts.files]


def _part(points: Array) -> _Part:
    from scipy.spatial import ConvexHull, QhullError

    low, high = points.min(axis=0), points.max(axis=0)
    try:
        hull = ConvexHull(points)
    except QhullError:  # a sliver without volume
        return _Part(points, 0.0, low, high)
    return _Part(points[hull.vertices], float(hull.volume), low, high)


def _few(parts: list[_Part], volume: float) -> list[_Part]:
    """At most `MOST_PARTS`, joined two by two where that adds the least volume."""
    there = dict(enumerate(parts))
    total = sum(part.volume for part in parts)
    heap: list[tuple[float, int, int]] = []
    apart = _APART

    def enter(i: int, j: int) -> None:
        a, b = there[i], there[j]
        if np.any((a.low > b.high + apart) | (b.low > a.high + apart)):
            return
        added = _part(np.concatenate([a.corners, b.corners])).volume - a.volume - b.volume
        heapq.heappush(heap, (added, i, j))

    for j in range(len(parts)):
        for i in range(j):
            enter(i, j)
    following = len(parts)
    while heap or (len(there) > MOST_PARTS and np.isfinite(apart)):
        if not heap:  # too many, and no neighbours are left: any two
            apart = np.inf
            for j in there:
                for i in there:
                    if i < j:
                        enter(i, j)
        added, i, j = heapq.heappop(heap)
        if i not in there or j not in there:
            continue
        cheap = added <= _JOINED * volume and total + added <= (1.0 + _FREE) * volume
        if len(there) <= MOST_PARTS and not cheap:
            if added > _JOINED * volume:
                break
            continue
        whole = _part(np.concatenate([there.pop(i).corners, there.pop(j).corners]))
        total += added
        there[following] = whole
        for other in there:
            if other != following:
                enter(other, following)
        following += 1
    return list(there.values())


def _read_only(corners: Array) -> Array:
    corners = np.array(corners, float)
    corners.setflags(write=False)
    return corners
