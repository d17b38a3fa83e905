"""``bt-tasksim convert``: imports change in place, or nothing does."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_tasksim.cli.main import main

OLD = "from bt_tasksim.world import Command  # mine\n"


def test_a_file_is_converted_in_place_and_a_second_time_nothing_is_left(tmp_path: Path, capsys):
    file = tmp_path / "mine.py"
    file.write_text(OLD)
    assert main(["convert", str(file)]) == 0
    assert file.read_text() == "from bt_tasksim import Command  # mine\n"
    assert f"{file}, line 1" in capsys.readouterr().out
    assert main(["convert", str(file)]) == 0 and "nothing" in capsys.readouterr().out


def test_a_check_changes_nothing(tmp_path: Path, capsys):
    file = tmp_path / "mine.py"
    file.write_text(OLD)
    assert main(["convert", "--check", str(file)]) == 1
    assert file.read_text() == OLD and "line 1" in capsys.readouterr().out
    file.write_text("from bt_tasksim import Command\n")
    assert main(["convert", "--check", str(file)]) == 0


@pytest.mark.parametrize("bad", [None, b"def (", b"\xff\xfe", b"x = 1\n" * 400_000])
def test_one_file_that_is_no_good_and_none_is_changed(tmp_path: Path, capsys, bad: bytes | None):
    good, other = tmp_path / "good.py", tmp_path / "other.py"
    good.write_text(OLD)
    if bad is not None:
        other.write_bytes(bad)
    assert main(["convert", str(good), str(other)]) == 2
    assert good.read_text() == OLD and len(capsys.readouterr().err.splitlines()) == 1
