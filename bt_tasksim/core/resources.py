"""Where the bundled data files are."""

from __future__ import annotations

from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
"""The package's own folder, in a checkout and in an installed wheel."""


FURNITURE = (".urdf", ".xml", ".mjcf")
"""Further endings of files in which fixtures are given."""


def is_file(name: str, also: tuple[str, ...] = ()) -> bool:
    """A robot, fixture or scene is given as a file of one's own, and not by the name of a bundled one.

    Args:
        name: The file's name, or that of a bundled one.
        also: Endings of files besides YAML's.
    """
    return name.endswith((".yaml", ".yml", *also))


def asset(*parts: str) -> Path:
    """Path of a bundled file or folder, looked up through `bt_tasksim` alone."""
    return (HOME / "assets").resolve().joinpath(*parts)
