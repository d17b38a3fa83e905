"""Pure, and the same world by world, in batches and in torch."""

from __future__ import annotations

import importlib.util
import random
import sys
import warnings
from typing import Any

import numpy as np

from bt_tasksim.checking.bundles import different, frozen
from bt_tasksim.checking.findings import ERROR, FAILED, Case
from bt_tasksim.checking.questions import QUESTIONS
from bt_tasksim.checking.situations import Situation, Situations
from bt_tasksim.core.poses import Array

DATA = (bool, int, float, str, list, dict, set, np.ndarray)


def check_purity(case: Case, situations: Situations) -> None:
    """Functions change nothing, remember nothing, and give the same answer to the same question."""
    for name in case.functions:
        if QUESTIONS[name].begins:
            continue
        answers = []
        for situation in situations.single:
            before = _surroundings(case, situation)
            answer = case.ask(name, situation, situations)
            again = case.ask(name, situation, situations)
            _compare(case, name, before, _surroundings(case, situation))
            answers.append(frozen(answer))
            if frozen(again) != answers[-1]:
                _unsteady(case, name)
        for situation, answer in zip(reversed(situations.single), reversed(answers), strict=True):
            if frozen(case.ask(name, situation, situations)) != answer:
                _unsteady(case, name)


def check_beginning(case: Case, situations: Situations) -> None:
    """What runs once at the start may plan and search, and leaves what it was given as it is."""
    for name in (n for n in case.functions if QUESTIONS[n].begins and not case.has(n, "text")):
        for situation in situations.firsts or situations.single[:1]:
            before = _surroundings(case, situation)
            case.ask(name, situation, situations)
            _compare(case, name, before, _surroundings(case, situation))


def _compare(case: Case, name: str, before: dict[str, Any], after: dict[str, Any]) -> None:
    for what, value in before.items():
        if value != after[what]:
            case.add(ERROR, name, _CHANGES[what][0], _CHANGES[what][1], f"changes {what}")


KEEP = "what is to be remembered goes into the memory"
_CHANGES = {
    "seen": ("changes what it is shown in 'seen'", "work on a copy: seen.tool.copy()"),
    "memory": ("changes the memory it is given", "return a new one from advance: memory._replace(...)"),
    "hidden": ("changes the hidden state", "work on a copy"),
    "self": ("changes itself or its class", f"keep nothing on self: {KEEP}"),
    "module": ("changes a global variable", f"keep nothing there: {KEEP}"),
    "random": ("draws from global random numbers", "draw nothing: decide from what is seen"),
}
"""What a pure function may change of its surroundings, and what to do instead."""


def _unsteady(case: Case, name: str) -> None:
    if case.has(name, "changes random"):
        return
    case.add(
        ERROR,
        name,
        "gives different answers to the same question",
        "compute the answer from 'seen', 'memory' and parameters alone",
        "unsteady",
    )


def _surroundings(case: Case, situation: Situation) -> dict[str, Any]:
    """Everything that a pure function leaves as it is."""
    concept = case.concept
    module = vars(sys.modules[concept.__module__]) if concept.__module__ in sys.modules else {}
    dice: list[Any] = [frozen(np.random.get_state(legacy=False)), random.getstate()]  # noqa: NPY002
    if "torch" in sys.modules:
        dice.append(frozen(sys.modules["torch"].random.get_rng_state()))
    return {
        "seen": frozen((situation.observation, situation.elapsed, situation.world)),
        "memory": frozen(situation.memory),
        "hidden": frozen((situation.hidden, situation.began)),
        "self": frozen({**vars(case.model), **{f"class {k}": v for k, v in _data(vars(concept)).items()}}),
        "module": frozen(_data(module)),
        "random": dice,
    }


def _data(names: Any) -> dict[str, Any]:
    return {k: v for k, v in names.items() if not k.startswith("__") and isinstance(v, DATA)}


def check_batches(case: Case, situations: Situations) -> bool:
    """The answer to a batch of worlds has the answers to each of them as its rows, in any order.

    Returns:
        They were compared in torch, too.
    """
    if case.has("begin", "rows") or case.has("advance", "rows"):
        return False  # its memories cannot stand in a batch
    torch = importlib.util.find_spec("torch") is not None
    rng = np.random.default_rng(2)
    for name in case.functions:
        if _unfit(case, name):
            continue
        found = case.call(name, lambda n=name: situations.asking(n))  # type: ignore[misc]
        if found is FAILED:
            continue
        rows = np.array(found, np.int64)
        one = {k: case.ask(name, situations.single[k], situations) for k in rows.tolist()}
        if not one or any(o is FAILED for o in one.values()):
            continue
        for order in (rows, rng.permutation(rows)):
            batch = situations.batch.at(order)
            many = case.call(name, lambda n=name, b=batch: situations.ask(n, b, case.model), " for a batch")  # type: ignore[misc]
            if many is FAILED:
                break
            for text in different("the answer", [one[k] for k in order.tolist()], many)[:1]:
                what = f"a batch is not the loop over it: {_part(text)}"
                case.add(
                    ERROR, name, what, "write [:, :3] for [:3], xp.where for if, axis=-1 in sums", "batch"
                )
        if torch and not case.has(name, "batch") and not case.has(name, "raises for a batch"):
            _check_torch(case, name, situations, rows, list(one.values()))
    return torch


def _unfit(case: Case, name: str) -> bool:
    """It was found to give something that can not be compared."""
    return case.has(name, "text") or case.has(name, "rows")


def _part(text: str) -> str:
    return text.removeprefix("the answer: ").replace("the answer.", "")


def _check_torch(case: Case, name: str, situations: Situations, rows: Array, one: list[Any]) -> None:
    import torch

    batch = situations.torch.at(torch.from_numpy(rows))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's words about read-only constants are none of the user's
        answer = case.call(name, lambda: situations.ask(name, batch, case.model), " for tensors")
    if answer is FAILED:
        return
    library = None if QUESTIONS[name].words else torch.Tensor
    for text in different("the answer", one, answer, library=library)[:1]:
        case.add(
            ERROR,
            name,
            f"torch and NumPy differ: {_part(text)}",
            "take functions from poses.array_namespace and constants from poses.constant; xp.where of plain "
            "numbers is in single precision",
            "torch",
        )
