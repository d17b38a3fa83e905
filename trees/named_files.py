"""Scenes and policies that a tree's file names: bundled ones, and such as lie with it."""

from __future__ import annotations

from pathlib import Path

from bt_tasksim.core.beside import beside
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.plain import shown
from bt_tasksim.policy.files import FILES
from bt_tasksim.policy.library import is_bundled


def scene_beside(name: str, tree: Path) -> str:
    """The path of a scene file that a tree's file names.

    Args:
        name: What stands in it.
        tree: The tree's file.

    Raises:
        InputError: The scene does not lie with the tree.
    """
    try:
        return str(beside(tree.parent, name, "a scene"))
    except InputError as error:
        raise InputError(f"'{tree}': {error}, or give --scene FILE") from None


def policy_beside(name: str, concept: str, folder: Path) -> str:
    """What a leaf names to get the policy that a tree's file names.

    Args:
        name: What stands in the file; empty for no policy.
        concept: Name of the leaf's concept, in lower case.
        folder: The file's folder.

    Returns:
        The name itself where it is a bundled policy's, or leads to the same folder from where the user is, or
        to none at all; else the policy's folder.

    Raises:
        InputError: The policy does not lie with the tree.
    """
    if not name or is_bundled(name):
        return name
    try:
        found = beside(folder, name, "a policy")
        for file in FILES:
            beside(folder, f"{name}/{file}", "a policy's file")
    except InputError as error:
        raise InputError(f"{error}, or give --policy {concept}=FOLDER") from None
    here = Path(name)
    if here.resolve() == found or not (found.exists() or here.exists()):
        return name
    return str(found)


def policy_from_beside(name: str, concept: str, tree: Path) -> str:
    """What a tree's file says of a leaf's policy, so that the leaf gets it again: its path from there.

    Args:
        name: What the leaf names.
        concept: Name of the leaf's concept, in lower case.
        tree: The tree's file.

    Raises:
        InputError: The policy does not lie with the tree.
    """
    if not name or is_bundled(name) or not Path(name).is_dir():
        return name
    folder, found = tree.resolve().parent, Path(name).resolve()
    if not found.is_relative_to(folder):
        raise InputError(
            f"the policy '{shown(name)}' of a leaf does not lie in the folder of '{tree}': copy it there, or "
            f"leave it out and run the tree with --policy {concept}={shown(name)}"
        )
    return found.relative_to(folder).as_posix()
