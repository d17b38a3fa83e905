"""Conditions: models of leaves that ask one question of what is seen."""

from __future__ import annotations

import abc
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from py_trees.common import Status

from bt_tasksim.concept.contract import Contract
from bt_tasksim.concept.leaf import ONE, ModelLeaf
from bt_tasksim.concept.model import LeafModel
from bt_tasksim.concept.parameters import Parameter, declared_parameters
from bt_tasksim.concept.reporting import as_statement
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.outcomes import Outcome, Statement, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.specs import Goal

HOLDS = register_reason("condition_holds", "")
HOLDS_NOT = register_reason("condition_does_not_hold", "")


class ConditionNode(ModelLeaf):
    """The leaf of a condition: SUCCESS for yes, FAILURE for no, at once.

    Args:
        args: Parameters of the condition, in their order.
        name: The leaf's name; by default the condition and its first parameter.
        kwargs: Parameters by name.

    Raises:
        InputError: A parameter is unknown, missing or does not fit.
    """

    def __init__(self, *args: Any, name: str | None = None, **kwargs: Any) -> None:
        super().__init__(self.model_class.value(*args, **kwargs), name)
        self._contract = Contract(self, self.model)

    @property
    def model(self) -> Condition:
        """What it asks, as a value."""
        found: Condition = self._model
        return found

    def update(self) -> Status:
        """Ask once."""
        seen = self.context.seen(ONE, np.zeros(1))
        holds, why = self.asked(seen)
        yes = bool(holds[0])
        self.report(answer(why, 0, yes))
        return Status.SUCCESS if yes else Status.FAILURE

    def asked(self, seen: Seen) -> tuple[Array, Statement | None]:
        """The answer, boolean ``(N,)``, and why.

        Raises:
            LeafError: The condition gives something else.
        """
        worlds = len(seen.elapsed)
        holds, why = self.model.holds(seen), self.model.explain(seen)
        self._contract.answers(holds, worlds, "holds")
        self._contract.words(why, worlds)
        return holds, as_statement(why)


if TYPE_CHECKING:
    # To type checkers a condition is what a call of its class makes, see `bt_tasksim.concept.model`.
    _CalledCondition = ConditionNode
else:
    _CalledCondition = object


class Condition(LeafModel, _CalledCondition):
    """A question; a leaf of it answers at once: SUCCESS for yes, FAILURE for no.

    A subclass declares parameters like a concept and overrides `holds`.
    """

    leaf_base: ClassVar[type[ModelLeaf]] = ConditionNode
    relation: ClassVar[str | None] = None
    """The goal relation that it asks about, as far as can be seen; None: no goal is about it."""
    in_hand: ClassVar[bool] = False
    """It can hold only as long as the hand holds something: letting go ends it."""
    takes_middle: ClassVar[bool] = False
    """A goal of its `relation` takes the one spot in the middle of its place: of two objects one has it."""
    leaves_open: ClassVar[bool] = False
    """A goal of its `relation` leaves open where on the place: its turn is after goals that do not."""
    rests_on_place: ClassVar[bool] = True
    """A goal of its `relation` puts its object on or in its place, which has to be where it should be before.
    Otherwise the two only refer to each other, and may do so in a circle."""

    lasting: ClassVar[bool] = False
    """What it asks never changes, such as how a part of furniture moves: where several chains of concepts
    lead to a goal, it says which of them does in a world."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._bind(args, kwargs, f"condition {type(self).__name__}")

    @classmethod
    def from_goal(cls, goal: Goal) -> dict[str, Any]:
        """Arguments with which it asks whether a goal of its `relation` is reached.

        By default the first parameter is the goal's object, and the second one its place.
        """
        return dict(zip(cls.parameters(), (goal.object, goal.place), strict=False))

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """The declared parameters, by name."""
        return {p.name: p for p in declared_parameters(cls, Condition)}

    @abc.abstractmethod
    def holds(self, seen: Seen) -> Array:
        """The answer: boolean ``(N,)``; what it is for one world may not depend on the others."""

    def explain(self, seen: Seen) -> Statement | str | None:
        """The answer: a `Form` with its numbers ``(N,)``, or words that are true of all worlds."""
        return None


def answer(why: Statement | None, world: int, yes: bool) -> Outcome:
    """A condition's answer in one world, by its row, as an outcome."""
    return (HOLDS if yes else HOLDS_NOT)(None if why is None else why.at(world))
