"""Which objects a goal that is a function looks at: it is about them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel
from bt_tasksim.scene.geometry import Shape
from bt_tasksim.scene.outlines import Slab
from bt_tasksim.scene.relations import FinalState

WHOLE = frozenset({"hidden", "configuration"})
"""Attributes of a state with which a function may look at any object."""


@dataclass(frozen=True)
class WatchedState(FinalState):
    """The same state, which notes the objects that somebody asks about by name.

    Attributes:
        plain: The state.
        names: The objects that were looked at so far: all of them, where the arrays were.
    """

    plain: FinalState
    names: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, final: FinalState) -> WatchedState:
        """A state that nobody has looked at."""
        return cls(final.configuration, final.world, final.hidden, final)

    def __getattribute__(self, name: str) -> Any:
        if name in WHOLE:
            self.names.update(self.world.index)
        return super().__getattribute__(name)

    def pose(self, name: str) -> Array:
        """See `FinalState.pose`."""
        return self._noted(name).pose(name)

    def start(self, name: str) -> Array:
        """See `FinalState.start`."""
        return self._noted(name).start(name)

    def model(self, name: str) -> ObjectModel:
        """See `FinalState.model`."""
        return self._noted(name).model(name)

    def parts(self, name: str) -> tuple[Slab, ...]:
        """See `FinalState.parts`."""
        return self._noted(name).parts(name)

    def shape(self, name: str) -> Shape:
        """See `FinalState.shape`."""
        return self._noted(name).shape(name)

    def touched(self, name: str) -> bool:
        """See `FinalState.touched`."""
        return self._noted(name).touched(name)

    def supported(self, name: str) -> bool:
        """See `FinalState.supported`."""
        return self._noted(name).supported(name)

    def borne(self, name: str) -> bool:
        """See `FinalState.borne`."""
        return self._noted(name).borne(name)

    def _noted(self, name: str) -> FinalState:
        self.names.add(name)
        return self.plain
