"""The project's own software Vulkan driver, for machines on which SAPIEN finds no render device.

``tools/fetch_vulkan_driver.py`` puts Mesa's lavapipe and the libraries it needs into a folder; this module
makes a running Python process use that folder. It imports nothing but the standard library, and SAPIEN where
it is asked for the device.
"""

from __future__ import annotations

import ctypes
import os
import warnings
from pathlib import Path

FOLDER_VARIABLE = "BT_TASKSIM_VULKAN"
DRIVER_FILE = "lvp_icd.json"
LIBRARY_LIST = "libraries.txt"

_loaded: dict[Path, list[ctypes.CDLL]] = {}


def driver_folder() -> Path | None:
    """Return the folder of a fetched driver, or None where there is none.

    Looked for in this order: the environment variable ``BT_TASKSIM_VULKAN`` (set but empty: use none), the
    project's ``.vulkan``, and ``~/.cache/bt-tasksim/vulkan``.
    """
    named = os.environ.get(FOLDER_VARIABLE)
    if named is not None:
        candidates = [Path(named)] if named else []
    else:
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
        candidates = [Path(__file__).resolve().parents[2] / ".vulkan", cache / "bt-tasksim" / "vulkan"]
    return next((folder for folder in candidates if (folder / LIBRARY_LIST).is_file()), None)


def use_software_driver() -> bool:
    """Make this process use the fetched driver. Call it before the first ``import sapien``.

    Does nothing where no driver was fetched. A driver that the caller chose with ``VK_DRIVER_FILES`` or
    ``VK_ICD_FILENAMES`` is left alone. May be called any number of times.

    Returns:
        True if the fetched driver is the one that SAPIEN will use.
    """
    folder = driver_folder()
    if folder is None:
        return False
    _load_libraries(folder)
    # SAPIEN then takes the loader in its own wheel, which serves as well; the warning would only alarm.
    warnings.filterwarnings("ignore", message="Failed to find system libvulkan")
    driver = str(folder / DRIVER_FILE)
    if not (os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")):
        os.environ["VK_DRIVER_FILES"] = driver
    return os.environ.get("VK_DRIVER_FILES") == driver


def render_device() -> str:
    """Name the device that everything in this process draws with, for `sapien.Device`.

    SAPIEN draws with one device a process, and takes a processor by its name for another one than the same
    processor found by itself: whoever draws beside somebody else has to name it alike.

    Returns:
        "cuda", or "cpu" where no such device can draw. ManiSkill takes both as a render backend.

    Raises:
        ImportError: There is no SAPIEN.
    """
    import sapien

    try:
        return "cuda" if sapien.Device("cuda").can_render() else "cpu"
    except RuntimeError:
        return "cpu"


def _load_libraries(folder: Path) -> None:
    """Load the folder's libraries, each after the ones it needs, unless the process has them already.

    The dynamic loader reads LD_LIBRARY_PATH only when a process starts, but finds by its name whatever
    was loaded before, so the driver's dependencies are met without touching the environment.
    """
    if folder in _loaded:
        return
    _loaded[folder] = []
    for name in (folder / LIBRARY_LIST).read_text(encoding="utf-8").split():
        try:
            ctypes.CDLL(name, mode=os.RTLD_NOLOAD)
        except OSError:
            _loaded[folder].append(ctypes.CDLL(str(folder / "lib" / name), mode=os.RTLD_LOCAL))
