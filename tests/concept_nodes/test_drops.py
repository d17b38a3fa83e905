"""Into a container things fall where they come to lie low, and where what is to come finds room."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.concept_nodes.drops import GRID, WALL, _lying, drops, preferred_options
from bt_tasksim.concept_nodes.standing import HEADINGS, nearest_first, standing_height, standing_options
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.core import poses
from bt_tasksim.planning.room import Room
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.scene.outlines import hull

SIZE, MIDDLE = (0.2, 0.16), np.array([0.01, -0.02])


@pytest.fixture
def view(toy):
    """The toy's world."""
    return views(toy(Grasp("cup")).context.seen(ONE, np.zeros(1)))[0]


def container(view, size=SIZE, middle=MIDDLE, objects=("box",), **more):
    """A view of an open bin with a few known objects."""
    place = view.world.place("goal")
    bin_ = dataclasses.replace(place, name="bin", kind="bin", extent=size, centre=tuple(middle), height=0.08)
    world = dataclasses.replace(view.world, places={"bin": bin_, **more})
    return view._replace(world=world, objects={name: view.objects[name] for name in objects})


def put(view, name, x, y, z=0.02):
    """The same view with an object in the bin."""
    at = poses.transform(np.asarray(view.world.places["bin"].pose), np.array([x, y, z]))
    return view._replace(objects={**view.objects, name: poses.pose(at)})


def within(view, options):
    """Where in the bin ``(k, 3)`` they are."""
    return poses.localise(np.asarray(view.world.places["bin"].pose), options[:, :3])


def outline(view, name, pose):
    """Corners of an object's outline in the bin."""
    corners = poses.transform(pose, np.concatenate(pieces_of(view.model(name))))
    return hull(poses.localise(np.asarray(view.world.places["bin"].pose), corners)[:, :2])


def gap(view, name, pose, other):
    """Metres between an object at a pose and another one in the bin, from above; negative: it is on it."""
    lies = outline(view, other, view.objects[other])
    return float(Room(outline(view, name, pose), [lies]).gaps(np.zeros((1, 2)))[0])


def test_over_an_empty_one_it_is_over_the_middle_turned_least(view):
    empty = container(view)
    found = preferred_options(empty, "box", "bin", [0.05])
    assert len(found) == len(GRID) * HEADINGS
    assert np.allclose(within(empty, found[:1])[0, :2], MIDDLE)
    assert np.allclose(within(empty, found)[:, 2], standing_height(view.model("box")) + 0.05 + 0.08)
    angles = poses.angle_between(found[:, 3:], view.objects["box"][None, 3:])
    assert (np.diff(angles) > -1e-5).all()


def test_it_is_within_the_walls_however_it_is_turned(view):
    empty = container(view)
    half = np.array(SIZE) / 2 - WALL
    for pose in preferred_options(empty, "box", "bin"):
        assert (abs(outline(empty, "box", pose) - MIDDLE) <= half + 1e-6).all()


def test_what_is_long_goes_in_along_the_walls(view):
    long, wide, _ = view.model("box").extent
    narrow = container(view, size=(long + 0.03, wide + 0.03), middle=(0.0, 0.0))
    across = poses.quat_multiply(np.asarray(narrow.world.places["bin"].pose)[3:], poses.yaw(np.pi / 2))
    held = {"box": poses.pose(narrow.objects["box"][:3], across)}
    best = preferred_options(narrow._replace(objects=held), "box", "bin")[0]
    half = np.array([long, wide]) / 2 + 0.015
    assert (abs(outline(narrow, "box", best)) <= half + 1e-6).all()


def test_beside_what_is_in_it_rather_than_on_it(view):
    full = put(container(view), "cup", MIDDLE[0] + 0.04, MIDDLE[1] + 0.03)
    best = preferred_options(full, "box", "bin")[0]
    assert gap(full, "box", best, "cup") > 0.004
    assert within(full, best[None])[0, 0] < MIDDLE[0]


def test_where_all_is_taken_it_is_on_what_is_lowest(view):
    spot = dataclasses.replace(view.world.place("goal"), kind="spot", extent=(0.1, 0.3))
    at = poses.pose(poses.transform(np.asarray(spot.pose), np.array([-0.06, 0.0, 0.0])))
    marked = container(view, (0.16, 0.1), (0.0, 0.0), goal=dataclasses.replace(spot, pose=at))
    full = put(marked, "cup", 0.04, 0.0, z=-0.03)
    best = preferred_options(full, "box", "bin")[0]
    assert gap(full, "box", best, "cup") < 0.0
    assert within(full, best[None])[0, 0] > 0.0


def test_where_more_is_to_come_it_leaves_the_floor_for_that(view):
    model = view.model("box")
    side = 2.2 * max(model.extent[:2]) + 0.03
    small = container(view, size=(side, side), middle=(0.0, 0.0), objects=("box", "cup"))
    alone = preferred_options(small, "box", "bin")[0]
    assert np.allclose(within(small, alone[None])[0, :2], 0.0)
    shared = preferred_options(small, "box", "bin", later=["cup"])[0]
    assert np.linalg.norm(within(small, shared[None])[0, :2]) > 0.01
    fallen = put(small, "box", *within(small, shared[None])[0, :2])
    fallen = fallen._replace(
        objects={**fallen.objects, "box": poses.pose(fallen.objects["box"][:3], shared[3:])}
    )
    second = preferred_options(fallen, "cup", "bin")[0]
    assert gap(fallen, "cup", second, "box") > 0.004


def test_a_spot_that_is_marked_in_it_counts_as_taken(view):
    spot = dataclasses.replace(view.world.place("goal"), kind="spot")
    frame = np.asarray(spot.pose)
    at = poses.pose(poses.transform(frame, np.array([0.06, -0.05, 0.0])))
    marked = container(view, (0.3, 0.24), (0.0, 0.0), goal=dataclasses.replace(spot, pose=at))
    place = marked.world.places["bin"]
    best = drops(marked, "box", place)[0]
    assert within(marked, best[None])[0, :2] @ [1.0, -1.0] < 0.0, "on the other side"


def test_one_height_comes_after_the_other(view):
    empty = container(view)
    both = preferred_options(empty, "box", "bin", [0.02, 0.05])
    low, high = np.split(both, 2)
    assert np.allclose(high - low, [0, 0, 0.03, 0, 0, 0, 0])


def test_what_is_on_a_board_above_does_not_lie_in_it_and_what_leans_over_its_wall_does(view):
    empty = container(view)
    above = put(empty, "cup", MIDDLE[0], MIDDLE[1], z=0.5)
    assert np.allclose(within(above, preferred_options(above, "box", "bin")[:1])[0, :2], MIDDLE)
    half = max(view.model("cup").extent[:2]) / 2
    leaning = put(empty, "cup", MIDDLE[0] + SIZE[0] / 2 + 0.5 * half, MIDDLE[1])
    assert [each.name for each in _lying(leaning, "box", leaning.world.places["bin"])] == ["cup"]


def test_what_lies_there_already_is_not_to_come(view):
    full = put(container(view), "cup", MIDDLE[0] + 0.05, MIDDLE[1] + 0.04)
    bin_ = full.world.places["bin"]
    assert np.array_equal(drops(full, "box", bin_, ["cup"]), drops(full, "box", bin_))


def test_elsewhere_the_least_turned_come_first(view):
    expected = nearest_first(standing_options(view, "box", "goal", 0.05), view.objects["box"][3:])
    assert np.array_equal(preferred_options(view, "box", "goal", [0.05]), expected)
