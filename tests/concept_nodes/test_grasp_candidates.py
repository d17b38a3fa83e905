"""Grasps that may be tried: across where an object may be held, the likeliest first; the order learns."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.concept_nodes.grasp_candidates import (
    AROUND,
    HOLD,
    PAD,
    STEEPEST,
    THIN,
    TIGHT,
    Candidates,
    across,
    candidates,
    narrowest_grip,
)
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.core import poses
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.grips import WIDER, GivenGrip

DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture
def view(toy):
    """The toy's world."""
    return views(toy(Grasp("cup")).context.seen(ONE, np.zeros(1)))[0]


def found_of(view, name="box"):
    return candidates(view, name, DOWN, view.tool[3:])


def with_grips(view, *grips, name="box", firmness=1.0, **changes):
    """The view with an object that may be held so alone: pairs of a middle's height and a width, along y."""
    given = tuple(
        GivenGrip((0.0, 0.0, height), (0.0, 1.0, 0.0), width, firmness=firmness) for height, width in grips
    )
    model = view.model(name)
    return with_model(view, model, solid=dataclasses.replace(model.solid, given=given), **changes)


def with_model(view, model, **changes):
    others = [m for m in view.world.objects if m.name != model.name]
    objects = (*others, dataclasses.replace(model, **changes))
    return view._replace(world=dataclasses.replace(view.world, objects=objects))


def turned(*angles):
    """Tool poses at one point, turned by so much about their approach."""
    return np.array([poses.pose([0, 0, 0], poses.yaw(angle)) for angle in angles])


def in_order(found):
    return [float(2 * np.arctan2(tool[6], tool[3])) for tool in found]


# ---- the order --------------------------------------------------------------------------------------------


def test_the_least_costly_come_first_and_each_comes_once():
    found = Candidates(turned(0.3, 0.1, 0.2), np.array([2.0, 0.0, 1.0]), np.zeros(3))
    assert in_order(found) == pytest.approx([0.1, 0.2, 0.3])
    assert list(found) == []
    assert list(Candidates(np.zeros((0, 7)), np.zeros(0), np.zeros(0))) == []


def test_those_like_one_that_was_no_good_come_later():
    tools, costs = turned(0.0, 0.1, 0.2, 1.5, 1.6), np.array([0.0, 0.1, 0.2, 0.4, 0.5])
    assert in_order(Candidates(tools, costs, np.zeros(len(costs)))) == pytest.approx(
        [0.0, 0.1, 0.2, 1.5, 1.6]
    )
    found = Candidates(tools, costs, np.zeros(len(costs)))
    found.no_good(next(found))
    assert in_order(found) == pytest.approx([1.5, 1.6, 0.2, 0.1]), "the more alike, the later; none is lost"


def test_what_was_wrong_with_a_grasp_says_nothing_of_an_unlike_one():
    tools, costs = turned(0.0, 2.0, 2.1), np.array([0.0, 0.1, 0.2])
    found = Candidates(tools, costs, np.zeros(len(costs)))
    for _ in range(5):
        found.no_good(tools[0])
    assert in_order(found) == pytest.approx([2.0, 2.1, 0.0])


def test_those_of_a_mask_keep_their_order():
    found = Candidates(turned(0.3, 0.1, 0.2), np.array([2.0, 0.0, 1.0]), np.zeros(3))
    assert in_order(found.keeping(found.costs != 1.0)) == pytest.approx([0.1, 0.3])


# ---- what they are ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["box", "cup"])
def test_they_are_across_where_it_may_be_held_with_the_likeliest_first(view, name):
    found = found_of(view, name)
    assert len(found.tools) > 10 and np.all(np.diff(found.costs) >= 0.0)
    assert poses.z_axis(found.tools[0][3:]) @ DOWN > 0.9, "the usual direction comes first"
    assert np.allclose(np.linalg.norm(found.tools[:, 3:], axis=-1), 1.0)
    assert poses.z_axis(found.tools[:, 3:])[:, 2].max() <= STEEPEST + 1e-9, "no hand comes from below"
    axes = poses.rotate(view.objects[name][3:], view.model(name).solid.grips.closing)
    closing = poses.rotate(found.tools[:, 3:], np.array([0.0, 1.0, 0.0]))
    assert np.allclose(abs(closing @ axes.T).max(axis=1), 1.0), "fingers close as a grip says"


@pytest.mark.parametrize("axis", [(1.0, 0, 0), (0, 0, 1.0), (0.6, 0, 0.8)])
def test_directions_are_across_an_axis_all_around(axis):
    found = across(np.array(axis))
    assert found.shape == (AROUND, 3) and np.allclose(found @ np.array(axis), 0.0, atol=1e-12)
    assert np.allclose(np.linalg.norm(found, axis=-1), 1.0) and np.allclose(found.sum(axis=0), 0.0, atol=1e-9)


def test_what_is_wider_than_the_hand_opens_has_none(view):
    most = view.robot.opening - WIDER
    assert len(found_of(with_grips(view, (0.0, most - 1e-4))).tools)
    assert not len(found_of(with_grips(view, (0.0, most + 1e-4))).tools)


