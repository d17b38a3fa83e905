"""Former names of fields: calls and files that use them keep working."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Mapping
from typing import ParamSpec, TypeVar

from bt_tasksim.core.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
V = TypeVar("V")
_FORMER: dict[type, Mapping[str, str]] = {}


def renamed_arguments(**former: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A decorator of a function whose keywords had other names, given as ``former="present"``."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def call(*args: P.args, **values: P.kwargs) -> R:
            for old in values.keys() & former.keys():
                values[former[old]] = values.pop(old)
            return function(*args, **values)

        return call

    return decorate


def renamed_fields(**former: str) -> Callable[[type[T]], type[T]]:
    """A decorator of a dataclass whose fields had other names, given as ``former="present"``.

    Calls may use a former name as a keyword, and read the attribute by it, unless the class says itself what
    that is. Where both are given, the former
    one counts, since `dataclasses.replace` gives the present one always.
    """

    def decorate(cls: type[T]) -> type[T]:
        made: Callable[..., None] = cls.__dict__["__init__"]
        setattr(cls, "__init__", renamed_arguments(**former)(made))  # noqa: B010 - no method to mypy
        for old, new in former.items():
            if old not in cls.__dict__:
                setattr(cls, old, property(operator.attrgetter(new)))
        _FORMER[cls] = former
        return cls

    return decorate


def former_names(kind: type) -> Mapping[str, str]:
    """Present names of a dataclass's fields by their former ones."""
    return _FORMER.get(kind, {})


def with_present_names(values: Mapping[str, V], former: Mapping[str, str]) -> dict[str, V]:
    """A file's values under the present names of their fields.

    Raises:
        InputError: One field is given under both of its names.
    """
    out: dict[str, V] = {}
    for name, value in values.items():
        present = former.get(name, name)
        if present in out or (present != name and present in values):
            raise InputError(f"'{name}' is a former name of '{present}': give one of the two")
        out[present] = value
    return out
