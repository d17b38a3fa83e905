"""Policies: what decides the action of a concept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from bt_tasksim.errors import InputError
from bt_tasksim.poses import Array

if TYPE_CHECKING:
    from bt_tasksim.concept import ConceptModel
    from bt_tasksim.context import Seen

PROGRAMMED = "programmed"


class Action(NamedTuple):
    """What a policy decides; batch dimensions ``(...)``.

    Attributes:
        motion: ``(..., n)`` offsets on the concept's reference motion, in [-1, 1] of the concept's scale.
        terminate: ``(...)`` boolean: the task is done. The motion then counts for nothing.
    """

    motion: Array
    terminate: Array


class Policy(Protocol):
    """Anything that decides a concept's action from what is seen."""

    @property
    def name(self) -> str:
        """How results name it; with the card's hash for a learned one."""

    def act(self, model: ConceptModel, seen: Seen, memory: Any) -> Action:
        """The action for this instant; pure and batched."""


class ProgrammedPolicy:
    """The concept's own programmed action, done when its own goal state is observed."""

    name = PROGRAMMED

    def act(self, model: ConceptModel, seen: Seen, memory: Any) -> Action:
        """See `Policy.act`."""
        return Action(model.programmed_motion(seen, memory), model.done(seen, memory))


def resolve_policy(name: str | None, concept: str, robot: str) -> Policy:
    """The policy that a leaf names, or the one pinned for its concept and robot.

    Raises:
        InputError: There is no such policy.
    """
    if name in (None, "", PROGRAMMED):
        return ProgrammedPolicy()
    raise InputError(f"concept '{concept}' on robot '{robot}': no policy '{name}'; known: programmed")
