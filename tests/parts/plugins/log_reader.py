"""A kind of log from outside: a text file with the hand and one cup, a sample per line.

time, hand x y z qw qx qy qz, opening, cup x y z qw qx qy qz; after a first line ``# hands``.
"""

from pathlib import Path

import numpy as np

from bt_tasksim.core.registry import register
from demos_decomp.log import Demonstration, Log, Surface, Track, checked_log
from demos_decomp.readers import LogReader


@register("log reader", "hands")
class Hands(LogReader):
    title = "hands as text"

    def recognises(self, path: Path) -> bool:
        with path.open("rb") as file:
            return file.readline().strip() == b"# hands"

    def read(self, path: Path) -> Log:
        rows = np.loadtxt(path, ndmin=2)
        cup = Track(rows[:, 9:16], "cylinder", np.array([0.07, 0.07, 0.1]))
        table = Surface(np.array([0.5, 0, 0, 1, 0, 0, 0]), np.array([1.0, 1.0]), "table")
        shown = Demonstration("1", rows[:, 0], rows[:, 1:8], rows[:, 8], {"cup": cup}, {"table": table})
        return checked_log(Log("human", (shown,), path=str(path)), f"'{path}'")
