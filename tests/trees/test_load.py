"""Trees by name: scenarios, Python files and XML files, and one sentence for whatever is wrong in them."""

import textwrap
from pathlib import Path

import pytest
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.plugins import load_parts
from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.core import plugins
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.trees import load_tree, save_tree, sequence
from bt_tasksim.trees.load import load_root, load_source, names_in, own_nodes, scenarios

GOOD = """
from bt_tasksim import Scene
from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.trees import sequence

def scene(robot="panda"):
    return Scene(robot, objects={"cup": "on table"}, name="mine")

def build():
    return sequence("lift", Grasp("cup"), Pick("cup"))
"""


@pytest.fixture
def write(tmp_path):
    def to(name, text):
        path = tmp_path / name
        path.write_text(textwrap.dedent(text))
        return str(path)

    return to


@pytest.mark.parametrize("name", ["tree.xml", "scene.json"])
def test_what_no_scene_can_be_is_said_with_what_one_can(name):
    sentence = refused("pick_and_place", None, name)
    assert name in sentence and "scenario" in sentence and ".yaml" in sentence and "scene()" in sentence


def refused(*arguments):
    with pytest.raises(InputError) as error:
        load_source(*arguments)
    sentence = str(error.value)
    assert "\n" not in sentence
    return sentence


# ---- policies ---------------------------------------------------------------------------------------------


def policies_of(source):
    return {leaf.name: leaf.policy for leaf in source.build().iterate() if hasattr(leaf, "policy")}


def test_the_given_policy_goes_over_the_trees_own_and_into_its_xml(write, tmp_path):
    text = GOOD.replace('Pick("cup")', 'Pick("cup"), Grasp("cup", policy="programmed", name="again")')
    source = load_source(write("t.py", text), policies=[("Grasp", "policies/x")])
    assert {k: v for k, v in policies_of(source).items() if v} == {
        "grasp cup": "policies/x",
        "again": "policies/x",
    }
    save_tree(source.build(), tmp_path / "t.xml")
    again = load_source(str(tmp_path / "t.xml"), scene="shelf_to_shelf")
    assert policies_of(again)["again"] == "policies/x"


def test_without_one_the_tree_says_it(write):
    source = load_source(write("t.py", GOOD.replace('Pick("cup")', 'Pick("cup", policy="programmed")')))
    assert policies_of(source)["pick cup"] == "programmed" and policies_of(source)["grasp cup"] is None


def test_policies_of_concepts_that_the_tree_lacks(write):
    file = write("t.py", GOOD)
    assert refused(file, None, None, [("bring", "x")]) == (
        "a policy is given for 'bring', and the tree has no leaf of this concept; known: grasp, pick"
    )
    assert "did you mean 'grasp'" in refused(file, None, None, [("gasp", "x")])
    assert "'pick' is given twice" in refused(file, None, None, [("pick", "x"), ("pick", "x")])


# ---- scenarios --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", scenarios())
def test_each_scenario_builds_a_fresh_tree_every_time(name):
    source = load_source(name)
    a, b = source.build(), source.build()
    assert source.name == source.scene.name == name
    assert {id(n) for n in a.iterate()}.isdisjoint(id(n) for n in b.iterate())
    assert names_in(a)[0] <= set(source.scene.object_names)


def test_the_scenarios_of_the_design_are_there():
    assert {"pick_and_place", "shelf_to_shelf", "pick_and_throw", "pick_and_place_recovering"} <= set(
        scenarios()
    )


def test_robot_and_scene_can_be_named():
    assert load_source("pick_and_place", "xarm7_ability").scene.robot == "xarm7_ability"
    other = load_source("pick_and_throw", None, "pick_and_throw")
    assert other.scene.robot == "panda"


