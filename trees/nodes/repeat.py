"""Repeat: a child has to succeed several times in a row."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.core.outcomes import Form, Statement
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import COUNT
from bt_tasksim.trees.nodes.base import NodeKind, Port, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, SUCCESS, NodePlace
from bt_tasksim.trees.nodes.rounds import BatchRounds, Rounds

ROUND_OF = Form("round {round} of {rounds} done", {"round": COUNT, "rounds": COUNT})
ROUND = Form("round {round} done", {"round": COUNT})


class Repeat(Rounds):
    """Ticks its child until it has succeeded ``times`` times in a row (-1: without end), unless it fails.

    A child that succeeds is ticked anew in the same tick; if it succeeded in the very tick in which it began,
    the next round waits for the next tick.

    Args:
        name: The node's name.
        child: What is repeated.
        times: How often, or -1.

    Raises:
        InputError: ``times`` is neither positive nor -1.
    """

    def __init__(self, name: str, child: Behaviour, times: int) -> None:
        super().__init__(name, child, times, again_on=Status.SUCCESS)
        self.times = times

    def report_round(self) -> None:
        """Say which round is done."""
        self.report(round_done(self.rounds, self.times))


def round_done(rounds: int, times: int) -> Statement:
    """Which round is done."""
    return ROUND_OF(round=rounds, rounds=times) if times > 0 else ROUND(round=rounds)


def repeat(times: int, child: Behaviour, *, name: str = "Repeat") -> Repeat:
    """The child so many times in a row, unless it fails; -1 for ever.

    Raises:
        InputError: The count does not fit, or the child already has a parent.
    """
    return Repeat(name, free_children(name, (child,))[0], times)


@register("tree node", "Repeat")
class RepeatKind(NodeKind[Repeat]):
    """See `Repeat`."""

    category = "Decorator"
    behaviour = Repeat
    symbol = "↻"
    label = "repeat"
    ports = (Port("num_cycles", doc="how often, -1 without end"),)
    helper = staticmethod(repeat)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Repeat:
        """See `NodeKind.make`."""
        return repeat(ports["num_cycles"], children[0], name=name)

    def read(self, node: Repeat) -> dict[str, int]:
        """See `NodeKind.read`."""
        return {"num_cycles": node.times}

    def describe(self, node: Repeat) -> str:
        """See `NodeKind.describe`."""
        often = "without end" if node.times < 0 else f"{node.times} times"
        return f"{self.label} {often}"

    def compiled(self, node: Repeat, place: NodePlace) -> BatchRepeat:
        """See `NodeKind.compiled`."""
        return BatchRepeat(place, node.limit, again_on=SUCCESS)


class BatchRepeat(BatchRounds):
    """`Repeat` in many worlds at once."""

    def says(self, row: int) -> Statement | None:
        """Why it failed, or which round is done."""
        if int(self.place.status[row]) == FAILURE:
            return self.batch.reasons.said_below(self.place.children[0], row)
        rounds = int(self.rounds[row])
        return round_done(rounds, self.limit) if rounds else None
