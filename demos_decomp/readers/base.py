"""What a kind of log is, as a part: how it is recognised and read."""

from __future__ import annotations

import abc
from pathlib import Path
from typing import ClassVar

from bt_tasksim.demos_decomp.log import Log


class LogReader(abc.ABC):
    """A kind of log; a subclass announces itself with ``@register("log reader", NAME)``."""

    title: ClassVar[str] = ""
    """What people call this kind of log, for messages; by default the name it is announced under."""

    @abc.abstractmethod
    def recognises(self, path: Path) -> bool:
        """Whether a file that is there is of this kind, by its content; False, not an error, if it is not."""

    @abc.abstractmethod
    def read(self, path: Path) -> Log:
        """Read a file of this kind.

        Raises:
            InputError: Its content is faulty.
        """
