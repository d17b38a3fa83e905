"""What was tried before the last failure, and why it failed: what retry and fallback have to add to it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from py_trees.behaviour import Behaviour

from bt_tasksim.concept.reporting import outcome_of, speaker
from bt_tasksim.core.outcomes import Outcome
from bt_tasksim.trees.nodes.batch import Reasons


class Cause(NamedTuple):
    """Why something failed: the leaf, the reason it is counted by, and the sentence."""

    leaf: str
    reason: str
    sentence: str


def cause_of(child: Behaviour) -> Cause | None:
    """Why a child has failed; None where nobody says it."""
    failed = speaker(child) or child
    return _cause(failed.name, outcome_of(failed))


def batch_cause_of(reasons: Reasons, child: int, row: int) -> Cause | None:
    """`cause_of` a child, by its number, in one world of a batch."""
    found = reasons.speaker(child, row)
    failed = child if found is None else found
    return _cause(reasons.name(failed), reasons.outcome_of(failed, row))


def _cause(leaf: str, outcome: Outcome | None) -> Cause | None:
    if outcome is None:
        return None
    cause = outcome.cause
    return Cause(leaf, cause.reason.name, cause.own_sentence or cause.sentence)


def summary(causes: Sequence[Cause]) -> str:
    """The causes in a few words: like ones are counted, and the first of them is said."""
    first: dict[tuple[str, str], Cause] = {}
    for cause in causes:
        first.setdefault(cause[:2], cause)
    often = Counter(cause[:2] for cause in causes)
    said = [
        ": ".join(filter(None, (cause.leaf, cause.sentence)))
        + (f", {often[kind]} times" if often[kind] > 1 else "")
        for kind, cause in first.items()
    ]
    return "; ".join(said)
