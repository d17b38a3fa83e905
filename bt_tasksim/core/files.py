"""Files and folders that appear whole or not at all.

Everything is written beside its place under a hidden name and renamed when complete. After an error, a full
disk or an interrupt, what was there before is still there, and nothing else.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Collection, Iterator
from pathlib import Path

from bt_tasksim.errors import InputError, MachineError


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write a file.

    Args:
        path: Where to; an existing file is replaced.
        content: What it shall hold.

    Raises:
        InputError: The folder does not exist, or the path is a folder.
        MachineError: The disk is full or not writable.
    """
    with whole_file(path) as unfinished, open(unfinished, "xb") as file:
        file.write(content)


def write_text(path: str | Path, content: str) -> None:
    """Write a text file as UTF-8; see `write_bytes`."""
    write_bytes(path, content.encode())


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A path to write to inside the ``with`` block, which becomes ``path`` at its end.

    Args:
        path: Where to; an existing file is replaced.

    Yields:
        A path in the same folder, with the same suffix, of a file that does not exist yet.

    Raises:
        InputError: The folder does not exist, or the path is a folder or a device.
        MachineError: The disk is full or not writable, or the block wrote nothing.
    """
    path = Path(path)
    _check_parent(path)
    if path.is_dir():
        raise InputError(f"cannot write '{path}': it is a folder; name a file in it")
    if path.exists() and not path.is_file():
        raise InputError(f"cannot write '{path}': it is a device or a pipe; name a file")
    unfinished = _beside(path)
    try:
        yield unfinished
        _flush(unfinished)
        os.replace(unfinished, path)
    except OSError as error:
        raise _cannot_write(path, error) from error
    finally:
        with contextlib.suppress(OSError):
            unfinished.unlink()


@contextlib.contextmanager
def whole_folder(path: str | Path, names: Collection[str] = ()) -> Iterator[Path]:
    """A folder to fill inside the ``with`` block, which becomes ``path`` at its end.

    Args:
        path: Where to; folders above it are made. An existing folder is replaced if it holds nothing but
            ``names``.
        names: Names of files that may be lost.

    Yields:
        An empty folder beside it.

    Raises:
        InputError: A folder above is a file, or the path holds something else.
        MachineError: The disk is full or not writable.
    """
    path = Path(os.path.abspath(path))
    check_folder(path, names)
    unfinished, before = _beside(path), _beside(path)
    made = [folder for folder in path.parents if not folder.exists()]
    try:
        unfinished.mkdir(parents=True)
        yield unfinished
        check_folder(path, names)
        for file in unfinished.rglob("*"):
            if file.is_file():
                _flush(file)
        if path.exists():
            os.rename(path, before)
        os.rename(unfinished, path)
    except (ConnectionError, TimeoutError):
        raise
    except MachineError as error:
        if str(unfinished) not in str(error):
            raise
        raise MachineError(str(error).replace(str(unfinished), str(path))) from error
    except OSError as error:
        raise _cannot_write(path, error) from error
    finally:
        if before.exists() and not path.exists():
            os.rename(before, path)
        for rest in (unfinished, before):
            shutil.rmtree(rest, ignore_errors=True)
        for folder in made:
            with contextlib.suppress(OSError):  # it is needed if it is not empty
                folder.rmdir()


def file_version(path: str | Path) -> tuple[int, ...]:
    """Numbers that change with a file's content, as far as its folder tells; none where it is gone."""
    try:
        about = os.stat(path)
    except OSError:
        return ()
    return about.st_mtime_ns, about.st_size, about.st_ino


def check_folder(path: str | Path, names: Collection[str] = ()) -> None:
    """Check that `whole_folder` may write here, before there is anything to write.

    Raises:
        InputError: The path or a folder above it is a file, or it holds more than ``names``.
    """
    path = Path(os.path.abspath(path))
    above = next(folder for folder in path.parents if folder.exists())
    if not above.is_dir():
        raise InputError(f"cannot write a folder '{path}': '{above}' is a file; choose another name")
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise InputError(f"cannot write a folder '{path}': there is a file of this name; choose another name")
    others = sorted(p.name for p in path.iterdir() if p.name not in names) if path.is_dir() else []
    if others:
        raise InputError(
            f"cannot write a folder '{path}': it holds other things, such as '{others[0]}'; "
            f"name a new or empty folder"
        )


def _check_parent(path: Path) -> None:
    parent = path.parent
    if not parent.is_dir():
        raise InputError(f"cannot write '{path}': the folder '{parent}' does not exist; make it first")


def _beside(path: Path) -> Path:
    return path.with_name(f".{path.stem}.{secrets.token_hex(6)}{path.suffix}")


def _flush(path: Path) -> None:
    """Have a file's content on the disk before its name is."""
    with open(path, "rb") as file:
        os.fsync(file.fileno())


def _cannot_write(path: Path, error: OSError) -> MachineError:
    return MachineError(f"cannot write '{path}': {error.strerror or error}; nothing was written")
