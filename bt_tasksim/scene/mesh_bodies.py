"""Separate bodies of triangles that were saved together, also where they touch or overlap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.meshes import TriangleMesh, volume_of

_SAME_ANGLE = 1e-6
"""Radians between faces around an edge that lie upon each other."""


def separate(vertices: Array, faces: Array) -> list[TriangleMesh]:
    """The closed bodies that triangles make up.

    Where more than two triangles meet in an edge, bodies touch there: around the edge, every face that has
    its solid behind it is paired with the next one that has its solid before it, which bounds the same solid.

    Args:
        vertices: ``(n, 3)``, each point once.
        faces: ``(m, 3)``, counter-clockwise seen from outside.

    Raises:
        InputError: They are not closed, or face different ways; it says only what is wrong.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    m = len(faces)
    start, end = (np.roll(faces, -k, axis=1).T.ravel() for k in (0, 1))
    apex, face = np.roll(faces, -2, axis=1).T.ravel(), np.tile(np.arange(m), 3)
    forward = start < end
    low, high = np.where(forward, start, end), np.where(forward, end, start)
    order = np.lexsort([high, low])
    key = low[order] * len(vertices) + high[order]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
    count = np.diff(np.r_[first, len(key)])
    if odd := int(np.sum(count % 2 != 0)):
        raise InputError(f"is not watertight: {odd} of its edges do not join two triangles")
    if np.any(np.add.reduceat(np.where(forward[order], 1, -1), first) != 0):
        raise InputError("has triangles that face different ways: recompute its normals")
    two = first[count == 2]
    pairs = [np.column_stack([face[order[two]], face[order[two + 1]]])]
    for at, n in zip(first[count > 2], count[count > 2], strict=True):
        around = order[at : at + n]
        pairs.append(
            _around(vertices, low[around[0]], high[around[0]], apex[around], forward[around], face[around])
        )
    joined = np.concatenate(pairs)
    graph = coo_array((np.ones(len(joined)), (joined[:, 0], joined[:, 1])), shape=(m, m))
    n_bodies, label = connected_components(graph, directed=False)
    return [_alone(vertices, faces[label == k]) for k in range(n_bodies)]


def _around(vertices: Array, low: int, high: int, apex: Array, forward: Array, face: Array) -> Array:
    """Faces ``(n / 2, 2)`` around one edge that bound the same solid."""
    along = vertices[high] - vertices[low]
    along = along / np.linalg.norm(along)
    aside = vertices[apex] - vertices[low]
    aside = aside - (aside @ along)[:, None] * along
    x = aside[0] / np.linalg.norm(aside[0])
    angle = np.arctan2(aside @ np.cross(along, x), aside @ x)
    # Seen along the edge, the solid of a face that runs against it follows counter-clockwise.
    begin, finish = np.flatnonzero(~forward), list(np.flatnonzero(forward))
    found = []
    for i in begin[np.argsort(angle[begin], kind="stable")]:
        turn = (angle[finish] - angle[i]) % (2 * np.pi)
        turn = np.where((turn < _SAME_ANGLE) | (turn > 2 * np.pi - _SAME_ANGLE), 2 * np.pi, turn)
        found.append((face[i], face[finish.pop(int(np.argmin(turn)))]))
    return np.array(found)


def _alone(vertices: Array, faces: Array) -> TriangleMesh:
    used, index = np.unique(faces, return_inverse=True)
    return TriangleMesh(vertices[used], index.reshape(-1, 3))


def turned(body: TriangleMesh) -> TriangleMesh:
    """The same surface seen from the other side."""
    return TriangleMesh(body.vertices, np.ascontiguousarray(body.faces[:, ::-1]))


def solids_and_cavities(
    bodies: Sequence[TriangleMesh],
) -> tuple[list[TriangleMesh], list[TriangleMesh]]:
    """Bodies that face outwards, and cavities within them, turned to face outwards, too.

    What faces inwards is a cavity where it lies within the bounding box of a body; else it was saved inside
    out.
    """
    volumes = [volume_of(body) for body in bodies]
    solids = [body for body, volume in zip(bodies, volumes, strict=True) if volume > 0]
    boxes = [(body.vertices.min(axis=0), body.vertices.max(axis=0)) for body in solids]
    cavities: list[TriangleMesh] = []
    for body, volume in zip(bodies, volumes, strict=True):
        if volume < 0:
            low, high = body.vertices.min(axis=0), body.vertices.max(axis=0)
            inner = any(np.all(low >= a) and np.all(high <= b) for a, b in boxes)
            (cavities if inner else solids).append(turned(body))
    return solids, cavities


def united(solids: Sequence[TriangleMesh], cavities: Sequence[TriangleMesh]) -> TriangleMesh:
    """The surface of all solids together without the cavities.

    Raises:
        InputError: They cannot be united; it says only what is wrong.
    """
    if not cavities and not _meet(solids):
        return _together(solids)
    from manifold3d import Manifold, OpType

    whole = Manifold.batch_boolean([_manifold(body) for body in solids], OpType.Add)
    if cavities:
        whole = whole - Manifold.batch_boolean([_manifold(body) for body in cavities], OpType.Add)
    mesh = whole.to_mesh64()
    if not len(mesh.tri_verts):
        raise InputError("has bodies that cannot be united: unite them in the program that made them")
    return TriangleMesh(np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts, np.int64))


def _meet(bodies: Sequence[TriangleMesh]) -> bool:
    """Whether the bounding boxes of two of them touch."""
    low = np.array([body.vertices.min(axis=0) for body in bodies])
    high = np.array([body.vertices.max(axis=0) for body in bodies])
    near = np.all((low[:, None] <= high[None]) & (low[None] <= high[:, None]), axis=-1)
    return bool(np.sum(near) > len(bodies))


def _together(bodies: Sequence[TriangleMesh]) -> TriangleMesh:
    starts = np.cumsum([0, *[len(body.vertices) for body in bodies]])
    return TriangleMesh(
        np.concatenate([body.vertices for body in bodies]),
        np.concatenate([body.faces + start for body, start in zip(bodies, starts, strict=False)]),
    )


def _manifold(body: TriangleMesh):  # type: ignore[no-untyped-def]
    from manifold3d import Error, Manifold, Mesh64

    made = Manifold(
        Mesh64(np.array(body.vertices, np.float64), np.array(body.faces, np.uint64))
    )  # to write to
    if made.status() != Error.NoError:
        raise InputError(
            f"has bodies that touch or overlap and cannot be united ({made.status().name}): "
            f"unite them in the program that made them"
        )
    return made
