"""What a model's functions have to give; which of them, in which file and line, gave something else.

Looked at are shapes and types alone, once a tick for all worlds. What cannot be seen so, such as a world that
depends on another, `bt-tasksim check` finds.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.core.culprit import place_of
from bt_tasksim.core.errors import InputError, LeafError
from bt_tasksim.core.outcomes import Statement
from bt_tasksim.core.plain import shown
from bt_tasksim.core.poses import array_namespace
from bt_tasksim.core.world import Command

DEFAULTS = "bt_tasksim.concept.functions"
"""Where the functions of concepts are that nobody overrides."""
ANSWERS = "an array (N,) of booleans, one for each world"
SHARES = "an array (N,) of booleans, or of shares from 0 to 1, one for each world"
WORDS = "what a Form gives with a number, or numbers (N,), for each gap; or text; or None"
CARRIED = "a Command and the memory for the next tick"
COMMAND = "a Command"


class Contract:
    """The functions of a leaf's model, as they are held to what they have to give.

    Args:
        leaf: The leaf.
        model: The model, or whatever else has functions.

    Every method raises `LeafError` where a function gave something else: it names leaf, class and function,
    with file and line, and says what was found and what it should be.
    """

    def __init__(self, leaf: Behaviour, model: Any) -> None:
        self._leaf, self._model = leaf, model
        self._called: dict[str, str] = {}

    def where(self, function: str) -> str:
        """``leaf 'push cup': Push.done (push.py:12)``."""
        if function not in self._called:  # a file is read for it
            self._called[function] = function_of(type(self._model), function)
        return f"leaf '{self._leaf.name}': {self._called[function]}"

    def answers(self, found: Any, worlds: int, function: str) -> None:
        """Booleans ``(N,)``."""
        if getattr(found, "shape", None) != (worlds,) or _kind(found) != "b":
            raise self._wrong(function, found, ANSWERS, worlds)

    def shares(self, found: Any, worlds: int, function: str) -> None:
        """Booleans or real numbers ``(N,)``."""
        if getattr(found, "shape", None) != (worlds,) or _kind(found) not in ("b", "f", "i"):
            raise self._wrong(function, found, SHARES, worlds)

    def motion(self, found: Any, worlds: int, size: int, function: str) -> None:
        """Real numbers ``(N, n)``."""
        if getattr(found, "shape", None) != (worlds, size) or _kind(found) not in ("f", "i"):
            wanted = f"an array (N, {size}) of numbers: {size} offsets, its actions, for each world"
            raise self._wrong(function, found, wanted, worlds)

    def carried(self, found: Any) -> tuple[Command, Any]:
        """What ``carry_out`` gives: a command and a memory."""
        if not isinstance(found, tuple) or len(found) != 2:
            raise self._wrong("carry_out", found, CARRIED)
        if not isinstance(found[0], Command):
            raise self._wrong(self.giver("carry_out", "command"), found[0], COMMAND)
        return found[0], found[1]

    def giver(self, function: str, asks: str) -> str:
        """The one of two functions that a concept's author wrote; the first asks the other by default."""
        whole = getattr(type(self._model), function)
        return asks if whole.__module__ == DEFAULTS else function

    def words(self, found: Any, worlds: int, function: str = "explain") -> None:
        """A statement whose numbers are each one for all worlds or ``(N,)``, or text, or None."""
        if found is None or isinstance(found, str):
            return
        if not isinstance(found, Statement):
            raise self._wrong(function, found, WORDS)
        numbers: list[Any] = list(found.numbers.values())
        if any(getattr(number, "ndim", 0) and number.shape != (worlds,) for number in numbers):
            raise self._wrong(function, found, WORDS, worlds)

    @contextmanager
    def kept(self, function: str) -> Iterator[None]:
        """An `InputError` in here is about what a function gave to be remembered.

        Raises:
            InputError: The same, with the leaf and the function.
        """
        try:
            yield
        except InputError as error:
            raise InputError(f"{self.where(function)}: {error}") from error

    def _wrong(self, function: str, found: Any, wanted: str, worlds: int = 0) -> LeafError:
        count = f" for {worlds} world{'s' if worlds > 1 else ''}" if worlds else ""
        return LeafError(f"{self.where(function)} gives {_said(found)}{count}: it should be {wanted}")


def function_of(owner: type, function: str) -> str:
    """``Push.done (push.py:12)``: a class's function, and where it is defined."""
    place = place_of(getattr(owner, function, owner))
    return f"{owner.__name__}.{function}{f' ({place})' if place else ''}"


def _kind(found: Any) -> str:
    """``b``, ``i`` or ``f`` for arrays of booleans, whole numbers and real numbers; else something else."""
    if isinstance(found, np.ndarray):
        return "i" if found.dtype.kind == "u" else found.dtype.kind
    xp, kinds = array_namespace(found), {"bool": "b", "integral": "i", "real floating": "f"}
    return next((letter for kind, letter in kinds.items() if xp.isdtype(found.dtype, kind)), "")


def _said(found: Any) -> str:
    """What was found, in words."""
    shape = tuple(found.shape) if hasattr(found, "dtype") else ()
    if shape:
        return f"an array {shape} of {found.dtype}"
    return shown(repr(found))
