"""A twin of real ROS processes for the tests of this folder."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from benchmarks.faults import Bench
from bt_tasksim.errors import MachineError
from bt_tasksim.twin.environment import environment


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    """Bridge and node, in a ROS domain of this process's own."""
    try:
        environment()
    except MachineError as error:
        pytest.skip(str(error))
    made = Bench(domain=1 + os.getpid() % 100)
    yield made
    made.close()
