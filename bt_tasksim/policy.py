"""Policies: what decides the action of a concept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from bt_tasksim.errors import InputError
from bt_tasksim.network import Network
from bt_tasksim.poses import Array, array_namespace

if TYPE_CHECKING:
    from bt_tasksim.concept import ConceptModel
    from bt_tasksim.context import Seen
    from bt_tasksim.robot import RobotDescription

PROGRAMMED = "programmed"
TERMINATE = 0.5
"""Output of a learned policy above which it says that the task is done."""


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


class LearnedPolicy:
    """A trained network: its last output says that the task is done, the others are the motion.

    Args:
        network: From features to outputs.
        name: How results name it.
    """

    def __init__(self, network: Network, name: str) -> None:
        self.network = network
        self.name = name

    def act(self, model: ConceptModel, seen: Seen, memory: Any) -> Action:
        """See `Policy.act`; where the concept takes no decision, its reference motion goes on."""
        decides = model.decides(seen, memory)
        xp = array_namespace(seen.tool)
        if seen.tool.ndim == 1 and not bool(decides):
            return Action(xp.zeros(model.actions), xp.asarray(False))
        out = xp.astype(self.network(model.features(seen, memory)), seen.tool.dtype)
        motion, terminate = split_action(out)
        if seen.tool.ndim == 1:
            return Action(motion, terminate)
        free = xp.asarray(decides)
        return Action(xp.where(free[..., None], motion, xp.zeros_like(motion)), terminate & free)


def split_action(output: Array) -> Action:
    """The action ``n`` and completion signal in the outputs ``(..., n + 1)`` of a network."""
    xp = array_namespace(output)
    return Action(xp.clip(output[..., :-1], -1.0, 1.0), output[..., -1] > TERMINATE)


def resolve_policy(model: ConceptModel, robot: RobotDescription) -> Policy:
    """The policy that a leaf names, or the one pinned for its concept and robot.

    Raises:
        InputError: There is no such policy.
    """
    if model.policy in (None, "", PROGRAMMED):
        return ProgrammedPolicy()
    concept = type(model).__name__.lower()
    raise InputError(f"concept '{concept}' on robot '{robot.name}': no policy '{model.policy}'")
