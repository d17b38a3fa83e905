"""Statuses of behaviours as small numbers, for arrays with one status a world."""

from __future__ import annotations

from py_trees.common import Status

INVALID, RUNNING, SUCCESS, FAILURE = range(4)
STATUSES = (Status.INVALID, Status.RUNNING, Status.SUCCESS, Status.FAILURE)
"""py_trees' own, by number."""
CODES = {status: code for code, status in enumerate(STATUSES)}
