"""What nodes of a tree say: the outcome as a value, and its sentence as py_trees' feedback message."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import Generic, TypeVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.core.outcomes import FAILED, TEXT, Outcome, Statement

NodeT = TypeVar("NodeT")


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


def as_statement(said: Statement | str | None) -> Statement | None:
    """What a concept's `explain` gives, which may be a value or words; None for nothing."""
    if isinstance(said, str):
        return TEXT(text=said) if said else None
    return said


class Sayings(abc.ABC, Generic[NodeT]):
    """What the nodes of a tree say in one world, whoever ticks them."""

    @abc.abstractmethod
    def tip(self, node: NodeT) -> NodeT | None:
        """The deepest node that was decided last, at or below a node; None where it is not active."""

    @abc.abstractmethod
    def failed(self, node: NodeT) -> bool:
        """Its last tick ended with FAILURE."""

    @abc.abstractmethod
    def says(self, node: NodeT) -> Statement | None:
        """What a node says itself: an outcome, or words; None for nothing."""

    @abc.abstractmethod
    def below(self, node: NodeT) -> Sequence[NodeT]:
        """A node's children."""

    @abc.abstractmethod
    def above(self, node: NodeT) -> NodeT | None:
        """A node's parent; None: it is the root."""

    @abc.abstractmethod
    def adds(self, node: NodeT, outcome: Outcome) -> Outcome:
        """What a failure below, which made a node fail, comes to there: with what was tried before."""

    def outcome_of(self, node: NodeT) -> Outcome | None:
        """What a node that has ended says; words of one that has failed are `FAILED`."""
        said = self.says(node)
        if said is None or isinstance(said, Outcome):
            return said
        words = said.sentence
        return FAILED(text=words) if words and self.failed(node) else None

    def said_by(self, node: NodeT) -> Statement | None:
        """What a node says itself, whether it has ended or not."""
        said = self.says(node)
        return None if said is None else self.outcome_of(node) or as_statement(said.sentence)

    def said_below(self, node: NodeT) -> Statement | None:
        """What the deepest node says that has something to say."""
        tip = self.tip(node)
        return (self.said_by(tip) if tip is not None else None) or self.said_by(node)

    def speaker(self, root: NodeT) -> NodeT | None:
        """The node of a failed tree that made it fail: decided last, with something to say."""
        found = self.tip(root)
        if found is not None and self._has_words(found):
            return found
        ahead = [root]
        while ahead:
            node = ahead.pop()
            if self.failed(node) and self._has_words(node):
                return node
            ahead.extend(self.below(node))
        return found

    def whole_outcome(self, node: NodeT) -> Outcome | None:
        """What a node that has failed says, with what the nodes above it have to add."""
        outcome, above = self.outcome_of(node), self.above(node)
        while outcome is not None and above is not None:
            outcome, above = self.adds(above, outcome), self.above(above)
        return outcome

    def _has_words(self, node: NodeT) -> bool:
        said = self.says(node)
        return said is not None and bool(said.sentence)


class Behaviours(Sayings[Behaviour]):
    """What py_trees' own nodes say."""

    def tip(self, node: Behaviour) -> Behaviour | None:
        """See `Sayings.tip`."""
        return node.tip()

    def failed(self, node: Behaviour) -> bool:
        """See `Sayings.failed`."""
        return node.status == Status.FAILURE

    def says(self, node: Behaviour) -> Statement | None:
        """See `Sayings.says`."""
        if isinstance(node, Reporting) and node.outcome is not None:
            return node.outcome
        return as_statement(str(node.feedback_message or ""))  # py_trees keeps whatever it is given

    def below(self, node: Behaviour) -> Sequence[Behaviour]:
        """See `Sayings.below`."""
        return node.children

    def above(self, node: Behaviour) -> Behaviour | None:
        """See `Sayings.above`."""
        return node.parent

    def adds(self, node: Behaviour, outcome: Outcome) -> Outcome:
        """See `Sayings.adds`."""
        return node.seen_from_here(outcome) if isinstance(node, Reporting) else outcome


BEHAVIOURS = Behaviours()
outcome_of, speaker, whole_outcome = BEHAVIOURS.outcome_of, BEHAVIOURS.speaker, BEHAVIOURS.whole_outcome
said_by, said_below = BEHAVIOURS.said_by, BEHAVIOURS.said_below
