"""What evaluation and training on a cluster have in common."""

from __future__ import annotations

from bt_tasksim.core.cluster import check_address
from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.worlds import WORLD_MEMORY

MEMORY = 500_000_000
"""Bytes that are reserved for an actor of a cluster, without its worlds; 350 MB were measured with one."""
MEMORY_WITH_PICTURES = 900_000_000
"""The same where pictures are drawn; 680 MB were measured."""


def check_cluster(address: str, options: EngineOptions) -> None:
    """Check that episodes with these engines can run on a cluster, and that this may be its address.

    Raises:
        InputError: They cannot, or it is none, or Ray is not installed.
    """
    if options.remote:
        raise InputError("an engine in another process serves one client at a time: leave --cluster away")
    check_address(address)


def actor_memory(worlds: int, pictures: bool) -> int:
    """Bytes to reserve for an actor with so many worlds at once, which draws pictures or not."""
    return (MEMORY_WITH_PICTURES if pictures else MEMORY) + worlds * WORLD_MEMORY
