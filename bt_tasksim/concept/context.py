"""What a leaf reads and writes during a tick.

Each tree has one `Context`, handed to its leaves through ``setup(context=...)``; nothing is process-global.
`Seen` and `Known` are the views through which the pure functions of concepts look at an observation and at
the hidden state: they resolve names to array slices.
"""

from __future__ import annotations

import typing
from math import isfinite

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.core.culprit import place_of
from bt_tasksim.core.errors import CommandConflictError, LeafError
from bt_tasksim.core.observables import observable
from bt_tasksim.core.outcomes import Outcome
from bt_tasksim.core.plain import shown
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Command, Hidden, ObjectModel, Observation, PlaceModel, WorldModel
from bt_tasksim.robot.description import RobotDescription

NO_EPISODE = "no episode has begun: a tree with concepts is ticked by a Runner"


class Seen:
    """An observation, with names resolved; batch dimensions ``(...)``.

    Args:
        observation: What was observed.
        world: Names and calibrated facts.
        robot: The robot.
        elapsed: ``(...)`` seconds since the concept became active.
    """

    __slots__ = ("_derived", "elapsed", "observation", "robot", "world")

    def __init__(
        self, observation: Observation, world: WorldModel, robot: RobotDescription, elapsed: Array
    ) -> None:
        self.observation = observation
        self.world = world
        self.robot = robot
        self.elapsed = elapsed
        self._derived: dict[str, Array] | None = None

    def observable(self, name: str) -> Array:
        """An observable by its name, computed when it is first asked for.

        Raises:
            InputError: There is none of this name.
        """
        if self._derived is None:
            self._derived = {}
        if name not in self._derived:
            self._derived[name] = observable(name).read(self.observation, self.world)
        return self._derived[name]

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
        if type(contacts) is np.ndarray and contacts.ndim == 1:
            touching = contacts.tolist()
            return np.bool_(all(any(touching[i] for i in group) for group in self.robot.opposition))
        out = contacts[..., self.robot.opposition[0][0]] | False
        for n, group in enumerate(self.robot.opposition):
            touched = contacts[..., group[0]]
            for i in group[1:]:
                touched = touched | contacts[..., i]
            out = touched if n == 0 else out & touched
        return out


class Known:
    """The hidden state, with names resolved; batch dimensions ``(...)``.

    Args:
        hidden: The state now.
        world: Names and calibrated facts.
        began: The state when the concept became active; None where nobody kept it.
    """

    __slots__ = ("began", "hidden", "world")

    def __init__(self, hidden: Hidden, world: WorldModel, began: Hidden | None = None) -> None:
        self.hidden = hidden
        self.world = world
        self.began = began

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
        self.now = 0.0
        """Seconds since the episode began."""
        self.refused: tuple[Behaviour | None, Outcome] | None = None
        """The leaf whose command of the last tick an engine could not carry out, and why."""
        self._tool: tuple[Array, Behaviour] | None = None
        self._hand: tuple[Array, Behaviour] | None = None
        self._held: set[tuple[str, str]] = set()

    @property
    def world(self) -> WorldModel:
        """Names and calibrated facts of the episode.

        Raises:
            RuntimeError: The tree is ticked outside an episode.
        """
        if self._world is None:
            raise RuntimeError(NO_EPISODE)
        return self._world

    @property
    def observation(self) -> Observation:
        """The observation of this tick.

        Raises:
            RuntimeError: The tree is ticked outside an episode.
        """
        if self._observation is None:
            raise RuntimeError(NO_EPISODE)
        return self._observation

    def begin(self, world: WorldModel, observation: Observation) -> None:
        """Begin an episode."""
        self._world = world
        self._held.clear()
        self.advance(observation)

    def advance(self, observation: Observation) -> None:
        """Go on to the next tick: a new observation, and an empty command."""
        self._observation = observation
        self.now = float(observation.time)
        self._tool = self._hand = None
        self.refused = None

    def write(self, command: Command, leaf: Behaviour) -> None:
        """Write a command, or a part of one.

        Raises:
            CommandConflictError: Another leaf has written the same part in this tick.
            LeafError: A part is not a row of numbers of its length; says where the leaf's class makes it.
        """
        if command.tool is not None:
            if self._tool is not None:
                raise _conflict("tool", self._tool[1], leaf)
            self._tool = (_checked("tool", command.tool, leaf), leaf)
        if command.hand is not None:
            if self._hand is not None:
                raise _conflict("hand", self._hand[1], leaf)
            self._hand = (_checked("hand", command.hand, leaf), leaf)

    @property
    def tool_writer(self) -> Behaviour | None:
        """The leaf that has commanded the tool in this tick."""
        return None if self._tool is None else self._tool[1]

    def withdraw(self, leaf: Behaviour) -> None:
        """Drop what a leaf has written in this tick: it was interrupted, and others may act instead."""
        if self._tool is not None and self._tool[1] is leaf:
            self._tool = None
        if self._hand is not None and self._hand[1] is leaf:
            self._hand = None

    @property
    def command(self) -> Command:
        """What the leaves have written in this tick.

        Raises:
            LeafError: A part is not finite; names the leaf that wrote it.
        """
        tool, hand = self._tool, self._hand
        for part, written in (("tool", tool), ("hand", hand)):
            if written is not None and not isfinite(written[0] @ written[0]):
                raise LeafError(
                    f"leaf '{written[1].name}' commands a {part} target that is not finite: {written[0]}"
                )
        return Command(None if tool is None else tool[0], None if hand is None else hand[0])

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
        if self._world is None or self._observation is None:
            raise RuntimeError(NO_EPISODE)
        return Seen(self._observation, self._world, self.robot, np.float64(elapsed))


WANTED = {
    "tool": "a tool target is 7 numbers: position, then quaternion w x y z",
    "hand": "a hand target is a row of numbers, the closure first: hand=np.array([closure])",
}


def _checked(part: str, value: Array, leaf: Behaviour) -> Array:
    """A part of a command as an array ``(n,)``."""
    if type(value) is np.ndarray and value.ndim == 1 and (part == "hand" or value.size == 7):
        return value
    try:
        found = np.asarray(value, float)
    except (TypeError, ValueError):
        found = np.zeros(())
    if found.ndim != 1 or (part == "tool" and found.size != 7) or not found.size:
        place = place_of(getattr(type(leaf), "command", type(leaf)))
        where = f" ({place})" if place else ""
        raise LeafError(f"leaf '{leaf.name}'{where} commands {part}={shown(repr(value))}: {WANTED[part]}")
    return found


def _conflict(part: str, first: Behaviour, second: Behaviour) -> CommandConflictError:
    return CommandConflictError(
        f"two leaves command the {part} in one tick: '{first.name}' and '{second.name}'"
    )
