"""Conditions of a Python file: asked about situations of real runs, one by one, in batches, in torch."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.checking.bundles import different, frozen, numbers
from bt_tasksim.checking.findings import ERROR, FAILED, WARNING, Case
from bt_tasksim.checking.questions import spoken
from bt_tasksim.checking.situations import Situation, Situations
from bt_tasksim.concept.condition import Condition, ConditionNode
from bt_tasksim.concept.reporting import as_statement
from bt_tasksim.concept.seen import Seen


def check_condition(kind: type[Condition], root: Behaviour, situations: Situations) -> tuple[Case, str]:
    """Check a condition as each of its leaves in a tree has it.

    Args:
        kind: The condition.
        root: The tree.
        situations: What was seen in runs of the tree.

    Returns:
        What was found, and what was checked.
    """
    case = Case(kind)
    leaves = [leaf for leaf in root.iterate() if isinstance(leaf, ConditionNode)]
    values = [leaf.model for leaf in leaves if leaf.model_class.__name__ == kind.__name__]
    if not values:
        what = "stands nowhere in the tree, so it was not asked"
        case.add(WARNING, "", what, "put a leaf of it into build()")
    answers: set[bool] = set()
    for value in values:
        answers |= _ask(copy.copy(value), situations, case)
    if len(answers) == 1:
        said = "true" if True in answers else "false"
        what = f"is {said} in all situations, those that were changed at random, too"
        case.add(WARNING, "holds", what, "see whether it asks what it should")
    asked = len(situations) * len(values)
    return case, f"{kind.__name__}, asked {asked} times, one by one, in batches, torch"


def _ask(condition: Condition, situations: Situations, case: Case) -> set[bool]:
    """Ask a condition, as it is with its parameters, about every situation; the answers that it gave."""
    answers: set[bool] = set()
    for name, answer in (("holds", condition.holds), ("explain", _words(condition))):
        ones = []
        for situation in situations.single:
            before = frozen(situation)
            found, again = (_call(case, name, answer, situations, situation) for _ in range(2))
            if found is FAILED:
                return answers
            if frozen(found) != frozen(again):
                case.add(ERROR, name, "gives another answer to the same question", "keep nothing on self")
            if frozen(situation) != before:
                case.add(ERROR, name, "changes what it is shown in 'seen'", "work on a copy")
            ones.append(found)
        if name == "holds":
            answers = _judged(ones, case)
        _compare(case, name, answer, situations, ones)
    return answers


def _judged(ones: Sequence[Any], case: Case) -> set[bool]:
    """The answers, as far as they are such."""
    answers = set()
    for found in map(numbers, ones):
        if found.dtype != bool or found.shape != (1,):
            what = f"gives {found.dtype} of the shape {found.shape} for one world, and not bool (1,)"
            case.add(ERROR, "holds", what, "compare arrays that have a row for each world")
            break
        answers.add(bool(found[0]))
    return answers


def _compare(
    case: Case, name: str, answer: Callable[[Seen], Any], situations: Situations, ones: Sequence[Any]
) -> None:
    """A batch, in NumPy and in torch, gets the same as the worlds one by one."""
    import torch

    many = _call(case, name, answer, situations, situations.batch, " for a batch")
    tensors = _call(case, name, answer, situations, situations.torch, " for tensors")
    library = torch.Tensor if name == "holds" else None
    for words, found, wanted in ((name, many, None), (f"{name} in torch", tensors, library)):
        for what in () if found is FAILED else different(words, ones, found, library=wanted)[:1]:
            case.add(ERROR, name, what, "work on rows: [:, :3] for [:3], axis=-1 in sums")


def _call(
    case: Case,
    name: str,
    answer: Callable[[Seen], Any],
    situations: Situations,
    situation: Situation,
    where: str = "",
) -> Any:
    """What it answers in a situation; `FAILED`, and a finding, where it raises."""
    return case.call(name, lambda: answer(situations.asked(situation).seen), where)


def _words(condition: Condition) -> Callable[[Seen], Any]:
    def words(seen: Seen) -> Any:
        said = spoken(as_statement(condition.explain(seen)), len(seen.elapsed))
        return said if said is None else {key: np.asarray(value) for key, value in said.items()}

    return words
