"""Furniture that is made by numbers: what worlds draw, what is refused, and how scene files say it."""

import numpy as np
import pytest

from bt_tasksim.core.errors import FieldError, InputError
from bt_tasksim.core.registry import parts
from bt_tasksim.scene.fixture_maker import FixtureMaker
from bt_tasksim.scene.fixture_overlap import overlap
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.outlines import TOUCHING
from bt_tasksim.scene.overlap import check_configuration
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.scene.specs import FixtureSpec

MADE = sorted(name for name, found in parts("fixture").items() if isinstance(found, type))


@pytest.mark.parametrize("name", MADE)
def test_worlds_differ_and_seeds_repeat(name):
    scene = Scene(fixtures=[name])
    worlds = [scene.sample(seed) for seed in (0, 1, 0)]
    assert worlds[0].to_json() == worlds[2].to_json() != worlds[1].to_json()
    assert scene.sample(0, "training").fixtures != worlds[0].fixtures
    for world in worlds[:2]:
        check_configuration(world)
        again = type(world).from_json(world.to_json())
        assert again.objects == world.objects and again.fixtures == world.fixtures
        moving = {part.name: part.joint.fixture for part in world.objects if part.joint is not None}
        assert scene.object_names == list(moving) and set(moving.values()) <= {name}
        assert {place.name for place in world.places} == scene.place_names


@pytest.mark.parametrize("name", MADE)
def test_a_parameter_that_is_given_leaves_the_others_as_they_were(name):
    free, fixed = (
        Scene(fixtures=[FixtureSpec(name, parameters=given)]).sample(3) for given in ({}, {"x": 0.5})
    )
    assert fixed.fixtures[1].pose[0] == 0.5 and fixed.fixtures[1].boxes == free.fixtures[1].boxes
    assert [part.size for part in fixed.objects] == [part.size for part in free.objects]


@pytest.mark.parametrize("name", MADE)
def test_every_parameter_says_what_it_is_and_in_which_unit(name):
    maker = parts("fixture")[name]
    assert issubclass(maker, FixtureMaker)
    for field_name, field in maker.model_fields.items():
        assert field.description, field_name
        if field.annotation is float:
            words = (
                field.description.rstrip(".").replace(":", " ").replace(",", " ").replace(";", " ").split()
            )
            assert {"m", "rad", "kg", "N", "Nm", "N/m", "Nm/rad"} & set(words), field_name


def test_ranges_are_drawn_between_and_words_chosen():
    spec = FixtureSpec("door", parameters={"radius": (0.3, 0.4), "side": ["left", "right"], "mass": 2})
    scene = Scene(fixtures=[spec])
    doors = [scene.sample(seed).objects[0] for seed in range(12)]
    radii = [abs(door.grasps[0].point[1] - door.joint.origin[1]) for door in doors]
    assert 0.3 <= min(radii) < 0.33 and 0.37 < max(radii) <= 0.4
    assert {door.joint.axis[2] for door in doors} == {-1.0, 1.0}
    assert {door.mass for door in doors} == {2.0}


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"radus": 0.3}, "did you mean 'radius'"),
        ({"radius": 0.01}, "'radius' should be at least 0.08, found 0.01"),
        ({"radius": (0.3, 9.0)}, "'radius' should be at most 0.7"),
        ({"radius": (0.3, 0.2)}, "the lower one first"),
        ({"radius": "wide"}, "'radius' should be a number"),
        ({"side": "up"}, "'side' should be 'left' or 'right'"),
        ({"side": ["left", "up"]}, "'side' should be 'left' or 'right'"),
        ({"handle_height": 0.6}, r"its handle is 0.60 m above the table, and its door has room"),
        ({"value": 1.0, "opens": 0.5}, "at the start, should be between 0 and 0.5 rad"),
    ],
)
def test_doors_that_cannot_be_are_refused_in_one_sentence(parameters, words):
    with pytest.raises(FieldError, match=words) as refused:
        Scene(fixtures=[FixtureSpec("door", parameters=parameters)])
    assert "\n" not in str(refused.value)


def test_what_is_as_its_file_says_takes_no_parameters():
    with pytest.raises(FieldError, match="'shelf' is as it is, and has no parameters"):
        Scene(fixtures=[FixtureSpec("shelf", parameters={"width": 0.5})])
    with pytest.raises(InputError, match="parameters"):
        FixtureSpec("door", parameters={"radius": (0.1, 0.2, 0.3)})


def test_what_is_made_is_made_again_until_it_is_free():
    door = FixtureSpec("door", parameters={"radius": (0.1, 0.4)}, area=(0.02, 0.02))
    scene = Scene(fixtures=[FixtureSpec("drawer", at=(0.62, 0.32)), door])
    doors = []
    for seed in range(12):
        world = scene.sample(seed)
        doors.append(world.fixtures[2])
        assert overlap(world.fixtures[1], doors[-1]) <= TOUCHING
    assert np.ptp([door.pose[0] for door in doors]) > 0.01


def test_names_and_places_of_two():
    two = [
        FixtureSpec("door", at=(0.6, 0.3), name="left"),
        FixtureSpec("door", at=(0.6, -0.3), yaw=-0.5, name="right", sensed=True),
    ]
    scene = Scene(fixtures=two, objects={"cup": "on left_cabinet"})
    world = scene.sample(0)
    assert scene.object_names == ["cup", "left", "right"]
    assert {"left_cabinet", "right_cabinet"} < scene.place_names
    assert [o.joint.sensed for o in world.objects[1:]] == [False, True]
    assert np.allclose(world.fixtures[2].pose[3:], [np.cos(0.25), 0, 0, -np.sin(0.25)])
    assert world.objects[1].joint.friction != world.objects[2].joint.friction


def test_scene_files_give_parameters(tmp_path):
    file = tmp_path / "scene.yaml"
    text = (
        "fixtures:\n"
        "  - {fixture: door, name: pantry, parameters: {radius: [0.25, 0.3], side: left}}\n"
        "objects:\n  cup: {on: pantry_cabinet}\n"
        "goal: {object: pantry, relation: open, value: 1.0}\n"
    )
    file.write_text(text)
    door = load_scene(file).sample(4).objects[1]
    assert door.name == "pantry" and door.joint.axis[2] == -1.0
    file.write_text(text.replace("[0.25, 0.3]", "[0.25, 3]"))
    with pytest.raises(InputError, match=r"line 2: .*'radius' should be at most 0.7, found 3"):
        load_scene(file)
    file.write_text(text.replace("radius", "radus"))
    with pytest.raises(InputError, match="did you mean 'radius'"):
        load_scene(file)


def test_the_middle_stands_for_all():
    assert load_fixture("door") == load_fixture(FixtureSpec("door"))
