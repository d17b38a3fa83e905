"""What stands around in a world: furniture and objects where they are seen, with margins."""

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.world import Obstacle, WorldModel
from bt_tasksim.planning.surroundings import (
    CLEAR_OF_FURNITURE,
    CLEAR_OF_OBJECTS,
    adrift,
    pieces_of,
    things_of,
)
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.shapes import ShapeSize, object_model
from bt_tasksim.scene.specs import FixtureSpec


@pytest.fixture
def world():
    """A board, and two boxes."""
    models = tuple(
        object_model(name, "box", ShapeSize((0.05, 0.06, 0.1), (1.0, 1.0), None)) for name in ("a", "b")
    )
    board = Obstacle(poses.pose([0.5, 0.0, 0.2]), (0.5, 0.5, 0.02), "shelf")
    return WorldModel(models, {}, ("l", "r"), 0.08, 0.05, (board,))


AT = poses.pose([0.4, 0.1, 0.05])


def test_furniture_and_objects_have_their_margins(world):
    board, a, b = things_of(world, {"a": AT, "b": AT})
    assert (board.name, board.size, board.margin) == ("shelf", (0.5, 0.5, 0.02), CLEAR_OF_FURNITURE)
    assert [a.name, b.name] == ["a", "b"] and a.margin == CLEAR_OF_OBJECTS
    assert np.array_equal(a.pose, AT)


def test_closer_scales_all_margins(world):
    usual, near = things_of(world, {"a": AT}), things_of(world, {"a": AT}, closer=0.7)
    assert [t.margin for t in near] == pytest.approx([0.3 * t.margin for t in usual])
    assert all(t.margin == 0.0 for t in things_of(world, {"a": AT}, closer=1.0))


def test_what_was_never_seen_is_left_out_and_rotations_are_made_whole(world):
    things = things_of(world, {"a": np.full(7, np.nan), "b": AT * [1, 1, 1, 2, 1, 1, 1]})
    assert [t.name for t in things] == ["shelf", "b"]
    assert np.linalg.norm(things[-1].pose[3:]) == pytest.approx(1.0)


@pytest.mark.parametrize("kind", ["box", "cylinder", "cup", "oval", "diamond"])
def test_pieces_lie_within_the_extent_and_reach_its_sides(kind):
    model = object_model("thing", kind, ShapeSize((0.05, 0.05, 0.1), (1.0, 1.0), None))
    corners = np.concatenate(pieces_of(model))
    assert np.allclose(corners.max(axis=0), np.array(model.extent) / 2, atol=2e-3)
    assert np.allclose(corners.min(axis=0), -np.array(model.extent) / 2, atol=2e-3)


@pytest.mark.parametrize(
    ("height", "gone"), [(0.26, False), (0.28, False), (0.33, True), (0.1, True), (0.2, False)]
)
def test_what_nothing_is_below_is_adrift(world, height, gone):
    seen = {"a": poses.pose([0.5, 0.0, height])}
    assert (adrift(things_of(world, seen), ["a"]) == {"a"}) is gone


def test_what_stands_on_another_object_is_not_adrift_and_beside_it_it_is(world):
    below = poses.pose([0.5, 0.0, 0.26])
    on, beside = poses.pose([0.51, 0.0, 0.36]), poses.pose([0.6, 0.0, 0.36])
    assert not adrift(things_of(world, {"a": on, "b": below}), ["a", "b"])
    assert adrift(things_of(world, {"a": beside, "b": below}), ["a", "b"]) == {"a"}
    assert not adrift(things_of(world, {"a": beside, "b": below}), [])


def test_a_drawer_stands_in_the_way_as_far_as_it_is_open_and_a_hand_may_reach_into_it():
    drawn = Scene(fixtures=[FixtureSpec("drawer", parameters={"value": 0.15, "opens": 0.2})]).sample(2)
    (part,) = drawn.objects
    *_, drawer = things_of(drawn.world_model(["l", "r"], 0.08), {"drawer": np.array(part.pose)})
    boxes = [(np.min(c, axis=0), np.max(c, axis=0)) for c in drawer.pieces]
    assert drawer.margin == CLEAR_OF_OBJECTS and len(boxes) == len(part.boxes)
    for box in part.boxes:
        middle = np.array(box.pose[:3])
        assert any(np.all((low < middle) & (middle < high)) for low, high in boxes)
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    within = (low + high) / 2
    assert not any(np.all((low < within) & (within < high)) for low, high in boxes)
