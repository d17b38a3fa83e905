"""A limit that a concept must not exceed, as data: what was measured, how much is allowed, and the reason."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from bt_tasksim.core.outcomes import Outcome, Reason, Statement
from bt_tasksim.core.poses import Array

NO_NAMES: Mapping[str, str] = MappingProxyType({})


class Limit(NamedTuple):
    """One limit; batch dimensions ``(...)``.

    Attributes:
        reason: What to say when it is exceeded; its gaps are ``value`` and ``limit``, both with units, and
            the ``names``.
        value: What was measured ``(...)``, SI units.
        limit: What it must not exceed ``(...)``, in the same unit.
        names: The names that the reason is about.
        counts: Boolean ``(...)``: the limit applies now.
    """

    reason: Reason
    value: Array
    limit: Array | float
    names: Mapping[str, str] = NO_NAMES
    counts: Array | bool = True

    @property
    def exceeded(self) -> Array:
        """Boolean ``(...)``."""
        return (self.value > self.limit) & self.counts

    def outcome(self, measured: Statement | None = None) -> Outcome:
        """The reason with its numbers, of a single world.

        Args:
            measured: Where things stood.

        Raises:
            TypeError: The reason has other gaps, see ``reason``.
        """
        return self.reason(measured, value=self.value, limit=self.limit, **self.names)
