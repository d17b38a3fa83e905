"""Drawing worlds: by seed, inside their ranges, and clear of each other."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.scene.configuration import STREAMS, ActorConfiguration
from bt_tasksim.scene.overlap import check_configuration
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec, SpotSpec

SHELF = Scene(fixtures=["shelf"], objects={"cup": "on upper_board", "oval": "on lower_board"})
TABLE = Scene(
    objects={
        "target": ObjectSpec(("box", "cylinder", "oval", "diamond"), on="table"),
        "other": ObjectSpec(("cube", "superellipsoid"), on="table"),
    },
    spots=[SpotSpec("mat", "table", (0.0, -0.2), (0.03, 0.03), yaw=0.5)],
    goal=Goal("target", "mat"),
    disturbed="target",
)


@settings(max_examples=40, deadline=None)
@given(st.sampled_from([SHELF, TABLE]), st.integers(0, 10**6), st.sampled_from(sorted(STREAMS)))
def test_same_seed_same_world_and_json_keeps_it(scene, seed, stream):
    world = scene.sample(seed, stream)
    assert world.to_json() == scene.sample(seed, stream).to_json()
    again = ActorConfiguration.from_json(world.to_json())
    assert again.to_json() == world.to_json()
    assert again.objects == world.objects and again.fixtures == world.fixtures
    assert again.goal == world.goal and again.disturbance == world.disturbance


def test_streams_are_unrelated():
    texts = {TABLE.sample(1, stream).objects for stream in STREAMS}
    assert len(texts) == len(STREAMS)
    numbers = {TABLE.sample(1).generator(purpose).random() for purpose in ("estimate", "scene", "demo")}
    assert len(numbers) == 3


@settings(max_examples=40, deadline=None)
@given(st.sampled_from([SHELF, TABLE]), st.integers(0, 10**6))
def test_worlds_stand_free_on_their_places(scene, seed):
    world = scene.sample(seed)
    check_configuration(world)
    places = {place.name: place for place in world.places}
    for actor in world.objects:
        place = places[scene.objects[actor.name].on]
        local = poses.transform(poses.inverse(place.pose), np.array(actor.pose[:3]))
        assert local[2] == pytest.approx(actor.model().extent[2] / 2)
        assert np.all(np.abs(local[:2] - place.centre) < np.array(place.extent) / 2)
        assert 0.08 <= actor.mass <= 0.25 and 0.4 <= actor.friction <= 0.9
    assert len({actor.colour for actor in world.objects}) == len(world.objects)


def test_kinds_and_ranges_are_all_drawn():
    worlds = [TABLE.sample(seed) for seed in range(200)]
    assert {w.objects[0].kind for w in worlds} == {"box", "cylinder", "oval", "diamond"}
    x = np.array([w.objects[0].pose[:2] for w in worlds]) - [0.5, 0.0]
    assert np.all(np.abs(x) <= [0.08, 0.10])
    assert np.all(np.ptp(x, axis=0) > [0.14, 0.18])


def test_world_model():
    world = TABLE.sample(3)
    model = world.world_model(("left", "right"), 0.08)
    assert [o.name for o in model.objects] == ["target", "other"]
    assert set(model.places) == {"table", "mat"}
    assert model.object_index("other") == 1
    assert model.obstacles[0].fixture == "table"
    assert model.control_period == pytest.approx(0.05)
    with pytest.raises(InputError, match="did you mean 'target'"):
        model.object("targt")


def test_short_forms():
    scene = Scene(fixtures=["shelf"], objects={"cup": "on upper_board", "thing": "diamond on table"})
    assert scene.objects["cup"].kinds == ("cup",)
    assert scene.objects["thing"].kinds == ("diamond",)
    assert scene.fixtures == ("table", "shelf")
    assert scene.with_robot("other").robot == "other"


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: Scene(objects={"cup": "on upper_bord"}, fixtures=["shelf"]), "did you mean 'upper_board'"),
        (lambda: Scene(objects={"cup": "on upper_board"}), "not a place of the scene"),
        (lambda: Scene(objects={"cupp": "on table"}), "did you mean 'cup'"),
        (lambda: Scene(objects={"cup": "upper_board"}), "should read"),
        (lambda: Scene(fixtures=["shelff"]), "did you mean 'shelf'"),
        (lambda: Scene(objects={"cup": "on table"}, goal=Goal("cap", "table")), "did you mean 'cup'"),
        (lambda: Scene(objects={"cup": "on table"}, goal=Goal("cup", "tabel")), "did you mean 'table'"),
        (lambda: Scene(objects={"cup": "on table"}, disturbed="cap"), "did you mean 'cup'"),
    ],
)
def test_unknown_names_are_refused_with_the_nearest(made, words):
    with pytest.raises(InputError, match=words):
        made()


def test_a_place_that_is_too_small_is_said_so():
    crowd = {f"cup {i}": "cup on table" for i in range(12)}
    with pytest.raises(InputError, match="no free spot on 'table'"):
        Scene(objects=crowd).sample(0)


def test_overlaps_are_found():
    world = TABLE.sample(0)
    a, b = world.objects
    inside = dataclasses.replace(world, objects=(a, dataclasses.replace(b, pose=a.pose)))
    with pytest.raises(InputError, match=r"'other' and object 'target' overlap by [\d.]+ mm"):
        check_configuration(inside)
    sunk = dataclasses.replace(a, pose=(*a.pose[:2], a.pose[2] - 0.004, *a.pose[3:]))
    with pytest.raises(InputError, match=r"'target' and fixture 'table' overlap by 4\.0 mm"):
        check_configuration(dataclasses.replace(world, objects=(sunk,)))


def test_something_in_a_cup_does_not_overlap_it():
    world = Scene(objects={"cup": ObjectSpec(("cup",), on="table")}).sample(0)
    cup = world.objects[0]
    pea = dataclasses.replace(
        cup, name="pea", kind="box", size=(0.02, 0.02, 0.02), pose=(*cup.pose[:2], 0.02, 1.0, 0.0, 0.0, 0.0)
    )
    check_configuration(dataclasses.replace(world, objects=(cup, pea)))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"robot": 1}', json.dumps({"objects": [{}]})])
def test_json_that_is_no_world(text):
    with pytest.raises(InputError, match="not an actor configuration"):
        ActorConfiguration.from_json(text)


def test_cubes_have_equal_sides_and_refuse_others():
    sizes = ((0.02, 0.02, 0.02), (0.04, 0.04, 0.04))
    scene = Scene(objects={"cube": ObjectSpec("cube", on="table", size=sizes)})
    drawn = [scene.sample(seed).objects[0].size for seed in range(20)]
    assert all(len(set(size)) == 1 and 0.02 <= size[0] <= 0.04 for size in drawn)
    assert len({size[0] for size in drawn}) == 20
    oblong = Scene(objects={"die": ObjectSpec("cube", on="table", size=((0.02, 0.03, 0.04),) * 2)})
    with pytest.raises(InputError, match=r"die.*equal"):
        oblong.sample(0)
