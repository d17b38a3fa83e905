"""The benchmark of engines in other processes: what is missing is said, and what fails is not hidden."""

import contextlib
import importlib.util
import sys

import pytest

from benchmarks import remote
from bt_tasksim.core.errors import MachineError


@pytest.fixture
def quick(monkeypatch):
    """Nothing is started or run; each comparison says which physics it had."""

    @contextlib.contextmanager
    def served(role, name):
        yield "remote:127.0.0.1:1"

    def compared(ways, rounds, episodes, longest, every=None):
        return {"pictures": next(iter(ways.values())).engines} if every is not None else {}

    monkeypatch.setattr(remote, "served", served)
    monkeypatch.setattr(remote, "compared", compared)
    monkeypatch.setattr(remote, "step_times", lambda options, steps: 1.0)


@pytest.mark.parametrize("there", [True, False])
def test_pictures_are_of_mujoco_where_it_is_installed(quick, monkeypatch, there):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: there or None)
    found = remote.measure(1, 1, 100)
    assert found["mixed_physics"] == found["pictures"] == ("mujoco" if there else "sapien")


def test_pictures_that_cannot_be_served_are_said_to_be_missing(quick, monkeypatch):
    served = remote.served

    @contextlib.contextmanager
    def without_pictures(role, name):
        if role == "rendering":
            raise MachineError("no pictures here")
        with served(role, name) as address:
            yield address

    monkeypatch.setattr(remote, "served", without_pictures)
    found = remote.measure(1, 1, 100)
    assert found["pictures_missing"] == "no pictures here" and "pictures" not in found


def test_a_run_that_fails_is_no_missing_picture(quick, monkeypatch):
    def compared(ways, rounds, episodes, longest, every=None):
        if every is not None:
            raise MachineError("the physics blew up")
        return {}

    monkeypatch.setattr(remote, "compared", compared)
    with pytest.raises(MachineError, match="blew up"):
        remote.measure(1, 1, 100)


@pytest.mark.parametrize("does", ["sleep 60", "false"])
def test_a_server_that_says_nothing_is_not_waited_for(tmp_path, monkeypatch, does):
    program = tmp_path / "python"
    program.write_text(f"#!/bin/sh\nexec {does}\n")
    program.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(program))
    monkeypatch.setattr(remote, "START", 0.3)
    with (
        pytest.raises(MachineError, match="the physics engine cannot be served"),
        remote.served("physics", "x"),
    ):
        pass
