"""Whether what somebody gives to run is what it should be, before anything begins."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import cast

from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.plain import short
from bt_tasksim.scene.scene import WorldSource

_SOURCE = ("name", "robot", "sample", "object_names", "place_names")


def checked_tree(tree: object) -> Behaviour | Callable[[], Behaviour]:
    """A tree's root, or what makes it.

    Raises:
        InputError: It is neither.
    """
    if isinstance(tree, Behaviour) or callable(tree):
        return tree
    by_name = f": load_source({short(tree)}).build() gives that of a file" if isinstance(tree, str) else ""
    raise InputError(
        f"a tree is a py_trees behaviour, or a function that makes it, found {short(tree)}{by_name}"
    )


def checked_root(root: object) -> Behaviour:
    """What a function has made as a tree.

    Raises:
        InputError: It is no behaviour.
    """
    if isinstance(root, Behaviour):
        return root
    raise InputError(f"what makes the tree should return a py_trees behaviour, found {short(root)}")


def checked_scene(scene: object) -> WorldSource:
    """A scene, or another source of worlds.

    Raises:
        InputError: It is none.
    """
    if not isinstance(scene, type) and all(hasattr(scene, name) for name in _SOURCE):
        return cast(WorldSource, scene)
    advice = ""
    if isinstance(scene, str):
        advice = f": load_scene({short(scene)}) gives that of a file"
    elif callable(scene):
        advice = ": call it"
    raise InputError(f"a scene is a Scene, found {short(scene)}{advice}")


def checked_policies(policy: object) -> Mapping[str, str]:
    """Policies by concept.

    Raises:
        InputError: They are none.
    """
    if policy is None:
        return {}
    if isinstance(policy, Mapping) and all(isinstance(p, str) for pair in policy.items() for p in pair):
        return policy
    raise InputError(
        f"policies are names by concept, such as {{'grasp': 'programmed'}}, found {short(policy)}"
    )


def checked_longest(seconds: object) -> float:
    """Seconds of an episode after which it is stopped.

    Raises:
        InputError: It is no positive number.
    """
    if isinstance(seconds, int | float) and not isinstance(seconds, bool) and seconds > 0.0:
        return float(seconds)
    raise InputError(
        f"the longest time of an episode is a positive number of seconds, found {short(seconds)}"
    )
