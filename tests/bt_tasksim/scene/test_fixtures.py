"""Bundled furniture, and furniture from a data file."""

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.scene.fixtures import Fixture, load_fixture
from bt_tasksim.scene.overlap import check_configuration
from bt_tasksim.scene.scene import Scene

BUNDLED = sorted(path.stem for path in asset("fixtures").glob("*.yaml"))


@pytest.mark.parametrize("name", BUNDLED)
def test_places_lie_on_solid_ground(name):
    fixture = load_fixture(name)
    assert fixture.name == name and fixture.boxes and fixture.places
    for place in fixture.places:
        point = np.array(place.position)
        tops = []
        for box in fixture.boxes:
            local = poses.transform(poses.inverse(np.array(box.pose)), point)
            half = np.array(box.size) / 2
            if np.all(np.abs(local[:2]) <= half[:2]):
                tops.append(local[2] - half[2])
        assert min(abs(t) for t in tops) < 1e-9, "the origin is on the top of a box"
        assert np.linalg.norm(place.access) == pytest.approx(1)
        assert np.all(np.abs(place.centre) <= np.array(place.extent) / 2)


@pytest.mark.parametrize("name", BUNDLED)
def test_free_height_is_free(name):
    fixture = load_fixture(name)
    for place in fixture.places:
        assert place.container == (place.kind == "bin")
        if place.container:
            continue
        for box in fixture.boxes:
            local = np.array(box.pose[:3]) - np.array(place.position)
            half = np.array(box.size) / 2
            if np.all(np.abs(local[:2]) < half[:2]) and local[2] > 0:
                assert local[2] - half[2] >= place.height - 1e-9


def test_moved_fixture_moves_its_places():
    shelf = load_fixture("shelf")
    turned = Fixture.from_data(
        {
            "name": "shelf",
            "pose": [1, 2, 0, *poses.yaw(np.pi / 2)],
            "boxes": [{"position": [0, 0, 0], "size": [1, 1, 1]}],
            "places": [
                {
                    "name": "a",
                    "kind": "board",
                    "position": [0.1, 0, 0.5],
                    "extent": [1, 1],
                    "access": [1, 0, 0],
                }
            ],
        }
    )
    place = turned.place_models()[0]
    assert place.pose[:3] == pytest.approx([1, 2.1, 0.5])
    assert place.access == pytest.approx([0, 1, 0], abs=1e-12)
    assert turned.boxes[0].look == "matte" and shelf.boxes[0].look == "wood"


@pytest.mark.parametrize(
    ("given", "meant"), [([0, 0, -2], (0, 0, -1)), ([0.6, 0, -0.8001], (0.6, 0, -0.8001))]
)
def test_a_direction_is_scaled_to_length_one_and_a_rounded_one_is_kept(given, meant):
    place = {"name": "p", "kind": "board", "position": [0, 0, 0], "extent": [1, 1], "access": given}
    found = Fixture.from_data({"name": "x", "boxes": [], "places": [{**place, "exit": [0, 3, 0]}]}).places[0]
    assert found.access == meant and found.exit == (0, 1, 0)


def test_an_unknown_kind_of_place_is_refused(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "name: x\nboxes: []\nplaces:\n"
        "  - name: p\n    kind: shelf\n    position: [0, 0, 0]\n    extent: [1, 1]\n"
    )
    with pytest.raises(InputError, match=r"line 5: 'places\[0\].kind'.*'board'"):
        load_fixture(str(file))


BOX = "{name: x, boxes: [{position: [0, 0, 0], size: [1, 1, 1], %s}], places: []}"
PLACE = "{name: x, boxes: [], places: [{name: p, kind: board, position: [0, 0, 0], %s}]}"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: x", "'boxes' is missing"),
        ("{", "line .: not YAML"),
        ("[]", "should be a mapping"),
        (
            "{name: x, boxes: [{position: [0, 0], size: [1, 1, 1]}], places: []}",
            r"'boxes\[0\].position'",
        ),
        (
            "{name: x, boxes: [{position: [0, 0, 0], size: [1, 0, 1]}], places: []}",
            r"'boxes\[0\].size\[1\]'",
        ),
        ("{name: x, pose: [0, 0, 0, 0, 0, 0, 0], boxes: [], places: []}", "unit quaternion"),
        ("{name: x, boxes: [{position: [0, 0, 0], size: [1, .nan, 1]}], places: []}", "finite"),
        ("{name: x, boxes: [{position: [0, 0, 0], size: [1, 1, 1], look: woood}], places: []}", "'wood'"),
        (BOX % "friction: .nan", r"'boxes\[0\].friction' should be a number that is finite"),
        (BOX % "friction: -1", r"'boxes\[0\].friction' should not be negative"),
        (BOX % "joint: hinge", r"unknown field 'boxes\[0\].joint'"),
        (BOX % "pose: [0, 0, 0, 1, 0, 0, 0]", "either 'position' or 'pose'"),
        (PLACE % "extent: [-1, 1]", r"'places\[0\].extent\[0\]' should be positive"),
        (PLACE % "extent: [1, 1], access: [0, 0, 0]", r"'places\[0\].access' should be a direction"),
        (PLACE % "extent: [1, 1], height: .nan", r"'places\[0\].height'"),
        (PLACE % "extent: [1, 1], clearance: .inf", r"'places\[0\].clearance'"),
        (PLACE % "extent: [1, 1], drawer: 1", r"unknown field 'places\[0\].drawer'"),
        ("{name: x, boxes: [], places: [], drawer: {}}", "unknown field 'drawer'"),
        ("{name: a/b, boxes: [], places: []}", "'name' should hold no '/'"),
    ],
)
def test_bad_fixture_files(tmp_path, text, words):
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=words):
        load_fixture(str(file))


def test_unknown_fixtures():
    with pytest.raises(InputError, match="did you mean 'trash_bin'"):
        load_fixture("trashbin")
    with pytest.raises(InputError, match="no fixture file"):
        load_fixture("nowhere.yaml")


def test_the_former_name_of_a_place_is_the_same_class():
    from bt_tasksim.scene import fixtures

    assert fixtures.Place is fixtures.FixturePlace
    with pytest.raises(AttributeError):
        _ = fixtures.Places


def test_furniture_may_be_no_more_than_places(tmp_path):
    file = tmp_path / "desk.yaml"
    file.write_text(
        "name: desk\nboxes: []\nplaces:\n"
        "  - {name: desk, kind: table, position: [0.5, 0, 0], extent: [0.4, 0.3]}\n"
    )
    scene = Scene(fixtures=["table", str(file)], objects={"cup": "cup on desk"})
    check_configuration(scene.sample(0))
