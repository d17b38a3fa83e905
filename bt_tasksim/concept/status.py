"""Statuses of behaviours as numbers, as a batch has them, and as py_trees has them."""

from __future__ import annotations

from py_trees.common import Status

STATUSES = (Status.INVALID, Status.RUNNING, Status.SUCCESS, Status.FAILURE)
"""py_trees' statuses, by the numbers of `bt_tasksim.core.batch_leaf`."""
