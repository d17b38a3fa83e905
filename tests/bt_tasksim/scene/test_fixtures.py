"""Bundled furniture, and furniture from a data file."""

import numpy as np
import pytest

from bt_tasksim import poses
from bt_tasksim.errors import InputError
from bt_tasksim.fixtures import Fixture, load_fixture
from bt_tasksim.resources import asset

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
        if place.kind == "bin":
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
    ("text", "words"),
    [
        ("name: x", "KeyError"),
        ("{", "Error"),
        ("[]", "AttributeError"),
        ("{name: x, boxes: [{position: [0, 0], size: [1, 1, 1]}], places: []}", "expected 7"),
        ("{name: x, boxes: [{position: [0, 0, 0], size: [1, 0, 1]}], places: []}", "three positive"),
        ("{name: x, pose: [0, 0, 0, 0, 0, 0, 0], boxes: [], places: []}", "unit quaternion"),
        ("{name: x, boxes: [{position: [0, 0, 0], size: [1, .nan, 1]}], places: []}", "finite"),
        ("{name: x, boxes: [{position: [0, 0, 0], size: [1, 1, 1], look: woood}], places: []}", "'wood'"),
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
