"""Any order: all children have to succeed, and one that could not begin waits until others have acted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from bt_tasksim.concept.reporting import Reporting
from bt_tasksim.core.outcomes import Outcome, register_reason
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.acting import acts
from bt_tasksim.trees.nodes.base import NodeKind, free_children
from bt_tasksim.trees.nodes.batch import FAILURE, INVALID, RUNNING, SUCCESS, BatchNode, NodePlace
from bt_tasksim.trees.nodes.causes import Cause, batch_cause_of, cause_of, summary

OTHERS_COULD_NOT_BEGIN = register_reason(
    "others_could_not_begin", "not all could be done (what could not begin either: {others})"
)


class AnyOrder(Reporting, Composite):
    """Ticks its children until all have succeeded, from left to right as long as each can begin.

    A child that fails before anything below it has acted is passed over: the next one has its turn, and after
    the last one the first again, but none twice as long as nothing has acted meanwhile. It fails with a child
    that fails after it has acted, and where none of those that are left can begin: with the one that failed
    last then. It says why the others could not begin, too. What has succeeded is not ticked again.

    Args:
        name: The node's name.
        children: What is to be done.
    """

    all_in_any_order = True  # see `bt_tasksim.concept.following`

    def __init__(self, name: str, children: list[Behaviour]) -> None:
        super().__init__(name, children)
        self._begin()

    def _begin(self) -> None:
        self._at, self._acted = 0, False
        self._refused = 0
        """The child that failed last."""
        self._done: set[int] = set()
        self._stuck: set[int] = set()
        self._causes: dict[int, Cause | None] = {}

    def tick(self) -> Iterator[Behaviour]:
        """One tick, in which one child may end and others have their turn."""
        if self.status != Status.RUNNING:
            for child in self.children:
                if child.status != Status.INVALID:
                    child.stop(Status.INVALID)
            self._begin()
            self.initialise()
        found: Status | None = None if self.children else Status.SUCCESS
        while found is None:
            child = self.current_child = self.children[self._at]
            if child.status != Status.RUNNING:
                self._acted = False
            yield from child.tick()
            found = self._after(child)
        if found == Status.RUNNING:
            self.status = found
        else:
            self.stop(found)
        yield self

    def _after(self, child: Behaviour) -> Status | None:
        """What the tick ends with; None where another child has its turn in it."""
        if child.status == Status.RUNNING:
            if not self._acted and acts(child):
                self._acted = True
                self._stuck.clear()
            return Status.RUNNING
        if child.status == Status.SUCCESS:
            self._done.add(self._at)
            self._causes.pop(self._at, None)
        else:
            self._refused = self._at
            self._causes[self._at] = cause_of(child)
            if self._acted:
                return Status.FAILURE
            self._stuck.add(self._at)
        return self._on()

    def _on(self) -> Status | None:
        """Go on to the next child that may have its turn; else what the tick ends with."""
        count = len(self.children)
        for k in range(1, count):
            following = (self._at + k) % count
            if following not in self._done and following not in self._stuck:
                self._at = following
                return None
        if len(self._done) == count:
            return Status.SUCCESS
        self._at = self._refused
        self.current_child = self.children[self._at]
        return Status.FAILURE

    def seen_from_here(self, outcome: Outcome) -> Outcome:
        """A child's failure, with why others that are left could not begin."""
        return not_all_done(self._causes, self._at, outcome) if self.status == Status.FAILURE else outcome


def not_all_done(causes: Mapping[int, Cause | None], failed: int, outcome: Outcome) -> Outcome:
    """Why a child failed, and why others that are left could not begin.

    Args:
        causes: By number of each child that is left and was tried; None where nobody says it.
        failed: The child by which it is told, by number.
        outcome: How that one ended.
    """
    others = [cause for number, cause in sorted(causes.items()) if number != failed and cause is not None]
    return OTHERS_COULD_NOT_BEGIN(outcome, others=summary(others)) if others else outcome


def any_order(name: str, *children: Behaviour) -> AnyOrder:
    """All children, from left to right; one that fails before it has acted waits until others have.

    Raises:
        InputError: A child is not a behaviour, or already has a parent.
    """
    return AnyOrder(name, free_children(name, children))


