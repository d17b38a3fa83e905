"""Nothing is left of a twin whose parent was killed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from bt_tasksim.hardware.twin.bridge_cleanup import clear_up, note_bridge, parent_has_ended


def test_whose_parent_is_gone() -> None:
    assert not parent_has_ended(os.getppid()) and not parent_has_ended(0)
    assert parent_has_ended(os.getpid())


@pytest.mark.parametrize("runs", ["sleep", "cat"])
def test_the_bridge_is_ended_and_nothing_else_is(tmp_path: Path, runs: str) -> None:
    sleep = shutil.which("sleep")
    assert sleep is not None
    home = tmp_path / "home"
    home.mkdir()
    process = subprocess.Popen([runs, "30"] if runs == "sleep" else [runs], stdin=subprocess.PIPE)
    try:
        note_bridge(home, process.pid, Path(sleep))
        clear_up(home)
        assert not home.exists()
        if runs == "sleep":
            assert process.wait(5.0) < 0
        else:  # another process has got the number of the bridge that was
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.3)
    finally:
        process.kill()
        process.communicate()


def test_a_folder_that_says_nothing(tmp_path: Path) -> None:
    (tmp_path / "bridge").write_text("nonsense")
    clear_up(tmp_path)
    assert not tmp_path.exists()
