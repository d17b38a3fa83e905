"""What estimates are corrected by: what stands is known better by its support than by how it is seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bt_tasksim.concept.resting import at_rest
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, constant, host
from bt_tasksim.core.world import Observation, WorldModel

_NOTHING = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


class Believed:
    """Gives the poses at which objects are taken to be at one tick; computed when they are first asked for.

    Args:
        estimates: Poses ``(N, n, 7)`` as they are seen.
        corrections: See `Beliefs.corrections`.
    """

    __slots__ = ("_corrections", "_poses")

    def __init__(self, estimates: Array, corrections: Array | None) -> None:
        self._poses, self._corrections = estimates, corrections

    def __call__(self) -> Array:
        """The poses ``(N, n, 7)``."""
        if self._corrections is not None:
            self._poses, self._corrections = poses.multiply(self._poses, self._corrections), None
        return self._poses


class Beliefs:
    """What the estimates of the objects of a batch of worlds are corrected by.

    An object that seems to stand is put right on what it stands on (`at_rest`) when it is seen for the first
    time in an episode. The error that this shows is one of how it is seen, and so goes with it: in the hand,
    too.

    Args:
        worlds: Number of worlds.
    """

    def __init__(self, worlds: int) -> None:
        self._models: list[WorldModel | None] = [None] * worlds
        self._own: list[Array] = [np.zeros((0, 7))] * worlds
        self._new: dict[int, Array] = {}
        self._arranged: tuple[object, Array | None] | None = None

    def begin(self, rows: Array, models: Sequence[WorldModel]) -> None:
        """Episodes begin in worlds ``rows (k,)``: nothing was seen of them."""
        for row, model in zip(rows.tolist(), models, strict=True):
            n = len(model.objects)
            self._models[row], self._own[row] = model, np.tile(_NOTHING, (n, 1))
            self._new[row] = np.ones(n, bool)
        self._arranged = None

    def see(self, observation: Observation) -> None:
        """Note what is seen for the first time.

        Args:
            observation: Of all worlds ``(N, ...)``, the objects of each in the order of its `WorldModel`.
        """
        for row, new in list(self._new.items()):
            model = self._models[row]
            assert model is not None, "it has begun"
            estimates = np.asarray(host(observation.objects[row, ...]), float)[: len(model.objects)]
            first = new & np.isfinite(estimates).all(axis=-1)
            if first.any():
                corrected = at_rest(model, estimates)
                self._own[row][first] = poses.relative(estimates[first], corrected[first])
                self._arranged = None
            self._new[row] = new & ~first
            if not self._new[row].any():
                del self._new[row]

    def of_world(self, row: int) -> Array:
        """Corrections ``(n, 7)`` of one world, in its objects' own frames and order."""
        return self._own[row]

    def corrections(self, columns: Sequence[str], like: Array) -> Array | None:
        """Corrections ``(N, columns, 7)`` in the objects' own frames; None where there are none.

        Args:
            columns: Names of the objects, in order.
            like: An array of the library, type and device that is wanted.
        """
        if self._arranged is None or self._arranged[0] != tuple(columns):
            out = np.tile(_NOTHING, (len(self._own), len(columns), 1))
            for row, model in enumerate(self._models):
                for name, own in () if model is None else model.index.items():
                    out[row, columns.index(name)] = self._own[row][own]
            some = bool((abs(out - _NOTHING) > 1e-9).any())
            self._arranged = tuple(columns), constant(out, like) if some else None
        return self._arranged[1]
