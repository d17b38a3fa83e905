"""A limit that a concept must not exceed, as data: what was measured, how much is allowed, and the reason."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from bt_tasksim.core.outcomes import Outcome, Reason
from bt_tasksim.core.poses import Array, host

NO_NAMES: Mapping[str, str] = MappingProxyType({})


class Limit(NamedTuple):
    """One limit in ``N`` worlds.

    Attributes:
        reason: What to say when it is exceeded; its gaps are ``value`` and ``limit``, both with units, and
            the ``names``.
        value: What was measured ``(N,)``, SI units.
        limit: What it must not exceed, one for all or ``(N,)``, in the same unit.
        names: The names that the reason is about.
        counts: Boolean, one for all or ``(N,)``: the limit applies now.
    """

    reason: Reason
    value: Array
    limit: Array | float
    names: Mapping[str, str] = NO_NAMES
    counts: Array | bool = True

    @property
    def applies(self) -> Array:
        """Boolean ``(N,)``: it is exceeded."""
        return (self.value > self.limit) & self.counts

    def on_host(self) -> Limit:
        """The same, with all numbers in NumPy: to be asked before many worlds are."""
        value, limit, counts = (
            host(x) if getattr(x, "ndim", 0) else x for x in (self.value, self.limit, self.counts)
        )
        return self._replace(value=value, limit=limit, counts=counts)

    def at(self, world: int) -> Outcome:
        """The reason with its numbers in one world, by its row.

        Raises:
            TypeError: The reason has other gaps, see ``reason``.
        """
        return self.reason(value=self.value, limit=self.limit, **self.names).at(world)
