"""A user's own URDF or MJCF as a fixture."""

import warnings

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.scene.specs import FixtureSpec

URDF = """<robot name="cabinet">
  <link name="body">
    <visual><geometry><mesh filename="/etc/passwd"/></geometry></visual>
    <collision><origin xyz="0.15 0 0.2"/><geometry><box size="0.3 0.4 0.4"/></geometry></collision>
  </link>
  <link name="door">
    <inertial><mass value="1.5"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="-0.01 -0.2 0"/><geometry><box size="0.02 0.4 0.3"/></geometry></collision>
  </link>
  <link name="door_handle">
    <collision><geometry><box size="0.02 0.02 0.1"/></geometry></collision>
  </link>
  <joint name="hinge" type="revolute">
    <parent link="body"/><child link="door"/><origin xyz="0 0.2 0.2"/><axis xyz="0 0 -1"/>
    <limit lower="0" upper="1.5" effort="1" velocity="1"/><dynamics friction="0.3" damping="0.1"/>
  </joint>
  <joint name="glue" type="fixed"><parent link="door"/><child link="door_handle"/>
    <origin xyz="-0.06 -0.35 0"/></joint>
</robot>"""
MJCF = """<mujoco><worldbody>
  <geom type="box" size="0.1 0.1 0.05" pos="0 0 0.05"/>
  <body name="valve" pos="0 0 0.12">
    <joint type="hinge" axis="0 0 1" range="-90 90" frictionloss="0.2"/>
    <geom name="grip" type="cylinder" size="0.02 0.02" mass="0.3"/>
  </body>
</worldbody></mujoco>"""
CHAIN = URDF.replace('name="glue" type="fixed"', 'name="glue" type="continuous"')


@pytest.fixture
def write(tmp_path):
    def make(text, name="cabinet.urdf"):
        file = tmp_path / name
        file.write_text(text)
        return str(file)

    return make


def test_links_of_a_urdf_become_parts(write):
    fixture = load_fixture(write(URDF))
    (door,) = fixture.parts
    assert (fixture.name, door.name, door.kind) == ("cabinet", "door", "hinge")
    assert np.allclose(door.axis, [0, 0, -1]) and np.allclose(door.origin, [0, 0.2, 0.2])
    assert door.limits == (0.0, 1.5) and door.friction == 0.3 and door.damping == pytest.approx(0.1)
    assert len(fixture.boxes) == 1 and np.allclose(fixture.boxes[0].size, [0.3, 0.4, 0.4])
    assert len(door.boxes) == 2 and door.mass > 1.5
    assert {round(grip.width, 3) for grip in door.grasps} == {0.02}
    assert all(np.allclose(grip.point, [-0.06, -0.15, 0.2]) for grip in door.grasps)


def test_bodies_of_an_mjcf_become_parts(write):
    (valve,) = load_fixture(write(MJCF, "valve_box.xml")).parts
    assert np.allclose(valve.limits, [-np.pi / 2, np.pi / 2]) and valve.friction == 0.2
    assert len(valve.boxes) == 4 and valve.mass == pytest.approx(0.3) and len(valve.grasps) == 2


def test_values_grow_from_where_it_is_shut_whichever_way_the_file_counts(write):
    ranged = MJCF.replace(
        'type="hinge" axis="0 0 1" range="-90 90"', 'type="slide" axis="1 0 0" range="-0.3 0"'
    )
    (drawer,) = load_fixture(write(ranged, "drawer.xml")).parts
    assert np.allclose(drawer.limits, [0.0, 0.3]) and np.allclose(drawer.axis, [-1, 0, 0])
    assert drawer.value == (0.0, 0.0)


def test_what_is_only_seen_is_left_out(write):
    seen = '<geom type="sphere" size="0.1" contype="0" conaffinity="0"/>'
    cube = '<texture name="t" type="cube" fileright="/etc/passwd"/><material name="m" texture="t"/>'
    texture = f"<asset>{cube}</asset>"
    text = MJCF.replace("<worldbody>", f"{texture}<worldbody>{seen}").replace(
        'name="grip"', 'name="grip" material="m"'
    )
    fixture = load_fixture(write(text, "seen.xml"))
    assert len(fixture.boxes) == 1 and len(fixture.parts[0].boxes) == 4


