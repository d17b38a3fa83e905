"""Standard streams that are closed, full or broken."""

from __future__ import annotations

import contextlib
import os
import sys


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
