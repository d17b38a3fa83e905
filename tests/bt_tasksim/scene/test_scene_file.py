"""Scenes and meshes of one's own: what is read, and what is refused with which sentence."""

import os

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.scene.mesh_file import mesh_shape
from bt_tasksim.scene.meshes import TriangleMesh, circle, cup, prism, rounded_rectangle
from bt_tasksim.scene.overlap import check_configuration
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.scene.specs import Goal


def save(path, *bodies, drop=0):
    with path.open("w") as file:
        start = 1
        for mesh in bodies:
            file.writelines(f"v {x} {y} {z}\n" for x, y, z in mesh.vertices)
            file.writelines(f"f {a} {b} {c}\n" for a, b, c in (mesh.faces + start)[drop:])
            start += len(mesh.vertices)


def block(x, y, z, at=(0, 0, 0)):
    corners = np.array([[x, y], [-x, y], [-x, -y], [x, -y]]) / 2
    mesh = prism(corners, z)
    return TriangleMesh(mesh.vertices + np.array(at), mesh.faces)


def write(folder, text):
    file = folder / "scene.yaml"
    file.write_text(text)
    return file


def test_the_bundled_example():
    scene = load_scene(asset("scenes", "bottle_on_table.yaml"))
    assert scene.name == "bottle_on_table" and scene.goal.place == "mat"
    world = scene.sample(0)
    bottle = world.objects[0]
    assert bottle.size == pytest.approx((0.056, 0.042, 0.146))
    assert bottle.mass == 0.2 and bottle.friction == 0.6
    assert bottle.pose[2] == pytest.approx(0.073)
    check_configuration(world)


@pytest.mark.parametrize("entry", ["cup on drawer", "{kind: cup, on: drawer, at: [0, 0]}"])
def test_nothing_starts_on_a_part_of_furniture(tmp_path, entry):
    file = write(tmp_path, f"fixtures: [drawer]\nobjects:\n  c: {entry}\n")
    with pytest.raises(InputError, match=r"line 3: object 'c' is on 'drawer', .*a place.* such as 'chest'"):
        load_scene(file)


def test_everything_that_may_be_said(tmp_path):
    save(tmp_path / "part.obj", block(0.05, 0.04, 0.1))
    file = write(
        tmp_path,
        """
        robot: panda
        fixtures: [shelf]
        objects:
          cup: on upper_board
          part: {mesh: part.obj, on: table, at: [0.05, 0.1], area: [0, 0], heading: 0, mass: [0.1, 0.2]}
          pack: {kind: [box, oval], on: lower_board, size: [[0.06, 0.04, 0.08], [0.07, 0.05, 0.1]]}
        spots:
          - {name: mat, on: lower_board, at: [0, -0.1], area: [0.01, 0.02], extent: [0.1, 0.1], heading: 0.2}
        goal: {object: part, place: mat, relation: stands, position_tolerance: 0.02}
        disturbed: part
        """,
    )
    scene = load_scene(file)
    assert scene.name == "scene" and scene.disturbed == "part"
    assert scene.goal.position_tolerance == 0.02
    world = scene.sample(4)
    part = next(o for o in world.objects if o.name == "part")
    assert part.pose[:3] == pytest.approx((0.55, 0.1, 0.05))
    assert part.size == pytest.approx((0.05, 0.04, 0.1))
    assert 0.1 <= part.mass <= 0.2


