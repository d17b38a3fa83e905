"""``bt-tasksim new tree``, ``new scene`` and ``new object``: one file each that works as it is."""

from __future__ import annotations

import keyword
from pathlib import Path

from bt_tasksim.checking.new_files import check_free, check_new, check_word, filled, named, write_new
from bt_tasksim.core.errors import InputError


def write_tree(name: str, folder: str | Path = ".") -> str:
    """Write a Python file with a tree and its scene, which runs.

    Args:
        name: Its name, lower-case words joined by underscores.
        folder: Where to; it is made where there is none.

    Returns:
        What was written, and what to do next.

    Raises:
        InputError: The name is no good or that of an installed module, or the file is there already; then
            nothing is written.
        MachineError: The disk is full or not writable; then nothing is written.
    """
    check_word(name, "a tree", "clear_the_table")
    if keyword.iskeyword(name):
        raise InputError(f"'{name}' is a word of Python: choose another name")
    path = Path(folder) / f"{name}.py"
    check_new(Path(folder), {path: None})
    check_free(name)
    write_new(Path(folder), {path: filled(("new_tree", "tree.py.txt"), named(name))})
    return f"wrote {path}\nnext: bt-tasksim run {path} --video; bt-tasksim evaluate {path} --episodes 20"


def write_scene(name: str, folder: str | Path = ".") -> str:
    """Write a scene's file, which can be drawn and run in.

    Args:
        name: Its name, lower-case words joined by underscores.
        folder: Where to; it is made where there is none.

    Returns:
        What was written, and what to do next.

    Raises:
        InputError: The name is no good, or the file is there already; then nothing is written.
        MachineError: The disk is full or not writable; then nothing is written.
    """
    check_word(name, "a scene", "kitchen")
    path = Path(folder) / f"{name}.yaml"
    write_new(Path(folder), {path: filled(("new_scene", "scene.yaml.txt"), named(name))})
    return f"wrote {path}\nnext: bt-tasksim check {path}; bt-tasksim new tree mine; " + (
        f"bt-tasksim run mine.py --scene {path}"
    )


def write_object(name: str, folder: str | Path = ".") -> str:
    """Write an object's file, which a scene can take.

    Args:
        name: Its name, lower-case words joined by underscores.
        folder: Where to; it is made where there is none.

    Returns:
        What was written, and what to do next.

    Raises:
        InputError: The name is no good, or the file is there already; then nothing is written.
        MachineError: The disk is full or not writable; then nothing is written.
    """
    check_word(name, "an object", "watering_can")
    path = Path(folder) / f"{name}.yaml"
    write_new(Path(folder), {path: filled(("new_object", "object.yaml.txt"), named(name))})
    return f"wrote {path}\nnext: bt-tasksim check {path}; name it in a scene: '{path.name} on table'"
