"""A decision of a leaf that learns: what it sees and remembers right before it acts."""

from __future__ import annotations

from typing import Any

import numpy as np

from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.bundles import taken


class Decision:
    """A decision in one of the worlds of a batch; what was seen is taken out when it is asked for.

    Args:
        leaf: The leaf.
        seen: What was seen in some worlds.
        memory: What the leaf remembered in them.
        position: Which of them it is.
    """

    __slots__ = ("_memory", "_position", "_seen", "leaf")

    def __init__(self, leaf: ConceptNode, seen: Seen, memory: Any, position: int) -> None:
        self.leaf, self._seen, self._memory, self._position = leaf, seen, memory, position

    @property
    def seen(self) -> Seen:
        """What was seen ``(1, ...)``."""
        return self._seen.at(np.array([self._position]))

    @property
    def memory(self) -> Any:
        """What the leaf remembered ``(1, ...)``."""
        return taken(self._memory, np.array([self._position]))
