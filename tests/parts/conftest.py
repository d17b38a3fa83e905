"""Parts from outside of the package: each of `plugins/` is one file, loaded for one test and forgotten."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from bt_tasksim.core import plugins

FOLDER = Path(__file__).parent / "plugins"


@pytest.fixture
def plugin() -> Callable[[str], ModuleType]:
    """Loads a file of `plugins/` by its stem."""
    return lambda stem: plugins.load_plugin(str(FOLDER / f"{stem}.py"))
