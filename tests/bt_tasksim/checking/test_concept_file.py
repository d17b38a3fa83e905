"""``bt-tasksim check``: which tree is taken, what is printed, and the exit code."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_tasksim.checking import concept_file as command
from bt_tasksim.checking.findings import ERROR, Finding
from bt_tasksim.cli.main import main
from bt_tasksim.core.resources import asset
from bt_tasksim.trees.load import load_source

pytestmark = pytest.mark.physical

ROOT = asset().parent
MOVE = '''
from bt_tasksim import ConceptModel, Scene
from bt_tasksim.concept.parameters import ObjectName
from bt_tasksim.core.world import Command
from bt_tasksim.trees import sequence
from bt_tasksim.trees.load import load_source

class Nudge(ConceptModel):
    """Hold still at the target."""
    target: ObjectName
    def command(self, action, seen, memory):
        {body}
    def done(self, seen, memory):
        return seen.elapsed > 0.2
'''
TREE = """
def build():
    return sequence("nudge", Nudge("cup"))

def scene(robot="panda"):
    return Scene(robot, objects={"cup": "on table"})
"""


def write(tmp_path, body="return Command(tool=seen.tool)", tree=TREE) -> Path:
    path = tmp_path / "nudge.py"
    path.write_text(MOVE.format(body=body) + tree)
    return path


def test_a_sound_file_of_ones_own(tmp_path, capsys):
    assert main(["check", str(write(tmp_path))]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("ok: Nudge, 2 functions in ") and "of 3 runs of nudge.py" in lines[0]
    assert lines[0].endswith("; 0 errors, 0 warnings")


def test_an_exception_is_named_with_its_line(tmp_path, capsys):
    path = write(tmp_path, "return Command(tool=seen.tool[[9]])")
    line = path.read_text().splitlines().index("        return Command(tool=seen.tool[[9]])") + 1
    assert main(["check", str(path)]) == 2
    first, *_, last = capsys.readouterr().out.splitlines()
    assert first.startswith(
        f"ERROR Nudge.command (nudge.py:{line}): raises IndexError: index 9 is out of bounds"
    )
    assert last.startswith("not ok: Nudge") and "0 errors" not in last


def test_without_a_tree_only_the_declaration_is_checked(tmp_path, capsys):
    assert main(["check", str(write(tmp_path, tree=""))]) == 0
    first, last = capsys.readouterr().out.splitlines()
    assert first.startswith("WARNING Nudge") and "stands in no tree that is known" in first
    assert "ok: Nudge, its declaration alone" in last


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1", "defines no concept"),
        (
            "from bt_tasksim import ConceptModel\nclass Half(ConceptModel):\n    pass\n",
            "Half has no command(), done()",
        ),
        ("import nothing_at_all", "line 1: ModuleNotFoundError"),
    ],
)
def test_files_that_hold_no_concept(tmp_path, capsys, text, words):
    path = tmp_path / "own.py"
    path.write_text(text)
    assert main(["check", str(path)]) == 2
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1


def test_missing_files_and_trees_without_the_concept(tmp_path, capsys):
    assert main(["check", str(tmp_path / "none.py")]) == 2
    assert "there is no file" in capsys.readouterr().err
    assert main(["check", str(write(tmp_path)), "--tree", "pick_and_place"]) == 2
    assert "has no leaf of Nudge; its concepts: Bring, Grasp, Pick, Place, Release" in capsys.readouterr().err


def test_which_tree_is_taken(tmp_path, monkeypatch):
    asked = []

    def record(name, concepts):
        asked.append(name)
        return None, command.Recording({}, ["it ended"], [])

    monkeypatch.setattr(command, "_record", record)
    own = write(tmp_path)
    command.check(own)
    alone = write(tmp_path, tree="")
    (tmp_path / "train_nudge.py").write_text("")
    command.check(alone)
    command.check(ROOT / "concept_nodes" / "grasp.py")
    command.check(ROOT / "concept_nodes" / "place.py")
    assert asked[:2] == [str(own), str(tmp_path / "train_nudge.py")]
    for name, concept in zip(asked[2:], ("Grasp", "Place"), strict=True):
        leaves = [getattr(node, "model", None) for node in load_source(name).build().iterate()]
        assert concept in [type(model).__name__ for model in leaves]


@pytest.mark.parametrize("name", ["grasp", "place"])
def test_the_shipped_concepts_are_sound(name):
    report = command.check(ROOT / "concept_nodes" / f"{name}.py")
    assert not report.errors, "\n".join(report.lines())


def test_a_finding_is_one_line():
    found = Finding(ERROR, "Push", "features", "reads 'x'", "declare it", 12, "push.py")
    assert str(found) == "ERROR Push.features (push.py:12): reads 'x'; declare it"
