"""What a leaf reads and writes during a tick.

Each tree has one `Context`, handed to its leaves through ``setup(context=...)``; nothing is process-global.
`Seen` and `Known` are the views through which the pure functions of concepts look at an observation and at
the hidden state: they resolve names to array slices.
"""

from __future__ import annotations

import typing
from dataclasses import replace

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.errors import CommandConflictError
from bt_tasksim.poses import Array
from bt_tasksim.robot import RobotDescription
from bt_tasksim.world import Command, Hidden, ObjectModel, Observation, PlaceModel, WorldModel


class Seen:
    """An observation, with names resolved; batch dimensions ``(...)``.

    Args:
        observation: What was observed.
        world: Names and calibrated facts.
        robot: The robot.
        elapsed: ``(...)`` seconds since the concept became active.
    """

    __slots__ = ("elapsed", "observation", "robot", "world")

    def __init__(
        self, observation: Observation, world: WorldModel, robot: RobotDescription, elapsed: Array
    ) -> None:
        self.observation = observation
        self.world = world
        self.robot = robot
        self.elapsed = elapsed

    @property
    def tool(self) -> Array:
        """Tool pose ``(..., 7)``."""
        return self.observation.tool_pose

    @property
    def closure(self) -> Array:
        """Closure of the hand ``(...)``."""
        return self.observation.closure

    @property
    def contacts(self) -> Array:
        """Fingertip contacts ``(..., n_tips)``."""
        return self.observation.contacts

    @property
    def wrench(self) -> Array:
        """External wrench at the tool ``(..., 6)``."""
        return self.observation.wrench

    def object(self, name: str) -> Array:
        """Estimated pose ``(..., 7)`` of an object."""
        return self.observation.objects[..., self.world.object_index(name), :]

    def model(self, name: str) -> ObjectModel:
        """What is known beforehand of an object."""
        return self.world.object(name)

    def place(self, name: str) -> PlaceModel:
        """A place of the scene."""
        return self.world.place(name)

    def opposed(self) -> Array:
        """Boolean ``(...)``: at least one fingertip of each opposing group touches something."""
        contacts = self.observation.contacts
        out = contacts[..., self.robot.opposition[0][0]] | False
        for n, group in enumerate(self.robot.opposition):
            touched = contacts[..., group[0]]
            for i in group[1:]:
                touched = touched | contacts[..., i]
            out = touched if n == 0 else out & touched
        return out


class Known:
    """The hidden state, with names resolved; batch dimensions ``(...)``."""

    __slots__ = ("hidden", "world")

    def __init__(self, hidden: Hidden, world: WorldModel) -> None:
        self.hidden = hidden
        self.world = world

    def object(self, name: str) -> Array:
        """True pose ``(..., 7)`` of an object."""
        return self.hidden.objects[..., self.world.object_index(name), :]

    def velocity(self, name: str) -> Array:
        """Linear and angular velocity ``(..., 6)`` of an object."""
        return self.hidden.velocities[..., self.world.object_index(name), :]

    def hand_force(self, name: str) -> Array:
        """Sum ``(...)`` of the hand's contact forces on an object, N."""
        return self.hidden.hand_force[..., self.world.object_index(name)]

    def supported(self, name: str) -> Array:
        """Boolean ``(...)``: an object touches something besides the hand."""
        row = self.hidden.support[..., self.world.object_index(name), :]
        out = row[..., 0]
        for i in range(1, row.shape[-1]):
            out = out | row[..., i]
        return out

    def place(self, name: str) -> PlaceModel:
        """A place of the scene."""
        return self.world.place(name)


class Context:
    """The one place through which a tree's leaves read the observation and write the command.

    Args:
        robot: The robot that the tree commands.
    """

    def __init__(self, robot: RobotDescription) -> None:
        self.robot = robot
        self._world: WorldModel | None = None
        self._observation: Observation | None = None
        self.hidden: typing.Callable[[], Hidden | None] = lambda: None
        self.look = False
        self._command = Command()
        self._writers: dict[str, Behaviour] = {}
        self._held: set[tuple[str, str]] = set()

    @property
    def world(self) -> WorldModel:
        """Names and calibrated facts of the episode.

        Raises:
            RuntimeError: The tree is ticked outside an episode.
        """
        if self._world is None:
            raise RuntimeError("no episode has begun: a tree with concepts is ticked by a Runner")
        return self._world

    @property
    def observation(self) -> Observation:
        """The observation of this tick.

        Raises:
            RuntimeError: The tree is ticked outside an episode.
        """
        if self._observation is None:
            raise RuntimeError("no episode has begun: a tree with concepts is ticked by a Runner")
        return self._observation

    @property
    def time(self) -> float:
        """Seconds since the episode began."""
        return float(self.observation.time)

    def begin(self, world: WorldModel, observation: Observation) -> None:
        """Begin an episode."""
        self._world = world
        self._held.clear()
        self.advance(observation)

    def advance(self, observation: Observation) -> None:
        """Go on to the next tick: a new observation, and an empty command."""
        self._observation = observation
        self._command = Command()
        self._writers.clear()
        self.look = False

    def write(self, command: Command, leaf: Behaviour) -> None:
        """Write a command, or a part of one.

        Raises:
            CommandConflictError: Another leaf has written the same part in this tick.
            ValueError: A part is not finite.
        """
        for part in ("tool", "hand"):
            value = getattr(command, part)
            if value is None:
                continue
            if part in self._writers:
                first = self._writers[part].name
                raise CommandConflictError(
                    f"two leaves command the {part} in one tick: '{first}' and '{leaf.name}'"
                )
            if not np.isfinite(value.sum()):
                raise ValueError(f"leaf '{leaf.name}' commands a {part} target that is not finite: {value}")
            self._writers[part] = leaf
        self._command = command.over(self._command)

    def withdraw(self, leaf: Behaviour) -> None:
        """Drop what a leaf has written in this tick: it was interrupted, and others may act instead."""
        for part in [p for p, writer in self._writers.items() if writer is leaf]:
            del self._writers[part]
            self._command = replace(self._command, **{part: None})

    @property
    def command(self) -> Command:
        """What the leaves have written in this tick."""
        return self._command

    def reach(self, goal: str, target: str) -> None:
        """A concept has reached a goal (such as ``holding``) that later ones may have to maintain."""
        self._held.add((goal, target))

    def end(self, goal: str, target: str) -> None:
        """A concept has ended a goal."""
        self._held.discard((goal, target))

    def reached(self, goal: str, target: str) -> bool:
        """An earlier concept reached this goal and none has ended it."""
        return (goal, target) in self._held

    def seen(self, elapsed: float) -> Seen:
        """The view of this tick's observation."""
        return Seen(self.observation, self.world, self.robot, np.float64(elapsed))
