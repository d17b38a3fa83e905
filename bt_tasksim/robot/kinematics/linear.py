"""Small linear systems, many at once, by operations that act on each row by itself."""

from __future__ import annotations

from bt_tasksim.core.poses import Array, array_namespace


def total(terms: Array) -> Array:
    """Sum ``(...)`` of terms ``(k, ...)`` in their order; none have another order, whatever their number."""
    out = terms[0, ...]
    for i in range(1, terms.shape[0]):
        out = out + terms[i, ...]
    return out


def solve_symmetric(matrix: Array, right: Array) -> Array:
    """Solutions ``(m, N)`` of ``matrix (m, m, N) x = right (m, N)``, symmetric and positive definite.

    Cholesky's factors without square roots (L D L^T), which need no exchange of rows; elimination goes both
    ways at once (Gauss and Jordan), as that is fewer operations.
    """
    xp = array_namespace(matrix, right)
    m = matrix.shape[0]
    whole = xp.concat([matrix, right[:, None, ...]], axis=1)
    for j in range(m):
        row = whole[j, j + 1 :, ...] / whole[j, j, ...]
        whole[:, j + 1 :, ...] -= whole[:, j, None, ...] * row
        whole[j, j + 1 :, ...] = row
    return whole[:, m, ...]
