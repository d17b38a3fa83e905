"""A kind of log from outside of the package, in one file: `plugins/log_reader.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bt_tasksim.cli.main import main
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.demos_decomp import decompose_log, open_log


@pytest.fixture
def hands(tmp_path):
    """The hand and the cup of a shipped demonstration, as text."""
    shown = open_log(asset("demonstrations", "pick_and_place", "00.h5")).demonstrations[0]
    (cup,) = shown.objects.values()
    rows = np.column_stack([shown.time, shown.hand_pose, shown.hand_opening, cup.pose])
    file = tmp_path / "shown.txt"
    np.savetxt(file, rows, header="hands")
    return file


def test_a_log_of_a_kind_from_outside_is_opened_by_its_content_and_decomposed(plugin, hands):
    with pytest.raises(InputError):
        open_log(hands)
    plugin("log_reader")
    found = decompose_log(open_log(hands))
    assert [task.concept for task in found.tasks] == ["grasp", "pick", "bring", "place", "release"]


def test_the_message_about_an_unknown_kind_names_the_known_ones(plugin, tmp_path):
    plugin("log_reader")
    (tmp_path / "a.log").write_text("something else")
    with pytest.raises(InputError, match="hands as text"):
        open_log(tmp_path / "a.log")


def test_the_command_line_takes_it(plugin, hands, capsys):
    assert main(["decompose", str(hands)]) == 2
    file = Path(__file__).parent / "plugins" / "log_reader.py"
    assert main(["decompose", str(hands), "--plugin", str(file)]) == 0
    assert "release" in capsys.readouterr().out
