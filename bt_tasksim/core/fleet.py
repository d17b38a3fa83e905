"""Fleets do work on many items: this process, processes of this machine, or actors of a cluster.

Each member of a fleet keeps something of its own, such as a runner, and does work with it. The members take
items in shares, and give results one by one, so that little is lost with a member.
"""

from __future__ import annotations

import copy
import traceback
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any, Generic, Self, TypeVar

from bt_tasksim.core.culprit import users_place, with_place
from bt_tasksim.core.errors import BtTasksimError, InputError, MachineError

StateT = TypeVar("StateT")
ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")

Work = Callable[[StateT, Sequence[ItemT]], Iterator[tuple[int, ResultT]]]
"""What is done with what a member keeps and a share of the items: gives the index of each item and its result
as they are done, in any order. It is pickled, and so are items and results."""


class Fleet(ABC, Generic[StateT]):
    """What does work on many items; a context manager, which ends its members."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.close(0.0 if kind is not None else 2.0)

    @abstractmethod
    def spread(
        self, work: Work[StateT, ItemT, ResultT], items: Sequence[ItemT], share: int = 1
    ) -> Iterator[tuple[int, ResultT]]:
        """The items' numbers and results, in the order in which they are done; each exactly once.

        Args:
            work: What is done with a share of the items.
            items: The items.
            share: How many of them a member takes at a time, at most.

        Raises:
            BtTasksimError: A member found an error; then they are good for nothing any more.
            InputError: A user's own code raised in a member; says where.
            MachineError: A member ended and could not be made up for, or something else was raised in it.
        """

    def close(self, patience: float = 2.0) -> None:  # not every one has members to end
        """End the members.

        Args:
            patience: Seconds for what they are doing, before they are killed.
        """


class Here(Fleet[StateT]):
    """This process as a fleet of one.

    Args:
        state: What it keeps.
    """

    def __init__(self, state: StateT) -> None:
        self._state = state

    def spread(
        self, work: Work[StateT, ItemT, ResultT], items: Sequence[ItemT], share: int = 1
    ) -> Iterator[tuple[int, ResultT]]:
        """As `Fleet.spread`; errors come as they are."""
        yield from work(self._state, items)


class Shares:
    """Which items wait, and which are with whom.

    Args:
        items: How many there are.
        share: How many a member takes at a time, at most; near the end it is less, so that all end together.
    """

    MOST_LOSSES = 3
    """Members that may be lost over one item that they had taken alone."""

    def __init__(self, items: int, share: int) -> None:
        self._share = share
        self._waiting = deque(range(items))
        self._suspects: deque[int] = deque()  # taken alone, so that only one is to blame if it happens again
        self._held: dict[Hashable, dict[int, int]] = {}  # by member: numbers by index in the share
        self._losses: Counter[int] = Counter()

    @property
    def left(self) -> bool:
        """Not every item has a result."""
        return bool(self._waiting or self._suspects or self._held)

    @property
    def waiting(self) -> int:
        """How many items nobody has taken."""
        return len(self._waiting) + len(self._suspects)

    @property
    def members(self) -> list[Any]:
        """Who has items."""
        return list(self._held)

    def take(self, member: Hashable, members: int) -> list[int]:
        """Numbers of the next items for a member that has none; none where none waits.

        Args:
            member: Who takes them.
            members: How many there are in all.
        """
        if self._suspects:
            taken = [self._suspects.popleft()]
        else:
            fair = max(1, len(self._waiting) // (2 * members))
            taken = [self._waiting.popleft() for _ in range(min(self._share, fair, len(self._waiting)))]
        if taken:
            self._held[member] = dict(enumerate(taken))
        return taken

    def done(self, member: Hashable, index: int) -> int:
        """Number of the item of which a member has given the result, by its index in the share."""
        held = self._held[member]
        number = held.pop(index)
        if not held:
            del self._held[member]
        return number

    def lost(self, member: Hashable) -> list[int]:
        """Numbers of the items that a lost member had not finished; others take them.

        Raises:
            TooManyLostError: One of them has ended one member after the other.
        """
        again = list(self._held.pop(member, {}).values())
        if len(again) == 1:
            self._losses[again[0]] += 1
            if self._losses[again[0]] >= self.MOST_LOSSES:
                raise TooManyLostError(again[0])
        self._suspects.extend(again)
        return again


class TooManyLostError(Exception):
    """An item has ended one member after the other.

    Args:
        number: Of the item.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def results_of(
    state: Callable[[], StateT], work: Work[StateT, Any, Any], items: Sequence[Any]
) -> Iterator[tuple[str, Any]]:
    """What a member answers: ``part`` with an index and a result for each item, or at last ``error``.

    Args:
        state: Gives what it keeps, and makes it the first time.
        work: The work.
        items: Its share.
    """
    try:
        left = set(range(len(items)))
        for index, result in work(state(), items):
            left.remove(index)
            yield "part", (index, result)
        if left:
            raise MachineError(f"no result came of {len(left)} of {len(items)} items")
    except Exception as error:
        yield "error", sendable(error)


def sendable(error: Exception) -> Exception:
    """An error that comes through a pipe: itself where it can, else one with the same sentence."""
    if not isinstance(error, BtTasksimError) and (place := users_place(error)):
        return InputError(f"{place}: {type(error).__name__}: {error}")
    if not isinstance(error, BtTasksimError):
        return MachineError(f"{error!r}: {traceback.format_exc(limit=-3)}")
    if type(error) is InputError:
        return InputError(with_place(error))
    try:
        return copy.copy(error)  # as it is put together again on the other side
    except Exception:  # whatever its constructor asks for
        return InputError(str(error)) if isinstance(error, InputError) else MachineError(str(error))
