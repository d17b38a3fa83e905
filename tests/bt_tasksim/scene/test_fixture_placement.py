"""Furniture that a scene puts elsewhere, several times, and not into other furniture."""

import numpy as np
import pytest

import bt_tasksim
from bt_tasksim.core.errors import FieldError, InputError
from bt_tasksim.scene.fixture_overlap import overlap
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.overlap import check_configuration
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.scene.specs import FixtureSpec, Goal

BINS = [
    "shelf",
    FixtureSpec("trash_bin", at=(0.35, -0.45), name="left"),
    FixtureSpec("trash_bin", at=(0.35, 0.45), yaw=0.5, name="right"),
]


def test_the_class_at_the_top_is_the_placement():
    assert bt_tasksim.Fixture is FixtureSpec


def test_the_same_fixture_twice_with_names_and_places_of_their_own():
    scene = Scene(fixtures=BINS, objects={"cup": "inside left"}, goals=[Goal("cup", inside="right")])
    world = scene.sample(0)
    check_configuration(world)
    assert [f.name for f in world.fixtures] == ["table", "shelf", "left", "right"]
    places = {place.name: place for place in world.places}
    assert set(places) == {"table", "lower_board", "upper_board", "left", "right"} == scene.place_names
    assert np.allclose(places["left"].pose, [0.35, -0.45, 0.01, 1, 0, 0, 0])
    assert np.allclose(places["right"].pose[3:], [np.cos(0.25), 0, 0, np.sin(0.25)])
    assert places["left"].fixture == "left" and world.objects[0].on == "left"


def test_other_places_are_called_by_both_names():
    shelf = load_fixture(FixtureSpec("shelf", at=(0.6, 0.2, 0.1), name="rack"))
    assert [p.name for p in shelf.places] == ["rack_lower_board", "rack_upper_board"]
    assert shelf.pose[:3] == (0.6, 0.2, 0.1) and shelf.pose[3:] == load_fixture("shelf").pose[3:]
    assert load_fixture(FixtureSpec("shelf")) == load_fixture("shelf")


@pytest.mark.parametrize(
    ("fixtures", "words"),
    [
        (["shelf", "trash_bin"], r"'shelf' and 'trash_bin' stand \d+ mm in one another"),
        (["trash_bin", FixtureSpec("trash_bin", at=(0.3, 0.4))], "'trash_bin' is there twice"),
        (["shelf", FixtureSpec("shelff")], "did you mean 'shelf'"),
    ],
)
def test_furniture_that_cannot_be(fixtures, words):
    with pytest.raises(FieldError, match=words):
        Scene(fixtures=fixtures)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"at": (1.0,)}, "'at' should be 2 or 3 numbers"),
        ({"at": 5}, "'at' should be 2 or 3 numbers"),
        ({"at": (0.0, float("nan"))}, "finite"),
        ({"yaw": 70.0}, "'yaw' should be at most"),
        ({"yaw": "a"}, "'yaw' should be a number"),
        ({"name": 5}, "'name' should be text"),
        ({"name": "a/b"}, "the name of a fixture"),
    ],
)
def test_placements_that_cannot_be(fields, words):
    with pytest.raises(InputError, match=words):
        FixtureSpec("shelf", **fields)


@pytest.mark.parametrize(("x", "expected"), [(0.22, 0.0), (0.215, 0.005), (0.3, 0.0)])
def test_the_depth_of_an_overlap(x, expected):
    bins = [load_fixture(FixtureSpec("trash_bin", at=(0.4 + shift, 0.0))) for shift in (0.0, x)]
    assert overlap(*bins) == pytest.approx(expected, abs=1e-9)
    assert overlap(load_fixture("table"), bins[0]) == pytest.approx(0.0, abs=1e-9)


def test_in_a_file(tmp_path):
    file = tmp_path / "scene.yaml"
    file.write_text(
        "fixtures:\n  - shelf\n  - {fixture: trash_bin, at: [0.35, -0.45], yaw: 0.1, name: left}\n  - tray\n"
        "objects:\n  cup: inside tray\n  box: {beside: cup, movable: true}\n"
        "  pea: {kind: cube, on: box, size: [0.03, 0.03, 0.03]}\n"
        "goals:\n  - {object: cup, inside: left}\n"
        "  - {object: box, on: lower_board, relation: anywhere, when: once}\n"
        "  - {object: pea, beside: box, distance: 0.2}\n"
    )
    scene = load_scene(file)
    assert scene.fixtures == ("table", "shelf", FixtureSpec("trash_bin", (0.35, -0.45), 0.1, "left"), "tray")
    assert scene.goals == (
        Goal("cup", inside="left"),
        Goal("box", on="lower_board", relation="anywhere", when="once"),
        Goal("pea", beside="box", distance=0.2),
    )
    assert {n: s.start for n, s in scene.objects.items()} == {
        "cup": ("inside", "tray"), "box": ("beside", "cup"), "pea": ("on", "box")
    }  # fmt: skip
    assert scene.objects["box"].movable


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("fixtures: [{fixture: shelff}]", r"line 1: .*did you mean 'shelf'"),
        ("fixtures: [{fixture: shelf, at: [1]}]", r"'fixtures\[0\].at' should be 2 or 3 numbers"),
        ("fixtures: [{at: [0, 1]}]", r"'fixtures\[0\].fixture' is missing"),
        (
            "objects: {cup: on table}\ngoals:\n- {object: cup, on: table}\n- {object: cup}",
            "line 4: .*names no place",
        ),
        ("objects: {cup: on table}\ngoals: [{object: cup, on: table, when: never}]", "when"),
        (
            "objects: {cup: on table}\ngoal: {object: cup, on: table}\ngoals: [{object: cup, on: table}]",
            "both are given",
        ),
        ("objects: {a: cube on b, b: cube on a}", "line 1: .*in a circle"),
    ],
)
def test_bad_files(tmp_path, text, words):
    file = tmp_path / "scene.yaml"
    file.write_text(text + "\n")
    with pytest.raises(InputError, match=words):
        load_scene(file)
