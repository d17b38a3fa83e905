"""What learns in a tree, what it sees and what it decides."""

from __future__ import annotations

from collections.abc import Mapping

import gymnasium
import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.plain import shown
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.trees.nodes.train import Train, train_nodes


def spaces_of(layout: Mapping[str, int], actions: int) -> tuple[gymnasium.spaces.Box, gymnasium.spaces.Box]:
    """What is observed, and what is decided: a motion, and last the completion signal.

    Args:
        layout: Sizes of the parts of the features, by name.
        actions: Size of the motion.
    """
    return (
        gymnasium.spaces.Box(-np.inf, np.inf, (sum(layout.values()),), np.float32),
        gymnasium.spaces.Box(-1.0, 1.0, (actions + 1,), np.float32),
    )


def checked_actions(actions: Array, *shape: int) -> Array:
    """Motions and completion signals as numbers of a shape.

    Args:
        actions: What somebody gives.
        shape: ``(k, actions + 1)``, or ``(actions + 1,)`` of a single one.

    Raises:
        InputError: They have another shape, or are not finite.
    """
    wanted = f"actions should be finite numbers of shape {shape}"
    try:
        found = np.asarray(actions, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{wanted}, found {shown(repr(actions))}") from None
    if found.shape != shape:
        raise InputError(f"{wanted}, found shape {found.shape}")
    if not np.isfinite(found).all():
        raise InputError(f"{wanted}, found {found[~np.isfinite(found)][0]} among them")
    return found


def find_train(tree: Behaviour, name: str | None = None) -> Train:
    """The Train node of a name, or the first one.

    Raises:
        InputError: There is none.
    """
    found = train_nodes(tree)
    if not found:
        raise InputError(f"tree '{tree.name}' has no Train(...) node: mark what is to be learned")
    for node in found:
        if name is None or node.name == name:
            return node
    raise InputError(f"no Train node '{name}' in the tree; there is {', '.join(repr(n.name) for n in found)}")


def shared_layout(train: Train, learners: list[ConceptNode], robot: RobotDescription) -> dict[str, int]:
    """What all leaves that learn under one Train see.

    Raises:
        InputError: Two of them differ in what they see or do.
    """
    first = learners[0]
    layout = dict(first.model.layout(robot))
    for leaf in learners[1:]:
        if dict(leaf.model.layout(robot)) != layout or leaf.model.actions != first.model.actions:
            raise InputError(
                f"'{first.name}' and '{leaf.name}' below '{train.name}' see or do different things: "
                f"give each its own Train(...)"
            )
    return layout
