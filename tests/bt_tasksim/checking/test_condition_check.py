"""``bt-tasksim check`` of a file with a condition: what a condition may be wrong in."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_tasksim.cli.main import main

NEAR = '''
import numpy as np
from bt_tasksim import Condition, Form, Goal, ObjectName, Scene, units
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.trees import fallback, invert, sequence

FAR = Form("{{object}} is {{far}} high", {{"far": units.METRES}})

class High(Condition):
    """Is it above the table?

    Args:
        target: The object.
    """
    target: ObjectName
    def holds(self, seen):
        {holds}
    def explain(self, seen):
        return FAR(object=self.target, far=seen.object(self.target)[:, 2])

def build():
    return sequence("nudge", invert({leaf}), Grasp("cup"))

def scene(robot="panda"):
    return Scene(robot, objects={{"cup": "on table"}})
'''
HEIGHT = "seen.object(self.target)[:, 2]"


def checked(folder: Path, capsys, holds: str, leaf: str = "High('cup')") -> tuple[int, str, list[str]]:
    path = folder / "high.py"
    path.write_text(NEAR.format(holds=holds, leaf=leaf))
    code = main(["check", str(path)])
    found = capsys.readouterr()
    line = next(k for k, text in enumerate(path.read_text().splitlines(), 1) if "def holds" in text)
    return code, f"(high.py:{line})", (found.out + found.err).splitlines()


def test_a_sound_one(tmp_path, capsys):
    code, _, lines = checked(tmp_path, capsys, f"return {HEIGHT} > 0.06")
    assert code == 0 and len(lines) == 1
    assert lines[0].startswith("ok: High, asked ") and lines[0].endswith("; 0 errors, 0 warnings")


@pytest.mark.parametrize(
    ("holds", "what"),
    [
        (
            f"return np.full(len({HEIGHT}), bool(np.any(np.asarray({HEIGHT}) > 0.06)))",
            "in torch: gives a ndarray",
        ),
        (
            f"self.__dict__['n'] = 1 - self.__dict__.get('n', 0); return {HEIGHT} > self.n * 100 - 50",
            "another answer",
        ),
        (f"seen.tool[:, 2] += 0.001; return {HEIGHT} > 5.0", "changes what it is shown"),
    ],
)
def test_what_is_wrong_is_said_with_the_line(tmp_path, capsys, holds, what):
    code, where, lines = checked(tmp_path, capsys, holds)
    errors = [line for line in lines if line.startswith(f"ERROR High.holds {where}")]
    assert code == 2 and any(what in line for line in errors), lines


def test_one_that_is_always_true_or_stands_nowhere_is_warned_of(tmp_path, capsys):
    code, _, lines = checked(tmp_path, capsys, f"return {HEIGHT} > 50.0")
    assert code == 0 and "WARNING High.holds" in lines[0] and "is false in all situations" in lines[0]
    code, _, lines = checked(
        tmp_path, capsys, f"return {HEIGHT} > 50.0", "fallback('no', invert(Grasp('cup')))"
    )
    assert any("stands nowhere in the tree" in line for line in lines)


def test_one_that_raises_in_a_run_is_named_in_one_sentence(tmp_path, capsys):
    code, _, lines = checked(tmp_path, capsys, "return seen.nothing")
    assert code == 2 and len(lines) == 1 and "AttributeError in high.py" in lines[0]
