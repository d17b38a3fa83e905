"""Where the tool and every object were at every tick of an episode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.names import TOOL
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Observation, WorldState


@dataclass(frozen=True, repr=False)
class Paths:
    """Poses over time, robot base frame.

    Attributes:
        times: Seconds ``(N,)`` since the episode began.
        poses: By name of an object, and ``tool``: poses ``(N, 7)``.
    """

    times: Array
    poses: Mapping[str, Array]

    def of(self, name: str) -> Array:
        """The poses ``(N, 7)`` of an object, or of the tool.

        Raises:
            InputError: There is no such object.
        """
        if name not in self.poses:
            raise InputError(f"no path of '{name}'{nearest(name, self.poses)}")
        return self.poses[name]

    @property
    def last(self) -> dict[str, Array]:
        """The last pose ``(7,)`` of each."""
        return {name: path[-1] for name, path in self.poses.items()}

    def __repr__(self) -> str:
        return f"<Paths of {', '.join(self.poses)} at {len(self.times)} times>"


class PathKeeper:
    """Keeps the paths of one episode while it runs: some hundred bytes a tick.

    Args:
        names: Names of the objects, in the order of the arrays.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._times: list[float] = []
        self._rows: list[Array] = []

    def add(self, state: WorldState | None, seen: Observation) -> None:
        """Note where everything is now.

        Args:
            state: What the physics engine reports: the truth in simulation.
            seen: What is observed: where nobody knows the truth, objects are where they are seen.
        """
        objects = seen.objects if state is None or state.objects is None else state.objects
        tool = seen.tool_pose if state is None else state.tool_pose
        row = np.empty((1 + len(self._names), 7))
        row[0], row[1:] = tool, objects[: len(self._names)]  # an engine may have room for more
        self._times.append(float(seen.time))
        self._rows.append(row)

    def paths(self) -> Paths:
        """The paths so far."""
        rows = np.array(self._rows).reshape(-1, 1 + len(self._names), 7)
        poses = {name: rows[:, i] for i, name in enumerate((TOOL, *self._names))}
        return Paths(np.array(self._times), poses)