def test_unknown_names_come_with_the_nearest():
    assert refused("pick_and_plce").startswith("no scenario 'pick_and_plce'; did you mean 'pick_and_place'")
    assert "(or give a .py or .xml file)" in refused("xyz")
    assert "no scene 'shelf_to_shelv'; did you mean 'shelf_to_shelf'?" in refused(
        "pick_and_place", None, "shelf_to_shelv"
    )
    sentence = refused("pick_and_throw", None, "shelf_to_shelf")
    assert sentence.startswith(
        "leaf 'bring cup': no place 'trash_bin' in the scene 'shelf_to_shelf'; known: "
    )
    assert "leaf 'grasp target': no object 'target' in the scene" in refused(
        "pick_and_place", None, "pick_and_throw"
    )


# ---- Python files -----------------------------------------------------------------------------------------


def test_a_python_file_with_its_own_scene(write):
    source = load_source(write("lift.py", GOOD), "xarm7_ability")
    assert source.name == "lift" and source.scene.name == "mine" and source.scene.robot == "xarm7_ability"
    assert [n.name for n in source.build().children] == ["grasp cup", "pick cup"]


def test_a_scene_that_passes_over_the_robot_that_is_named(write):
    path = write("lift.py", GOOD.replace("Scene(robot,", "Scene('panda',"))
    sentence = refused(path, "xarm7_ability")
    assert "lift.py" in sentence and "'panda'" in sentence and "'xarm7_ability'" in sentence
    assert load_source(path, "panda").scene.robot == "panda"


@pytest.mark.parametrize("text", [GOOD, GOOD.replace("Scene(robot,", "Scene('panda',")])
def test_a_robot_that_there_is_not(write, text):
    sentence = refused(write("lift.py", text), "nonsense")
    assert "'nonsense'" in sentence and "--robot" not in sentence


