"""Plugins as they are loaded by whoever starts a process: the command line, and its workers."""

from __future__ import annotations

import inspect
from collections.abc import Iterable

from bt_tasksim.core.plugins import load_plugin
from bt_tasksim.core.registry import parts, register


def load_parts(plugin: str) -> None:
    """Load a plugin; concepts and conditions that it defines are parts, whether it announces them or not.

    Args:
        plugin: A Python file, or the name of an importable module.

    Raises:
        InputError: There is no such file or module, it raises, or it takes a name that is taken.
    """
    module = load_plugin(plugin)
    own = [v for v in vars(module).values() if inspect.isclass(v) and v.__module__ == module.__name__]
    if not own:
        return
    from bt_tasksim.concept.condition import Condition
    from bt_tasksim.concept.model import ConceptModel

    known = set(map(id, parts("concept").values()))
    for value in own:
        if (
            issubclass(value, ConceptModel | Condition)
            and not inspect.isabstract(value)
            and id(value) not in known
        ):
            register("concept")(value)


def load_all(plugins: Iterable[str]) -> None:
    """Load the plugins of another process, see `bt_tasksim.core.plugins.loaded`."""
    for plugin in plugins:
        load_parts(plugin)
