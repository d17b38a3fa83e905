"""What a check has found, and the calls of a concept's functions that it makes."""

from __future__ import annotations

import copy
import inspect
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from bt_tasksim.checking.questions import QUESTIONS
from bt_tasksim.checking.report import ERROR, WARNING, Finding
from bt_tasksim.checking.situations import RecordedDecision, Situation, Situations
from bt_tasksim.concept.functions import ConceptFunctions
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.errors import NoWayError

__all__ = ["ERROR", "FAILED", "WARNING", "Case", "Finding"]

FAILED: Any = object()
"""What a call gives that raised."""


class Case:
    """One concept or condition that is checked, with what is known of it and what was found.

    Args:
        concept: The concept, or the condition.
        decisions: What a leaf of it decided on in real runs; empty where there is no such run.
        followed: In its tree something follows that judges it.
    """

    def __init__(
        self, concept: type[Any], decisions: Sequence[RecordedDecision] = (), followed: bool = False
    ) -> None:
        self.concept, self.followed = concept, followed
        self.decisions = list(decisions)
        self.file = Path(inspect.getsourcefile(concept) or "")
        self.findings: list[Finding] = []
        self._said: set[tuple[str, str]] = set()
        self.model: ConceptFunctions | None = copy.copy(decisions[0].leaf.model) if decisions else None

    def overrides(self, name: str) -> bool:
        """The concept has a function of its own by this name."""
        own, base = getattr(self.concept, name), getattr(ConceptModel, name)
        return getattr(own, "__func__", own) is not getattr(base, "__func__", base)

    @property
    def functions(self) -> list[str]:
        """The pure functions that the concept writes itself."""
        written = [f for f in QUESTIONS if self.overrides(self._named(f))]
        return [f for f in written if f != "maintained" or self.concept.maintains]

    def _named(self, function: str) -> str:
        """What the concept writes for a function that is asked: `limits` where that decides `violated`."""
        return "limits" if function == "violated" and not self.overrides("violated") else function

    def add(self, level: str, function: str, what: str, remedy: str, kind: str = "", line: int = 0) -> None:
        """Note a finding, unless one of this kind was noted for this function.

        Args:
            level: See `Finding`.
            function: See `Finding`.
            what: See `Finding`.
            remedy: See `Finding`.
            kind: What it is about; by default ``what``.
            line: See `Finding`; 0 for that of the function.
        """
        function = self._named(function)
        key = function, kind or what
        if key in self._said:
            return
        self._said.add(key)
        line = line or self._line_of(function)
        self.findings.append(
            Finding(level, self.concept.__name__, function, what, remedy, line, self.file.name)
        )

    def has(self, function: str, kind: str) -> bool:
        """A finding of this kind was noted."""
        return (self._named(function), kind) in self._said

    def ask(self, name: str, situation: Situation, like: Situations, seen: Seen | None = None) -> Any:
        """What a function answers; `FAILED`, and a finding, where it raises.

        A beginning may find that there is no way: that is `FAILED`, and no finding.
        """

        def answer() -> Any:
            try:
                return like.ask(name, situation, self.model, seen)
            except NoWayError:
                if QUESTIONS[name].begins:
                    return FAILED
                raise

        return self.call(name, answer)

    def call(self, name: str, answer: Callable[[], Any], where: str = "") -> Any:
        """What a call gives; `FAILED`, and a finding, where it raises.

        Args:
            name: The function.
            answer: The call.
            where: In what case it was made, for the sentence.
        """
        try:
            return answer()
        except Exception as error:  # whatever it is, the user is to read it
            self.raised(name, error, where)
            return FAILED

    def raised(self, name: str, error: BaseException, where: str = "") -> None:
        """Note an exception."""
        line = 0
        trace = error.__traceback__
        while trace is not None:
            if Path(trace.tb_frame.f_code.co_filename) == self.file:
                line = trace.tb_lineno
            trace = trace.tb_next
        remedy = {
            " for a batch": "write [:, :3] for [:3], xp.where for if, and xp's functions for those of math",
            " for tensors": "take functions from poses.array_namespace, and constants from poses.constant",
        }.get(where, "put it right")
        text = str(error).split("\n")[0] or "no reason given"
        self.add(ERROR, name, f"raises {type(error).__name__}{where}: {text}", remedy, f"raises{where}", line)

    def _line_of(self, function: str) -> int:
        """The line of a function, where it stands in the concept's own file."""
        try:
            found: Any = inspect.unwrap(getattr(self.concept, function)) if function else self.concept
            if Path(inspect.getsourcefile(found) or "") != self.file:
                return 0
            return inspect.getsourcelines(found)[1]
        except (OSError, TypeError, AttributeError):
            return 0
