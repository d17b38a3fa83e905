"""Pure, and the same one by one, in batches and in torch."""

from __future__ import annotations

import importlib.util
import random
import sys
import warnings
from typing import Any

import numpy as np

from bt_tasksim.checking.bundles import different, frozen, mapped, numbers, parts
from bt_tasksim.checking.findings import ERROR, FAILED, Case
from bt_tasksim.checking.questions import QUESTIONS
from bt_tasksim.checking.situations import Situation, Situations
from bt_tasksim.concept.seen import Seen

DATA = (bool, int, float, str, list, dict, set, np.ndarray)


def check_purity(case: Case, situations: Situations) -> None:
    """Functions change nothing, remember nothing, and give the same answer to the same question."""
    for name in case.functions:
        answers = []
        for situation in situations.single:
            before = _surroundings(case, situations, situation)
            answer = case.ask(name, situation, situations)
            again = case.ask(name, situation, situations)
            _compare(case, name, before, _surroundings(case, situations, situation))
            answers.append(frozen(answer))
            if frozen(again) != answers[-1]:
                _unsteady(case, name)
        for situation, answer in zip(reversed(situations.single), reversed(answers), strict=True):
            if frozen(case.ask(name, situation, situations)) != answer:
                _unsteady(case, name)


def check_beginning(case: Case, situations: Situations) -> None:
    """What runs once at the start may plan and search, and leaves what it was given as it is."""
    leaf = case.leaf
    assert leaf is not None
    firsts = [s for s, d in zip(situations.single, case.decisions, strict=False) if d.first]
    for name in ("initial_state", "begin"):
        if not case.overrides(name):
            continue
        for situation in firsts or situations.single[:1]:
            before = _surroundings(case, situations, situation)
            seen = Seen(situation.observation, situations.world, situations.robot, situation.elapsed)
            case.call(name, lambda n=name, s=seen: getattr(leaf, n)(s))  # type: ignore[misc]
            _compare(case, name, before, _surroundings(case, situations, situation))


def _compare(case: Case, name: str, before: dict[str, Any], after: dict[str, Any]) -> None:
    for what, value in before.items():
        if value != after[what]:
            case.add(ERROR, name, _CHANGES[what][0], _CHANGES[what][1], f"changes {what}")


KEEP = "what is to be remembered goes into the memory"
_CHANGES = {
    "seen": ("changes what it is shown in 'seen'", "work on a copy: seen.tool.copy()"),
    "memory": ("changes the memory it is given", "return a new one from advance: memory._replace(...)"),
    "hidden": ("changes the hidden state", "work on a copy"),
    "self": ("changes its own leaf or class", f"keep nothing on self: {KEEP}"),
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


def _surroundings(case: Case, situations: Situations, situation: Situation) -> dict[str, Any]:
    """Everything that a pure function leaves as it is."""
    leaf, concept = case.leaf, case.concept
    module = vars(sys.modules[concept.__module__]) if concept.__module__ in sys.modules else {}
    dice: list[Any] = [frozen(np.random.get_state(legacy=False)), random.getstate()]  # noqa: NPY002
    if "torch" in sys.modules:
        dice.append(frozen(sys.modules["torch"].random.get_rng_state()))
    return {
        "seen": frozen((situation.observation, situation.elapsed, situations.world)),
        "memory": frozen(situation.memory),
        "hidden": frozen((situation.hidden, situation.began)),
        "self": frozen({**vars(leaf), **{f"class {k}": v for k, v in _data(vars(concept)).items()}}),
        "module": frozen(_data(module)),
        "random": dice,
    }


def _data(names: Any) -> dict[str, Any]:
    return {k: v for k, v in names.items() if not k.startswith("__") and isinstance(v, DATA)}


def check_batches(case: Case, situations: Situations) -> bool:
    """The answer to a batch is the batch of the answers, with one and with two leading dimensions.

    Returns:
        They were compared in torch, too.
    """
    torch = importlib.util.find_spec("torch") is not None
    for name in case.functions:
        one = [case.ask(name, s, situations) for s in situations.single]
        if any(o is FAILED for o in one):
            continue
        n = len(one)
        many = _batch(case, name, situations)
        if many is FAILED:
            continue
        found = different("the answer", one, many, n) if not _single_is_fine(name, many) else []
        for text in found[:1]:
            case.add(
                ERROR,
                name,
                f"a batch is not the loop over it: {_part(text)}",
                "write [..., :3] for [:3], xp.where for if, axis=-1 in sums",
                "batch",
            )
        if not found:
            _check_two_dimensions(case, name, situations, many)
        if torch:
            _check_torch(case, name, situations, one, n)
    return torch


def _batch(case: Case, name: str, situations: Situations) -> Any:
    return case.call(name, lambda: situations.ask(name, situations.batch, case.leaf), " for a batch")


def _single_is_fine(name: str, many: Any) -> bool:
    return QUESTIONS[name].one_for_all and parts(many) is None and numbers(many).ndim == 0


def _part(text: str) -> str:
    return text.removeprefix("the answer: ").replace("the answer.", "")


def _check_two_dimensions(case: Case, name: str, situations: Situations, many: Any) -> None:
    half = len(situations) // 2
    if half == 0:
        return
    wide = mapped(lambda a: a[: 2 * half].reshape(2, half, *a.shape[1:]), situations.batch)
    answer = case.call(name, lambda: situations.ask(name, wide, case.leaf), " for a batch")
    if answer is FAILED or _single_is_fine(name, many):
        return

    def same(a: Any, b: Any) -> bool:
        inner = parts(a)
        if inner is not None:
            other = parts(b) or {}
            return all(same(v, other.get(k)) for k, v in inner.items())
        if a is None or b is None or isinstance(a, str):
            return a is b or a == b
        first, second = numbers(a), numbers(b)
        should = (2, half, *first.shape[1:])
        return second.shape == should and np.allclose(
            first[: 2 * half].reshape(should), second, rtol=0.0, atol=1e-6, equal_nan=True
        )

    if not same(many, answer):
        case.add(
            ERROR,
            name,
            "a batch with two leading dimensions is not the loop over it",
            "write axis=-1 for axis=1, and [..., 0] for [:, 0]",
            "batch",
        )


def _check_torch(case: Case, name: str, situations: Situations, one: list[Any], n: int) -> None:
    import torch

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's words about read-only constants are none of the user's
        answer = case.call(name, lambda: situations.ask(name, situations.torch, case.leaf), " for tensors")
    if answer is FAILED or _single_is_fine(name, answer) or case.has(name, "batch"):
        return
    for text in different("the answer", one, answer, n, library=torch.Tensor)[:1]:
        case.add(
            ERROR,
            name,
            f"torch and NumPy differ: {_part(text)}",
            "take functions from poses.array_namespace and constants from poses.constant; xp.where of plain "
            "numbers is in single precision",
            "torch",
        )
