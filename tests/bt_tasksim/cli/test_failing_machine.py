"""A full disk and interrupts: what was there before stays."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from bt_tasksim.core.resources import asset

LOG = asset("demonstrations", "pick_and_place", "00.h5")


def disk_full(*arguments, **options):
    raise OSError(28, "No space left on device")


def interrupt(*arguments, **options):
    raise KeyboardInterrupt


WRITERS = [
    ("show pick_and_place --xml out", "out"),
    ("show pick_and_place --picture out", "out"),
    (f"decompose {LOG} --json out", "out"),
    (f"decompose {LOG} --xml out", "out"),
    (f"decompose {LOG} --picture out", "out"),
    ("evaluate pick_and_place --episodes 1 --json out", "out"),
    ("policies --json out", "out"),
]


@pytest.mark.parametrize(("words", "name"), WRITERS)
@pytest.mark.parametrize("old", [None, "what was there before"])
@pytest.mark.parametrize("when", ["fsync", "replace"])
def test_a_full_disk_leaves_what_was_there(call, monkeypatch, words, name, old, when):
    if old is not None:
        Path(name).write_text(old)
    monkeypatch.setattr(os, when, disk_full)
    code, _, err = call(*words.split())
    assert (
        code == 1
        and err == f"bt-tasksim: cannot write '{name}': No space left on device; nothing was written\n"
    )
    assert [p.name for p in Path().iterdir()] == ([name] if old else [])
    assert old is None or Path(name).read_text() == old


@pytest.mark.parametrize(("words", "name"), WRITERS)
@pytest.mark.parametrize("old", [None, "what was there before"])
def test_an_interrupt_while_writing_leaves_what_was_there(call, monkeypatch, words, name, old):
    if old is not None:
        Path(name).write_text(old)
    monkeypatch.setattr(os, "fsync", interrupt)
    code, _, err = call(*words.split())
    assert code == 130 and err == "interrupted\n"
    assert [p.name for p in Path().iterdir()] == ([name] if old else [])
    assert old is None or Path(name).read_text() == old


@pytest.mark.parametrize(("error", "code"), [(disk_full, 1), (interrupt, 130)])
@pytest.mark.parametrize("when", ["fsync", "rename"])
def test_a_runs_folder_is_written_whole_or_not_at_all(call, monkeypatch, error, code, when):
    with monkeypatch.context() as patch:
        patch.setattr(os, when, error)
        found, _, err = call("run", "pick_and_throw", "--out", "here")
    assert found == code and err.count("\n") == 1 and "Traceback" not in err
    assert code == 130 or ("here" in err and "No space left on device" in err)
    assert list(Path().iterdir()) == []


def test_an_interrupt_during_a_run_ends_everything(call, monkeypatch):
    from bt_tasksim.engines.physics.sapien import SapienPhysics

    step, count = SapienPhysics.step, []

    def stop(self, target):
        count.append(1)
        if len(count) == 20:
            raise KeyboardInterrupt
        return step(self, target)

    monkeypatch.setattr(SapienPhysics, "step", stop)
    code, out, err = call("run", "pick_and_throw", "--out", "here")
    assert code == 130 and err == "interrupted; what was run is in here\n" and out == ""
    assert sorted(p.name for p in Path("here").iterdir()) == [
        "report.html", "result.json", "run.h5", "tree.svg",
    ]  # fmt: skip
    assert call("evaluate", "pick_and_throw", "--episodes", 1, "--json", "e.json")[0] == 0
