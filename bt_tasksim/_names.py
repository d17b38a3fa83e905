"""The short names ``trees``, ``concept_nodes`` and ``demos_decomp``, for people's imports.

The packages are `bt_tasksim.trees` and so on. Whoever writes ``from trees import sequence`` gets the same
module object, provided that nobody else has claimed the name: a user's own ``trees.py`` or another installed
package comes first. Installed by ``import bt_tasksim``, and at the start of Python by the line in
``bt_tasksim.pth``; so this file imports next to nothing.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from importlib.abc import InspectLoader
from importlib.machinery import ModuleSpec, PathFinder

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import CodeType, ModuleType

SHORT = ("trees", "concept_nodes", "demos_decomp")
PACKAGE = "bt_tasksim"


class ShortNames:
    """A finder of short names as what they stand for, where nobody else has claimed them."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The alias's spec; None for every other name."""
        top, _, inner = name.partition(".")
        if top not in SHORT:
            return None
        if inner:
            if sys.modules.get(top) is not sys.modules.get(f"{PACKAGE}.{top}"):
                return None
        elif _claimed(top):
            return None
        origin = os.path.join(os.path.dirname(__file__), *name.split(".")) + ".py"  # sys.argv[0] of python -m
        return ModuleSpec(name, _Alias(), origin=origin)  # type: ignore[arg-type]  # a loader by its methods


class _Alias:
    """A loader that hands on the module that a short name stands for."""

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = importlib.import_module(f"{PACKAGE}.{spec.name}")
        self._own = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._own  # the import system has put the alias's there

    def get_code(self, name: str) -> CodeType | None:
        """The code that ``python -m`` runs."""
        spec = importlib.util.find_spec(f"{PACKAGE}.{name}")
        loader = None if spec is None else spec.loader
        return loader.get_code(f"{PACKAGE}.{name}") if isinstance(loader, InspectLoader) else None


def install() -> None:
    """Make the short names known; a second call changes nothing."""
    if not any(isinstance(finder, ShortNames) for finder in sys.meta_path):
        sys.meta_path.insert(0, ShortNames())


def one_module(name: str) -> None:
    """Called by a package that was found under its short name, in a checkout: hands on the one module."""
    if name in SHORT:
        sys.modules[name] = importlib.import_module(f"{PACKAGE}.{name}")


def _claimed(top: str) -> bool:
    """Another module of this name is found; a checkout's own folder is ours."""
    try:
        found = PathFinder.find_spec(top)
    except (ImportError, ValueError):
        return True
    if found is None or found.origin is None:
        return False
    home = os.path.join(os.path.dirname(os.path.abspath(__file__)), top)
    return os.path.dirname(os.path.realpath(found.origin)) != os.path.realpath(home)
