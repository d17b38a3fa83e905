"""A tree that keeps an arm moving for as long as it should, and misbehaves when told; on the twin."""

from __future__ import annotations

from typing import Any

import numpy as np

from bt_tasksim import Runner, Scene
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.world import Command
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.trees import sequence

SCENE = Scene("panda", objects={"cup": "on table"})
AMPLITUDE, RATE = 0.1, 4.0
"""Metres to and fro, and rad/s: up to 0.2 m/s."""


class Sweep(ConceptModel):
    """Moves the tool to and fro along y.

    Attributes:
        trouble: Called at every tick with the command that it would give; gives the one to use.
        lasts: Seconds.
    """

    default_timeout = 10_000.0
    lasts = 10_000.0

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.trouble = lambda tool: tool

    def begin(self, seen: Any) -> Any:
        """Where the tool is at first."""
        return seen.tool.copy()

    def command(self, action: Any, seen: Any, memory: Any) -> Command:
        """The next point of the way."""
        tool = memory.copy()
        tool[:, 1] += AMPLITUDE / 2.0 * (1.0 - np.cos(RATE * seen.elapsed))
        return Command(tool=self.trouble(tool))

    def done(self, seen: Any, memory: Any) -> Any:
        """It has lasted long enough."""
        return seen.elapsed >= self.lasts


def sweeping(port: int, ros: str = "") -> tuple[Runner, Sweep]:
    """A runner of a sweep, and the sweep, on the twin behind a rosbridge of this machine.

    Args:
        port: Of rosbridge.
        ros: File with topics and names; by default the robot's bundled one.
    """
    leaf = Sweep(name="sweep")
    runner = Runner(sequence("root", leaf), SCENE, EngineOptions(engines=f"ros:127.0.0.1:{port}", ros=ros))
    runner.longest = 10_000.0
    sweep: Sweep = leaf.model
    return runner, sweep
