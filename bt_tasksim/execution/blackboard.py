"""py_trees' blackboard, of which a process has one, as one for each world and each episode."""

from __future__ import annotations

import copy
from typing import Any, Self

from py_trees.blackboard import Blackboard

PARTS = ("storage", "metadata", "clients")
"""What stands on it: values, who may read and write them, and who these are."""


class WorldBlackboard:
    """A blackboard: where it is entered (``with board:``) it is py_trees' own, which is as before afterwards.

    It begins with what stands on another one: the same values, which are not copied. What is written then
    stays on it.

    Args:
        like: The other one; by default the process's as it is now.
    """

    def __init__(self, like: WorldBlackboard | None = None) -> None:
        found = _now() if like is None else like._parts
        self._parts: dict[str, Any] = {
            "storage": dict(found["storage"]),
            "metadata": {key: _copied(known) for key, known in found["metadata"].items()},
            "clients": dict(found["clients"]),
        }
        self._before: list[dict[str, Any]] = []

    @property
    def storage(self) -> dict[str, Any]:
        """The values, by py_trees' names of the keys, such as ``/speed``."""
        found: dict[str, Any] = self._parts["storage"]
        return found

    def __enter__(self) -> Self:
        self._before.append(_now())
        _put(self._parts)
        return self

    def __exit__(self, *_: object) -> None:
        self._parts = _now()
        _put(self._before.pop())


def _now() -> dict[str, Any]:
    return {name: getattr(Blackboard, name) for name in PARTS}


def _put(parts: dict[str, Any]) -> None:
    for name, value in parts.items():
        setattr(Blackboard, name, value)


def _copied(known: Any) -> Any:
    """Who may read and write a key, with sets of its own."""
    out = copy.copy(known)
    out.__dict__.update({name: set(users) for name, users in vars(known).items()})
    return out
