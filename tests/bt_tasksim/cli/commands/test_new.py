"""``bt-tasksim new concept``: what it writes runs as it is; bad names and places write nothing."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from bt_tasksim.checking import new_concept
from bt_tasksim.checking.declaration import UNITS
from bt_tasksim.cli.main import main
from bt_tasksim.core import files
from bt_tasksim.core.errors import InputError, MachineError

FILES = ["nudge.py", "test_nudge.py", "train_nudge.py"]


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def here():
    return sorted(os.listdir())


def test_it_says_what_it_wrote_and_what_to_do_next(capsys):
    assert main(["new", "concept", "nudge"]) == 0
    assert here() == FILES
    out = capsys.readouterr().out
    assert out.startswith("wrote nudge.py, train_nudge.py, test_nudge.py\nnext: bt-tasksim check nudge.py; ")
    for name in FILES:
        assert not re.search("@(name|Class|words)@", Path(name).read_text()), name


@pytest.mark.parametrize("like", [None, *new_concept.examples()])
def test_its_own_tests_pass_and_its_style_is_clean(like):
    new_concept.write_concept("wipe_table", like=like)
    text = Path("wipe_table.py").read_text()
    assert "class WipeTable(ConceptModel):" in text and "WipeTableMemory" in text
    rules = ["--select", "E,F,W,I,D,UP,B", "--ignore", "D103,D105,D401,D107,D203,D213,D407,D413"]
    ruff = [
        sys.executable,
        "-m",
        "ruff",
        "check",
        "--isolated",
        "--ignore",
        "D401",
        "--line-length",
        "110",
        *rules,
        ".",
    ]
    done = subprocess.run(ruff, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    own = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "."]
    done = subprocess.run(own, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "3 passed" in done.stdout


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Push", "lower-case words"),
        ("push-cup", "lower-case words"),
        ("2push", "lower-case words"),
        ("../push", "lower-case words"),
        ("", "lower-case words"),
        ("class", "lower-case words"),
        ("test_push", "lower-case words"),
        ("grasp", "there is a concept Grasp already"),
        ("json", "a Python module 'json' is installed already"),
    ],
)
def test_bad_names(name, words, capsys):
    assert main(["new", "concept", name]) == 2
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1 and here() == []


def test_a_missing_folder_is_made(capsys):
    assert main(["new", "concept", "nudge", "--out", "some/where"]) == 0
    assert sorted(os.listdir("some/where")) == FILES
    assert main(["new", "concept", "lambda", "--out", "other/where"]) == 2
    Path("file").touch()
    for out in ("file", "file/in"):
        assert main(["new", "concept", "nudge", "--out", out]) == 2
        assert "'file' is a file" in capsys.readouterr().err
    assert here() == ["file", "some"]


def test_files_that_are_there():
    Path("test_nudge.py").touch()
    with pytest.raises(InputError, match=r"'test_nudge\.py' is there already"):
        new_concept.write_concept("nudge")
    assert here() == ["test_nudge.py"] and Path("test_nudge.py").read_text() == ""


def test_nothing_stays_half_written(monkeypatch):
    count = []

    def full(file):
        count.append(file)
        if len(count) == 3:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(MachineError, match="No space left"):
        new_concept.write_concept("nudge", "some/where")
    assert len(count) == 3 and here() == []


@pytest.mark.parametrize("like", [[], ["--like", "push"]])
def test_its_costs_say_their_unit(like):
    assert main(["new", "concept", "shift", *like]) == 0
    costs = re.findall(r'def \w+_cost\(.*?"""(.*?)"""', Path("shift.py").read_text(), re.DOTALL)
    assert len(costs) == 2 and all(UNITS.search(said) for said in costs), costs


def test_it_is_neutral_unless_an_example_is_asked_for(capsys):
    assert main(["new", "concept", "tilt"]) == 0
    text = Path("tilt.py").read_text().lower()
    assert "class tilt(" in text and "push" not in text and text.count("todo") > 5
    assert main(["new", "concept", "shove", "--like", "push"]) == 0
    assert "Push an object" in Path("shove.py").read_text()
    assert main(["new", "concept", "heave", "--like", "pusch"]) == 2
    assert "did you mean 'push'" in capsys.readouterr().err and not Path("heave.py").exists()
