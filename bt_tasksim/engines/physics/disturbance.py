"""A disturbance as it happens: when it begins, how it pushes, and when it is over."""

from __future__ import annotations

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.scene.configuration import Disturbance

_WAITING, _PUSHING, _OVER = range(3)


class DisturbanceForce:
    """Pushes an object out of the hand, some time after the hand first held it clear of its support.

    Args:
        disturbance: What happens, or None for nothing.
    """

    def __init__(self, disturbance: Disturbance | None) -> None:
        self._disturbance = disturbance
        self._phase = _OVER if disturbance is None else _WAITING
        self._held_since: float | None = None
        self._end = 0.0

    @property
    def over(self) -> bool:
        """Nothing will happen any more."""
        return self._phase == _OVER

    @property
    def pushing(self) -> bool:
        """It pushes now."""
        return self._phase == _PUSHING

    def watch(self, time: float, held: bool) -> None:
        """Wait for the push to begin; ``held``: the hand holds the object clear of everything else."""
        if self._disturbance is None or self._phase != _WAITING:
            return
        if self._held_since is None:
            self._held_since = time if held else None
        elif time - self._held_since >= self._disturbance.delay:
            self._phase, self._end = _PUSHING, time + self._disturbance.limit

    def force(self, time: float, touched: bool, velocity: Array) -> Array:
        """Force ``(3,)`` on the object's origin now, N: none above the stated speed, and none once it is out.

        Args:
            time: Seconds since the episode began.
            touched: The hand still touches the object.
            velocity: Of the object ``(3,)``, m/s.
        """
        assert self._disturbance is not None and self._phase == _PUSHING
        if time > self._end or not touched:
            self._phase = _OVER
            return np.zeros(3)
        force = np.array(self._disturbance.force)
        slow = float(velocity @ force) < self._disturbance.speed * float(np.linalg.norm(force))
        return force if slow else np.zeros(3)
