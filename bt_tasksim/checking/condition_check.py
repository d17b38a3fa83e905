"""Conditions of a Python file: asked about situations of real runs, one by one, in batches, in torch."""

from __future__ import annotations

import copy
import inspect
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.checking.bundles import different, frozen, numbers
from bt_tasksim.checking.questions import spoken
from bt_tasksim.checking.report import ERROR, WARNING, Finding, Report
from bt_tasksim.checking.situations import Situation, Situations
from bt_tasksim.concept.condition import Condition, ConditionNode
from bt_tasksim.concept.reporting import as_statement
from bt_tasksim.concept.seen import Seen


def check_condition(kind: type[Condition], root: Behaviour, situations: Situations, report: Report) -> None:
    """Check a condition as each of its leaves in a tree has it.

    Args:
        kind: The condition.
        root: The tree.
        situations: What was seen in runs of the tree.
        report: Where findings go.
    """
    asked = _Asked(kind, situations, report)
    leaves = [leaf for leaf in root.iterate() if isinstance(leaf, ConditionNode)]
    values = [leaf.model for leaf in leaves if leaf.model_class.__name__ == kind.__name__]
    if not values:
        asked.add(
            WARNING, "", "stands nowhere in the tree, so it was not asked", "put a leaf of it into build()"
        )
    for value in values:
        asked.about(copy.copy(value))
    asked.end()


class _Asked:
    """One condition that is asked."""

    def __init__(self, kind: type[Condition], situations: Situations, report: Report) -> None:
        self._kind, self._situations, self._report = kind, situations, report
        self._file = Path(inspect.getsourcefile(kind) or "")
        self._answers: set[bool] = set()
        self._said: set[tuple[str, str]] = set()
        self._count = 0

    def about(self, condition: Condition) -> None:
        """Ask it about every situation, as it is with its parameters."""
        for name, answer in (("holds", condition.holds), ("explain", _words(condition))):
            ones = []
            for situation in self._situations.single:
                seen, before = self._seen(situation), frozen(situation)
                found, again = (self._call(name, answer, seen) for _ in range(2))
                if found is _NOTHING:
                    return
                if frozen(found) != frozen(again):
                    self.add(ERROR, name, "gives another answer to the same question", "keep nothing on self")
                if frozen(situation) != before:
                    self.add(ERROR, name, "changes what it is shown in 'seen'", "work on a copy")
                ones.append(found)
            if name == "holds":
                self._judge(ones)
            self._compare(name, answer, ones)
        self._count += len(self._situations)

    def end(self) -> None:
        """Say what was checked."""
        if self._answers == {True} or self._answers == {False}:
            said = "true" if True in self._answers else "false"
            what = f"is {said} in all situations, those that were changed at random, too"
            self.add(WARNING, "holds", what, "see whether it asks what it should")
        self._report.done(f"{self._kind.__name__}, asked {self._count} times, one by one, in batches, torch")

    def _judge(self, ones: Sequence[Any]) -> None:
        for found in map(numbers, ones):
            if found.dtype != bool or found.shape != (1,):
                what = f"gives {found.dtype} of the shape {found.shape} for one world, and not bool (1,)"
                self.add(ERROR, "holds", what, "compare arrays that have a row for each world")
                return
            self._answers.add(bool(found[0]))

    def _compare(self, name: str, answer: Callable[[Seen], Any], ones: Sequence[Any]) -> None:
        import torch

        many = self._call(name, answer, self._seen(self._situations.batch), " for a batch")
        tensors = self._call(name, answer, self._seen(self._situations.torch), " for tensors")
        library = torch.Tensor if name == "holds" else None
        for words, found, wanted in ((name, many, None), (f"{name} in torch", tensors, library)):
            for what in () if found is _NOTHING else different(words, ones, found, library=wanted)[:1]:
                self.add(ERROR, name, what, "work on rows: [:, :3] for [:3], axis=-1 in sums")

    def _seen(self, situation: Situation) -> Seen:
        return self._situations.asked(situation).seen

    def _call(self, name: str, answer: Callable[[Seen], Any], seen: Seen, where: str = "") -> Any:
        try:
            return answer(seen)
        except Exception as error:  # whatever it is, the user is to read it
            lines = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename) == self._file]
            text = str(error).split("\n")[0] or "no reason given"
            what = f"raises {type(error).__name__}{where}: {text}"
            self.add(ERROR, name, what, "put it right", (lines[-1].lineno or 0) if lines else 0)
            return _NOTHING

    def add(self, level: str, function: str, what: str, remedy: str, line: int = 0) -> None:
        """Note a finding, once."""
        if (function, what) in self._said:
            return
        self._said.add((function, what))
        line = line or inspect.getsourcelines(getattr(self._kind, function) if function else self._kind)[1]
        self._report.findings.append(
            Finding(level, self._kind.__name__, function, what, remedy, line, self._file.name)
        )


_NOTHING: Any = object()
"""What a call gives that raised."""


def _words(condition: Condition) -> Callable[[Seen], Any]:
    def words(seen: Seen) -> Any:
        said = spoken(as_statement(condition.explain(seen)), len(seen.elapsed))
        return said if said is None else {key: np.asarray(value) for key, value in said.items()}

    return words
