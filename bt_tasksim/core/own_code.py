"""People's own code: which of their modules take part in a tree or a part, and whether they are the same."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Sequence
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from bt_tasksim._names import SHORT
from bt_tasksim.core.resources import HOME

_INSTALLED = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")})
_PACKAGES = ("site-packages", "dist-packages")
"""Folders of installed packages, those of other Pythons too."""
_OURS = (HOME, *((HOME / name).resolve() for name in (*SHORT, "assets")))
_LOADERS = ("import_module", "__import__")
"""Functions that import a module by its name."""


class OwnModule(NamedTuple):
    """A module of people's own.

    Attributes:
        name: Its name.
        file: Its file.
        package: Name of the package from which its relative imports go.
        inner: Folders of its own modules, where it is a package.
    """

    name: str
    file: Path
    package: str
    inner: Sequence[str]


def is_own(module: str, file: str) -> bool:
    """Whether code is people's own, and neither ours, nor Python's, nor an installed package's.

    Args:
        module: The module's name.
        file: Its file.
    """
    if module.partition(".")[0] == "bt_tasksim" or file.startswith("<frozen"):
        return False
    return not is_installed(file)


def is_installed(file: str | Path) -> bool:
    """Whether a file is Python's or an installed package's."""
    return str(file).startswith(_INSTALLED) or any(name in Path(file).parts for name in _PACKAGES)


def is_own_file(file: str | Path) -> bool:
    """Whether a file is people's own, of whatever kind; what packages and we bring goes by their versions."""
    return not is_installed(file) and not any(Path(file).resolve().is_relative_to(ours) for ours in _OURS)


def own_modules(roots: Iterable[ModuleType]) -> dict[str, Path]:
    """The modules of people's own that take part in some modules: what they import, and so on.

    An import counts wherever it stands in a file, whether it has been carried out or not. Where a name is
    computed, all modules count that were loaded from the importing file's folder and below.

    Args:
        roots: The modules; they count themselves, wherever they are installed.

    Returns:
        Files by the modules' names.
    """
    found: dict[str, Path] = {}
    left = [known for root in roots if (known := _loaded(root)) is not None]
    while left:
        module = left.pop()
        if module.name in found:
            continue
        found[module.name] = module.file
        for name in dict.fromkeys(_imported(module)):
            inner = _found(name)
            if inner is not None and is_own(inner.name, str(inner.file)) and is_own_file(inner.file):
                left.append(inner)
    return found


def code_hash(file: str | Path) -> str:
    """SHA-256 of what a file of code says: comments and the layout of a Python file do not count.

    Raises:
        OSError: It cannot be read.
    """
    content = Path(file).read_bytes()
    code = _parsed(content) if Path(file).suffix == ".py" else None
    return hashlib.sha256(content if code is None else ast.dump(code).encode()).hexdigest()


def _loaded(module: ModuleType) -> OwnModule | None:
    file = getattr(module, "__file__", None)
    if not file:
        return None
    package = getattr(module, "__package__", None) or ""
    return OwnModule(module.__name__, Path(file), package, list(getattr(module, "__path__", ())))


def _found(name: str) -> OwnModule | None:
    """A module, loaded or where it would be found; none is loaded for this."""
    if name in sys.modules:
        return _loaded(sys.modules[name])
    above, _, last = name.rpartition(".")
    places = None
    if above:
        if (outer := _found(above)) is None or not outer.inner:
            return None
        places = outer.inner
    try:
        spec = PathFinder.find_spec(name, places)
    except (ImportError, ValueError):
        return None
    if not last or spec is None or spec.origin is None or not spec.has_location:
        return None
    return OwnModule(name, Path(spec.origin), spec.parent or "", list(spec.submodule_search_locations or ()))


def _imported(module: OwnModule) -> Iterator[str]:
    """Names of modules that a module's code may import, and others that are none."""
    try:
        code = _parsed(module.file.read_bytes()) if module.file.suffix == ".py" else None
    except OSError:
        return
    for node in () if code is None else ast.walk(code):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield from _with_parents(alias.name)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                try:
                    base = importlib.util.resolve_name("." * node.level + base, module.package)
                except ImportError:
                    continue
            yield from _with_parents(base)
            yield from (f"{base}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Call) and _name_of(node.func) in _LOADERS and node.args:
            name = node.args[0]
            if isinstance(name, ast.Constant) and isinstance(name.value, str) and name.value[:1] != ".":
                yield from _with_parents(name.value)
            else:
                yield from _below(module.file.resolve().parent)


def _parsed(content: bytes) -> ast.Module | None:
    try:
        return ast.parse(content)
    except (SyntaxError, ValueError, RecursionError):  # edited since it was loaded
        return None


def _with_parents(name: str) -> Iterator[str]:
    parts = name.split(".")
    return (".".join(parts[:n]) for n in range(1, len(parts) + 1))


def _below(folder: Path) -> Iterator[str]:
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if file and Path(file).resolve().is_relative_to(folder):
            yield name


def _name_of(function: ast.expr) -> str:
    if isinstance(function, ast.Attribute):
        return function.attr
    return function.id if isinstance(function, ast.Name) else ""
