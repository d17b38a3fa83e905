"""Parts announce themselves: one registry for everything that can be added without editing anything else.

A part is one file that says all about itself and registers under its kind::

    @register("concept")
    class Push(ConceptModel): ...

    @register("engine/physics", "bullet")
    class BulletPhysics(PhysicsEngine): ...

Built-in parts lie in the packages of `HOMES`, in files that may be named after them; other packages name
their modules in the entry point group ``bt_tasksim.parts``; a single file or module is loaded by
`bt_tasksim.core.plugins`. No file that people exchange (log, tree, scene, policy, run) can load one.

What is registered is code, the same for all trees of a process; nothing of a run is kept here.
"""

from __future__ import annotations

import importlib
import logging
import os
import pkgutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from types import FunctionType
from typing import Any, TypeVar

from bt_tasksim.core.errors import InputError, MachineError, nearest
from bt_tasksim.core.plain import shown

LOG = logging.getLogger("bt_tasksim.registry")
GROUP = "bt_tasksim.parts"
"""Entry point group; each entry is a module that registers parts when it is imported."""

HOMES: dict[str, tuple[str, ...]] = {
    "concept": ("bt_tasksim.concept_nodes",),
    "engine/kinematics": ("bt_tasksim.engines.kinematics", "bt_tasksim.engines.remote.engines"),
    "engine/physics": (
        "bt_tasksim.engines.physics",
        "bt_tasksim.engines.remote.engines",
        "bt_tasksim.hardware.ros.engine",
    ),
    "engine/rendering": ("bt_tasksim.engines.rendering", "bt_tasksim.engines.remote.engines"),
    "engine/postprocess": ("bt_tasksim.engines.perception", "bt_tasksim.engines.remote.engines"),
    "noise model": ("bt_tasksim.engines.perception.noise",),
    "robot": ("bt_tasksim.robot.bundled",),
    "fixture": ("bt_tasksim.scene.bundled", "bt_tasksim.scene.makers"),
    "shape": ("bt_tasksim.scene.kinds",),
    "log reader": ("bt_tasksim.demos_decomp.readers",),
    "tree node": ("bt_tasksim.trees.nodes",),
    "observable": ("bt_tasksim.core.observables",),
    "reward part": ("bt_tasksim.training.reward_parts",),
    "goal relation": ("bt_tasksim.scene.relations",),
    "reason": ("bt_tasksim.core.outcomes",),
    "command": ("bt_tasksim.cli.commands",),
}
"""Packages or modules of the built-in parts, by kind; reasons also stand beside the parts that give them."""

OWN = "; one of your own comes with --plugin FILE"
"""What to say besides of a part that there is not."""
T = TypeVar("T")


@dataclass(frozen=True)
class Part:
    """A registered part: its kind, its name, what it is, and the module that it comes from."""

    kind: str
    name: str
    value: Any
    module: str


_parts: dict[str, dict[str, Part]] = {kind: {} for kind in HOMES}
_missing: dict[str, dict[str, str]] = {kind: {} for kind in HOMES}
_discovered: set[str] = set()


def register(kind: str, name: str | None = None, module: str | None = None) -> Callable[[T], T]:
    """A decorator that announces a class, a function or any other value as a part.

    Args:
        kind: One of `HOMES`.
        name: What it is called; by default its ``__name__``, which values other than classes and functions
            do not have.
        module: The module that it comes from; by default that of a class or a function, else the caller's.

    Raises:
        InputError: There is no such kind, or another part has this name.
    """
    here = module or str(sys._getframe(1).f_globals.get("__name__", ""))

    def announced(value: T) -> T:
        called = name if name is not None else str(getattr(value, "__name__", ""))
        own = module is None and isinstance(value, type | FunctionType)
        _add(Part(kind, called, value, value.__module__ if own else here))
        return value

    _table(kind)
    return announced


def part(kind: str, name: str) -> Any:
    """The part of a kind that has this name.

    Raises:
        InputError: There is none; says which names are near.
        MachineError: It needs a library that is not installed.
    """
    table = _table(kind)
    if name not in table:
        _import_named(kind, name)
    if name not in table:
        discover(kind)
    if name in table:
        return table[name].value
    if name in _missing[kind]:
        raise MachineError(f"{_said(kind)} '{name}' needs what is not installed: {_missing[kind][name]}")
    raise InputError(f"unknown {_said(kind)} '{shown(name)}'{nearest(name, table)}{OWN}")


