"""Object files: what is read, how scenes take it, and which sentence refuses what."""

import json

import pytest

from bt_tasksim.core.beside import beside
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.grips import GivenGrip
from bt_tasksim.scene.object_file import load_object, object_file
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.scene.specs import ObjectSpec
from tools.make_objects import texts

BLOCK = "class: brick\nkind: box\nsize: [0.06, 0.04, 0.08]\ncolour: red\nmass: 0.3\nsymmetry: 4\n"
GRASPS = "grasps:\n  - {point: [0, 0, 0.02], closing: [0, 1, 0], firmness: 0.7}\n"


def written(folder, **files):
    for name, text in files.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder / "scene.yaml"


def test_the_bundled_meshes_are_what_the_program_makes():
    for name, text in texts().items():
        assert asset("objects", name).read_text() == text


@pytest.mark.parametrize("name", ["mug", "bracket"])
def test_bundled_objects_are_drawn_by_their_files_name(name):
    world = Scene(objects={"it": f"{name}.yaml on table"}).sample(2)
    actor = world.objects[0]
    assert (actor.kind, actor.category, actor.on) == ("mesh", name, "table")
    assert actor.mesh == str(asset("objects", f"{name}.obj"))
    assert len(actor.model().solid.grips) >= 3


def test_what_is_given_in_python_goes_before_the_file(tmp_path):
    written(tmp_path, brick=BLOCK + GRASPS)
    spec = ObjectSpec(on="table", file=str(tmp_path / "brick.yaml"), mass=(0.1, 0.1), colour=(0.0, 0.0, 1.0))
    assert spec.mass == (0.1, 0.1) and spec.colour == (0.0, 0.0, 1.0)
    assert spec.kinds == ("box",) and spec.size == ((0.06, 0.04, 0.08),) * 2
    assert spec.category == "brick" and spec.symmetry == 4
    (grip,) = spec.grasps
    assert grip == GivenGrip((0, 0, 0.02), (0, 1, 0), grip.width, None, 0.7)
    assert grip.width == pytest.approx(0.04, abs=1e-6)


def test_a_scene_file_takes_it_from_beside_it_and_overrides_some_of_it(tmp_path):
    scene = written(
        tmp_path,
        brick=BLOCK + GRASPS,
        scene="""
            objects:
              short: brick.yaml on table
              long: {object: brick.yaml, on: table, at: [0.1, 0.2], mass: 0.5, colour: [0.1, 0.2, 0.3]}
              mug: {object: mug.yaml, on: table, at: [0.0, -0.3]}
        """,
    )
    short, long, mug = load_scene(scene).sample(1).objects
    assert short.colour == (0.86, 0.16, 0.15) and short.mass == pytest.approx(0.3)
    assert long.colour == (0.1, 0.2, 0.3) and long.mass == pytest.approx(0.5)
    assert short.grasps == long.grasps and len(short.grasps) == 1
    assert short.model().symmetry == 4 and mug.model().symmetry == 1
    assert mug.category == "mug" and mug.kind == "mesh"


def test_an_entry_may_have_colour_and_grasps_of_its_own(tmp_path):
    scene = written(tmp_path, scene="objects:\n  box: {on: table, colour: green, size: [0.06, 0.05, 0.09], "
                    "grasps: [{point: [0, 0, 0], closing: [1, 0, 0], width: 0.06}]}\n")  # fmt: skip
    actor = load_scene(scene).sample(0).objects[0]
    assert actor.colour == (0.22, 0.60, 0.32)
    assert actor.model().solid.grips.widths.tolist() == [0.06]


def test_a_colour_that_is_given_changes_no_other_draw():
    plain, red = (
        Scene(objects={"a": ObjectSpec(("box",), "table", colour=c), "b": "cup on table"}).sample(3).objects
        for c in (None, (1.0, 0.0, 0.0))
    )
    assert red[0].colour == (1.0, 0.0, 0.0)
    assert (plain[0].pose, plain[1].pose, plain[1].size) == (red[0].pose, red[1].pose, red[1].size)


