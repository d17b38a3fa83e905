"""What nodes of a tree say: the outcome as a value, and its sentence as py_trees' feedback message."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.core.outcomes import FAILED, TEXT, Outcome, Statement


class Reporting(Behaviour):
    """A node that says what it has to say as a value; a base class beside one of py_trees' own."""

    outcome: Outcome | None = None
    """How it ended when it was last active, or None: it runs, or has nothing to say."""

    def report(self, said: Statement | None) -> None:
        """Keep an outcome, and set the feedback message to the sentence; None: nothing is to be said."""
        self.outcome = said if isinstance(said, Outcome) else None
        self.feedback_message = "" if said is None else said.sentence

    def seen_from_here(self, outcome: Outcome) -> Outcome:
        """What a failure below, which made this node fail, comes to here: with what was tried before."""
        return outcome


def outcome_of(node: Behaviour) -> Outcome | None:
    """What a node that has ended says; the words of a behaviour that knows no outcomes are `FAILED`."""
    if isinstance(node, Reporting) and node.outcome is not None:
        return node.outcome
    if node.status == Status.FAILURE and node.feedback_message:
        return FAILED(text=node.feedback_message)
    return None


def speaker(root: Behaviour) -> Behaviour | None:
    """The node of a failed tree that made it fail: the one that was decided last, with something to say."""
    found = root.tip()
    if found is not None and found.feedback_message:
        return found
    failed = [n for n in root.iterate() if n.status == Status.FAILURE and n.feedback_message]
    return failed[-1] if failed else found


def whole_outcome(node: Behaviour) -> Outcome | None:
    """What a node that has failed says, with what the nodes above it have to add."""
    outcome, above = outcome_of(node), node.parent
    while outcome is not None and above is not None:
        outcome = above.seen_from_here(outcome) if isinstance(above, Reporting) else outcome
        above = above.parent
    return outcome


def as_statement(said: Statement | str | None) -> Statement | None:
    """What a concept's `explain` gives, which may be a value or words; None for nothing."""
    if isinstance(said, str):
        return TEXT(text=said) if said else None
    return said
