"""The pure functions of a concept, and how each is asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.checking.bundles import numbers
from bt_tasksim.concept.functions import Applying, ConceptFunctions, sequence_of
from bt_tasksim.concept.reporting import as_statement
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.core.outcomes import Statement
from bt_tasksim.core.poses import Array


class Asked(NamedTuple):
    """What pure functions are given in ``N`` worlds."""

    seen: Seen
    memory: Any
    known: Known


@dataclass(frozen=True)
class Question:
    """A pure function, and how it is asked.

    Attributes:
        ask: Calls it.
        words: What it gives is said to people, and comes as NumPy's arrays whatever it was computed in.
        begins: It is asked when the concept begins, and has no memory yet.
    """

    ask: Callable[[ConceptFunctions, Asked], Any]
    words: bool = False
    begins: bool = False


def _command(model: ConceptFunctions, at: Asked) -> Any:
    return model.command(model.programmed_motion(at.seen, at.memory), at.seen, at.memory)


def _advance(model: ConceptFunctions, at: Asked) -> Any:
    return model.advance(model.programmed_motion(at.seen, at.memory), at.seen, at.memory)


def _carry_out(model: ConceptFunctions, at: Asked) -> Any:
    return model.carry_out(model.programmed_motion(at.seen, at.memory), at.seen, at.memory)


def _explain(model: ConceptFunctions, at: Asked) -> Any:
    return spoken(as_statement(model.explain(at.seen, at.memory)), at.seen.tool.shape[0])


def _planned(model: ConceptFunctions, at: Asked) -> Any:
    return model.planned(at.memory) + 0.0 * at.seen.elapsed  # it may be one number for all worlds


def _limits(model: ConceptFunctions, at: Asked) -> Any:
    return possible(model.limits(at.seen, at.memory), at.seen.tool.shape[0])


def _initial_state(model: ConceptFunctions, at: Asked) -> Any:
    unmet = sequence_of(model.initial_state(at.seen), type(model).__name__)
    return possible(unmet, at.seen.tool.shape[0])


def spoken(said: Statement | None, worlds: int) -> dict[str, Array] | None:
    """A statement as arrays ``(worlds,)``: its form, numbers and names."""
    if said is None:
        return None
    out = {"form": np.full(worlds, said.form.template)}
    for name, value in said.numbers.items():
        out[name] = np.array(np.broadcast_to(numbers(value), (worlds,)), float)
    names: Mapping[str, Any] = said.names
    for name, text in names.items():
        out[name] = np.array(text) if isinstance(text, tuple) else np.full(worlds, text)
    for name, value in (spoken(said.detail, worlds) or {}).items():
        out[f"detail.{name}"] = value
    return out


def possible(found: Any, worlds: int) -> list[Any]:
    """What may apply in each world, as arrays ``(worlds,)``: does it, and what is said of it then."""
    return [_possible(one, worlds) for one in found]


def _possible(one: Applying, worlds: int) -> Any:
    applies = numbers(one.applies)
    rows = [spoken(one.at(k), 1) or {} for k in range(worlds)]
    return {"applies": applies, **{name: np.concatenate([row[name] for row in rows]) for name in rows[0]}}


QUESTIONS: Mapping[str, Question] = {
    "initial_state": Question(_initial_state, words=True, begins=True),
    "begin": Question(lambda model, at: model.begin(at.seen), begins=True),
    "decides": Question(lambda model, at: model.decides(at.seen, at.memory)),
    "features": Question(lambda model, at: model.features(at.seen, at.memory)),
    "command": Question(_command),
    "programmed_motion": Question(lambda model, at: model.programmed_motion(at.seen, at.memory)),
    "done": Question(lambda model, at: model.done(at.seen, at.memory)),
    "necessary_cost": Question(lambda model, at: model.necessary_cost(at.seen, at.memory)),
    "violated": Question(lambda model, at: model.violated(at.seen, at.memory)),
    "limits": Question(_limits, words=True),
    "maintained": Question(lambda model, at: model.maintained(model.maintains[0], at.seen, at.memory)),
    "advance": Question(_advance),
    "carry_out": Question(_carry_out),
    "sufficient_cost": Question(lambda model, at: model.sufficient_cost(at.known, at.memory)),
    "planned": Question(_planned),
    "explain": Question(_explain, words=True),
}
"""By the function's name."""
