"""The worlds of episodes: drawn from a scene, begun, and stepped with what a tree has written."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.context import Context, Refusal
from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.clear_start import clear_draw
from bt_tasksim.execution.worlds import Worlds
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import WorldSource


class Draws(NamedTuple):
    """Where the worlds of an episode are drawn from.

    Attributes:
        rng: Gives one seed after the other, until one has an episode.
        draw: The seed of the only world instead; None: as many as it takes.
        stream: See `bt_tasksim.scene.configuration.STREAMS`.
        stage: Number of the scene's stage; None: the scene itself.
    """

    rng: np.random.Generator
    draw: int | None = None
    stream: str = "training"
    stage: int | None = None


class DrawnWorlds:
    """Worlds that take another draw one by one.

    Args:
        engines: They simulate the worlds.
        scene: Where worlds are drawn from.
        robot: The robot.
        context: What leaves see of the worlds and write for them.

    Attributes:
        scene: Where worlds are drawn from: the engines' own, if they have one.
        seeds: ``(N,)`` the seed of each world.
    """

    def __init__(
        self, engines: Worlds, scene: WorldSource, robot: RobotDescription, context: Context
    ) -> None:
        self._engines, self._robot, self._context = engines, robot, context
        self.scene = engines.source(scene)
        self.seeds = np.zeros(context.worlds, np.int64)
        self._draws: list[Draws | None] = [None] * context.worlds
        self._refused: dict[int, Refusal] = {}

    def draw_from(self, row: int, draws: Draws) -> None:
        """Where the next worlds in a row come from."""
        self._draws[row] = draws

    def has_one_draw(self, row: int) -> bool:
        """There is one draw for the world, and no other instead."""
        draws = self._draws[row]
        return draws is not None and draws.draw is not None

    def sample(self, rows: Array) -> tuple[dict[int, ActorConfiguration], dict[int, BtTasksimError]]:
        """Draw worlds for rows ``(k,)``: what was drawn, and why there is none, by row."""
        drawn: dict[int, ActorConfiguration] = {}
        failed: dict[int, BtTasksimError] = {}
        for row in rows.tolist():
            draws = self._draws[row]
            assert draws is not None
            self.seeds[row] = int(draws.rng.integers(2**31)) if draws.draw is None else draws.draw
            try:
                drawn[row] = clear_draw(
                    self.scene,
                    int(self.seeds[row]),
                    draws.stream,
                    self._robot,
                    draws.stage,
                    self._engines.real,
                )
            except BtTasksimError as error:
                failed[row] = error
        return drawn, failed

    def begin(self, drawn: dict[int, ActorConfiguration]) -> dict[int, BtTasksimError]:
        """Begin drawn worlds, by row: why that was not possible, where it was not."""
        rows, tips = np.array(list(drawn), int), [tip.name for tip in self._robot.tips]
        worlds = list(drawn.values())
        self._context.begin([world.world_model(tips, self._robot.opening) for world in worlds], rows)
        self._engines.reset(rows, worlds)
        return self._engines.errors(rows)

    def step(self, rows: Array) -> dict[int, BtTasksimError]:
        """One control period in worlds ``(k,)``, with what was written there: which have failed, and why.

        Raises:
            LeafError: What was written is not finite.
        """
        written = self._context.written
        tool, hand = (None if part is None else part[rows] for part in (written.tool, written.hand))
        unreached = self._engines.step(tool, hand, rows)
        self._refused = {miss.row: self._context.refusal(miss.row, miss.error) for miss in unreached}
        return self._engines.errors(rows)

    def look(self, rows: Array) -> None:
        """Let the leaves see worlds ``(k,)`` as they are now, and what could not be reached in the step."""
        self._context.advance(self._engines.observe(rows), rows)
        self._context.refused.update(self._refused)
        self._refused = {}