@pytest.mark.parametrize(
    ("objects", "words"),
    [
        ("{cup: {on: tabel}}", "did you mean 'table'"),
        ("{cup: {kind: cupp, on: table}}", "did you mean 'cup'"),
        ("{cup: {on: table, masss: 1}}", "unknown field 'objects.cup.masss'; did you mean 'mass'"),
        ("{cup: {kind: cup}}", "'objects.cup.on' is missing"),
        ("{cup: 5}", "'objects.cup' should be a mapping"),
        ("{cup: {on: table, mass: heavy}}", "'objects.cup.mass' should be a number"),
        ("{cup: {on: table, mass: 200}}", "between 0.001 and 20 kg"),
        ("{cup: {on: table, mass: [0.2, 0.1]}}", "the lower one first"),
        ("{cup: {on: table, mass: 15}}", "denser than any metal"),
        ("{cup: {on: table, friction: -0.1}}", "'objects.cup.friction' should be between"),
        ("{cup: {on: table, friction: .nan}}", "'objects.cup.friction' should be a number"),
        ("{box: {on: table, size: [60, 40, 80]}}", "looks like millimetres"),
        ("{box: {on: table, size: [0.06, 0.04]}}", "'objects.box.size' should be 3 numbers"),
        ("{box: {on: table, size: [0.06, 0, 0.08]}}", "should be positive"),
        ("{box: {on: table, mesh: a.obj, kind: box}}", "belong to the kind 'mesh'"),
        ("{part: {kind: mesh, on: table}}", "'mesh' is missing"),
        ("{part: {mesh: nothing.obj, on: table}}", "no mesh file"),
        ("{part: {mesh: text.obj, on: table}}", "no solid in it|cannot be read"),
        ("{part: {mesh: open.obj, on: table}}", "not watertight: 3 of its edges"),
        ("{part: {mesh: large.obj, on: table}}", "looks like millimetres: set scale: 0.001"),
        ("{part: {mesh: large.obj, scale: 0.00001, on: table}}", "should be between 0.005 m and 1 m"),
        ("{part: {mesh: large.obj, scale: -1, on: table}}", "'objects.part.scale' should be positive"),
        ("{part: {mesh: large.obj, scale: 1, size: [1, 1, 1], on: table}}", "not both"),
        ("{box: {on: table, at: [0.7, 0]}}", "mm beyond the edge of 'table' along x"),
        ("{box: {on: lower_board, at: [0.16, 0]}}", "overlap by [0-9.]+ mm at the start"),
    ],
)
def test_bad_objects(tmp_path, objects, words):
    (tmp_path / "text.obj").write_text("hello\n")
    save(tmp_path / "open.obj", block(0.05, 0.04, 0.1), drop=1)
    save(tmp_path / "large.obj", block(50, 40, 100))
    file = write(tmp_path, f"fixtures: [shelf]\nobjects: {objects}\n")
    with pytest.raises(InputError, match=words) as caught:
        load_scene(file)
    assert str(file) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "should be a mapping"),
        ("[1, 2]", "should be a mapping"),
        ("objects: {cup: [", "line"),
        ("robbot: panda", "did you mean 'robot'"),
        ("robot: pandaa", "did you mean 'panda'"),
        ("fixtures: shelf", "'fixtures' should be a list"),
        ("fixtures: [shelv]", "did you mean 'shelf'"),
        ("spots: [{name: a}]", r"'spots\[0\].on' is missing"),
        ("spots: [{name: a, on: table, extent: [0, 1]}]", r"'spots\[0\].extent\[0\]' should be positive"),
        ("{objects: {cup: on table}, goal: {object: cup}}", "the goal 'on' of 'cup' names no place"),
        ("{objects: {cup: on table}, goal: {object: cup, place: table, relation: lifte}}", "'lifted'"),
        ("{objects: {cup: on table}, disturbed: cap}", "did you mean 'cup'"),
    ],
)
def test_bad_files(tmp_path, text, words):
    with pytest.raises(InputError, match=words):
        load_scene(write(tmp_path, text))


def test_the_line_is_that_of_the_field(tmp_path):
    text = "robot: panda\nobjects:\n  cup: on table\n  box:\n    kind: box\n    on: tabel\n"
    with pytest.raises(InputError, match=r"scene.yaml', line 6: object 'box' is on 'tabel'.*'table'"):
        load_scene(write(tmp_path, text))
    with pytest.raises(InputError, match=r"line 4: unknown field 'fixtrues'; did you mean 'fixtures'"):
        load_scene(write(tmp_path, "robot: panda\nobjects:\n  cup: on table\nfixtrues: [shelf]\n"))


def test_a_goal_may_be_on_an_object(tmp_path):
    file = write(
        tmp_path,
        "objects:\n  cup: on table\n  tin: cylinder on table\nspots: [{name: mat, on: table}]\n"
        "goal:\n  object: cup\n  place: tin\n",
    )
    assert load_scene(file).goal == Goal("cup", on="tin")


STOOL = """name: stool
boxes: [{position: [0.5, 0, 0.1], size: [0.3, 0.3, 0.2]}]
places:
  - {name: seat, kind: board, position: [0.5, 0, %s], extent: [0.3, 0.3]}
"""


@pytest.mark.parametrize(("height", "floats"), [(0.2, False), (0.0, False), (0.3, True)])
def test_a_place_in_mid_air_is_refused(tmp_path, height, floats):
    (tmp_path / "stool.yaml").write_text(STOOL % height)
    file = write(tmp_path, "name: room\nfixtures: [./stool.yaml]\n")
    if not floats:
        assert load_scene(file).fixtures[-1].endswith("stool.yaml")
        return
    with pytest.raises(InputError, match=r"line 2: place 'seat' .*'places\[0\].position'.* 100 mm"):
        load_scene(file)


