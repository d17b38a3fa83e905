"""Reader of the project's own logs (`bt_tasksim.demos_decomp.log_file`)."""

from __future__ import annotations

from pathlib import Path

from bt_tasksim.core import hdf5
from bt_tasksim.core.registry import register
from bt_tasksim.demos_decomp.log import Log
from bt_tasksim.demos_decomp.log_file import read_log
from bt_tasksim.demos_decomp.readers.base import LogReader


@register("log reader", "own")
class OwnLog(LogReader):
    """HDF5 in the format of docs/demonstrations.md; every logged run is one."""

    title = "bt-tasksim log"

    def recognises(self, path: Path) -> bool:
        """It says so, or holds demonstrations."""
        if not hdf5.is_hdf5(path):
            return False
        file = hdf5.read(path, wanted=())
        return "format" in file.attributes or "demonstrations" in file.names()

    def read(self, path: Path) -> Log:
        """See `read_log`."""
        return read_log(path)
