"""Names, trees, scenes and places that are no good: one sentence each, exit code 2."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

TREE = """
from bt_tasksim import Scene
from bt_tasksim.concept_nodes import Bring, Grasp, Pick
from bt_tasksim.trees import sequence

def scene(robot="panda"):
    return Scene(robot, objects={{"cup": "on table"}}, name="mine")

def build():
    return {body}
"""


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("show pick_and_plac", "no scenario 'pick_and_plac'; did you mean 'pick_and_place'"),
        ("run pick_and_place --robot pandda", "unknown robot 'pandda'; did you mean 'panda'?"),
        ("run pick_and_place --robot gone.yaml", "gone.yaml"),
        ("run pick_and_place --video --video-size 12", "--video-size should be like 1280x720, found '12'"),
        ("run pick_and_place --video --video-fps nan", "nan frames a second"),
        ("run pick_and_place --engines sapiem", "unknown physics engine 'sapiem'; did you mean 'sapien'?"),
        (
            "run pick_and_place --perception camara",
            "unknown postprocess engine 'camara'; did you mean 'camera'?",
        ),
        ("evaluate pick_and_place --noise find", "unknown noise model 'find'; did you mean 'fine'?"),
        (
            "run pick_and_place --scene shelf_to_shef",
            "no scene 'shelf_to_shef'; did you mean 'shelf_to_shelf'?",
        ),
        ("run pick_and_place --scene gone.yaml", "scene file 'gone.yaml' cannot be read: No such file"),
        ("run pick_and_place --scene pick_and_throw", "leaf 'grasp target': no object 'target' in the scene"),
        ("show gone.py", "there is no tree file 'gone.py'"),
        ("show gone.xml", "there is no tree file 'gone.xml'"),
        ("decompose gone.h5", "there is no file 'gone.h5'; check the path"),
        ("replay gone", "there is no file 'gone'; check the path"),
        ("run pick_and_place --policy gasp=x", "no leaf of this concept; did you mean 'grasp'?"),
        ("run pick_and_place --policy grasp=progammed", "no policy 'progammed'; did you mean 'programmed'?"),
        ("evaluate pick_and_place --policy grasp=gone/x", "leaf 'grasp target': there is no policy folder"),
        ("run pick_and_place --policy grasp=a --policy Grasp=b", "the policy of 'Grasp' is given twice"),
        ("policies --folder gone", "there is no folder 'gone' to look for policies in"),
        ("policies --pin gone", "no policy 'gone' in "),
        ("policies --unpin gone panda", "no policy is pinned for 'gone' on 'panda'"),
    ],
)
def test_unknown_names(refused, words, sentence):
    assert sentence in refused(*words.split())


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x = 1", "'tree.py' has no function build(): define one that returns the tree's root"),
        ("def build(:", "'tree.py', line 1: SyntaxError: invalid syntax"),
        ("\n1 / 0", "'tree.py', line 2: ZeroDivisionError: division by zero"),
        (TREE.format(body="1 / 0"), "'tree.py', line 10: ZeroDivisionError: division by zero"),
        (
            TREE.format(body='Grasp("cap")'),
            "leaf 'grasp cap': no object 'cap' in the scene 'mine'; did you mean 'cup'?",
        ),
        (
            TREE.format(body='Bring("cup", to="goal")'),
            "leaf 'bring cup': no place 'goal' in the scene 'mine'; known: cup, table",
        ),
    ],
)  # fmt: skip
def test_faulty_python_trees(refused, text, sentence):
    Path("tree.py").write_text(text)
    assert refused("run", "tree.py") == sentence


XML = '<root BTCPP_format="4" main_tree_to_execute="a">\n<BehaviorTree ID="a">\n{}\n</BehaviorTree>{}</root>'


@pytest.mark.parametrize(
    ("inside", "more", "sentence"),
    [
        ('<Grap target="cup"/>', "", "tree.xml, line 3: unknown node 'Grap'; did you mean 'Grasp'"),
        ("<Pick/>", "", "tree.xml, line 3: "),
        ('<Pick target="cup" distance="near"/>', "", "'distance' should be a number in m, found 'near'"),
        (
            '<SubTree ID="b"/>',
            '<BehaviorTree ID="b"><SubTree ID="a"/></BehaviorTree>',
            "subtrees go round in a circle: a -> b -> a",
        ),
    ],
)
def test_faulty_xml_trees(refused, inside, more, sentence):
    Path("tree.xml").write_text(XML.format(inside, more))
    assert sentence in refused("run", "tree.xml")


def test_a_missing_parameter_is_named(refused):
    Path("tree.xml").write_text(XML.format("<Pick/>", ""))
    assert "target" in refused("run", "tree.xml")


OPEN_PYRAMID = (
    "v 0 0 0\nv .05 0 0\nv .05 .05 0\nv 0 .05 0\nv .02 .02 .05\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"
)


@pytest.mark.parametrize(
    ("mesh", "sentence"),
    [
        (OPEN_PYRAMID, "is not watertight: 4 of its edges do not join two triangles"),
        ("", "mesh '.*part.obj' "),
        ("v 0 0\nf 1 2 9\n", "mesh '.*part.obj' "),
        (None, "no mesh file '.*part.obj'"),
    ],
)
def test_a_broken_mesh(refused, tree_file, mesh, sentence):
    if mesh is not None:
        Path("part.obj").write_text(mesh)
    Path("room.yaml").write_text("objects:\n  cup: {mesh: part.obj, on: table, mass: 0.1}\n")
    assert re.search(sentence, refused("run", tree_file('Grasp("cup")'), "--scene", "room.yaml"))


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("objects: {cup: {kind: cupp, on: table}}", "did you mean 'cup'"),
        ("objects: {cup: {kind: cup, on: tabel}}", "did you mean 'table'"),
        ("objects: {cup: {kind: cup, on: table, mas: 1}}", "did you mean 'mass'"),
        ("objects: {cup: {kind: cup, on: table, mass: heavy}}", "mass"),
        ("objects: [", "room.yaml"),
    ],
)
def test_faulty_scene_files(refused, tree_file, text, sentence):
    Path("room.yaml").write_text(text)
    assert sentence in refused("run", tree_file('Grasp("cup")'), "--scene", "room.yaml")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("show pick_and_place --xml gone/out.xml", "the folder 'gone' does not exist"),
        ("show pick_and_place --picture .", "cannot write '.': it is a folder; name a file in it"),
        ("evaluate pick_and_place --episodes 1 --json pipe", "cannot write 'pipe': it is a device or a pipe"),
        ("run pick_and_place --out there", "there': it holds other things, such as 'diary.txt'"),
    ],
)  # fmt: skip
def test_places_that_cannot_be_written_to(refused, words, sentence):
    Path("there").mkdir()
    Path("there/diary.txt").write_text("dear")
    os.mkfifo("pipe")
    assert sentence in refused(*words.split())
    assert Path("there/diary.txt").read_text() == "dear"


@pytest.mark.parametrize(
    ("written", "meant"),
    [("Retry", "RetryUntilSuccessful"), ("retry", "RetryUntilSuccessful"), ("force_success", "ForceSuccess")],
)
def test_a_node_by_its_name_in_python_is_told_its_name_in_xml(refused, written, meant):
    Path("a.xml").write_text(XML.format(f'<{written}><Grasp target="cup"/></{written}>', ""))
    sentence = refused("run", "a.xml")
    assert "line 3" in sentence and f"did you mean '{meant}'" in sentence


@pytest.mark.parametrize("leaf", ['<Grasp target="cap"/>', '<Bring target="target" to="gaol"/>'])
def test_an_unknown_name_in_xml_is_said_with_file_and_line(refused, leaf):
    Path("a.xml").write_text(XML.format(f'<Sequence>\n<Grasp target="target"/>\n{leaf}\n</Sequence>', ""))
    for command in ("run", "evaluate", "show"):
        sentence = refused(command, "a.xml", "--scene", "pick_and_place")
        assert sentence.startswith("a.xml, line 5: leaf '"), sentence


def test_a_warning_is_one_sentence_said_once(call, tree_file):
    own = "py_trees.decorators.Timeout('slow', Grasp('cup', timeout=0.5), duration=3.0)"
    tree_file(own, "\nimport py_trees\n")
    code, _, err = call("run", "tree.py", "--out", "here")
    assert code == 1 and err.count("\n") == 1, err
    assert err.startswith("bt-tasksim: 'slow' is py_trees' own Timeout") and "UserWarning" not in err