def test_a_python_file_takes_a_robot_file_by_a_relative_path(write, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_bytes(asset("robots", "panda.yaml").read_bytes())
    assert load_source(write("lift.py", GOOD), "mine.yaml").scene.robot == str(tmp_path / "mine.yaml")


WITH_MESH = """
from bt_tasksim import ObjectSpec, Scene
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.scene.scene import CurriculumStage


def scene(robot="panda"):
    it = ObjectSpec(on="table", mesh="things/pyramid.obj")
    return Scene(robot, objects={"it": it}, stages=[CurriculumStage("one", objects={"it": it})])


def build():
    return Grasp("it")
"""
PYRAMID = """
v 0 0 0
v 0.1 0 0
v 0.1 0.1 0
v 0 0.1 0
v 0.05 0.05 0.1
f 1 3 2
f 1 4 3
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5
"""


def test_a_mesh_of_a_python_scene_is_looked_for_beside_its_file_and_else_where_one_works(
    write, tmp_path, monkeypatch
):
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.chdir(work)
    file = write("lift.py", WITH_MESH)
    with pytest.raises(InputError, match=r"no mesh file 'things/pyramid\.obj' in ") as error:
        load_source(file)
    assert str(tmp_path) in str(error.value) and str(work) in str(error.value)
    for folder in (work, tmp_path):
        (folder / "things").mkdir()
        (folder / "things" / "pyramid.obj").write_text(PYRAMID)
        scene = load_source(file).scene
        there = {Path(o.mesh).resolve() for o in (scene.objects["it"], scene.stages[0].objects["it"])}
        assert there == {folder / "things" / "pyramid.obj"}
    assert Path(scene.objects["it"].mesh).is_absolute() and scene.sample(0).objects[0].mesh


def test_an_object_a_fixture_and_a_robot_of_a_python_scene_are_looked_for_beside_its_file_too(
    write, tmp_path, monkeypatch
):
    (tmp_path / "work").mkdir()
    (tmp_path / "own_mug.yaml").write_text(asset("objects", "mug.yaml").read_text())
    (tmp_path / "mug.obj").write_bytes(asset("objects", "mug.obj").read_bytes())
    (tmp_path / "low.yaml").write_text(asset("fixtures", "shelf.yaml").read_text())
    (tmp_path / "arm.yaml").write_text(asset("robots", "panda.yaml").read_text())
    monkeypatch.chdir(tmp_path / "work")
    said = "Scene('arm.yaml', fixtures=['low.yaml'], objects={'cup': 'own_mug.yaml on table'})"
    source = load_source(write("lift.py", GOOD.replace("return Scene(", f"return {said}  # (", 1)))
    assert source.scene.robot == str(tmp_path / "arm.yaml")
    assert str(tmp_path / "low.yaml") in source.scene.fixtures
    assert source.scene.objects["cup"].category == "mug"


def test_a_python_file_with_a_named_scene(write):
    path = write("lift.py", GOOD.replace("def scene", "def other"))
    assert load_source(path, None, "pick_and_throw").scene.name == "pick_and_throw"
    assert "has no scene() and none was named: add one, or use --scene" in refused(path)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x = 1", "has no function build(): define one that returns the tree's root"),
        ("build = 3", "has no function build(), build is int: define one"),
        (
            "scene = 3\ndef build(): ...",
            "has no function scene(), scene is int: define one that returns a Scene",
        ),
        ("def build(:\n    pass", "line 1: SyntaxError: invalid syntax"),
        ("x = 1\ny = 1 / 0", "line 2: ZeroDivisionError: division by zero"),
        (
            "import nothing_of_that_name",
            "line 1: ModuleNotFoundError: No module named 'nothing_of_that_name'",
        ),
        ("import sys\nsys.exit(3)", "line 2: SystemExit: 3"),
        ("def scene():\n    raise KeyError('cup')\ndef build(): ...", "line 2: KeyError: 'cup'"),
        ("def scene():\n    return 'shelf'\ndef build(): ...", "scene() should return a Scene, found str"),
    ],
)
def test_faulty_python_files(write, text, sentence):
    found = refused(write("tree.py", text))
    assert "tree.py'" in found and sentence in found


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("return 3", "build() should return a py_trees behaviour, found int"),
        ("raise ValueError('no')", "line 7: ValueError: no"),
        ("return Grasp('cup', speeed=1)", "grasp has no parameter 'speeed'; did you mean 'speed'?"),
        ("return Pick('cup', distance='far')", "'distance' should be a number in m, found 'far'"),
        ("return Grasp('cop')", "leaf 'grasp cop': no object 'cop' in the scene 'mine'; did you mean 'cup'?"),
        ("return sequence('root')", "sequence 'root' has no children"),
        ("a = Grasp('cup'); return sequence('root', a, a)", "node 'grasp cup' already stands under 'root'"),
    ],
)
def test_faulty_build_functions(write, body, sentence):
    head = GOOD.split("def build")[0].lstrip().replace("\n\n", "\n").rstrip()
    assert sentence in refused(write("tree.py", f"{head}\ndef build():\n    {body}\n"))


def test_a_missing_file():
    assert refused("gone.py") == "there is no tree file 'gone.py'"
    assert refused("gone.xml") == "there is no tree file 'gone.xml'"


# ---- XML files --------------------------------------------------------------------------------------------


def lift(name="cup"):
    return sequence("lift", Grasp(name), Pick(name))


def test_the_scene_of_an_xml_file(tmp_path):
    named, unnamed = tmp_path / "named.xml", tmp_path / "unnamed.xml"
    save_tree(lift(), named, scene="shelf_to_shelf")
    save_tree(lift(), unnamed)
    assert load_source(str(named)).scene.name == "shelf_to_shelf"
    assert load_source(str(named), None, "pick_and_throw").scene.name == "pick_and_throw"
    assert "cup" in load_source(str(unnamed)).scene.objects, "the first ready-made scene that fits"


def test_a_scene_file_beside_the_tree(tmp_path):
    (tmp_path / "room.yaml").write_text("name: room\nobjects:\n  cup: {kind: cup, on: table}\n")
    save_tree(lift(), tmp_path / "lift.xml", scene="room.yaml")
    source = load_source(str(tmp_path / "lift.xml"))
    assert source.scene.name == "room" and isinstance(source.build(), Behaviour)


ROOM = """
from bt_tasksim import Scene

def near(final):
    return True

def scene(robot="panda"):
    return Scene(robot, name="own_room", objects={"cup": "on table"}, goals=[near])
"""


