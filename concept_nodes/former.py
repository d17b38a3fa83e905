"""Concepts of version 0.1, whose functions at the begin and for people were written for one world.

``bt-tasksim convert`` has files of that version import from here. A concept written today derives from
`bt_tasksim.concept.model.ConceptModel`, see ``docs/write_a_concept.md``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bt_tasksim.concept.functions import MemoryT
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes import holding as held
from bt_tasksim.core.bundles import mapped
from bt_tasksim.core.fact_arrays import FactArrays
from bt_tasksim.core.outcomes import PRECONDITION_UNMET, TEXT, Possible, Statement
from bt_tasksim.core.poses import Array, array_namespace, host
from bt_tasksim.planning import reference_motion
from bt_tasksim.planning.reference_motion import Path


class OneWorld:
    """What is seen in one world, or a part of it, without the axis of worlds, in NumPy.

    Args:
        whole: The same of a batch of one.
    """

    def __init__(self, whole: Any) -> None:
        self.whole = whole

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.whole, name)
        if callable(found):
            return lambda *arguments: _without(found(*arguments))
        return OneWorld(found) if name in ("observation", "world") else _without(found)


def _without(value: Any) -> Any:
    if isinstance(value, FactArrays):
        return value.map(lambda values: host(values)[0])
    return host(value)[0] if getattr(value, "ndim", 0) else value


def _worlds(seen: Seen) -> list[OneWorld]:
    return [OneWorld(seen.at(np.array([k]))) for k in range(seen.tool.shape[0])]


class OneWorldConcept(ConceptModel[MemoryT]):
    """A concept whose own `initial_state`, `begin` and `explain` are asked in one world after the other."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        for name, change in _CHANGES.items():
            if name in vars(cls):
                setattr(cls, name, change(vars(cls)[name]))


def _initial_state(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def initial_state(self: Any, seen: Any) -> Any:
        if isinstance(seen, OneWorld):
            return function(self, seen)
        said = tuple(str(function(self, one) or "") for one in _worlds(seen))
        cannot = array_namespace(seen.tool).asarray([bool(text) for text in said], device=seen.tool.device)
        return Possible(cannot, PRECONDITION_UNMET(text=said))

    return initial_state


def _begin(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def begin(self: Any, seen: Any) -> Any:
        if isinstance(seen, OneWorld):
            return function(self, seen)
        xp, device = array_namespace(seen.tool), seen.tool.device
        memories = [function(self, one) for one in _worlds(seen)]
        return mapped(lambda *v: xp.asarray(np.stack([host(x) for x in v]), device=device), *memories)

    return begin


def _explain(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def explain(self: Any, seen: Any, memory: Any) -> Any:
        if isinstance(seen, OneWorld):
            return function(self, seen, memory)
        rows = [mapped(lambda values, k=k: host(values[k, ...]), memory) for k in range(seen.tool.shape[0])]
        said = [function(self, one, row) for one, row in zip(_worlds(seen), rows, strict=True)]
        return TEXT(
            text=tuple(one.sentence if isinstance(one, Statement) else str(one or "") for one in said)
        )

    return explain


_CHANGES = {"initial_state": _initial_state, "begin": _begin, "explain": _explain}


def plan(waypoints: Sequence[Array], *arguments: Any, **settings: Any) -> Path:
    """See `bt_tasksim.planning.reference_motion.plan`; the path ``(n, 7)`` of one world."""
    path = reference_motion.plan([host(w)[None] for w in waypoints], *arguments, **settings)
    return Path(path.table[0], path.duration[0])


def holding(seen: Any, target: str, reach: float = 0.03) -> Any:
    """See `bt_tasksim.concept_nodes.holding.holding`; in one world it is one boolean."""
    if isinstance(seen, OneWorld):
        return bool(held.holding(seen.whole, target, reach)[0])
    return held.holding(seen, target, reach)


def not_held(seen: Any, target: str) -> str:
    """That an object is not in the hand, in words."""
    return held.not_held(seen.whole, target).at(0).sentence
