"""The twin's own virtual environment: where it is, and what its processes need around them."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

from bt_tasksim.core import child
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.resources import HOME

FOLDER = ".twin"
MAKER = Path("tools") / "make_twin.py"


def root() -> Path:
    """The folder that holds the package, and in a checkout the tools."""
    return HOME.parent


def environment(build: bool = False) -> Path:
    """The virtual environment.

    Args:
        build: Make it where it is missing; takes some minutes.

    Raises:
        MachineError: It is missing, or cannot be made.
    """
    folder = root() / FOLDER
    if (folder / "made").is_file():
        return folder
    if not build:
        raise MachineError(
            f"the twin's environment '{folder}' is missing: make it with 'make twin-environment'"
        )
    maker = root() / MAKER
    if not maker.is_file():
        raise MachineError(
            f"the twin's environment is made by '{MAKER}' of a checkout, which is not at '{maker}'"
        )
    made = subprocess.run([sys.executable, str(maker), str(folder)])
    if made.returncode:
        raise MachineError("the twin's environment could not be made; the reason stands above")
    return folder


def site_packages(folder: Path) -> Path:
    """Where an environment's packages are."""
    return next((folder / "lib").glob("python3*")) / "site-packages"


def ros_variables(domain: int) -> dict[str, str]:
    """Variables of a process that speaks ROS with processes of this machine alone.

    Messages go by UDP. Fast DDS's shared memory has locks that a killed process may leave behind, so that the
    next one hears nothing, and files that it does leave behind.

    Args:
        domain: Number of the ROS domain, 0 to 101; processes of different domains do not hear each other.
    """
    keep = ("PATH", "HOME", "LANG", "TMPDIR")
    kept = {name: os.environ[name] for name in keep if name in os.environ}
    return {
        **kept,
        **child.VARIABLES,
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(domain),
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
        "PYTHONPATH": str(root()),
        "PYTHONUNBUFFERED": "1",
        "OMP_NUM_THREADS": "1",
    }


def bridge_variables(folder: Path, domain: int, home: Path) -> dict[str, str]:
    """Variables of the bridge's binary.

    It looks for a middleware by a name that the wheels do not give it, and for Python's own library, which an
    executable Python may have built in and not handed on.

    Args:
        folder: The twin's environment.
        domain: Number of the ROS domain.
        home: A folder for its log.

    Raises:
        MachineError: Python's library is not to be found.
    """
    libraries = sorted(str(p) for p in site_packages(folder).glob("ros_*.libs"))
    return {
        **ros_variables(domain),
        "HOME": str(home),
        "AMENT_PREFIX_PATH": str(folder),
        "LD_LIBRARY_PATH": os.pathsep.join([str(folder / "bridge"), str(folder / "lib"), *libraries]),
        "LD_PRELOAD": str(python_library(folder)),
    }


def bridge_binary(folder: Path) -> Path:
    """The bridge's binary."""
    return site_packages(folder) / "rosbridge_server_rs" / "rosbridge_server_rs_jazzy"


def python_library(folder: Path) -> Path:
    """The shared library of this version of Python.

    Args:
        folder: The twin's environment, whose own copy comes first.

    Raises:
        MachineError: There is none.
    """
    name = f"libpython{sys.version_info.major}.{sys.version_info.minor}.so.1.0"
    places = [folder / "libpython", Path(str(sysconfig.get_config_var("LIBDIR")))]
    places += [Path(sys.base_prefix) / "lib", Path("/usr/lib")]
    places += sorted(Path("/usr/lib").glob("*-linux-gnu"))
    for place in places:
        if (place / name).is_file():
            return place / name
    raise MachineError(
        f"the bridge needs '{name}', which is not there; on Debian or Ubuntu "
        f"'apt install libpython{sys.version_info.major}.{sys.version_info.minor}' brings it"
    )
