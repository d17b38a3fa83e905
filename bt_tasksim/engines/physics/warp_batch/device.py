"""The device on which Warp works: found, and started without a word."""

from __future__ import annotations

import ctypes
import importlib
import logging
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import ModuleType

import warp as wp

from bt_tasksim.core.errors import MachineError

LOG = logging.getLogger("bt_tasksim.engines")


def start(name: str) -> wp.Device:
    """The device of that name; Warp starts with the first one.

    Args:
        name: ``cpu``, ``cuda`` or ``cuda:N``.

    Raises:
        MachineError: There is no such GPU.
    """
    wp.config.log_level = max(wp.config.log_level, wp.LOG_ERROR)  # Warp's one setting for the process
    _choose_cache()
    with nullcontext() if _has_driver() else _silent():
        wp.init()
    gpus = wp.get_cuda_device_count()
    if name != "cpu":
        number = int(name.partition(":")[2] or 0)
        if number >= gpus:
            found = (
                "no GPU that Warp can use" if gpus == 0 else f"{gpus} GPU{'s' * (gpus > 1)}, numbered from 0"
            )
            raise MachineError(f"the device '{name}' is not there: this machine has {found}")
        name = f"cuda:{number}"
    return wp.get_device(name)


def _has_driver() -> bool:
    """A driver of GPUs is installed; without one, Warp complains on the C library's standard error."""
    if not sys.platform.startswith("linux"):
        return True
    for name in ("libcuda.so", "libcuda.so.1"):
        try:
            ctypes.CDLL(name)
        except OSError:
            continue
        return True
    return False


@contextmanager
def _silent() -> Iterator[None]:
    """Nothing is said on standard error, by code that is not Python's either."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def mujoco_warp_library() -> ModuleType:
    """The library, which wants Warp to be started first."""
    return importlib.import_module("mujoco_warp")


def _choose_cache() -> None:
    """Keep compiled kernels where Warp keeps them, or for this process alone where nothing can be written.

    Never in a folder of a name that others could guess and fill: what lies there is run.
    """
    if (
        wp.config.kernel_cache_dir
        or os.environ.get("WARP_CACHE_PATH")
        or not sys.platform.startswith("linux")
    ):
        return
    usual = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "warp"
    try:
        usual.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=usual):
            pass
    except (OSError, RuntimeError) as error:
        folder = tempfile.mkdtemp(prefix="bt-tasksim-warp-")
        LOG.warning(
            "compiled kernels cannot be kept in Warp's cache (%s): they are compiled anew, in '%s'; "
            "set WARP_CACHE_PATH to a folder of yours",
            error,
            folder,
        )
        wp.config.kernel_cache_dir = folder
