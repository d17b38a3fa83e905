"""Files and folders that appear whole or not at all.

Everything is written beside its place under a hidden name and renamed when complete. After an error, a full
disk, an interrupt or SIGTERM, what was there before is still there, and nothing else. What a killed process
has left under a hidden name is cleared away when its place is written the next time.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import os
import platform
import re
import secrets
import shutil
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from bt_tasksim.core.errors import InputError, MachineError, is_bad_path
from bt_tasksim.core.interrupts import terminable
from bt_tasksim.core.locks import locked

_NEW, _OLD = "new", "old"
"""Kinds of hidden names: what is being written, and what was there before."""
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL)
"""Errors of file systems that know no locks: there, two processes may write to one place."""


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


def write_texts(contents: Mapping[str | Path, str]) -> None:
    """Write several text files as UTF-8: all of them, or none where one of them cannot be written.

    Args:
        contents: What each shall hold, by its path.

    Raises:
        InputError: A folder does not exist, a path is a folder, or two are the same file.
        MachineError: The disk is full or not writable.
    """
    check_targets(contents)
    with contextlib.ExitStack() as files:
        for path, content in contents.items():
            unfinished = files.enter_context(whole_file(path))
            with open(unfinished, "xb") as file:
                file.write(content.encode())
                file.flush()
                os.fsync(file.fileno())


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
    _check_file(path)
    clear_away(path)
    unfinished = _beside(path, _NEW)
    try:
        with terminable():
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
        InputError: A folder above is a file, the path holds something else, or another process fills it.
        MachineError: The disk is full or not writable.
    """
    path = Path(os.path.abspath(path))
    clear_away(path)
    check_folder(path, names)
    with alone(path):
        unfinished, before = _beside(path, _NEW), _beside(path, _OLD)
        try:
            with terminable():
                unfinished.mkdir(parents=True)
                yield unfinished
                check_folder(path, names)
                for file in unfinished.rglob("*"):
                    if file.is_file():
                        _flush(file)
                if os.path.exists(path):
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
            if os.path.exists(before) and not os.path.exists(path):
                os.rename(before, path)
            for rest in (unfinished, before):
                shutil.rmtree(rest, ignore_errors=True)


@contextlib.contextmanager
def alone(path: str | Path) -> Iterator[None]:
    """No other process that asks writes to a path in the ``with`` block: of two, one would be lost.

    Args:
        path: A file or folder; folders above it are made, and removed at the end if nothing came into them.

    Raises:
        InputError: Another process is writing there.
        MachineError: The disk is not writable.
    """
    named, path = path, Path(os.path.realpath(path))  # one thing may be reached by several names
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(locked(path.with_name(f".{path.name}.writing"), f"writing '{named}'"))
        except MachineError as error:
            assert isinstance(error.__cause__, OSError)
            if error.__cause__.errno not in _NO_LOCKS:
                raise _cannot_write(path, error.__cause__) from error
        yield


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
    above = next((folder for folder in path.parents if os.path.exists(folder)), path)
    if not os.path.isdir(above):
        raise InputError(f"cannot write a folder '{path}': '{above}' is a file; choose another name")
    if os.path.islink(path) or (os.path.exists(path) and not os.path.isdir(path)):
        raise InputError(f"cannot write a folder '{path}': there is a file of this name; choose another name")
    within = sorted(path.iterdir()) if os.path.isdir(path) else []
    others = [p.name for p in within if p.name not in names]
    others += [f"a folder named {p.name}" for p in within if p.name in names and not p.is_file()]
    if others:
        raise InputError(
            f"cannot write a folder '{path}': it holds other things, such as '{others[0]}'; "
            f"name a new or empty folder"
        )


def check_writable(path: str | Path) -> None:
    """Check that `whole_file` may write here, before there is anything to write.

    Raises:
        InputError: The folder does not exist, or the path is a folder or a device.
        MachineError: The folder is not writable.
    """
    path = Path(path)
    _check_file(path)
    trial = _beside(path, _NEW)
    try:
        trial.touch(exist_ok=False)
        trial.unlink()
    except OSError as error:
        raise _cannot_write(path, error) from error


def check_targets(paths: Iterable[str | Path | None], sources: Iterable[str | Path | None] = ()) -> None:
    """Check that `write_texts` may write here, before there is anything to write.

    Args:
        paths: Where to; None where nothing is wanted.
        sources: What is read, and so must not be written over.

    Raises:
        InputError: See `check_writable`, or two paths are the same file, or one is a source.
        MachineError: A folder is not writable.
    """
    known: set[str] = set()
    read = {os.path.realpath(source) for source in sources if source is not None}
    for path in paths:
        if path is None:
            continue
        check_writable(path)
        whole = os.path.realpath(path)
        if whole in read:
            raise InputError(f"cannot write into '{path}', which is read: give another name")
        if whole in known:
            raise InputError(f"cannot write two things into '{path}': give each a name of its own")
        known.add(whole)


def clear_away(path: Path) -> None:
    """Clear away what processes that were killed have left beside a path; what they had moved comes back."""
    pattern = re.compile(
        rf"\.{re.escape(path.stem)}\.({_NEW}|{_OLD})-{_host()}-([0-9]+)-[0-9a-f]+{re.escape(path.suffix)}"
    )
    try:
        left = [(found, p) for p in path.parent.iterdir() if (found := pattern.fullmatch(p.name))]
    except OSError:
        return
    for found, rest in left:
        if _runs(int(found[2])):
            continue
        with contextlib.suppress(OSError):
            if found[1] == _OLD and not path.exists():
                os.rename(rest, path)
            elif rest.is_dir():
                shutil.rmtree(rest, ignore_errors=True)
            else:
                rest.unlink()


def _check_file(path: Path) -> None:
    if not os.path.isdir(path.parent):
        raise InputError(f"cannot write '{path}': the folder '{path.parent}' does not exist; make it first")
    if os.path.isdir(path):
        raise InputError(f"cannot write '{path}': it is a folder; name a file in it")
    if os.path.exists(path) and not os.path.isfile(path):
        raise InputError(f"cannot write '{path}': it is a device or a pipe; name a file")


def _beside(path: Path, kind: str) -> Path:
    """A hidden name beside a path that says which process of which machine it is of."""
    return path.with_name(f".{path.stem}.{kind}-{_host()}-{os.getpid()}-{secrets.token_hex(4)}{path.suffix}")


@functools.cache
def _host() -> str:
    return f"{zlib.crc32(platform.node().encode()):08x}"


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


def _flush(path: Path) -> None:
    """Have a file's content on the disk before its name is."""
    with open(path, "rb") as file:
        os.fsync(file.fileno())


def _cannot_write(path: Path, error: OSError) -> InputError | MachineError:
    kind = InputError if is_bad_path(error) else MachineError
    return kind(f"cannot write '{path}': {error.strerror or error}; nothing was written")
