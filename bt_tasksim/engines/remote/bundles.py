"""Bundles of arrays (`WorldState` and its like) as the arrays of a message, by their fields' names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import lru_cache
from typing import Any, TypeVar

from bt_tasksim.core.poses import Array

Bundle = TypeVar("Bundle")


def arrays_of(bundle: Any) -> dict[str, Array]:
    """Its arrays by name; those that are None are left out."""
    found = {name: getattr(bundle, name) for name in _names(_declared(type(bundle)))}
    return {name: value for name, value in found.items() if value is not None}


def bundle_of(kind: type[Bundle], arrays: Mapping[str, Array]) -> Bundle:
    """A bundle from its arrays; what is missing has its default, and further ones are left alone."""
    declared: Any = kind
    return kind(**{name: arrays[name] for name in _names(declared) if name in arrays})


@lru_cache(maxsize=16)
def _names(kind: Any) -> tuple[str, ...]:
    return tuple(f.name for f in fields(kind))


def _declared(kind: type) -> type:
    """The dataclass that a lazily computed bundle stands for."""
    return kind if "__dataclass_fields__" in kind.__dict__ else _declared(kind.__bases__[0])
