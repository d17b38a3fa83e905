"""Errors with one clear sentence, sorted by whose fault they are.

The command line turns :class:`InputError` into exit code 2 (the user can put it right) and
:class:`MachineError` into exit code 1 (the machine failed), and prints the sentence alone.
"""

from __future__ import annotations

import difflib
import errno
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

LONGEST = 100
"""Characters of a name in which near ones are looked for."""


class BtTasksimError(Exception):
    """Root of every error that this framework raises on purpose."""


class InputError(BtTasksimError, ValueError):
    """Bad input: one clear sentence that says what is wrong, where, and what to do."""


class FieldError(InputError):
    """Bad input in a field; a loader of files adds the file and the line.

    Args:
        message: The sentence.
        where: Keys and indices that lead to the field.
    """

    def __init__(self, message: str, *where: str | int) -> None:
        super().__init__(message)
        self.where = where


class NoDrawError(InputError):
    """A world that cannot be drawn with one seed: others may do, so an evaluation counts it and goes on."""


class NotToldApartError(InputError):
    """Objects that perception cannot tell apart as they are drawn with one seed; an evaluation goes on."""


@contextmanager
def within(*where: str | int) -> Iterator[None]:
    """Errors raised in here are about this field (`FieldError`)."""
    try:
        yield
    except FieldError as error:
        raise FieldError(str(error), *where, *error.where) from error
    except InputError as error:
        raise FieldError(str(error), *where) from error


class NoVolumeError(InputError):
    """Corners whose hull is no body: they lie in one plane, or are not finite."""


class MachineError(BtTasksimError, RuntimeError):
    """The machine failed: a full disk, a lost connection, an engine that stopped."""


class LostEngine(MachineError):  # noqa: N818  # it says what happened
    """An engine in another process is not there any more, or another client has it."""


def is_bad_path(error: OSError) -> bool:
    """Whether there can be nothing at a path, whatever the machine: it is too long, or leads in a circle."""
    return error.errno in (errno.ENAMETOOLONG, errno.ELOOP, errno.ENOTDIR)


class UnreachableError(InputError):
    """A tool pose that the arm cannot bring about.

    Args:
        message: The sentence.
        distance: Metres by which the nearest pose misses.
        angle: Radians by which the nearest pose misses.
    """

    def __init__(self, message: str, distance: float, angle: float) -> None:
        super().__init__(message)
        self.distance = distance
        self.angle = angle


class NoWayError(BtTasksimError):
    """There is no collision-free way."""


class CommandConflictError(InputError):
    """Two leaves of a tree wrote the same part of the command in one tick."""


class LeafError(BtTasksimError, RuntimeError):
    """A leaf raised an exception, which is ``__cause__`` then, or commands nonsense; the message names it."""


class BtTasksimWarning(UserWarning):
    """Something that works and is probably not meant so; the command line says it once, as a sentence."""


class Terminated(KeyboardInterrupt):
    """SIGTERM or SIGHUP, where it is to end things in order as Ctrl-C does."""


def nearest(name: object, known: Iterable[str]) -> str:
    """Says which known names are nearest to an unknown one.

    Args:
        name: The name that was not found; nothing is near to what is no text.
        known: The names that would have been right.

    Returns:
        The end of a sentence, to be put right behind it: ``; did you mean 'a' or 'b'?``, or where nothing
        is near ``; known: a, b, c``, or where nothing is known ``; none is known``.
    """
    names = sorted(set(known))
    if not names:
        return "; none is known"
    folded = {candidate.casefold(): candidate for candidate in names}
    wrong = name[:LONGEST].casefold() if isinstance(name, str) else ""
    close = difflib.get_close_matches(wrong, list(folded), n=3, cutoff=0.6)
    if close:
        return f"; did you mean {' or '.join(repr(folded[match]) for match in close)}?"
    return f"; known: {', '.join(names)}"
