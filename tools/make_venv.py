#!/usr/bin/env python3
"""Make the project's virtual environment, with pip in it, whatever the machine's Python lacks.

Debian keeps ``ensurepip`` in a package of its own (python3-venv). Where it is missing, uv or virtualenv is
used, and else Debian's own pip is fetched and unpacked into the environment: no root, nothing on the machine
changes. Only the standard library is needed.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from private_apt import Apt, UnavailableError, own_sources, release


def with_pip_from_debian(python: Path) -> None:
    """Install pip into an environment from Debian's package of pip's wheel.

    Raises:
        UnavailableError: the package cannot be had.
    """
    _, codename = release()
    sources = own_sources(Path("/etc/apt"), codename, None) if codename and shutil.which("apt-get") else {}
    if not sources:
        raise UnavailableError("there is no Debian package source to fetch it from")
    with tempfile.TemporaryDirectory() as name:
        apt = Apt(Path(name) / "apt", sources, None)
        apt("update")
        apt("-qq", "download", "python3-pip-whl")
        for deb in apt.debs.glob("*.deb"):
            subprocess.run(["dpkg", "-x", str(deb), name], check=True)
        wheel = next(Path(name).rglob("pip-*.whl"))
        subprocess.run([python, wheel / "pip", "install", "-q", "--no-index", wheel], check=True)


def make(folder: Path) -> None:
    """Make the environment in ``folder``, replacing a broken one.

    Raises:
        UnavailableError, OSError, subprocess.SubprocessError: no way worked.
    """
    python = folder / "bin" / "python"
    ways = [[sys.executable, "-m", "venv", "--clear", str(folder)]]
    if shutil.which("uv"):
        ways.append(["uv", "venv", "-q", "--seed", "--clear", "--python", sys.executable, str(folder)])
    if shutil.which("virtualenv"):
        ways.append(["virtualenv", "-q", "--clear", "--python", sys.executable, str(folder)])
    for way in ways:
        made = subprocess.run(way, capture_output=True).returncode == 0
        if made and subprocess.run([python, "-m", "pip", "--version"], capture_output=True).returncode == 0:
            return
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    with_pip_from_debian(python)


def main(arguments: list[str]) -> int:
    """Make the environment named by the only argument. Returns the exit status."""
    folder = Path(arguments[0])
    try:
        make(folder)
    except (UnavailableError, OSError, subprocess.SubprocessError) as error:
        shutil.rmtree(folder, ignore_errors=True)
        print(
            f"Cannot make a virtual environment: this Python has no pip of its own, and {error}. "
            "On Debian or Ubuntu, 'apt install python3-venv' cures it.",
            file=sys.stderr,
        )
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
