"""Demonstration logs: read and decomposed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from bt_tasksim.core.resources import asset
from bt_tasksim.demos_decomp.decompose import decompose_log
from bt_tasksim.demos_decomp.readers import open_log
from tests.attacks.mutations import Bait, Rng, damaged_bytes, damaged_hdf5, one_of


def begin(folder: Path, bait: Bait) -> Callable[[Rng], Callable[[], object]]:
    """See `tests.attacks.__main__.KINDS`."""
    sound = [path.read_bytes() for path in sorted(asset("demonstrations").rglob("0[0-3].h5"))]

    def make(rng: Rng) -> Callable[[], object]:
        content = one_of(rng, sound)
        damage = damaged_bytes(content, rng) if rng.random() < 0.3 else damaged_hdf5(content, rng, bait)
        path = folder / "log.h5"
        path.write_bytes(damage)
        return lambda: decompose_log(open_log(path))

    return make
