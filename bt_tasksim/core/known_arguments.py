"""Calls of a class with an argument that it does not have end with a sentence that names the right one."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import TypeVar

from bt_tasksim.core.errors import FieldError, nearest

T = TypeVar("T")


def known_arguments(what: str, **instead: str) -> Callable[[type[T]], type[T]]:
    """A decorator of a class whose constructor takes no other keywords than it declares.

    Args:
        what: What an instance is, in an error's words: ``an object``.
        instead: Arguments by what people call them who know files, say: ``at="centre"``.
    """

    def decorate(cls: type[T]) -> type[T]:
        made: Callable[..., None] = cls.__dict__["__init__"]
        names = [name for name in inspect.signature(made).parameters if name != "self"]

        @functools.wraps(made)
        def call(self: T, *args: object, **values: object) -> None:
            for name in values:
                if name not in names:
                    said = f"; it is '{instead[name]}'" if name in instead else nearest(name, names)
                    raise FieldError(f"{what} has no '{name}'{said}", name)
            made(self, *args, **values)

        setattr(cls, "__init__", call)  # noqa: B010 - no method to mypy
        return cls

    return decorate
