"""Conditions that a concept says of its own parameters: what it brings about, and what it asks for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, init=False)
class ConditionOf:
    """A condition about a concept's parameters, such as ``ConditionOf("AtPose", target="target", on="on")``.

    The condition is named as it is registered, so that a concept and its condition need not import each
    other.

    Args:
        condition: The condition's registered name.
        given: Values of the concept's parameters, by name, with which alone this is so.
        sometimes: It is so only where the concept can do it, such as a push, for which things have to stand
            on one level: another concept that establishes the condition is preferred.
        parameters: By the condition's parameter, the concept's parameter that has its value.
    """

    condition: str
    parameters: Mapping[str, str]
    given: Mapping[str, Any]
    sometimes: bool

    def __init__(
        self,
        condition: str,
        /,
        *,
        given: Mapping[str, Any] | None = None,
        sometimes: bool = False,
        **parameters: str,
    ) -> None:
        object.__setattr__(self, "condition", condition)
        object.__setattr__(self, "parameters", parameters)
        object.__setattr__(self, "given", given or {})
        object.__setattr__(self, "sometimes", sometimes)

    def arguments(self, values: Mapping[str, Any]) -> dict[str, Any] | None:
        """The condition's arguments for a concept; None where the concept leaves one of them open.

        Also None where the concept has other values than the given ones.

        Args:
            values: The concept's arguments and defaults, by name.
        """
        if any(values.get(name) != value for name, value in self.given.items()):
            return None
        found = {ours: values.get(theirs) for ours, theirs in self.parameters.items()}
        return None if None in found.values() else found

    def inverted(self, arguments: Mapping[str, Any]) -> dict[str, Any] | None:
        """The concept's arguments that make a condition hold; None where it would say something else.

        Arguments that the concept has no say in, such as tolerances, are passed over.

        Args:
            arguments: The condition's arguments, by name.
        """
        if not self.parameters.keys() & arguments.keys() and self.parameters:
            return None
        found = {theirs: arguments[ours] for ours, theirs in self.parameters.items() if ours in arguments}
        return {**found, **self.given}