def test_a_goal_of_being_lifted_keeps_its_height(tmp_path):
    goal = "goal: {object: cup, place: table, relation: lifted, height: 0.12}"
    found = load_scene(write(tmp_path, f"objects: {{cup: on table}}\n{goal}\n")).goal
    assert (found.relation, found.height) == ("lifted", 0.12)
    with pytest.raises(InputError, match=r"line 2: 'goal.height' should be positive"):
        load_scene(write(tmp_path, f"objects: {{cup: on table}}\n{goal.replace('0.12', '-1')}\n"))


@pytest.mark.parametrize(
    "entry",
    ["objects: {x: {mesh: %s, on: table}}", "fixtures: [%s.yaml]", "robot: %s.yaml"],
    ids=["mesh", "fixture", "robot"],
)
@pytest.mark.parametrize("where", ["/etc/passwd", "../secret", "a/../../secret", "C:\\\\secret"])
def test_nothing_outside_of_the_files_folder_is_opened(tmp_path, entry, where):
    (tmp_path / "inner").mkdir()
    for name in ("secret", "secret.yaml"):
        (tmp_path / name).write_text("name: secret")
    with pytest.raises(InputError, match=r"line 1: .* should lie in the folder"):
        load_scene(write(tmp_path / "inner", entry % where))


def test_a_mesh_opens_no_other_file(tmp_path):
    save(tmp_path / "part.obj", block(0.05, 0.04, 0.1))
    text = (tmp_path / "part.obj").read_text()
    os.mkfifo(tmp_path / "pipe.mtl")  # whoever opens it waits for ever
    (tmp_path / "part.obj").write_text(f"mtllib pipe.mtl\nusemtl a\n{text}")
    scene = load_scene(write(tmp_path, "objects: {part: {mesh: part.obj, on: table}}"))
    assert scene.sample(0).objects[0].size == pytest.approx((0.05, 0.04, 0.1))


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(InputError, match="cannot be read: No such file"):
        load_scene(tmp_path / "none.yaml")
    file = tmp_path / "scene.yaml"
    file.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match=r"not text|special characters"):
        load_scene(file)


def test_a_mesh_of_thin_walls_says_that_they_are_thicker(tmp_path):
    save(tmp_path / "cup.obj", cup(0.035, 0.1, 0.001, 0.001))
    with pytest.warns(UserWarning, match="has thin walls, which its 32 convex parts make thicker"):
        geometry = mesh_shape(str(tmp_path / "cup.obj"), (0.07, 0.07, 0.1))
    assert len(geometry.collision) == 32


def test_separate_bodies_keep_hollows(tmp_path):
    walls = [block(0.06, 0.01, 0.05, (0, y, 0)) for y in (-0.03, 0.03)]
    save(tmp_path / "two.obj", *walls)
    geometry = mesh_shape(str(tmp_path / "two.obj"), (0.06, 0.07, 0.05))
    assert len(geometry.collision) == 2
    assert geometry.volume == pytest.approx(2 * 0.06 * 0.01 * 0.05)


def test_a_mesh_of_too_many_bodies_is_refused(tmp_path):
    save(tmp_path / "gravel.obj", *(block(0.001, 0.001, 0.001, (0.002 * k, 0, 0)) for k in range(300)))
    with pytest.raises(InputError, match="has 300 separate bodies, more than 256"):
        mesh_shape(str(tmp_path / "gravel.obj"), (0.06, 0.06, 0.1))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [1e15, 1e307])
def test_coordinates_without_bounds_are_refused(tmp_path, size):
    mesh = block(1.0, 1.0, 1.0)
    save(tmp_path / "far.obj", TriangleMesh(mesh.vertices * size, mesh.faces))
    with pytest.raises(InputError, match=r"coordinates (beyond|that are not finite)"):
        mesh_shape(str(tmp_path / "far.obj"), (0.06, 0.06, 0.1))


def test_fine_meshes_get_few_corners(tmp_path):
    save(tmp_path / "can.obj", prism(circle(200) * 0.03, 0.1))
    corners = mesh_shape(str(tmp_path / "can.obj"), (0.06, 0.06, 0.1)).collision[0].corners()
    assert len(corners) <= 64
    assert np.ptp(corners, axis=0) == pytest.approx([0.06, 0.06, 0.1], rel=0.01)


def test_inside_out_meshes_are_turned(tmp_path):
    mesh = prism(rounded_rectangle(0.03, 0.02, 0.005), 0.1)
    save(tmp_path / "out.obj", TriangleMesh(mesh.vertices, mesh.faces[:, ::-1].copy()))
    assert mesh_shape(str(tmp_path / "out.obj"), (0.06, 0.04, 0.1)).volume > 0