@pytest.mark.parametrize("tree", ["lift.xml", "pick_and_throw", "tree.py"])
def test_a_scene_in_a_python_file(tree, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.py").write_text(ROOM)
    save_tree(lift(), tmp_path / "lift.xml")
    (tmp_path / "tree.py").write_text(
        "from bt_tasksim.concept_nodes import Grasp\ndef build():\n    return Grasp('cup')\n"
    )
    if tree == "pick_and_throw":
        assert "no place 'trash_bin' in the scene 'own_room'" in refused(tree, None, "room.py")
        return
    source = load_source(tree, "so100", "room.py")
    assert (source.scene.name, source.scene.robot) == ("own_room", "so100")
    assert isinstance(source.build(), Behaviour)


def test_a_python_file_without_a_scene_and_a_tree_that_names_one(tmp_path):
    (tmp_path / "room.py").write_text("raise SystemExit('this ran')\n")
    (tmp_path / "empty.py").write_text("x = 1\n")
    assert "has no function scene(): define one that returns a Scene" in refused(
        "pick_and_throw", None, str(tmp_path / "empty.py")
    )
    assert refused("pick_and_throw", None, "gone.py") == "there is no scene file 'gone.py'"
    save_tree(lift(), tmp_path / "lift.xml", scene="pick_and_throw")
    text = (tmp_path / "lift.xml").read_text().replace("pick_and_throw", "room.py")
    (tmp_path / "lift.xml").write_text(text)
    assert "a tree's file runs no Python" in refused(str(tmp_path / "lift.xml"))


@pytest.mark.parametrize("name", ["../room.yaml", "{folder}/room.yaml", "link.yaml", "..\\\\room.yaml"])
def test_a_tree_file_opens_no_scene_elsewhere(tmp_path, name):
    (tmp_path / "room.yaml").write_text("name: room\nobjects:\n  cup: {kind: cup, on: table}\n")
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "link.yaml").symlink_to(tmp_path / "room.yaml")
    tree = tmp_path / "sub" / "lift.xml"
    save_tree(lift(), tree, scene=name.format(folder=tmp_path))
    sentence = refused(str(tree))
    assert "a scene" in sentence and "folder of the file that names it" in sentence
    assert sentence.endswith("or give --scene FILE")
    assert load_source(str(tree), scene=str(tmp_path / "room.yaml")).scene.name == "room"


@pytest.fixture
def with_policy(tmp_path):
    """A tree's file of a folder ``sub`` whose grasp has this policy."""
    (tmp_path / "sub").mkdir()

    def make(name):
        file = tmp_path / "sub" / "lift.xml"
        save_tree(lift(), file)
        file.write_text(
            file.read_text().replace('<Grasp target="cup"', f'<Grasp target="cup" policy="{name}"')
        )
        return str(file)

    return make


@pytest.mark.parametrize("name", ["../mine", "{folder}/mine", "link", "inner/../../mine", "half"])
def test_a_tree_file_opens_no_policy_elsewhere(tmp_path, monkeypatch, with_policy, name):
    for folder in ("mine", "sub/half"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "mine" / "card.json").write_text("{}")
    (tmp_path / "sub" / "link").symlink_to(tmp_path / "mine")
    (tmp_path / "sub" / "half" / "card.json").symlink_to(tmp_path / "mine" / "card.json")
    tree = with_policy(name.format(folder=tmp_path))
    for read in (load_source, load_root, load_tree):
        with pytest.raises(InputError, match=r"lift.xml, line \d+: .*, or give --policy grasp=FOLDER$"):
            read(tree)
    source = load_source(tree, policies=[("Grasp", "programmed")])
    assert next(leaf for leaf in source.build().iterate() if leaf.name == "grasp cup").policy == "programmed"
    assert load_root(tree, {"grasp"}) is not None


