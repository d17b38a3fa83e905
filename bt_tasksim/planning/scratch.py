"""What each thread has of its own of something that is made once for all of them."""

from __future__ import annotations

import threading

import pinocchio as pin


class Scratch(threading.local):
    """Begins anew in each thread, and in a copy."""

    _data: pin.Data | None = None

    def data(self, model: pin.Model) -> pin.Data:
        """What Pinocchio writes into for a model, always the same one."""
        if self._data is None:
            self._data = model.createData()
        return self._data

    def __reduce__(self) -> tuple[type[Scratch], tuple[()]]:
        return type(self), ()