@register("tree node", "AnyOrder")
class AnyOrderKind(NodeKind[AnyOrder]):
    """See `AnyOrder`."""

    category = "Control"
    behaviour = AnyOrder
    symbol = "⇄"
    label = "any order"
    own = True
    helper = staticmethod(any_order)

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> AnyOrder:
        """See `NodeKind.make`."""
        return any_order(name, *children)

    def compiled(self, node: AnyOrder, place: NodePlace) -> BatchAnyOrder:
        """See `NodeKind.compiled`."""
        return BatchAnyOrder(place)


class BatchAnyOrder(BatchNode):
    """`AnyOrder` in many worlds at once; why children failed is kept world by world."""

    def __init__(self, place: NodePlace) -> None:
        super().__init__(place)
        self.count = len(place.children)
        self.stands_at = self.arrays.indices(self.count)
        """``(N,)`` the child that was ticked last, or by which a failure is told."""
        self.refused = self.arrays.indices(self.count)
        """``(N,)`` the child that failed last."""
        self.acted = self.arrays.full(False, "bool")
        """``(N,)`` that child has acted since it began."""
        self.done = [self.arrays.full(False, "bool") for _ in place.children]
        """For each child ``(N,)``: it has succeeded."""
        self.stuck = [self.arrays.full(False, "bool") for _ in place.children]
        """For each child ``(N,)``: it could not begin, and nothing has acted since."""
        self._causes: dict[int, dict[int, Cause | None]] = {}

    def tick(self, rows: Array) -> None:
        """On to the first child, or to where it stood."""
        begins = self.begins(rows)
        if len(begins):
            self.stop_ended(begins)
            self.stands_at[begins] = 0
            for flags in (*self.done, *self.stuck):
                flags[begins] = False
            for row in begins.tolist() if self._causes else ():
                self._causes.pop(row, None)
        for child, there in self.arrays.groups(self.stands_at[rows], rows):
            self._go(child, there)

    def _go(self, child: int, rows: Array) -> None:
        if len(rows):
            self.acted[self.part(rows, self.place.child_status[child][rows] != RUNNING)] = False
            self.tick_child(child, rows)

    def after(self, child: int, rows: Array, status: Array) -> None:
        """Back, or on to the next child that may have its turn."""
        (running,), (rows, status) = self._split_running(rows, status)
        self._noticed(child, running)
        self.end(running, RUNNING)
        (good,), (bad,) = self.split(status == SUCCESS, rows)
        self.done[child][good] = True
        self.refused[bad] = child
        for row in good.tolist() if self._causes else ():
            self._causes.get(row, {}).pop(child, None)
        for row in bad.tolist():
            cause = batch_cause_of(self.batch.reasons, self.place.children[child], row)
            self._causes.setdefault(row, {})[child] = cause
        (failed,), (refused,) = self.split(self.acted[bad], bad)
        self.end(failed, FAILURE)
        self.stuck[child][refused] = True
        self._on(child, good)
        self._on(child, refused)

    def _split_running(self, rows: Array, status: Array) -> tuple[list[Array], list[Array]]:
        yes, no = self.split(status == RUNNING, rows, status)
        return yes[:1], no

    def _noticed(self, child: int, rows: Array) -> None:
        """In worlds where a child is RUNNING: those that could not begin may try again where it acts."""
        quiet = self.part(rows, ~self.acted[rows])
        if len(quiet):
            acting = self.part(quiet, self.batch.acting(self.place.children[child], quiet))
            self.acted[acting] = True
            for flags in self.stuck:
                flags[acting] = False

    def _on(self, child: int, rows: Array) -> None:
        """The next child, in worlds where one may have its turn; else the end."""
        for k in range(1, self.count):
            following = (child + k) % self.count
            may = ~self.done[following][rows] & ~self.stuck[following][rows]
            (there,), (rows,) = self.split(may, rows)
            self.stands_at[there] = following
            self._go(following, there)
        for number in range(self.count):
            (left,), (rows,) = self.split(~self.done[number][rows], rows)
            self.stands_at[left] = self.refused[left]
            self.end(left, FAILURE)
        self.end(rows, SUCCESS)

    def current(self, row: int) -> int | None:
        """The child that was ticked last, or by which a failure is told."""
        return int(self.stands_at[row]) if int(self.place.status[row]) != INVALID else None

    def adds(self, row: int, outcome: Outcome) -> Outcome:
        """A child's failure, with why others that are left could not begin."""
        if int(self.place.status[row]) != FAILURE:
            return outcome
        return not_all_done(self._causes.get(row, {}), int(self.stands_at[row]), outcome)
