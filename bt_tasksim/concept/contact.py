"""Contact states, and the change of one by which a task is known."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

Freedom = Literal["translation", "rotation"]


class ContactState(Enum):
    """The seven classes of contact states, in the order of their freedom, the freest first.

    The value says what the class means for translation.
    """

    NC = "no contact"
    PC = "rests on something, can be lifted off"
    TR = "moves in a plane only, held from both sides"
    OT = "as TR, and blocked on one side in the plane"
    PR = "moves on a line only, such as a half-open drawer"
    OP = "as PR, at an end stop, such as a closed drawer"
    FT = "cannot move"


class Change(Enum):
    """What a task does to the contact state in which it finds the object."""

    BREAKS = "breaks"
    KEEPS = "keeps"
    MAKES = "makes"


@dataclass(frozen=True)
class ContactChange:
    """What a task does to a contact state.

    Attributes:
        before: Class of contact state before the task.
        after: Class of contact state after the task.
        motion: Whether the contact state is that of translation or of rotation.
        to: What the object has the contact with: the environment, or the hand.
    """

    before: ContactState
    after: ContactState
    motion: Freedom = "translation"
    to: Literal["environment", "hand"] = "environment"

    @property
    def change(self) -> Change:
        """Whether the task breaks, keeps or makes the contact state."""
        if self.before is self.after:
            return Change.KEEPS
        order = list(ContactState)
        return Change.BREAKS if order.index(self.after) < order.index(self.before) else Change.MAKES
