"""What the twin's node does when whoever started it is gone without a word: it ends the bridge, too."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import time
from pathlib import Path

PATIENCE = 3.0
"""Seconds within which the bridge should end."""
_FILE = "bridge"


def parent_has_ended(parent: int) -> bool:
    """The process that started this one has ended; never where its number is not known (0)."""
    return parent > 0 and os.getppid() != parent


def note_bridge(home: Path, pid: int, binary: Path) -> None:
    """Remember the bridge in the twin's folder: its process and what that runs."""
    (home / _FILE).write_text(f"{pid}\n{binary.resolve()}\n")


def clear_up(home: Path) -> None:
    """End the bridge that is remembered, where it is that still, and remove the twin's folder."""
    with contextlib.suppress(OSError, ValueError):
        number, binary = (home / _FILE).read_text().splitlines()
        if os.readlink(f"/proc/{number}/exe") == binary:  # else another process has got its number
            os.kill(int(number), signal.SIGTERM)
            end = time.monotonic() + PATIENCE
            while os.readlink(f"/proc/{number}/exe") == binary and time.monotonic() < end:
                time.sleep(0.05)  # it writes a log in there until it ends
    shutil.rmtree(home, ignore_errors=True)