def test_in_scenes_and_scene_files(write, tmp_path):
    file = write(URDF)
    spec = FixtureSpec(file, at=(0.6, 0.0), name="mine", sensed=True)
    world = Scene(fixtures=[spec]).sample(0)
    assert world.objects[0].name == "mine_door" and world.objects[0].joint.sensed
    (tmp_path / "scene.yaml").write_text(
        "fixtures: [{fixture: cabinet.urdf, at: [0.6, 0]}]\nobjects: {cup: {on: table, at: [0, 0.4]}}\n"
        "goal: {object: door, relation: open, value: 1.0}\n"
    )
    assert load_scene(tmp_path / "scene.yaml").object_names == ["cup", "door"]
    (tmp_path / "scene.yaml").write_text("fixtures: [../cabinet.urdf]\nobjects: {cup: {on: table}}\n")
    with pytest.raises(InputError, match="should lie in the folder of the file that names it"):
        load_scene(tmp_path / "scene.yaml")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (CHAIN, "'door_handle' moves by more than one joint"),
        (URDF.replace('<box size="0.3 0.4 0.4"/>', '<mesh filename="a.stl"/>'), "'mesh' names another file"),
        (URDF.replace('<box size="0.3 0.4 0.4"/>', '<sphere radius="0.1"/>'), "a sphere is among its shapes"),
        (URDF.replace('type="revolute"', 'type="floating"'), "cabinet.urdf.*joint"),
        (URDF.replace('"door"', '"a/b"'), "the name of link"),
        (MJCF.replace("<worldbody>", '<include file="/etc/passwd"/><worldbody>'), "names another file"),
        (MJCF.replace("</mujoco>", ""), "no XML that can be read"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><robot>&b;</robot>", "no XML that can be read"),
        ("<html/>", "neither URDF nor MJCF"),
        (URDF.replace('upper="1.5"', 'upper="-1.5"'), "the lower one first"),
        (URDF.replace('upper="1.5"', 'upper="0"'), "the lower one first"),
        (MJCF.replace('"-90 90"', '"90 0"'), "the lower one first, found '' 90 0"),
        (MJCF.replace('"-90 90"', '"0 nan"'), "the lower one first"),
        (MJCF.replace("<worldbody>", "<worldbody><replicate count='99999'/>"), "'replicate' is none of them"),
        (
            MJCF.replace("<worldbody>", "<asset><mesh name='m' file='a.stl'/></asset><worldbody>"),
            "another file",
        ),
        (MJCF.replace("<worldbody>", "<worldbody>" + "<body/>" * 6000), "more than 5000 elements"),
        (
            URDF.replace('"0 0.2 0.2"', '"nan 0 0"'),
            "'xyz' of origin should be finite .* 'nan 0 0'",
        ),
        (MJCF.replace('name="grip"', 'name="grip" pos="0 -INF 0"'), "'pos' of geom 'grip' should be finite"),
        (
            URDF.replace('"0 0.2 0.2"', '"1e30 0 0"'),
            r"cabinet.urdf', joint 'hinge' of link 'door': 'origin\[0\]' should be at most 100, found 1e",
        ),
        (URDF.replace('upper="1.5"', 'upper="7"'), "cabinet.urdf', joint 'hinge' of link 'door': .* found 7"),
        (URDF.replace('"0.3 0.4 0.4"', '"300 0.4 0.4"'), r"cabinet.urdf': 'boxes\[0\].size\[0\]' should be"),
        (
            MJCF.replace("<worldbody>", "<worldbody>" + "<body>" * 2000).replace(
                "</worldbody>", "</body>" * 2000 + "</worldbody>"
            ),
            "more than 50 elements within one another",
        ),
        (URDF.replace("<axis", "<mimic joint='other'/><axis"), "'mimic' is none of them"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(write, tmp_path, monkeypatch, capfd, text, words):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    with warnings.catch_warnings(record=True) as warned, pytest.raises(InputError, match=words) as refused:
        load_fixture(write(text))
    assert "\n" not in str(refused.value)
    assert not warned and capfd.readouterr() == ("", ""), "no library says anything by itself"
    assert not list((tmp_path / "here").iterdir())


def test_a_name_may_read_like_a_number(write):
    (valve,) = load_fixture(write(MJCF.replace('"valve"', '"nan"'), "valve.xml")).parts
    assert valve.name == "nan"
