"""A command from outside of the package, in one file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from bt_tasksim.cli.main import main
from bt_tasksim.core import registry

PLUGIN = Path(__file__).parent / "plugins" / "command.py"


def start(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "bt_tasksim.cli", *words], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("before", [True, False])
def test_it_runs_with_the_plugin_before_or_after_its_name(before):
    named, words = ["--plugin", str(PLUGIN)], ["count-leaves", "pick_and_place"]
    done = start(*named, *words) if before else start(*words, *named)
    assert done.returncode == 0 and done.stdout == "5 leaves\n", done.stderr


def test_its_options_groups_and_exit_code_are_those_of_any_command():
    done = start("count-leaves", "pick_and_place", f"--plugin={PLUGIN}", "--least", "99")
    assert done.returncode == 1
    done = start("count-leaves", "pick_and_plac", f"--plugin={PLUGIN}")
    assert done.returncode == 2 and "did you mean 'pick_and_place'" in done.stderr


def test_help_knows_it_and_the_right_name_is_suggested():
    assert "Count the leaves of a tree." in start("--plugin", str(PLUGIN), "--help").stdout
    assert "--least" in start("count-leaves", "--help", "--plugin", str(PLUGIN)).stdout
    assert "did you mean 'count-leaves'" in start("--plugin", str(PLUGIN), "count-leafs").stderr


def test_without_the_plugin_there_is_no_such_command():
    done = start("count-leaves", "pick_and_place")
    assert done.returncode == 2 and "count-leaves" in done.stderr


def test_in_python_it_is_a_function(plugin, capsys):
    from bt_tasksim.cli.options.tree import TreeOptions

    count_leaves = plugin("command").count_leaves
    assert count_leaves(TreeOptions("pick_and_place")) == 0
    assert registry.part("command", "count-leaves") is count_leaves
    assert main(["count-leaves", "pick_and_place"]) == 0
    assert capsys.readouterr().out == "5 leaves\n" * 2
