"""Drawn worlds for another process: files by name and content, and nothing that no engine should build."""

import dataclasses
import json
import shutil

import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.engines.remote.configurations import as_received, find_mesh, for_sending, mesh_name
from bt_tasksim.engines.remote.plain import from_plain
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec
from bt_tasksim.trees.load import load_source, scenarios

BOTTLE = asset("objects", "bottle.obj")


def with_mesh(path):
    size = ((0.056, 0.042, 0.146),) * 2
    return Scene(objects={"it": ObjectSpec(("mesh",), on="table", mesh=str(path), size=size)}).sample(0)


@pytest.mark.parametrize("scenario", sorted(scenarios()))
@pytest.mark.parametrize("name", ["panda", "xarm7_ability"])
def test_shipped_worlds_arrive_as_they_were_sent(scenario, name):
    robot, scene = load_robot(name), load_source(scenario, name).scene
    for seed in range(2):
        world = scene.sample(seed)
        arrived = as_received(for_sending(world, robot), robot)
        assert load_robot(arrived.robot).name == robot.name
        assert dataclasses.replace(arrived, robot=name).to_json() == world.to_json()


def test_no_path_of_the_sender_is_sent(tmp_path, robot):
    own = tmp_path / "mine.obj"
    shutil.copy(BOTTLE, own)
    sent = for_sending(with_mesh(own), robot)
    assert str(tmp_path) not in sent.to_json() and sent.robot == "panda"


def test_meshes_are_found_by_name_and_content(tmp_path, robot):
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir(), there.mkdir()
    bundled = as_received(for_sending(with_mesh(BOTTLE), robot), robot)
    assert bundled.objects[0].mesh == str(BOTTLE)
    shutil.copy(BOTTLE, here / "mine.obj")
    sent = for_sending(with_mesh(here / "mine.obj"), robot)
    with pytest.raises(InputError, match=r"the server has no mesh file 'mine.obj': copy it into a folder"):
        as_received(sent, robot, there)
    shutil.copy(BOTTLE, there / "mine.obj")
    assert as_received(sent, robot, there).objects[0].mesh == str(there / "mine.obj")
    with open(there / "mine.obj", "a") as file:
        file.write("# changed\n")
    with pytest.raises(InputError, match=r"'mine.obj' is not the same on the server and the client"):
        as_received(sent, robot, there)


def test_a_mesh_that_was_changed_on_both_sides_is_built_anew(tmp_path, robot):
    """However long a server has been there."""
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir(), there.mkdir()
    filled = []
    for text in (BOTTLE.read_text(), WEDGE):
        for folder in (here, there):
            (folder / "mine.obj").write_text(text)
        arrived = as_received(for_sending(with_mesh(here / "mine.obj"), robot), robot, there)
        filled.append(arrived.objects[0].shape().volume)
    assert filled[1] == pytest.approx(0.056 * 0.042 * 0.146 / 6) and filled[0] > 2 * filled[1]


WEDGE = (
    "".join(f"v {v}\n" for v in ("0 0 0", "1 0 0", "0 1 0", "0 0 1")) + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
)


def test_no_other_file_of_the_server_is_looked_at(tmp_path):
    secret = tmp_path / "secret.obj"
    shutil.copy(BOTTLE, secret)
    digest = mesh_name(str(secret)).partition("#")[2]
    (tmp_path / "folder").mkdir()
    for name in (str(secret), "../secret.obj", "a/../../secret.obj", "", ".", "..", ".hidden"):
        with pytest.raises(InputError, match=r"is no name of a mesh file|has no mesh file"):
            find_mesh(f"{name}#{digest}", tmp_path / "folder")
    with pytest.raises(InputError, match="no mesh file"):
        mesh_name(str(tmp_path / "gone.obj"))


def _object(world, **changes):
    return dataclasses.replace(world, objects=(dataclasses.replace(world.objects[0], **changes),))


def _box(world, **changes):
    fixture = world.fixtures[0]
    box = dataclasses.replace(fixture.boxes[0], **changes)
    return dataclasses.replace(world, fixtures=(dataclasses.replace(fixture, boxes=(box,)),))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda w: dataclasses.replace(w, robot="xarm7_ability"), "is for the robot 'xarm7_ability'"),
        (lambda w: dataclasses.replace(w, physics_frequency=10**8), "frequencies lie between"),
        (lambda w: dataclasses.replace(w, control_frequency=0), "frequencies lie between"),
        (lambda w: dataclasses.replace(w, seed=-1), "seed is not negative"),
        (lambda w: dataclasses.replace(w, stream="other"), "seed is not negative"),
        (lambda w: dataclasses.replace(w, joint_position=(0.0,) * 8), "'joint_position' has 9 numbers"),
        (lambda w: dataclasses.replace(w, hand_start=(0.0,)), "'hand_start' has 4 numbers"),
        (lambda w: dataclasses.replace(w, noise="loud"), "unknown noise model 'loud'"),
        (lambda w: dataclasses.replace(w, objects=w.objects * 2), "same name"),
        (lambda w: dataclasses.replace(w, objects=w.objects * 200), "at most 128"),
        (lambda w: dataclasses.replace(w, fixtures=w.fixtures * 200), "at most 128"),
        (lambda w: _object(w, kind="ghost"), "unknown kind 'ghost'"),
        (lambda w: _object(w, size=(0.0, 0.1, 0.1)), "size should lie between 0.0001 and 100, found 0.0"),
        (lambda w: _object(w, size=(0.1, 0.2, 1e4)), "size should lie between 0.0001 and 100, found 10000.0"),
        (lambda w: _object(w, mass=0.0), "mass should lie between"),
        (lambda w: _object(w, friction=-1.0), "friction should lie between"),
        (lambda w: _object(w, colour=(2.0, 0.0, 0.0)), "colour should lie between"),
        (lambda w: _object(w, pose=(0.0,) * 7), "unit quaternion"),
        (lambda w: _object(w, pose=(1e6, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)), "within 1000 m"),
        (lambda w: _object(w, pose=(0.0,)), "unit quaternion"),
        (lambda w: _box(w, size=(1e9, 1.0, 1.0)), "size of a box"),
        (lambda w: _box(w, pose=(0.0,) * 6), "unit quaternion"),
    ],
)
def test_what_no_engine_should_build_is_refused(robot, change, sentence):
    world = for_sending(load_source("pick_and_place").scene.sample(0), robot)
    as_received(world, robot)
    with pytest.raises(InputError, match=sentence):
        as_received(change(world), robot)


def test_a_disturbance_names_an_object_of_the_world(robot):
    world = for_sending(load_source("pick_and_place_recovering").scene.sample(0), robot)
    other = dataclasses.replace(world, disturbance=dataclasses.replace(world.disturbance, object="gone"))
    with pytest.raises(InputError, match="what is disturbed is not in the world; known: cube"):
        as_received(other, robot)


def test_given_grasps_arrive_and_are_bounded(robot):
    sent = for_sending(Scene(objects={"it": "bracket.yaml on table"}).sample(0), robot)
    assert len(sent.objects[0].grasps) == 3
    arrived = as_received(from_plain(ActorConfiguration, json.loads(sent.to_json()), "it"), robot)
    assert arrived.objects[0].grasps == sent.objects[0].grasps
    many = dataclasses.replace(sent.objects[0], grasps=sent.objects[0].grasps * 22)
    with pytest.raises(InputError, match="at most 64 grasps, found 66"):
        as_received(dataclasses.replace(sent, objects=(many,)), robot)
