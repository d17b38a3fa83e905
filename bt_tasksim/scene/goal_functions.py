"""Goals that are Python functions of the state at the end of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core.culprit import place_of, users_place
from bt_tasksim.core.errors import BtTasksimError, InputError

Judge = Callable[[Any], Any]
"""Is given a `bt_tasksim.scene.relations.FinalState`, and answers with true or false, or with that and words.
The state is of a drawn world, which has these goals, and so is not known here.
"""


@dataclass(frozen=True, init=False, eq=False)
class GoalFunction:
    """A function that says whether a run has done what it should; as data it is no more than its name.

    Two are equal that have one name and one function; where only the name of one is known, names count.

    Args:
        name: Its name.
        judge: The function; None where only its name is known, as in a replay.
    """

    name: str

    def __init__(self, name: str, judge: Judge | None = None) -> None:
        super().__setattr__("name", name)
        super().__setattr__("judge", judge)

    @classmethod
    def of(cls, judge: Judge) -> GoalFunction:
        """The goal that a function is."""
        return cls(str(getattr(judge, "__name__", type(judge).__name__)), judge)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, GoalFunction):
            return NotImplemented
        one, two = self.__dict__["judge"], other.__dict__["judge"]
        return self.name == other.name and (one is None or two is None or one == two)

    def __hash__(self) -> int:
        return hash((GoalFunction, self.name))

    def __str__(self) -> str:
        return self.name

    @property
    def module(self) -> str:
        """Name of the module that defines the function; empty where only its name is known."""
        judge = self.__dict__["judge"]
        return str(getattr(judge, "__module__", None) or type(judge).__module__) if judge is not None else ""

    def ask(self, final: Any) -> tuple[bool, str] | None:
        """What the function says: whether it is reached, and words or none; None where it is not here.

        Raises:
            InputError: It raised an exception, or its answer is none; says its file and line.
        """
        judge: Judge | None = self.__dict__["judge"]
        if judge is None:
            return None
        try:
            answer = judge(final)
        except BtTasksimError as error:
            raise InputError(f"the goal '{self.name}' ({self._place(error)}): {error}") from error
        except Exception as error:
            said = f"{type(error).__name__}: {error}".removesuffix(": ")
            raise InputError(f"the goal '{self.name}' raised {said} ({self._place(error)})") from error
        reached, words = answer if isinstance(answer, tuple) and len(answer) == 2 else (answer, "")
        if not isinstance(reached, bool | np.bool_) or not isinstance(words, str):
            raise InputError(
                f"the goal '{self.name}' ({place_of(judge)}) should answer with True or False, or with "
                f"(True, 'words'), found {answer!r:.100}"
            )
        return bool(reached), words

    def _place(self, error: BaseException) -> str:
        """Where in its code an exception comes from."""
        return users_place(error) or place_of(self.__dict__["judge"])