def parts(kind: str) -> dict[str, Any]:
    """All parts of a kind by name, in the order in which they were announced.

    Raises:
        InputError: There is no such kind.
    """
    discover(kind)
    return {name: found.value for name, found in _table(kind).items()}


def kinds(prefix: str = "") -> tuple[str, ...]:
    """Names of the kinds that begin with ``prefix``."""
    return tuple(kind for kind in HOMES if kind.startswith(prefix))


def module_of(kind: str, name: str) -> str:
    """Name of the module from which a part was announced."""
    part(kind, name)
    return _parts[kind][name].module


def discover(kind: str) -> None:
    """Import the homes of a kind, and once the modules that installed packages name."""
    _table(kind)
    if kind not in _discovered:
        _discovered.add(kind)
        for home in HOMES[kind]:
            for module in _modules(home):
                _import(kind, module)
    if GROUP not in _discovered:
        _discovered.add(GROUP)
        for entry in metadata.entry_points(group=GROUP):
            try:
                entry.load()
            except Exception as error:  # another package's fault: say it, and go on without its parts
                LOG.warning("parts of '%s' are left out: %s: %s", entry.value, type(error).__name__, error)


@contextmanager
def scratch() -> Iterator[None]:
    """Whatever is announced inside is forgotten afterwards; for tests."""
    before = {kind: dict(table) for kind, table in _parts.items()}
    try:
        yield
    finally:
        for kind, table in before.items():
            added = {
                name: found for name, found in _parts[kind].items() if found.module.startswith("bt_tasksim.")
            }
            _parts[kind].clear()
            _parts[kind].update({**added, **table})


def _table(kind: str) -> dict[str, Part]:
    if kind not in _parts:
        raise InputError(f"there is no kind of part called '{kind}'{nearest(kind, _parts)}")
    return _parts[kind]


def _add(new: Part) -> None:
    table = _table(new.kind)
    if not new.name:
        raise InputError(f"a {_said(new.kind)} from '{new.module}' has no name: register it under one")
    if new.name not in table and not _ours(new.module):
        _meet(new)
    old = table.get(new.name)
    if old is None or old.value is new.value or _redefined(old, new):
        table[new.name] = new
    elif not _copied(old, new):
        raise InputError(
            f"{_said(new.kind)} '{new.name}' is there twice: in '{old.module}' and in '{new.module}'; "
            f"rename one of them"
        )


def _ours(module: str) -> bool:
    return module.partition(".")[0] == "bt_tasksim"


def _meet(new: Part) -> None:
    """Import what of ours may have the name of a part from outside, which then is the one refused."""
    if new.kind.startswith("engine/"):  # heavy, and all of them in files that are named after them
        _import_named(new.kind, new.name)
    else:
        discover(new.kind)


def _redefined(old: Part, new: Part) -> bool:
    """The same definition, run again: a reloaded module, a notebook's cell. The new one counts."""
    return old.module == new.module and _same_name(old, new)


def _copied(old: Part, new: Part) -> bool:
    """The same file, loaded under another name, too: a plugin that is imported. The first one counts."""
    files = [getattr(sys.modules.get(part.module), "__file__", None) for part in (old, new)]
    if files[0] is None or files[1] is None:
        return False
    return os.path.realpath(files[0]) == os.path.realpath(files[1]) and _same_name(old, new)


def _same_name(old: Part, new: Part) -> bool:
    names = [getattr(value, "__qualname__", None) for value in (old.value, new.value)]
    return names[0] is not None and names[0] == names[1]


def _modules(home: str) -> list[str]:
    module = importlib.import_module(home)
    path = getattr(module, "__path__", None)
    inner = [] if path is None else [found.name for found in pkgutil.iter_modules(path)]
    return [home, *(f"{home}.{name}" for name in sorted(inner))]


def _import_named(kind: str, name: str) -> None:
    """Import the file or folder that is named after the part, if there is one: the others may be heavy."""
    stem = name.replace("-", "_").lower()
    for home in HOMES[kind]:
        if stem in home.split("."):
            _import(kind, home)
        elif stem.isidentifier() and f"{home}.{stem}" in _modules(home):
            _import(kind, f"{home}.{stem}")


def _import(kind: str, module: str) -> None:
    """Import a module of ours; a library that it needs and that is not installed is remembered."""
    try:
        importlib.import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("bt_tasksim"):
            raise
        _missing[kind][module.rpartition(".")[2]] = str(error)


def _said(kind: str) -> str:
    """A kind in words: ``physics engine``."""
    family, _, role = kind.partition("/")
    return f"{role} {family}".strip()
