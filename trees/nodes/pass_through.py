"""What decorators share that pass their child's status on, and say why it failed.

None of these nodes commands anything; in a tick in which nothing acts the robot holds its last target.
"""

from __future__ import annotations

from collections.abc import Iterator

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.decorators import Decorator

from bt_tasksim.concept.reporting import Reporting


class PassThrough(Reporting, Decorator):
    """A decorator whose status is its child's."""

    def update(self) -> Status:
        """The child's status."""
        return self.decorated.status


def end_tick(node: Decorator, status: Status) -> Iterator[Behaviour]:
    """End a node's tick with a status; yields the node, as ``tick`` has to."""
    if status != Status.RUNNING:
        node.stop(status)
    node.status = status
    yield node
