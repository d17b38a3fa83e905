"""The pure functions of a concept, and how each is asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.seen import Known, Seen


class Asked(NamedTuple):
    """What pure functions are given; single, or with leading batch dimensions."""

    seen: Seen
    memory: Any
    known: Known


@dataclass(frozen=True)
class Question:
    """A pure function, and how it is asked.

    Attributes:
        ask: Calls it.
        one_for_all: One answer may stand for a whole batch.
    """

    ask: Callable[[ConceptModel, Asked], Any]
    one_for_all: bool = False


def _command(leaf: ConceptModel, at: Asked) -> Any:
    return leaf.command(leaf.programmed_motion(at.seen, at.memory), at.seen, at.memory)


def _advance(leaf: ConceptModel, at: Asked) -> Any:
    return leaf.advance(leaf.programmed_motion(at.seen, at.memory), at.seen, at.memory)


QUESTIONS: Mapping[str, Question] = {
    "decides": Question(lambda leaf, at: leaf.decides(at.seen, at.memory), one_for_all=True),
    "features": Question(lambda leaf, at: leaf.features(at.seen, at.memory)),
    "command": Question(_command),
    "programmed_motion": Question(lambda leaf, at: leaf.programmed_motion(at.seen, at.memory)),
    "done": Question(lambda leaf, at: leaf.done(at.seen, at.memory)),
    "necessary_cost": Question(lambda leaf, at: leaf.necessary_cost(at.seen, at.memory)),
    "violated": Question(lambda leaf, at: leaf.violated(at.seen, at.memory), one_for_all=True),
    "maintained": Question(
        lambda leaf, at: leaf.maintained(leaf.maintains[0], at.seen, at.memory), one_for_all=True
    ),
    "advance": Question(_advance),
    "sufficient_cost": Question(lambda leaf, at: leaf.sufficient_cost(at.known, at.memory)),
}
"""By the function's name."""
ACT = Question(lambda leaf, at: leaf.policy_in_use.act(leaf, at.seen, at.memory))
"""The policy of a leaf, asked as its pure functions are."""
