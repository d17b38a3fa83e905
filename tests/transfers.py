"""What goes between host and device, counted without a device: torch on the CPU, its calls watched."""

from __future__ import annotations

import traceback
from collections import Counter
from typing import Any

import numpy as np
import torch
from torch.overrides import TorchFunctionMode

UP = {"asarray", "tensor", "as_tensor", "from_numpy", "scalar_tensor"}
DOWN = {
    "numpy", "cpu", "item", "tolist", "nonzero", "argwhere", "masked_select", "__array__", "__dlpack__",
    "__bool__", "__float__", "__int__", "__index__", "__contains__",
}  # fmt: skip
OURS = "bt_tasksim"


class Transfers(TorchFunctionMode):
    """Counts transfers while it is entered, by the functions of ours in which they are made.

    Attributes:
        up: From the host, by ``file:function``.
        down: To the host.
        silent: Arrays of NumPy, or masks, with which a tensor was picked from: torch would move them itself.
    """

    def __init__(self) -> None:
        super().__init__()
        self.up: Counter[str] = Counter()
        self.down: Counter[str] = Counter()
        self.silent: Counter[str] = Counter()

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = kwargs or {}
        name = getattr(func, "__name__", "")
        if name in UP and not isinstance(args[0], torch.Tensor):
            self.up[where()] += 1
        elif name in DOWN and not (name == "numpy" and self._within_cpu):
            self.down[where()] += 1
        else:
            picks = name in ("__getitem__", "__setitem__") and any(map(moves, flat(args[1])))
            if picks or any(isinstance(x, np.ndarray | np.generic) for x in flat(args)):
                self.silent[where()] += 1
        found = func(*args, **kwargs)
        self._within_cpu = name == "cpu"
        return found

    _within_cpu = False


def flat(found: Any) -> list[Any]:
    """A value, or the values of a tuple or list."""
    if isinstance(found, tuple | list):
        return [x for each in found for x in flat(each)]
    return [found]


def moves(index: Any) -> bool:
    """An index of the host, or one whose result has as many rows as a device alone knows."""
    return isinstance(index, np.ndarray) or (isinstance(index, torch.Tensor) and index.dtype == torch.bool)


def where() -> str:
    """The innermost functions of ours that are running."""
    ours = [f for f in traceback.extract_stack() if f"/{OURS}/" in f.filename][-4:]
    return " > ".join(f"{f.filename.rpartition('/')[2]}:{f.name}" for f in ours)
