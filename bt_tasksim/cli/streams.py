"""Standard streams: closed, full or broken ones, and what terminals would obey or cannot show."""

from __future__ import annotations

import contextlib
import io
import os
import sys

from bt_tasksim.core.plain import printable

LONGEST = 2000
"""Characters of a complaint; what files hold may be longer."""
_END = 400


def open_missing() -> None:
    """Have closed streams (``>&-``) lead nowhere, so that no file opened later takes their place."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free
            setattr(sys, name, open(number, mode, closefd=False, encoding="utf-8"))  # noqa: SIM115


def flush_or_discard() -> None:
    """Write out what was printed; drop what cannot be, so that Python does not try it again when it ends."""
    try:
        sys.stdout.flush()
    except OSError:
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def spell_out() -> None:
    """Have characters that a stream's encoding lacks, such as branches of trees in ASCII, spelled out."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def say(*texts: object, flush: bool = False) -> None:
    """Print lines, each text one or several.

    What else a terminal would obey is spelled out: names in files may hold anything.

    Args:
        texts: What to print.
        flush: At once.
    """
    for text in texts:
        print(*map(printable, str(text).split("\n")), sep="\n", flush=flush)


def complain(sentence: str) -> None:
    """Print a sentence on standard error, as `say` does, and not without end; other lines of it indented."""
    if len(sentence) > LONGEST:
        sentence = f"{sentence[: LONGEST - _END - 5]} ... {sentence[-_END:]}"
    with contextlib.suppress(OSError):  # nobody can be told that nobody can be told
        print("\n    ".join(printable(line) for line in sentence.splitlines() or [""]), file=sys.stderr)
