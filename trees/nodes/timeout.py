"""Time-out: a child is stopped, and fails, when its episode time is over.

Time is that of the tree's `Context`: the wall clock plays no part, so that simulation is deterministic.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.context import Context
from bt_tasksim.concept.leaf import not_set_up
from bt_tasksim.concept.reporting import said_below
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import TIMED_OUT, Form, Statement
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind, Port, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, INVALID, RUNNING, NodePlace, PassesOn
from bt_tasksim.trees.nodes.pass_through import PassThrough, end_tick

AT_WORK = Form("'{node}' was at work")
SLACK = 1e-9
"""Seconds by which summed control periods may fall short of a time."""


class Timeout(PassThrough):
    """Stops its child and fails when ``seconds`` of episode time have passed since it began.

    The child is not ticked in the tick in which its time is over.

    Args:
        name: The node's name.
        child: What may take only so long.
        seconds: Its time, a whole number of milliseconds after rounding.

    Raises:
        InputError: ``seconds`` is not a number of at least 0.001.
    """

    def __init__(self, name: str, child: Behaviour, seconds: float) -> None:
        super().__init__(name, child)
        if isinstance(seconds, bool | str) or not 0.001 <= seconds <= 4e6:
            raise InputError(f"'{name}': seconds should be a number between 0.001 and 4e6, found {seconds!r}")
        self.seconds = round(seconds * 1000) / 1000
        self._context: Context | None = None
        self._started = 0.0

    def setup(self, **kwargs: Any) -> None:
        """Take the tree's context.

        Raises:
            InputError: There is none: the tree was set up without a Runner.
        """
        context = kwargs.get("context")
        if not isinstance(context, Context):
            raise InputError(f"'{self.name}' counts episode time and needs a context: run it with a Runner")
        self._context = context

    def tick(self) -> Iterator[Behaviour]:
        """One tick.

        Raises:
            RuntimeError: The tree was not set up.
        """
        if self._context is None:
            raise not_set_up(self)
        now = self._context.now
        if self.status != Status.RUNNING:
            self._started = now
            self.report(None)
        elif now - self._started >= self.seconds - SLACK:
            tip = self.decorated.tip()
            said = _at_work(None if tip is None else tip.name, said_below(self.decorated))
            self.report(TIMED_OUT(said, limit=self.seconds))
            self.decorated.stop(Status.INVALID)
            yield from end_tick(self, Status.FAILURE)
            return
        yield from self.decorated.tick()
        yield from end_tick(self, self.decorated.status)


def _at_work(name: str | None, said: Statement | None) -> Statement | None:
    """What stood below when the time was over: the node that was ticked last, and what it said."""
    return said if name is None else AT_WORK(said, node=name)


def timeout(seconds: float, child: Behaviour, *, name: str = "Timeout") -> Timeout:
    """The child, which is stopped and fails after so many seconds of episode time.

    Raises:
        InputError: The time does not fit, or the child already has a parent.
    """
    return Timeout(name, free_children(name, (child,))[0], seconds)


@register("tree node", "Timeout")
class TimeoutKind(NodeKind[Timeout]):
    """See `Timeout`."""

    category = "Decorator"
    behaviour = Timeout
    symbol = "◷"
    label = "time-out"
    ports = (Port("msec", doc="milliseconds of episode time"),)
    helper = staticmethod(timeout)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Timeout:
        """See `NodeKind.make`."""
        return timeout(ports["msec"] / 1000, children[0], name=name)

    def read(self, node: Timeout) -> dict[str, int]:
        """See `NodeKind.read`."""
        return {"msec": round(node.seconds * 1000)}

    def describe(self, node: Timeout) -> str:
        """See `NodeKind.describe`."""
        return f"{self.label} {node.seconds:g} s"

    def compiled(self, node: Timeout, place: NodePlace) -> BatchTimeout:
        """See `NodeKind.compiled`."""
        return BatchTimeout(place, node.seconds)


class BatchTimeout(PassesOn):
    """`Timeout` in many worlds at once.

    Args:
        place: Where it stands.
        seconds: The child's time.
    """

    def __init__(self, place: NodePlace, seconds: float) -> None:
        super().__init__(place)
        self.seconds = seconds
        self.started = self.arrays.full(0.0, "float64")
        """``(N,)`` when the child began."""
        self._below: dict[int, Statement | None] = {}

    def tick(self, rows: Array) -> None:
        """On to the child, unless its time is over."""
        now, running = self.batch.now[rows], self.place.status[rows] == RUNNING
        over = running & (now - self.started[rows] >= self.seconds - SLACK)
        self.started[rows] = self.xp.where(running, self.started[rows], now)
        (late,), (rows,) = self.split(over, rows)
        for row in late.tolist():
            child, reasons = self.place.children[0], self.batch.reasons
            tip = reasons.tip(child, row)
            name = None if tip is None else reasons.name(tip)
            self._below[row] = _at_work(name, reasons.said_below(child, row))
        self.stop_child(0, late)
        self.end(late, FAILURE)
        self.tick_child(0, rows)

    def says(self, row: int) -> Statement | None:
        """That the time was over: then its child was stopped."""
        if int(self.place.status[row]) != FAILURE or int(self.place.child_status[0][row]) != INVALID:
            return None
        return TIMED_OUT(self._below.get(row), limit=self.seconds)
