"""Where the bundled data files are."""

from __future__ import annotations

from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
"""The package's own folder, in a checkout and in an installed wheel."""


def is_file(name: str) -> bool:
    """A robot, fixture or scene is given as a file of one's own, and not by the name of a bundled one."""
    return name.endswith((".yaml", ".yml"))


def asset(*parts: str) -> Path:
    """Path of a bundled file or folder, looked up through `bt_tasksim` alone."""
    return (HOME / "assets").resolve().joinpath(*parts)
