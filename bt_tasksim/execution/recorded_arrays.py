"""The arrays of a run's log, one row a tick, and where those of its repetition differ from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bt_tasksim.core.errors import InputError
from bt_tasksim.demos_decomp.log import Demonstration

TITLES = {
    "time": ("times", "s"),
    "state/joint_position": ("joint positions", "rad or m"),
    "state/joint_velocity": ("joint velocities", "rad/s or m/s"),
    "state/objects": ("object poses", "m"),
    "state/velocities": ("object velocities", "m/s or rad/s"),
    "observations/objects": ("estimated object poses", "m"),
    "observations/wrench": ("the wrist's wrench", "N or Nm"),
    "observations/contact_force": ("contact forces", "N"),
    "commands/tool": ("the tool's command", "m"),
    "commands/hand": ("the hand's command", ""),
    "tree/status": ("statuses", ""),
}
"""Arrays that every log has, and that have a title and a unit in sentences."""
GROUPS = ("commands/", "observations/", "state/", "tree/")
"""Groups of a log in which everything has one row a tick."""
ROUNDED = 1e-12
"""Up to where numbers are the same in poses that a log brings to unit quaternions, and in what it says."""
NAMED = 5
"""Arrays without a title that are named; of more it is said how many."""

Arrays = Mapping[str, NDArray[Any]]


def arrays_of(demonstration: Demonstration, where: str) -> dict[str, NDArray[Any]]:
    """All numbers of a run's log that have one row a tick, by path.

    Raises:
        InputError: An array of `GROUPS` does not hold numbers, one row for each tick.
    """
    found: dict[str, NDArray[Any]] = {"time": demonstration.time}
    for name, values in demonstration.extra.items():
        if not name.startswith(GROUPS):
            continue
        if values.dtype.kind not in "biuf" or values.ndim < 1 or len(values) != len(demonstration.time):
            raise InputError(f"{where}: {name} should hold numbers, one row for each tick")
        found[name] = values
    found |= {f"objects/{name}/pose": as_read(track.pose) for name, track in demonstration.objects.items()}
    return found | {"hand/pose": as_read(demonstration.hand_pose), "hand/opening": demonstration.hand_opening}


def as_read(pose: NDArray[Any]) -> NDArray[Any]:
    """Poses ``(..., 7)`` with unit quaternions, as a log that was read has them."""
    lengths = np.linalg.norm(pose[..., 3:], axis=-1, keepdims=True)
    return np.concatenate([pose[..., :3], pose[..., 3:] / lengths], axis=-1)


def gaps(recorded: Arrays, repeated: Arrays, count: int) -> dict[str, NDArray[np.float64]]:
    """Largest difference ``(count,)`` in each of the first ticks, by array, where there is one.

    What only the repetition has is no difference, as an older log may lack it, but for those of `TITLES`.
    """
    found = {}
    for name in {**recorded, **repeated}:
        if name in recorded and name in repeated:
            gap = _gap(recorded[name], repeated[name], count)
            if name.endswith("/pose"):
                gap[gap <= ROUNDED] = 0.0
        elif name in recorded or name in TITLES:
            gap = np.full(count, np.inf)
        else:
            continue
        if (gap > 0).any():
            found[name] = gap
    return found


def sizes(differences: Mapping[str, float]) -> str:
    """In words, how large differences are, those with a title first."""
    titled = [name for name in TITLES if name in differences]
    others = [name for name in differences if name not in TITLES]
    said = [_size(name, differences[name]) for name in titled + others[:NAMED]]
    if len(others) > NAMED:
        said.append(f"and {len(others) - NAMED} more")
    return ", ".join(said)


def _gap(a: NDArray[Any], b: NDArray[Any], count: int) -> NDArray[np.float64]:
    """Largest difference ``(count,)`` in each tick; infinite where only one is a number."""
    if a.shape[1:] != b.shape[1:]:
        return np.full(count, np.inf)
    rows_a = a[:count].reshape(count, -1).astype(np.float64)
    rows_b = b[:count].reshape(count, -1).astype(np.float64)
    missing = np.isnan(rows_a) != np.isnan(rows_b)
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.where(rows_a == rows_b, 0.0, np.abs(rows_a - rows_b))
    gap: NDArray[np.float64] = np.where(missing, np.inf, np.nan_to_num(apart))
    return np.asarray(gap.max(axis=1, initial=0.0))


def _size(name: str, size: float) -> str:
    title, unit = TITLES.get(name, (name, ""))
    if name == "tree/status":
        return title
    return f"{title} {size:.2g} {unit}".strip() if np.isfinite(size) else f"{title} (one has none)"
