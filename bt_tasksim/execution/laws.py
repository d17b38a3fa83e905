"""Where a batch of worlds computes its laws: concepts, observations, joints.

NumPy by default, on the host. Where physics runs on a GPU, thousands of worlds are computed there, too, in
torch: in double precision, as on the host. It is imported when it is asked for.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from bt_tasksim.core.errors import BtTasksimWarning, MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.pipelines import EngineOptions


def laws_of(options: EngineOptions) -> Array:
    """An empty array of the library, type and device that a batch with these engines computes with.

    Raises:
        MachineError: torch was asked for and is not installed, or has no such device.

    Warns:
        BtTasksimWarning: Physics is on a GPU, and torch cannot be: all else is computed by NumPy.
    """
    device = options.device
    if options.laws == "torch":
        return _in_torch(device)
    if options.laws == "auto" and device.startswith("cuda"):
        try:
            return _in_torch(device)
        except MachineError as error:
            warnings.warn(f"concepts and joints are computed on the host: {error}", BtTasksimWarning, 2)
    return np.empty(0)


def _in_torch(device: str) -> Any:
    try:
        import torch
    except ImportError as error:
        raise MachineError(
            f"torch is not installed ({error}); install the extra 'train': pip install 'bt-tasksim[train]'"
        ) from error
    try:
        return torch.empty(0, dtype=torch.float64, device=device)
    except (RuntimeError, AssertionError) as error:  # which is what torch raises where it was built without
        said = str(error).partition("\n")[0]
        raise MachineError(f"torch cannot compute on '{device}': {said}") from error
