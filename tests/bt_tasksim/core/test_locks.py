"""A lock is one process's, and a killed process holds none."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.locks import locked

HOLD = """
import sys, time
from bt_tasksim.core.locks import locked
with locked(sys.argv[1], "holding"):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path / "new" / "lock")], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_second_process_is_refused_and_a_killed_one_is_not_waited_for(tmp_path, holder):
    with (
        pytest.raises(InputError, match="another process is holding"),
        locked(tmp_path / "new/lock", "holding"),
    ):
        pass
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert (tmp_path / "new/lock").exists()
    with locked(tmp_path / "new/lock", "holding"):
        pass
    assert os.listdir(tmp_path / "new") == []


def test_nothing_is_left(tmp_path):
    with locked(tmp_path / "a/b/lock", "writing"):
        assert (tmp_path / "a/b/lock").exists()
    assert os.listdir(tmp_path) == []
