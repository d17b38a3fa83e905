"""Every command that README and docs name runs in the files beside this one, or is at least parsed."""

import argparse
import re
import runpy
import shlex
import subprocess
import sys

import pytest

from bt_tasksim.cli.app import NAME, application
from bt_tasksim.cli.options.plugins import taken
from tests.doc_commands.lines import (
    COMMANDS,
    ELSEWHERE,
    HERE,
    OWN,
    PARSED,
    ROOT,
    RUN,
    TARGETS,
    UNKNOWN,
    only_parsed,
)

TO_PARSE = [line for line in COMMANDS if line not in (*RUN, *UNKNOWN) and not line.startswith("make")]


@pytest.mark.parametrize("line", [line for line in COMMANDS if line.startswith("make")])
def test_its_targets_are_there(line):
    words = shlex.split(line)
    assert set(words[1:]) <= TARGETS, "unknown to this test"
    done = subprocess.run(["make", "-n", *words[1:]], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("line", TO_PARSE)
def test_it_is_parsed(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROOT)
    parse(line, monkeypatch)


def test_every_command_is_known_and_no_table_has_a_row_too_many():
    assert not UNKNOWN, "say in lines.py how they are made quick, or why they are only parsed"
    found = COMMANDS
    assert {"make demo", "make test", "bt-tasksim run shelf.py --seed 7 --video"} <= set(found)
    assert all(any(re.search(pattern, line) for line in found) for pattern in PARSED)
    assert sorted(RUN) == sorted([*OWN, *HERE, *ELSEWHERE]) and len(RUN) > 70
    assert not any(only_parsed(line) for line in RUN)


def parse(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parse a command and do nothing else."""
    words = shlex.split(line)
    if words[0] == "bt-tasksim":
        group, (_, words) = application(), taken(words[1:])
        if words == ["--help"] or len(words) == 1 or words[0].isupper():
            return
        context = group.make_context(NAME, list(words))
        if "--plugin" in line and words[0] not in group.list_commands(context):
            return  # the plugin's own command
        name, command, rest = group.resolve_command(context, words)
        command.make_context(name, rest, parent=context)
        return

    if words[2].startswith("tools."):
        assert (ROOT / words[2].replace(".", "/")).with_suffix(".py").is_file()
        return
    if len(words) == 3:  # a bare name, in running text
        words.append("--help")

    class Parsed(Exception):
        pass

    whole = argparse.ArgumentParser.parse_args

    def only(self, *arguments, **options):
        raise Parsed(whole(self, *arguments, **options))

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", only)
    monkeypatch.setattr(sys, "argv", words[2:])
    with pytest.raises((Parsed, SystemExit) if "--help" in words else Parsed):
        runpy.run_module(words[2], run_name="__main__")
