"""Files that a file names: only such as lie with it."""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.plain import shown


def beside(folder: Path, name: str, what: str) -> Path:
    """Absolute path of a file that another one names, in the other one's folder or below.

    A file that people exchange opens nothing elsewhere on the machine of whoever tries it.

    Args:
        folder: Folder of the file that names the other one.
        name: What stands in it, a relative path.
        what: What is named, for the error, such as ``a mesh``.

    Raises:
        InputError: The path is absolute or leads out of the folder, by itself or through a link.
    """
    parts = (*PurePosixPath(name).parts, *PureWindowsPath(name).parts)
    absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).anchor
    if not name or absolute or ".." in parts or not name.isprintable():
        raise InputError(
            f"{what} should lie in the folder of the file that names it, or below, and be named by the path "
            f"from there, found '{shown(name)}': copy it there"
        )
    found = (folder / name).resolve()
    if not found.is_relative_to(folder.resolve()):
        raise InputError(
            f"{what}, '{shown(name)}', is a link that leads out of the folder of the file that names it: "
            f"copy the file itself there"
        )
    return found