def test_nothing_is_known_of_what_has_no_solid(view):
    alone = with_model(view, view.model("box"), solid=None)
    assert not len(found_of(alone).tools) and narrowest_grip(alone, "box") == np.inf
    assert narrowest_grip(with_grips(view, (0.0, 0.05), (0.01, 0.03)), "box") == 0.03


def test_a_rounded_side_is_held_near_its_middle(view):
    """A hand that comes level reaches less deep; fingers that close before the middle squeeze a cup out."""
    view = view._replace(robot=dataclasses.replace(view.robot, depth=0.03))
    shallow = found_of(view, "cup")
    local = poses.localise(view.objects["cup"], shallow.tools[:, :3])
    radius = view.model("cup").extent[0] / 2
    level = abs(poses.z_axis(shallow.tools[:, 3:])[:, 2]) < 0.1
    beside = np.linalg.norm(local[level, :2], axis=1)
    assert np.all(beside < 0.6 * radius), "where a circle is nine tenths as wide as in its middle: 0.44"
    assert len(found_of(view).tools), "a box is as wide everywhere"


@pytest.mark.parametrize("height", [-0.02, 0.0, 0.02])
def test_a_mesh_is_held_near_its_grips_and_below_its_top(view, height):
    """Beside a grip of a mesh may be a hollow; a hand may reach a little less deep, and never above it."""
    mesh = with_grips(view, (height, 0.03), kind="mesh")
    found, pose = found_of(mesh), mesh.objects["box"]
    grip = poses.transform(pose, np.array([0.0, 0.0, height]))
    off = np.linalg.norm(found.tools[:, :3] - grip, axis=1)
    assert len(found.tools) and off.max() <= PAD + 1e-9
    assert off.min() == 0.0 and off.max() > 0.0
    top = pose[2] + mesh.model("box").extent[2] / 2
    above = found.tools[poses.z_axis(found.tools[:, 3:]) @ DOWN > 0.999]
    assert len(above) and np.all((top - above[:, 2] >= HOLD - 1e-9) | np.isclose(above[:, 2], grip[2]))


def test_a_simple_solid_is_held_as_deep_as_the_palm_allows(view):
    """A grip that is deeper below the top than fingers reach is taken higher up, however far."""
    low = -view.model("box").extent[2] / 2 + 0.002
    tall = with_grips(view, (low, 0.03))
    found = found_of(tall)
    above = found.tools[poses.z_axis(found.tools[:, 3:]) @ DOWN > 0.999]
    top = tall.objects["box"][2] + tall.model("box").extent[2] / 2
    assert len(above) and (top - above[:, 2]).max() <= view.robot.depth + 1e-9


# ---- what they cost ---------------------------------------------------------------------------------------


def cheapest(view, width):
    return float(found_of(with_grips(view, (0.0, width))).costs[0])


def test_thin_grips_and_tight_ones_cost_more(view):
    opening, easy = view.robot.opening, cheapest(view, 0.03)
    assert cheapest(view, 0.04) == pytest.approx(easy)
    thin = [cheapest(view, share * THIN) for share in (0.25, 0.5, 0.75, 1.0)]
    assert np.all(np.diff(thin) < -0.2) and thin[-1] == pytest.approx(easy)
    tight = [cheapest(view, opening - 2 * share * TIGHT) for share in (0.4, 0.6, 0.8, 1.0)]
    assert np.all(np.diff(tight) < -0.15) and tight[-1] == pytest.approx(easy)


def test_of_two_grips_the_easier_one_is_tried_first(view):
    half = view.model("box").extent[2] / 2
    for thin, easy in ((0.02, 0.015), (0.015, 0.02)):
        found = found_of(with_grips(view, (half - thin, 0.004), (half - easy, 0.03)))
        assert found.tools[0][2] == pytest.approx(view.objects["box"][2] + half - easy, abs=1e-6)


def test_less_firm_ones_cost_more(view):
    firm = found_of(with_grips(view, (0.0, 0.03))).costs
    less = found_of(with_grips(view, (0.0, 0.03), firmness=0.5)).costs
    assert np.all(less - firm > 0.3) and np.ptp(less - firm) < 1e-9


# ---- a jaw that swings ------------------------------------------------------------------------------------


def test_a_jaw_that_swings_prefers_what_is_narrow_and_holds_poorly_what_is_wide(view):
    swings = view._replace(robot=load_robot("so100"))
    wide, narrow = (found_of(with_grips(swings, (0.0, width))) for width in (0.05, 0.025))
    assert wide.poor.all() and not narrow.poor.any()
    assert wide.costs.min() > narrow.costs.min() + 0.3
    assert not found_of(with_grips(view, (0.0, 0.05))).poor.any()


def test_each_grasp_knows_how_wide_it_holds(view):
    found = found_of(with_grips(view, (0.0, 0.03), (0.0, 0.05)))
    assert set(found.widths.tolist()) == {0.03, 0.05}
    assert found.keeping(found.widths < 0.04).widths == pytest.approx(0.03)
