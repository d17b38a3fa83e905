"""Arrays on the device as rows of four-byte words: what can be copied without knowing what it is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import warp as wp

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.warp_batch import kernels


def words(array: wp.array) -> wp.array:
    """An array as ``(n, m)`` words, of the same memory; the first axis stays."""
    n = array.shape[0]
    size = wp.types.type_size_in_bytes(array.dtype) * array.size
    view = wp.array(
        ptr=array.ptr, dtype=wp.int32, shape=(n, size // 4 // max(n, 1)), device=array.device, copy=False
    )
    view.kept = array  # whose memory it is
    return view


def host_words(values: Array, dtype: type) -> Array:
    """Numbers ``(n, ...)`` of the host as words ``(n, m)`` of the device.

    Args:
        values: Whole numbers or floats.
        dtype: ``np.float32`` or ``np.int32``.
    """
    return np.ascontiguousarray(np.asarray(values, dtype).reshape(len(values), -1)).view(np.int32)


def write(target: wp.array, rows: Array, values: Array) -> None:
    """Write words ``(k, m)`` of the host into rows ``(k,)``."""
    if values.size == 0:
        return
    source = wp.array(np.ascontiguousarray(values), dtype=wp.int32, device=target.device)
    copy(source, np.arange(len(rows)), target, rows)


def copy(source: wp.array, source_rows: Array, target: wp.array, target_rows: Array) -> None:
    """Copy rows of words from one array on the device to another."""
    if source.shape[1] == 0 or not len(source_rows):
        return
    rows = (
        wp.array(np.asarray(r, np.int32), dtype=wp.int32, device=target.device)
        for r in (source_rows, target_rows)
    )
    mine, its = rows
    wp.launch(
        kernels.copy_rows,
        (len(source_rows), source.shape[1]),
        [source, mine, target, its],
        device=target.device,
    )


class RowFields:
    """Arrays of one number of rows, by name, that are written and copied together.

    Args:
        arrays: On the device, each with the same first axis.
    """

    def __init__(self, arrays: Mapping[str, wp.array]) -> None:
        self.words = {name: words(array) for name, array in arrays.items()}

    def copy_to(self, rows: Array, other: RowFields, other_rows: Array) -> None:
        """Copy rows of all of them to those of the same name."""
        for name, mine in self.words.items():
            copy(mine, rows, other.words[name], other_rows)
