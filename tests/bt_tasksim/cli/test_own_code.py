"""Whatever is wrong in a user's own file, the command line says where: a sentence, the file and the line."""

from __future__ import annotations

from pathlib import Path

import pytest

from bt_tasksim.core import registry

HEAD = """\
import py_trees
from bt_tasksim import Command, ConceptModel, Goal, ObjectName, Scene, register
from bt_tasksim.scene.relations.base import GoalRelation
from concept_nodes import Grasp
from trees import sequence
"""
SCENE = """
def scene(robot="panda"):
    return Scene(robot, objects={"box": "on table"})
"""
BUILD = """
def build():
    return sequence("s", Grasp("box"))
"""
OWN = """
class Mine(py_trees.behaviour.Behaviour):
    def {method}:
        {body}

    def {other}:
        return py_trees.common.Status.SUCCESS

def build():
    return sequence("s", Mine("mine"))
"""
CONCEPT = """
class Push(ConceptModel):
    target: ObjectName

    def begin(self, seen):
        {begin}
        return seen.tool

    def command(self, action, seen, memory):
        {command}
        return Command(tool=memory)

    def done(self, seen, memory):
        {done}
        return seen.elapsed > 0.3

    def necessary_cost(self, seen, memory):
        {necessary_cost}
        return seen.elapsed

    def initial_state(self, seen):
        {initial_state}
        return ()

    def explain(self, seen, memory):
        {explain}
        return None

def build():
    return sequence("s", Push("box"))
"""
GOAL = """
@register("goal relation", "near by test")
class Near(GoalRelation):
    def evaluate(self, goal, final):
        raise ValueError("HERE")

def scene(robot="panda"):
    return Scene(robot, objects={"box": "on table"}, goal=Goal("box", "table", relation="near by test"))

def build():
    return sequence("s", py_trees.behaviours.Success("at once"))
"""
RAISES = 'raise ValueError("HERE")'
FUNCTIONS = ("begin", "command", "done", "initial_state", "explain")


def own(method: str, body: str = RAISES, other: str = "update(self)") -> str:
    return HEAD + SCENE + OWN.format(method=method, body=body, other=other)


def concept(function: str) -> str:
    said = dict.fromkeys((*FUNCTIONS, "necessary_cost"), "pass") | {function: RAISES}
    return HEAD + SCENE + CONCEPT.format(**said)


CASES = {
    "an import": "import nowhere  # HERE\n" + HEAD + SCENE + BUILD,
    "syntax": HEAD + "def build(:  # HERE\n",
    "build": HEAD + SCENE + "def build():\n    return 1 / 0  # HERE\n",
    "build, refused": HEAD + SCENE + 'def build():\n    return Grasp("box", spede=1)  # HERE\n',
    "scene": HEAD + "def scene():\n    return {}['x']  # HERE\n" + BUILD,
    "scene, refused": HEAD + 'def scene():\n    return Scene(objects={"bx": "on table"})  # HERE\n' + BUILD,
    "a goal": HEAD + GOAL,
    "making a behaviour": own("__init__(self, name)"),
    "setup": own("setup(self, **known)"),
    "initialise": own("initialise(self)"),
    "update": own("update(self)", other="shutdown(self)"),
    "terminate": own("terminate(self, new_status)"),
    **{f"a concept's {function}": concept(function) for function in FUNCTIONS},
}


@pytest.mark.parametrize("text", CASES.values(), ids=CASES.keys())
def test_every_way_into_a_users_code_is_said_with_file_and_line(call, text):
    Path("mine.py").write_text(text)
    line = 1 + [("HERE" in line) for line in text.splitlines()].index(True)
    with registry.scratch():
        code, _, err = call("run", "mine.py", "--out", "runs/mine")
    assert code in (1, 2) and "Traceback" not in err and err.count("\n") == 1, err
    assert f"mine.py:{line}: " in err or f"mine.py', line {line}: " in err, err


def test_a_behaviour_without_a_status_is_named_with_its_class(call):
    text = own("update(self)", "return None", "shutdown(self)")
    Path("mine.py").write_text(text)
    line = 1 + [line.startswith("class Mine") for line in text.splitlines()].index(True)
    code, _, err = call("run", "mine.py", "--out", "runs/mine")
    assert code == 1 and f"leaf 'mine' (Mine, mine.py:{line}) has no status" in err
