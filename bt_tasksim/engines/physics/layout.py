"""How states of several worlds stand in arrays: what objects have is as wide as the world with the most."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np

from bt_tasksim.core.bundles import mapped
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, WorldState


@dataclass(frozen=True)
class Layout:
    """How objects of several worlds stand in arrays.

    Attributes:
        counts: Objects of each world ``(k,)``.
        objects: The most objects that a world of the batch has had.
        fixtures: The most fixtures.
    """

    counts: Array
    objects: int
    fixtures: int

    def padded(self, values: Array | Sequence[Any], width: int = 0) -> Array:
        """What objects have, ``(k, objects)`` or with a ``width`` ``(k, objects, width)``, NaN at the end.

        Args:
            values: Of all objects, world after world.
            width: Numbers that each has; 0 for one alone.
        """
        tail = (width,) if width else ()
        out = np.full((len(self.counts), self.objects, *tail), np.nan)
        out[np.arange(self.objects) < self.counts[:, None]] = np.asarray(values, float).reshape(-1, *tail)
        return out

    def finite(self, state: WorldState) -> Array:
        """Whether all numbers of a state are finite, ``(k,)``, but for the padding."""
        assert state.objects is not None and state.velocities is not None
        joints = np.isfinite(state.joint_position) & np.isfinite(state.joint_velocity)
        objects = np.isfinite(state.objects).all(axis=-1) & np.isfinite(state.velocities).all(axis=-1)
        return joints.all(axis=1) & (objects.sum(axis=1) == self.counts)

    def support(self, pairs: Sequence[Iterable[tuple[int, int]]]) -> Array:
        """`Hidden.support` from the pairs of each world, whose fixtures are numbered behind its objects."""
        out = np.zeros((len(self.counts), self.objects, self.objects + self.fixtures), bool)
        found = np.array([(k, i, j) for k, world in enumerate(pairs) for i, j in world], int).reshape(-1, 3)
        k, i, j = found[:, 0], found[:, 1], found[:, 2]
        out[k, i, body_column(j, self.counts[k], self.objects)] = True
        return out


N = TypeVar("N", int, Array)


def body_column(body: N, own: N | int, most: int) -> N:
    """The column of `Hidden.support` for a body of a world, where all objects of any world stand first.

    Args:
        body: Its number in its world, whose fixtures are numbered behind its objects.
        own: How many objects that world has.
        most: How many the one with the most has.
    """
    return body + (most - own) * (body >= own)


def wider_support(support: Array, own: int, objects: int, fixtures: int) -> Array:
    """`Hidden.support` ``(k, objects, objects + fixtures)`` of worlds that were alike.

    Args:
        support: Of these worlds, ``(k, own, own + fixtures of theirs)``.
        own: How many objects they have.
        objects: How many the world with the most has.
        fixtures: The same.
    """
    out = np.zeros((len(support), objects, objects + fixtures), bool)
    out[:, :own, body_column(np.arange(support.shape[2]), own, objects)] = support
    return out


B = TypeVar("B", WorldState, Hidden)


def rows_for(bundle: B, n: int) -> B:
    """Arrays for ``n`` rows like those of a bundle, zero."""
    made: B = mapped(lambda values: np.zeros((n, *values.shape[1:]), values.dtype), bundle)
    return made


def put(bundle: B, rows: Array, values: B) -> None:
    """Write rows of a bundle of arrays."""
    for field in fields(values):
        getattr(bundle, field.name)[rows] = getattr(values, field.name)
