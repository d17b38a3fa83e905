"""The views through which the pure functions of concepts look at an observation and at the hidden state.

They resolve names to columns. All arrays have a leading axis of worlds ``(N, ...)``, N = 1 included.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any, TypeVar

import numpy as np

from bt_tasksim.core.bundles import Rows
from bt_tasksim.core.fact_arrays import ObjectFacts, PlaceFacts
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.observables import observable
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.transfer import Index
from bt_tasksim.core.world import Hidden, Observation
from bt_tasksim.robot.description import RobotDescription

Made = TypeVar("Made")


class Seen:
    """An observation of ``N`` worlds, with names resolved.

    Args:
        observation: What was observed ``(N, ...)``.
        world: What is known beforehand of these worlds.
        robot: The robot.
        elapsed: ``(N,)`` seconds since the concept became active.
        later: The concepts that may still follow this one in its tree, where they are known: those after it
            in sequences, in order, and those of the same composite where all succeed in any order.
        succeeded: Booleans ``(N, n)`` in NumPy: which of these have succeeded already; None where nobody says
            it.
        failures: ``(N,)`` in NumPy: how often this leaf has failed in a row in the episode before it became
            active, or one after it has failed with what this one had reached, every second loss of it
            among them; None where nobody has counted.
        believed: Gives the poses ``(N, n_objects, 7)`` at which the objects are taken to be; by default they
            are as they were observed.
    """

    __slots__ = (
        "_believed",
        "_derived",
        "_made",
        "_whole",
        "elapsed",
        "failures",
        "later",
        "observation",
        "robot",
        "succeeded",
        "world",
    )

    def __init__(
        self,
        observation: Observation,
        world: WorldFacts,
        robot: RobotDescription,
        elapsed: Array,
        later: Sequence[Any] = (),
        failures: np.ndarray | None = None,
        believed: Callable[[], Array] | None = None,
        succeeded: np.ndarray | None = None,
    ) -> None:
        self.observation = observation
        self.world = world
        self.robot = robot
        self.elapsed = elapsed
        self.later = later
        self.failures = failures
        self.succeeded = succeeded
        self._believed = believed
        self._derived: dict[str, Array] | None = None
        self._made: dict[Hashable, Any] | None = None
        self._whole: tuple[Seen, Index] | None = None

    def at(self, rows: Array) -> Seen:
        """The view of some of these worlds.

        Args:
            rows: Their numbers ``(k,)``, ascending.
        """
        index = Index(rows)
        picked: Observation = Rows(self.observation, index.of)  # type: ignore[assignment]
        found = Seen(
            picked,
            self.world.map(index.of),
            self.robot,
            index.of(self.elapsed),
            self.later,
            index.of(self.failures) if self.failures is not None else None,
            lambda: index.of(self.objects),
            None if self.succeeded is None else self.succeeded[rows],
        )
        found._whole = self, index
        return found

    def believing(self, objects: Array) -> Seen:
        """The same view with the objects taken to be at other poses ``(N, n_objects, 7)``."""
        return Seen(
            self.observation,
            self.world,
            self.robot,
            self.elapsed,
            self.later,
            self.failures,
            believed=lambda: objects,
            succeeded=self.succeeded,
        )

    def to_come(self, row: int) -> list[Any]:
        """The concepts of `later` that have not succeeded already in one of these worlds."""
        done = self.succeeded
        return [model for k, model in enumerate(self.later) if done is None or not done[row, k]]

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

    def once(self, key: Hashable, make: Callable[[], Made], by_world: bool = False) -> Made:
        """What is made of this view, when it is first asked for; nobody writes to it.

        Args:
            key: Says what it is, with all that it is made of beside the view.
            make: Makes it.
            by_world: It is an array ``(N, ...)``, and a view of some of the worlds has their rows of it.
        """
        if self._made is None:
            self._made = {}
        if key not in self._made:
            there = self._of_whole(key) if by_world else None
            self._made[key] = make() if there is None else there
        found: Made = self._made[key]
        return found

    def _of_whole(self, key: Hashable) -> Array | None:
        """The rows of what was made of the view that this one was taken of; None where nothing was."""
        if self._whole is None:
            return None
        whole, index = self._whole
        made = (whole._made or {}).get(key)
        made = whole._of_whole(key) if made is None else made
        return None if made is None else index.of(made)

    @property
    def tool(self) -> Array:
        """Tool pose ``(N, 7)``."""
        return self.observation.tool_pose

    @property
    def closure(self) -> Array:
        """Closure of the hand ``(N,)``."""
        return self.observation.closure

    @property
    def contacts(self) -> Array:
        """Fingertip contacts ``(N, n_tips)``."""
        return self.observation.contacts

    @property
    def wrench(self) -> Array:
        """External wrench at the tool ``(N, 6)``."""
        return self.observation.wrench

    @property
    def objects(self) -> Array:
        """Poses ``(N, n_objects, 7)`` at which the objects are taken to be; NaN where one was never seen.

        They are as observed, but for what their first sight on a support has shown to be wrong: see
        `bt_tasksim.concept.beliefs`.
        """
        return self.observation.objects if self._believed is None else self._believed()

    def object(self, name: str) -> Array:
        """Pose ``(N, 7)`` at which an object is taken to be, see `objects`."""
        return self.objects[:, self.world.column(name), :]

    def observed(self, name: str) -> Array:
        """Estimated pose ``(N, 7)`` of an object as it was observed; NaN where it was never seen."""
        return self.observation.objects[:, self.world.column(name), :]

    def model(self, name: str) -> ObjectFacts:
        """What is known beforehand of an object."""
        return self.world.object(name)

    def place(self, name: str) -> PlaceFacts:
        """A place of the scene."""
        return self.world.place(name)

    def opposed(self) -> Array:
        """Boolean ``(N,)``: at least one fingertip of each opposing group touches something."""
        contacts, out = self.observation.contacts, None
        for group in self.robot.opposition:
            touched = contacts[:, group[0]]
            for i in group[1:]:
                touched = touched | contacts[:, i]
            out = touched if out is None else out & touched
        assert out is not None, "a robot has opposing groups"
        return out


class Known:
    """The hidden state of ``N`` worlds, with names resolved.

    Args:
        hidden: The state now ``(N, ...)``.
        world: What is known beforehand of these worlds.
        began: The state when the concept became active; None where nobody kept it.
    """

    __slots__ = ("began", "hidden", "world")

    def __init__(self, hidden: Hidden, world: WorldFacts, began: Hidden | None = None) -> None:
        self.hidden = hidden
        self.world = world
        self.began = began

    def object(self, name: str) -> Array:
        """True pose ``(N, 7)`` of an object."""
        return self.hidden.objects[:, self.world.column(name), :]

    def velocity(self, name: str) -> Array:
        """Linear and angular velocity ``(N, 6)`` of an object."""
        return self.hidden.velocities[:, self.world.column(name), :]

    def hand_force(self, name: str) -> Array:
        """Sum ``(N,)`` of the hand's contact forces on an object, N."""
        return self.hidden.hand_force[:, self.world.column(name)]

    def supported(self, name: str) -> Array:
        """Boolean ``(N,)``: an object touches something besides the hand."""
        rows = self.hidden.support[:, self.world.column(name), :]
        return array_namespace(rows).any(rows, axis=-1)

    def place(self, name: str) -> PlaceFacts:
        """A place of the scene."""
        return self.world.place(name)
