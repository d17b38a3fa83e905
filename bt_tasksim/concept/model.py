"""Concept models: what one writes to describe a task, as typed parameters and pure functions.

A concept model is its own leaf of a behaviour tree; its SUCCESS is its completion signal.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bt_tasksim.concept.functions import ConceptFunctions, MemoryT
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.parameters import Parameter, bind_arguments
from bt_tasksim.core.errors import InputError, nearest


class ConceptModel(ConceptFunctions[MemoryT], ConceptNode):
    """A task described well enough to learn it, or programmed where nothing is unknown.

    A subclass declares parameters as annotated attributes (`bt_tasksim.concept.parameters`) and overrides the
    pure functions of `ConceptFunctions`.

    Every concept takes these keyword arguments besides its own parameters:

    - ``name``: the leaf's name; by default the concept and its first parameter.
    - ``policy``: ``"programmed"``, or the folder of a learned policy; by default the one pinned.
    - ``timeout``: seconds after which it fails; by default the concept's own.
    - ``tolerance``: metres within which its goal counts as reached; by default the concept's own.
    - ``uncertainty``: standard deviations of numeric parameters, by name, in their units.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        concept = type(self).__name__
        settings = {k: kwargs.pop(k, None) for k in ("name", "policy", "timeout", "tolerance", "uncertainty")}
        declared = self.parameters()
        owner = f"{concept.lower()} '{settings['name']}'" if settings["name"] else concept.lower()
        checked = bind_arguments(declared, args, kwargs, owner)
        self._settings = settings
        first = next(iter(checked.values()), "")
        super().__init__(settings["name"] or f"{concept.lower()} {first}".strip())
        self._model = self
        for key, value in checked.items():
            object.__setattr__(self, key, value)
        self.values: Mapping[str, Any] = checked
        self.policy: str | None = _text(settings["policy"], owner, "policy")
        self.timeout = _positive(settings["timeout"], self.default_timeout, owner, "timeout")
        self.tolerance = _positive(settings["tolerance"], self.default_tolerance, owner, "tolerance")
        self.uncertainty = _uncertainty(settings["uncertainty"], declared, owner)
        contradiction = self.contradiction()
        if contradiction:
            raise InputError(f"{owner}: {contradiction}")

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments that build an equal leaf: parameters and settings that are not defaults."""
        out = {k: v for k, v in self.values.items() if (p := self.parameters()[k]).required or v != p.default}
        out |= {k: v for k, v in self._settings.items() if v not in (None, {})}
        return out


def _text(value: Any, owner: str, what: str) -> str | None:
    if value is not None and not isinstance(value, str):
        raise InputError(f"{owner}: '{what}' should be text, found {value!r}")
    return value


def _positive(value: Any, default: float, owner: str, what: str) -> float:
    if value is None:
        return default
    if isinstance(value, bool | str) or not np.isfinite(value) or value <= 0:
        raise InputError(f"{owner}: '{what}' should be a positive number, found {value!r}")
    return float(value)


def _uncertainty(value: Any, declared: Mapping[str, Parameter], owner: str) -> dict[str, float]:
    out = {}
    for key, sigma in dict(value or {}).items():
        if key not in declared:
            raise InputError(f"{owner}: uncertainty of unknown parameter '{key}'{nearest(key, declared)}")
        if not declared[key].quantity.unit:
            raise InputError(f"{owner}: parameter '{key}' is not a number and has no uncertainty")
        out[key] = _positive(sigma, 0.0, owner, f"uncertainty of {key}")
    return out
