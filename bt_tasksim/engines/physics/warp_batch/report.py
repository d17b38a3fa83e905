"""What is read of a group of worlds in one transfer, and which columns of it are what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.mujoco_model import World
from bt_tasksim.robot.description import RobotDescription


@dataclass(frozen=True)
class Columns:
    """Where things are in a report.

    Attributes:
        first: First column, by name.
        count: Number of columns, by name.
    """

    first: dict[str, int]
    count: dict[str, int]

    @classmethod
    def of(cls, widths: Mapping[str, int]) -> Columns:
        """One thing behind the other."""
        ends = np.cumsum([0, *widths.values()]).tolist()
        return cls(dict(zip(widths, ends, strict=False)), dict(widths))

    @property
    def width(self) -> int:
        """Number of all columns."""
        return sum(self.count.values())

    def floats(self, report: Array, name: str) -> Array:
        """Numbers ``(k, n)`` of rows of a report, in double precision."""
        return self._of(report, name).view(np.float32).astype(float)

    def integers(self, report: Array, name: str) -> Array:
        """Whole numbers ``(k, n)`` of rows of a report."""
        return self._of(report, name)

    def _of(self, report: Array, name: str) -> Array:
        return np.ascontiguousarray(report[:, self.first[name] : self.first[name] + self.count[name]])


@dataclass(frozen=True, eq=False)
class BodyNumbers:
    """Numbers of bodies in a model, and counts.

    Attributes:
        tool: The one that carries the tool.
        wrist: The one behind the wrist's sensor.
        root: The robot's root.
        read: Those whose poses are read: the tool's, the fingertips', the objects'.
        n_tips: Number of fingertips.
        n_objects: Number of objects.
        n_fixtures: Number of fixtures.
    """

    tool: int
    wrist: int
    root: int
    read: Array
    n_tips: int
    n_objects: int
    n_fixtures: int

    @classmethod
    def of(cls, robot: RobotDescription, world: World, n_fixtures: int) -> BodyNumbers:
        """The numbers of a world."""
        model = world.model

        def body(link: str) -> int:
            return int(model.body(f"robot/{link}").id)

        wrist = body(robot.wrist_link)
        frames = [body(robot.tool_link), *(body(tip.links[0]) for tip in robot.tips)]
        return cls(
            tool=frames[0],
            wrist=wrist,
            root=int(model.body_rootid[wrist]),
            read=np.array([*frames, *world.object_body.tolist()], np.int32),
            n_tips=len(robot.tips),
            n_objects=len(world.object_body),
            n_fixtures=n_fixtures,
        )
