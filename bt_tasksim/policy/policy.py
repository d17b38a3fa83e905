"""Policies: what decides the action of a concept."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from bt_tasksim.errors import InputError
from bt_tasksim.network import Network
from bt_tasksim.policy_files import check_fits, load_policy
from bt_tasksim.policy_library import PROGRAMMED as PROGRAMMED
from bt_tasksim.policy_library import find_policy, folder_of_pinned, source_of
from bt_tasksim.poses import Array, array_namespace, clip

if TYPE_CHECKING:
    from bt_tasksim.concept import ConceptModel
    from bt_tasksim.context import Seen
    from bt_tasksim.robot import RobotDescription

TERMINATE = 0.5
"""Output of a learned policy above which it says that the task is done."""


class Action(NamedTuple):
    """What a policy decides; batch dimensions ``(...)``.

    Attributes:
        motion: ``(..., n)`` offsets on the concept's reference motion, in [-1, 1] of the concept's scale.
        terminate: ``(...)`` how much nearer to done this decision brings the task, from 0 to 1: the task is
            done when its decisions come to 1. A boolean is all or nothing. The motion of the decision that
            ends it counts for nothing.
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
    source = PROGRAMMED

    def act(self, model: ConceptModel, seen: Seen, memory: Any) -> Action:
        """See `Policy.act`."""
        return Action(model.programmed_motion(seen, memory), model.done(seen, memory))


class LearnedPolicy:
    """A trained network: its last output says that the task is done, the others are the motion.

    Args:
        network: From features to outputs.
        name: How results name it.
        source: What a leaf names to get it again.
    """

    def __init__(self, network: Network, name: str, source: str = "") -> None:
        self.network = network
        self.name = name
        self.source = source

    def act(self, model: ConceptModel, seen: Seen, memory: Any) -> Action:
        """See `Policy.act`; where the concept takes no decision, its reference motion goes on."""
        decides = model.decides(seen, memory)
        xp = array_namespace(seen.tool)
        if seen.tool.ndim == 1 and not bool(decides):
            return Action(xp.zeros(model.actions), xp.asarray(False))
        out = xp.astype(self.network(model.features(seen, memory)), seen.tool.dtype)
        motion, terminate = split_action(out, self.network.signal_deviation)
        if seen.tool.ndim == 1:
            return Action(motion, terminate)
        free = xp.asarray(decides)
        none = xp.zeros_like(terminate)
        return Action(
            xp.where(free[..., None], motion, xp.zeros_like(motion)), xp.where(free, terminate, none)
        )


def split_action(output: Array, signal_deviation: float = 0.0) -> Action:
    """The action ``n`` and completion signal in the outputs ``(..., n + 1)`` of a network."""
    return Action(clip(output[..., :-1], -1.0, 1.0), done_share(output[..., -1], signal_deviation))


def done_share(signal: Array, deviation: float) -> Array:
    """How much nearer to done ``(...)`` a completion signal ``(...)`` brings a task; at 1 in all it is done.

    In training the signal has noise of this ``deviation``: a task ends with some probability p at each
    decision, which is learned. Without the noise it ends where it would have ended in half of all trainings:
    when the product of the 1 - p comes to 1/2, so each decision adds -log2(1 - p). A threshold on the signal
    itself would wait for ever where training waited some decisions more. With no deviation it is a boolean.

    Source of the normal distribution's p: S. Bowling et al., "A logistic approximation to the cumulative
    normal distribution", 2009; its error is below 0.00014.
    """
    if deviation <= 0.0:
        return signal > TERMINATE
    xp = array_namespace(signal)
    z = clip((signal - TERMINATE) / deviation, -8.0, 0.0)
    return xp.log1p(xp.exp(1.5976 * z + 0.070565992 * z * z * z)) / math.log(2.0)


def resolve_policy(model: ConceptModel, robot: RobotDescription) -> Policy:
    """The policy that a leaf names, or the one pinned for its concept and robot, or the programmed one.

    A name is ``programmed``, a policy of ``assets/policies``, or the path of a policy's folder.

    Args:
        model: The leaf.
        robot: The robot that it runs on.

    Raises:
        InputError: There is no such policy, it is damaged, or it is none for this concept and robot.
    """
    try:
        concept = concept_name(type(model))
        folder = find_policy(model.policy) if model.policy else folder_of_pinned(concept, robot.name)
        if folder is None:
            return ProgrammedPolicy()
        network, card = load_policy(folder)
        check_fits(card, folder, concept, robot.name, type(model).layout(robot), model.actions)
    except InputError as error:
        raise InputError(f"leaf '{model.name}': {error}") from error
    return LearnedPolicy(network, f"{folder.resolve().name}@{card.hash}", source_of(folder))


def concept_name(concept: type[ConceptModel]) -> str:
    """How cards, pins and the command line name a concept."""
    return concept.__name__.lower()
