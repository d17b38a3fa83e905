#!/usr/bin/env python3
"""Write down every package of the twin's environment with its version and hash: tools/twin_packages.lock.txt.

Run it with the Python and on the kind of machine that the lock is for; pip says what it would install, and
nothing is installed.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
LOCK = HERE / "twin_packages.lock.txt"
HEAD = """\
# Every package of the twin's environment with its version and hash, for Python 3.11 on Linux x86_64.
# Made from twin_packages.txt and constraints.txt by `python tools/lock_twin.py`.
"""


def main() -> int:
    """Write the lock. Returns the exit status."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        pip = [sys.executable, "-m", "pip", "install", "-q", "--dry-run", "--ignore-installed"]
        files = ["-c", str(HERE.parent / "constraints.txt"), "-r", str(HERE / "twin_packages.txt")]
        subprocess.run([*pip, *files, "--report", str(report)], check=True)
        packages = json.loads(report.read_text(encoding="utf-8"))["install"]
    LOCK.write_text(HEAD + "".join(sorted(line(package) for package in packages)), encoding="utf-8")
    return 0


def line(package: dict[str, dict[str, object]]) -> str:
    """One package of pip's report as a requirement with its hash."""
    metadata, archive = package["metadata"], package["download_info"]["archive_info"]
    assert isinstance(archive, dict)
    name = str(metadata["name"]).lower().replace("_", "-")
    return f"{name}=={metadata['version']} --hash=sha256:{archive['hashes']['sha256']}\n"


if __name__ == "__main__":
    sys.exit(main())
