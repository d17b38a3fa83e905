"""Parts from outside of the package: a Python file or an importable module, named on the command line.

Loading one runs its code, so only whoever starts a command names it; no file that people exchange can.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from bt_tasksim.core import registry
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.former import advice

_loaded: dict[str, ModuleType] = {}


def load_plugin(plugin: str) -> ModuleType:
    """Run a plugin, whose parts announce themselves.

    Args:
        plugin: A path that ends with ``.py``, or the name of an importable module.

    Raises:
        InputError: There is no such file or module, or it raises; says where.
    """
    file = Path(plugin)
    key = str(file.resolve()) if plugin.endswith(".py") else plugin
    if key not in _loaded:
        _loaded[key] = _from_file(file) if plugin.endswith(".py") else _from_name(plugin)
    return _loaded[key]


def loaded() -> tuple[str, ...]:
    """The plugins of this process, for worker processes that need the same parts."""
    return tuple(_loaded)


@contextmanager
def scratch() -> Iterator[None]:
    """Plugins that are loaded inside are forgotten afterwards, and their parts; for tests."""
    plugins, modules, path = dict(_loaded), set(sys.modules), list(sys.path)
    try:
        with registry.scratch():
            yield
    finally:
        _loaded.clear()
        _loaded.update(plugins)
        for name in set(sys.modules) - modules:
            if name.startswith("_plugin_"):
                del sys.modules[name]
        sys.path[:] = path


def _from_file(file: Path) -> ModuleType:
    if not file.is_file():
        raise InputError(f"there is no plugin file '{file}'")
    name = f"_plugin_{file.stem}"
    name = name if name not in sys.modules else f"{name}_{len(_loaded)}"  # another folder's of the same name
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise InputError(f"plugin '{file}' is no Python file")
    folder = str(file.resolve().parent)
    if folder not in sys.path:  # as for a script: it may import what stands beside it
        sys.path.append(folder)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except InputError as error:
        del sys.modules[spec.name]
        raise InputError(f"plugin '{file}'{line_in(error, file)}: {error}") from error
    except (Exception, SystemExit) as error:
        del sys.modules[spec.name]
        where = f"plugin '{file}'{line_in(error, file)}"
        raise InputError(f"{where}: {type(error).__name__}: {error}{advice(error)}") from error
    return module


def _from_name(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and (name == error.name or name.startswith(f"{error.name}.")):
            raise InputError(f"there is no module '{name}' to load parts from") from error
        raise InputError(f"plugin '{name}': {error}{advice(error)}") from error
    except InputError:
        raise
    except (Exception, SystemExit) as error:
        raise InputError(f"plugin '{name}': {type(error).__name__}: {error}") from error


def line_in(error: BaseException, file: Path) -> str:
    """``, line N`` where an error came through a file, the innermost; empty where it did not."""
    if isinstance(error, SyntaxError):
        return f", line {error.lineno}"
    trace, line = error.__traceback__, ""
    while trace is not None:
        if Path(trace.tb_frame.f_code.co_filename).absolute() == file.absolute():
            line = f", line {trace.tb_lineno}"
        trace = trace.tb_next
    return line
