"""What the tests of the command line share."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_tasksim.cli.main import main


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def call(capsys):
    """Runs a command in this process: exit code, what it printed, and its sentence."""

    def run(*words):
        capsys.readouterr()
        code = main([str(w) for w in words])
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.fixture
def refused(call):
    """Runs a command that must be refused with exit code 2 and one sentence; returns the sentence."""

    def run(*words):
        code, _, err = call(*words)
        assert code == 2, err
        assert err.startswith("bt-tasksim: ") and err.count("\n") == 1 and "Traceback" not in err, err
        return err[len("bt-tasksim: ") :].strip()

    return run


@pytest.fixture
def until(call):
    """Calls a command with one seed after the other, five at most, until it ends with a code.

    A single draw may fail (see `draws`).
    """

    def run(wanted, *words, said="", seeds=range(3, 8)):
        for seed in seeds:
            code, out, err = call(*words, "--seed", seed)
            if code == wanted and said in out:
                return out, err
        raise AssertionError(f"code {code}, not {wanted}: {out}{err}")

    return run


TREE = """
from bt_tasksim import Scene
from bt_tasksim.concept_nodes import Bring, Grasp, Pick
from bt_tasksim.trees import sequence

def scene(robot="panda"):
    return Scene(robot, objects={{"cup": "on table"}}, name="mine")

def build():
    return {body}
"""


@pytest.fixture
def tree_file():
    """Writes a Python tree with a given root, and returns its name."""

    def write(body, more="", name="tree.py"):
        Path(name).write_text(TREE.format(body=body) + more)
        return name

    return write
