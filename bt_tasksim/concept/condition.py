"""Conditions: leaves of a behaviour tree that ask one question of what is seen."""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import Any

from py_trees.common import Status

from bt_tasksim.concept.context import Seen
from bt_tasksim.concept.leaf import ContextLeaf
from bt_tasksim.concept.parameters import Parameter, bind_arguments, declared_parameters
from bt_tasksim.concept.reporting import as_statement
from bt_tasksim.core.outcomes import Statement, register_reason
from bt_tasksim.core.poses import Array

HOLDS = register_reason("condition_holds", "")
HOLDS_NOT = register_reason("condition_does_not_hold", "")


class Condition(ContextLeaf):
    """A leaf that asks a question and answers at once: SUCCESS for yes, FAILURE for no.

    A subclass declares parameters like a concept and overrides `holds`.
    """

    values: Mapping[str, Any]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        name = kwargs.pop("name", None)
        kind = type(self).__name__
        owner = f"condition {kind}"
        checked = bind_arguments(self.parameters(), args, kwargs, owner)
        first = next(iter(checked.values()), "")
        super().__init__(name or f"{kind.lower()} {first}".strip())
        self._named = name
        self.values = checked
        for key, value in checked.items():
            setattr(self, key, value)

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """The declared parameters, by name."""
        return {p.name: p for p in declared_parameters(cls, Condition)}

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments that build an equal leaf."""
        out = {k: v for k, v in self.values.items() if (p := self.parameters()[k]).required or v != p.default}
        return out | ({"name": self._named} if self._named else {})

    @abc.abstractmethod
    def holds(self, seen: Seen) -> Array:
        """The answer: boolean ``(...)``; pure and batched."""

    def explain(self, seen: Seen) -> Statement | str | None:
        """The answer: a `Form` with its numbers, or words."""
        return None

    def update(self) -> Status:
        """Ask once."""
        seen = self.context.seen(0.0)
        yes = bool(self.holds(seen))
        said = as_statement(self.explain(seen))
        self.report(HOLDS(said) if yes else HOLDS_NOT(said))
        return Status.SUCCESS if yes else Status.FAILURE