def test_logs_keep_what_was_given():
    world = Scene(objects={"it": "bracket.yaml on table"}).sample(4)
    again = ActorConfiguration.from_json(world.to_json())
    assert again.objects == world.objects and len(again.objects[0].grasps) == 3
    assert isinstance(again.objects[0].grasps[0], GivenGrip)
    old = json.loads(world.to_json())
    for name in ("grasps", "symmetry", "category"):
        del old["objects"][0][name]
    actor = ActorConfiguration.from_json(json.dumps(old)).objects[0]
    assert (actor.grasps, actor.symmetry, actor.category) == ((), None, "")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("mass: 0.2\n", "should name a 'mesh' or a 'kind'"),
        ("kind: bocks\n", "unknown kind of object 'bocks'; did you mean 'book'"),
        ("kind: box\ncolor: red\n", "line 2: unknown field 'color'; did you mean 'colour'"),
        ("kind: box\ncolour: rde\n", "unknown colour 'rde'; did you mean 'red'"),
        ("kind: box\ncolour: [1, 2, 3]\n", "3 numbers from 0 to 1"),
        ("kind: box\nmesh: a.obj\n", "belong to the kind 'mesh'"),
        ("mesh: ../a.obj\n", "should lie in the folder"),
        ("mesh: a.obj\n", "line 1: no mesh file"),
        ("kind: box\nsymmetry: -1\n", "'symmetry' should not be negative"),
        ("kind: box\n" + GRASPS, "'width' is missing, and the object has no single size"),
        (BLOCK + GRASPS.replace("[0, 1, 0]", "[0, 0, 0]"), "should be a direction"),
        (BLOCK + GRASPS.replace("0.02", "0.2"), "meet nothing"),
        (BLOCK + GRASPS.replace("0.7", "7"), r"'grasps\[0\].firmness' should be at most 1"),
    ],
)
def test_what_cannot_be_is_one_sentence(tmp_path, text, words):
    written(tmp_path, thing=text)
    with pytest.raises(InputError, match=words) as caught:
        load_object(object_file(str(tmp_path / "thing.yaml")))
    assert "object file" in str(caught.value)


def test_one_kind_needs_no_sequence():
    assert ObjectSpec("cup", on="table") == ObjectSpec(("cup",), on="table")


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("{object: mugg.yaml, on: table}", "no object file 'mugg.yaml'; did you mean 'mug.yaml'"),
        ("{object: ../brick.yaml, on: table}", "should lie in the folder"),
        ("/etc/mug.yaml on table", "should lie in the folder"),
        ("{object: brick.yaml, on: table, mesh: mug.obj, kind: box}", "belong to the kind 'mesh'"),
        ("{object: brick.yaml, on: table, mass: 19}", "denser than any metal"),
        ("{object: brick.yaml}", "'objects.it.on' is missing"),
    ],
)
def test_scenes_refuse_what_cannot_be(tmp_path, entry, words):
    scene = written(tmp_path, brick=BLOCK, scene=f"objects:\n  it: {entry}\n")
    with pytest.raises(InputError, match=words):
        load_scene(scene)


def test_an_object_needs_a_kind_or_a_file():
    with pytest.raises(InputError, match="needs 'kinds', a 'mesh', or a 'file'"):
        ObjectSpec(on="table")


def test_a_link_out_of_the_folder_is_refused(tmp_path):
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "secret.obj").write_text("v 0 0 0\n")
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "linked.obj").symlink_to(tmp_path / "outside" / "secret.obj")
    (folder / "there").symlink_to(tmp_path / "outside")
    for name in ("linked.obj", "there/secret.obj"):
        with pytest.raises(InputError, match="a link that leads out of the folder"):
            beside(folder, name, "a mesh")
    (folder / "own.obj").write_text("")
    (folder / "again.obj").symlink_to(folder / "own.obj")
    assert beside(folder, "again.obj", "a mesh") == folder / "own.obj"
