"""Policies: what decides the action of a concept."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol, TypeVar

from bt_tasksim.core.poses import Array, array_namespace, clip
from bt_tasksim.policy.files import PolicySlot as PolicySlot
from bt_tasksim.policy.files import check_fits, load_policy
from bt_tasksim.policy.library import PROGRAMMED as PROGRAMMED
from bt_tasksim.policy.library import find_policy, folder_of_pinned, source_of
from bt_tasksim.policy.network import Network

TERMINATE = 0.5
"""Output of a learned policy above which it says that the task is done."""


class Action(NamedTuple):
    """What a policy decides in ``N`` worlds.

    Attributes:
        motion: ``(N, n)`` offsets on the concept's reference motion, in [-1, 1] of the concept's scale.
        terminate: ``(N,)`` how much nearer to done this decision brings the task, from 0 to 1: the task is
            done when its decisions come to 1. A boolean is all or nothing. The motion of the decision that
            ends it counts for nothing.
    """

    motion: Array
    terminate: Array


class View(Protocol):
    """What a policy knows of the view through which a concept looks at an observation."""

    @property
    def tool(self) -> Array:
        """Tool pose ``(..., 7)``; its type and leading dimensions are those of the action."""


ViewT = TypeVar("ViewT", bound=View)
ViewT_contra = TypeVar("ViewT_contra", bound=View, contravariant=True)


class Decidable(Protocol[ViewT_contra]):
    """What a policy knows of a concept; all arrays have leading batch dimensions ``(...)``."""

    @property
    def actions(self) -> int:
        """Size of the action's motion part."""

    def decides(self, seen: ViewT_contra, memory: Any, /) -> Array:
        """Boolean ``(...)``: a learned policy is asked at this tick."""

    def features(self, seen: ViewT_contra, memory: Any, /) -> Array:
        """What a learned policy sees: ``(..., n)``."""

    def programmed_motion(self, seen: ViewT_contra, memory: Any, /) -> Array:
        """The programmed policy's action ``(..., actions)``."""

    def done(self, seen: ViewT_contra, memory: Any, /) -> Array:
        """The programmed policy's completion signal: boolean ``(...)``."""


class Policy(Protocol):
    """Anything that decides a concept's action from what is seen."""

    @property
    def name(self) -> str:
        """How results name it; with the card's hash for a learned one."""

    @property
    def source(self) -> str:
        """What a leaf names to get it again, which a run's log keeps; empty where that is not possible."""

    def act(self, model: Decidable[ViewT], seen: ViewT, memory: Any) -> Action:
        """The action for this instant; pure and batched."""


class ProgrammedPolicy:
    """The concept's own programmed action, done when its own goal state is observed."""

    name = PROGRAMMED
    source = PROGRAMMED

    def act(self, model: Decidable[ViewT], seen: ViewT, memory: Any) -> Action:
        """See `Policy.act`."""
        return Action(model.programmed_motion(seen, memory), model.done(seen, memory))


class LearnedPolicy:
    """A trained network: its last output says that the task is done, the others are the motion.

    Args:
        network: From features to outputs.
        name: How results name it.
        source: What a leaf names to get it again; a run's log keeps it.
    """

    def __init__(self, network: Network, name: str, source: str = "") -> None:
        self.network = network
        self.name = name
        self.source = source

    def act(self, model: Decidable[ViewT], seen: ViewT, memory: Any) -> Action:
        """See `Policy.act`; where the concept takes no decision, its reference motion goes on."""
        xp = array_namespace(seen.tool)
        decides = xp.asarray(model.decides(seen, memory), device=seen.tool.device)
        if not bool(xp.any(decides)):
            still = xp.zeros_like(seen.tool[..., 0])
            return Action(xp.broadcast_to(still[..., None], (*still.shape, model.actions)), still)
        out = xp.astype(self.network(model.features(seen, memory)), seen.tool.dtype)
        motion, terminate = split_action(out, self.network.signal_std)
        return Action(
            xp.where(decides[..., None], motion, xp.zeros_like(motion)),
            xp.where(decides, terminate, xp.zeros_like(terminate)),
        )


def split_action(output: Array, signal_std: float = 0.0) -> Action:
    """The action ``n`` and completion signal in the outputs ``(..., n + 1)`` of a network."""
    return Action(clip(output[..., :-1], -1.0, 1.0), done_share(output[..., -1], signal_std))


def done_share(signal: Array, std: float) -> Array:
    """How much nearer to done ``(...)`` a completion signal ``(...)`` brings a task; at 1 in all it is done.

    In training the signal has noise of this ``std``: a task ends with some probability p at each decision,
    which is learned. Without the noise it ends where it would have ended in half of all trainings:
    when the product of the 1 - p comes to 1/2, so each decision adds -log2(1 - p). A threshold on the signal
    itself would wait for ever where training waited some decisions more. With no std it is a boolean.

    Source of the normal distribution's p: S. Bowling et al., "A logistic approximation to the cumulative
    normal distribution", 2009; its error is below 0.00014.
    """
    if std <= 0.0:
        return signal > TERMINATE
    xp = array_namespace(signal)
    z = clip((signal - TERMINATE) / std, -8.0, 0.0)
    return xp.log1p(xp.exp(1.5976 * z + 0.070565992 * z * z * z)) / math.log(2.0)


def named_policy(name: str | None, slot: PolicySlot) -> Policy:
    """The policy of a name, or the one pinned for a concept and robot, or the programmed one.

    Args:
        name: ``programmed``, a policy of ``assets/policies``, or the path of a policy's folder; None: the
            pinned one.
        slot: What it has to fit.

    Raises:
        InputError: There is no such policy, it is damaged, or it does not fit.
    """
    folder = find_policy(name) if name else folder_of_pinned(slot.concept, slot.robot)
    if folder is None:
        return ProgrammedPolicy()
    network, card = load_policy(folder)
    check_fits(card, folder, slot)
    return LearnedPolicy(network, f"{folder.resolve().name}@{card.hash}", source_of(folder))


def concept_name(concept: type) -> str:
    """How cards, pins and the command line name a concept: its class's name in lower case."""
    return concept.__name__.lower()