def test_a_policy_beside_the_tree_is_found_from_anywhere(tmp_path, monkeypatch, with_policy):
    folder = tmp_path / "sub" / "policies" / "mine"
    folder.mkdir(parents=True)
    tree = with_policy("policies/mine")
    (grasp,) = (leaf for leaf in load_root(tree).iterate() if leaf.name == "grasp cup")
    assert grasp.policy == str(folder)
    save_tree(grasp, tmp_path / "sub" / "again.xml")
    assert 'policy="policies/mine"' in (tmp_path / "sub" / "again.xml").read_text()
    (tmp_path / "other").mkdir()
    with pytest.raises(InputError, match=r"does not lie in the folder of .*--policy grasp="):
        save_tree(grasp, tmp_path / "other" / "again.xml")
    monkeypatch.chdir(tmp_path / "sub")
    (grasp,) = (leaf for leaf in load_root(tree).iterate() if leaf.name == "grasp cup")
    assert grasp.policy == "policies/mine"


def test_a_tree_file_names_bundled_policies(with_policy):
    (grasp,) = (leaf for leaf in load_root(with_policy("programmed")).iterate() if leaf.name == "grasp cup")
    assert grasp.policy == "programmed"


def test_a_tree_that_fits_no_scene(tmp_path):
    save_tree(lift("teapot"), tmp_path / "tea.xml")
    sentence = refused(str(tmp_path / "tea.xml"))
    assert (
        "does not say in which scene it runs, and no ready-made one has teapot: name one with --scene"
        in sentence
    )


LEAF = '<root BTCPP_format="4"><BehaviorTree ID="main">{}</BehaviorTree></root>'


@pytest.mark.parametrize(
    ("inside", "sentence"),
    [
        ('<Graps target="cup"/>', "line 1: unknown node 'Graps'; did you mean 'Grasp'"),
        ("<Grasp/>", "line 1: .*target.* missing|line 1: .*'target'"),
        ('<Pick target="cup" distance="far"/>', "line 1: .*'distance' should be a number in m, found 'far'"),
        ('<Pick target="cup" distanse="0.1"/>', "line 1: .*'distanse'.*did you mean 'distance'"),
        ('<SubTree ID="main"/>', "line 1: subtrees go round in a circle: main -> main"),
        ("<Sequence/>", "line 1: "),
        ('<Grasp target="cup"/><Grasp target="cup"/>', "should hold one node, found 2"),
    ],
)
def test_faulty_xml(write, inside, sentence):
    import re

    found = refused(write("tree.xml", LEAF.format(inside)))
    assert "tree.xml" in found and re.search(sentence, found), found


@pytest.mark.parametrize(
    "text", ["", "<root", "no xml", "<!DOCTYPE x [<!ENTITY a 'b'>]><root>&a;</root>", "\x00\x01"]
)
def test_what_is_no_xml(write, text):
    assert "tree.xml" in refused(write("tree.xml", text))


OWN = '''
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.parameters import ObjectName


class Shiny(Condition):
    """Does it shine?"""

    target: ObjectName

    def holds(self, seen):
        """It does."""
        return True
'''


def test_nodes_of_ones_own_come_from_a_file(tmp_path):
    file, tree = tmp_path / "own.py", tmp_path / "tree.xml"
    file.write_text(OWN)
    tree.write_text(
        '<root BTCPP_format="4" scene="shelf_to_shelf">'
        '<BehaviorTree ID="a"><Shiny target="cup"/></BehaviorTree></root>'
    )
    with pytest.raises(InputError, match=r"unknown node 'Shiny'.*--plugin FILE\.py"):
        load_source(str(tree))
    with plugins.scratch():
        load_parts(str(file))
        root = load_source(str(tree)).build()
        assert type(root).__name__ == "Shiny" and root.model.target == "cup"
    file.write_text("from concept_nodes import Grasp\n")
    with pytest.raises(InputError, match="defines no concept and no condition"):
        own_nodes(str(file))


def test_a_log_is_no_tree(tmp_path):
    with pytest.raises(InputError, match="is a log: make a tree of it with 'bt-tasksim decompose"):
        load_source("kitchen.h5")
