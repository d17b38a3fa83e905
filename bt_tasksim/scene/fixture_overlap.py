"""Whether the furniture of a scene stands in other furniture."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import combinations

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import FieldError
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.fixtures import Fixture
from bt_tasksim.scene.outlines import TOUCHING


def check_fixtures(fixtures: Sequence[Fixture]) -> None:
    """Refuse furniture of the same name, places of the same name, and boxes in one another.

    Raises:
        FieldError: Says which two, and what to do.
    """
    names = [fixture.name for fixture in fixtures]
    owner: dict[str, str] = {}
    for i, fixture in enumerate(fixtures):
        if fixture.name in names[:i]:
            raise FieldError(
                f"the fixture '{fixture.name}' is there twice: give each its place and its own name, such "
                f"as at=(0.45, -0.35), name='left_{fixture.name}'",
                "fixtures",
            )
        for place in fixture.places:
            if place.name in owner:
                raise FieldError(
                    f"fixtures '{owner[place.name]}' and '{fixture.name}' both have a place "
                    f"'{place.name}': give one of them a name of its own",
                    "fixtures",
                )
            owner[place.name] = fixture.name
    for a, b in combinations(fixtures, 2):
        depth = overlap(a, b)
        if depth > TOUCHING:
            raise FieldError(
                f"fixtures '{a.name}' and '{b.name}' stand {1000 * depth:.0f} mm in one another: put one of "
                f"them elsewhere, by its 'at'",
                "fixtures",
            )


@lru_cache(maxsize=512)
def overlap(a: Fixture, b: Fixture) -> float:
    """Depth in metres to which two fixtures stand in one another; 0 where they do not."""
    mine, others = _boxes(a), _boxes(b)
    if not mine or not others:
        return 0.0
    low, high = _bounds(mine)
    other_low, other_high = _bounds(others)
    near = np.all((low[:, None] < other_high) & (other_low < high[:, None]), axis=2)
    found = [_depth(mine[i], others[j]) for i, j in np.argwhere(near).tolist()]
    return max(found, default=0.0)


def _boxes(fixture: Fixture) -> list[tuple[Array, Array, Array]]:
    """Middle ``(3,)``, axes ``(3, 3)`` in columns and half size ``(3,)`` of each box."""

    def of(box: Box) -> tuple[Array, Array, Array]:
        pose = poses.multiply(fixture.pose_array(), np.array(box.pose))
        return pose[:3], poses.to_matrix(pose[3:]), np.array(box.size) / 2

    return [of(box) for box in fixture.boxes]


def _bounds(boxes: Sequence[tuple[Array, Array, Array]]) -> tuple[Array, Array]:
    middle = np.array([box[0] for box in boxes])
    reach = np.array([np.abs(axes) @ half for _, axes, half in boxes])
    return middle - reach, middle + reach


def _depth(a: tuple[Array, Array, Array], b: tuple[Array, Array, Array]) -> float:
    """Depth to which two boxes overlap: the least over all axes that can separate them.

    Source: S. Gottschalk, M. Lin and D. Manocha, "OBBTree", SIGGRAPH 1996: six faces, nine pairs of edges.
    """
    (at, axes, half), (to, others, other_half) = a, b
    edges = np.cross(axes.T[:, None], others.T[None]).reshape(9, 3)
    lengths = np.linalg.norm(edges, axis=1)
    edges = edges[lengths > 1e-6] / lengths[lengths > 1e-6, None]
    every = np.concatenate([axes.T, others.T, edges])
    reach = np.abs(every @ axes) @ half + np.abs(every @ others) @ other_half
    return max(float(np.min(reach - np.abs(every @ (to - at)))), 0.0)
