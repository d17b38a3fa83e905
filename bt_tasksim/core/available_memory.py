"""How much memory this machine can give."""

from __future__ import annotations

import os
from pathlib import Path


def available_memory() -> int:
    """Bytes that programs can still have without the machine swapping, as far as the system tells."""
    try:
        lines = Path("/proc/meminfo").read_text("ascii").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable:"))
    except (OSError, StopIteration):  # elsewhere than on Linux
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2
