"""A file that only one process may hold at a time, and that a killed process lets go of."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from bt_tasksim.core.errors import InputError, MachineError


class LockedError(InputError):
    """Another process holds the lock."""


@contextlib.contextmanager
def locked(path: str | Path, what: str) -> Iterator[None]:
    """Hold a lock in the ``with`` block; processes forked in it do not hold it.

    Args:
        path: The lock's file; folders above it are made, and what was made is removed at the end.
        what: What may be done by one process alone, for the error's sentence.

    Raises:
        LockedError: Another process holds it.
        MachineError: The file cannot be made.
    """
    path = Path(os.path.abspath(path))
    made = [folder for folder in path.parents if not os.path.exists(folder)]
    try:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file = _taken(path, what)
        except OSError as error:
            raise MachineError(f"cannot write '{path}': {error.strerror or error}") from error
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                path.unlink()  # while it is held: whoever waits for it sees that the file is another one now
            os.close(file)
    finally:
        for folder in made:
            with contextlib.suppress(OSError):  # it is needed if it is not empty
                folder.rmdir()


def _taken(path: Path, what: str) -> int:
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.exists(path) and os.path.samestat(os.fstat(file), os.stat(path)):
                return file
            os.close(file)
        except (BlockingIOError, PermissionError):
            os.close(file)
            raise LockedError(f"another process is {what}: wait for it, or choose another place") from None
        except BaseException:
            os.close(file)
            raise
