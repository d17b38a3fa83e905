"""Grasp: each world as alone, the right pose, and why it fails."""

import math

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.concept_nodes.grasp import CLOSED_ON_NOTHING, PUSHED_AWAY, TIPPED_OVER, TOO_WIDE
from bt_tasksim.concept_nodes.grasp_features import ALONG, SCALE
from bt_tasksim.concept_nodes.grasp_pose import grasp_pose
from bt_tasksim.concept_nodes.limits import WRIST_STRAINED
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import CANNOT_START, DONE, LIMIT_VIOLATED, TIMED_OUT


def test_each_world_is_treated_as_alone(situations, functions):
    for name in functions:
        if name == "maintained":  # it maintains nothing
            continue
        answers = situations(Grasp, "pick_and_place").check(name, tolerance=1e-7)  # a root of nearly nothing
        if name in ("done", "violated", "necessary_cost"):
            assert len({float(a[0]) for a in answers}) > 1, f"the situations should differ in {name}"


def view(toy, tree):
    return toy(tree).context.seen(ONE, np.zeros(1))


def test_the_pose_is_over_the_object_across_its_narrow_side(toy):
    seen = view(toy, Grasp("box"))
    pose, model = seen.object("box")[0], seen.model("box")
    tool = grasp_pose(seen, "box")[0]
    assert np.allclose(tool[:2], pose[:2], atol=1e-9)
    z, y = (poses.rotate(tool[3:], np.eye(3)[i]) for i in (2, 1))
    assert np.allclose(z, [0, 0, -1], atol=1e-9)
    axis = poses.rotate(pose[3:], model.grasp_axes[0, 0])
    assert abs(y @ axis) == pytest.approx(1.0)
    assert tool[2] == pytest.approx(pose[2] + max(0.0, model.extent[0, 2] / 2 - seen.robot.depth))


@pytest.mark.parametrize("approach", [(0, 0, -1), (1, 0, 0), (math.sqrt(0.5), 0, -math.sqrt(0.5))])
def test_an_approach_is_obeyed(toy, approach):
    seen = view(toy, Grasp("cup", approach=approach))
    tool = grasp_pose(seen, "cup", approach)
    assert np.allclose(poses.z_axis(tool[:, 3:]), [approach], atol=1e-9)


def test_closing_axis_and_standoff_are_obeyed(toy):
    leaf = Grasp("box", closing=(0, 1, 0), standoff=0.2)
    seen = view(toy, leaf)
    memory = leaf.model.begin(seen)
    goal, table = memory.goal[0], memory.path.table[0]
    y = poses.rotate(goal[3:], np.array([0.0, 1, 0]))
    assert abs(y @ poses.rotate(seen.object("box")[0, 3:], np.array([0.0, 1, 0]))) == pytest.approx(1.0)
    near = table[np.linalg.norm(table[:, :3] - goal[:3], axis=-1) < 0.17]
    assert len(near) > 3 and np.allclose(near[:, :2], goal[:2], atol=1e-4), "the last 0.17 m are straight"
    assert (
        np.allclose(table[-1, :3], goal[:3], atol=1e-6)
        and poses.angle_between(table[-1, 3:], goal[3:]) < 1e-4
    )


def test_the_usual_grasp_of_a_tall_object_that_stands_free_is_taken(toy):
    """The Panda's palm is some 37.5 mm above the fingertips, and these reach 35 mm below the object's top."""
    seen = view(toy, Grasp("box"))
    assert np.allclose(Grasp.value("box").begin(seen).goal, grasp_pose(seen, "box"), atol=1e-8)


def test_a_closing_axis_that_was_given_is_kept_where_the_first_choice_does_not_serve(toy):
    """The box is 74 mm wide there, the hand opens 80 mm, and 3 mm are kept clear on each side."""
    leaf = Grasp("box", closing=(1, 0, 0))
    seen = view(toy, leaf)
    try:
        goal = leaf.model.begin(seen).goal[0]
    except NoWayError:
        return
    y = poses.rotate(goal[3:], np.array([0.0, 1, 0]))
    assert abs(y @ poses.rotate(seen.object("box")[0, 3:], np.array([1.0, 0, 0]))) == pytest.approx(1.0)


@pytest.mark.parametrize("wrong", [-0.015, 0.01, 0.02])
def test_the_programmed_grasp_believes_the_support_and_not_an_estimate_above_or_below_it(toy, wrong):
    """A wrong height of the estimate leaves the hand where it goes without that error."""
    heights = []
    for error in (0.0, wrong):
        leaf = Grasp("box", policy="programmed")
        stage = toy(leaf)
        objects = stage.world.now.objects.copy()
        objects[stage.world.model.object_index("box"), 2] += error
        stage.world.put(objects=objects)
        stage.look()
        while stage.tick() == Status.RUNNING and leaf.memory.closing[0] < 0.0:
            pass
        heights.append(float(stage.world.now.tool_pose[2]))
    assert heights[1] == pytest.approx(heights[0], abs=0.001)


def test_an_object_wider_than_the_hand_is_refused_with_both_widths(toy):
    from bt_tasksim.scene.scene import Scene
    from bt_tasksim.scene.specs import ObjectSpec

    wide = ObjectSpec(("box",), on="table", size=((0.11, 0.11, 0.11), (0.11, 0.11, 0.11)))
    stage = toy(Grasp("box"), Scene(objects={"box": wide}))
    assert stage.tick() == Status.FAILURE
    assert stage.tree.outcome.is_a(CANNOT_START) and stage.tree.outcome.is_a(TOO_WIDE)
    assert stage.tree.outcome.cause.numbers == pytest.approx({"width": 0.11, "opening": 0.08})


def test_done_only_after_contacts_on_both_sides_and_a_still_hand(toy):
    leaf = Grasp("cup", timeout=30)
    stage = toy(leaf)
    assert stage.tick(400) == Status.FAILURE  # the toy hand closes on nothing
    limit = leaf.outcome.cause
    assert leaf.outcome.is_a(LIMIT_VIOLATED) and limit.is_a(CLOSED_ON_NOTHING)
    assert limit.numbers == {"value": 1.0, "limit": 0.97}
    assert limit.detail.numbers["closure"] == 1.0
    assert limit.detail.names["contact"] == "no contact"

    for contacts, status in (([True, False], Status.FAILURE), ([True, True], Status.SUCCESS)):
        leaf = Grasp("cup", timeout=6)
        stage = toy(leaf)
        step = stage.world.step

        def grip(command, step=step, stage=stage, contacts=contacts):
            step(command)
            if stage.world.now.closure > 0.5:
                stage.world.put(closure=np.float64(0.5), contacts=np.array(contacts))
            return stage.world.now

        stage.world.step = grip
        assert stage.tick(400) == status, leaf.feedback_message
        measured = leaf.outcome.detail
        assert measured.numbers["closure"] == 0.5
        if status == Status.SUCCESS:
            assert leaf.outcome.is_a(DONE) and measured.names["contact"] == "contact at left, right"
            assert stage.context.reached("holding", "cup", ONE)
        else:
            assert leaf.outcome.is_a(TIMED_OUT) and measured.names["contact"] == "contact at left"
            assert not stage.context.reached("holding", "cup", ONE)


@pytest.mark.parametrize(
    ("reason", "changed", "value", "limit"),
    [
        (WRIST_STRAINED, {"wrench": np.array([0, 0, 71.0, 0, 0, 0])}, 71.0, 60.0),
        (PUSHED_AWAY, {"move": [0.1, 0, 0, 0, 0, 0, 0]}, 0.1, 0.06),
        (TIPPED_OVER, {"turn": 0.4}, 0.4, math.radians(20.0)),
    ],
)
def test_each_limit_says_which_it_is_and_by_how_much(toy, reason, changed, value, limit):
    leaf = Grasp("cup")
    stage = toy(leaf)
    stage.tick(3)
    objects, i = stage.world.now.objects.copy(), stage.world.model.object_index("cup")
    objects[i] += changed.get("move", 0.0)
    if "turn" in changed:
        half = changed["turn"] / 2
        turn = np.array([math.cos(half), math.sin(half), 0.0, 0.0])
        objects[i, 3:] = poses.quat_multiply(turn, objects[i, 3:])
    stage.world.put(objects=objects, **{k: v for k, v in changed.items() if k == "wrench"})
    stage.look()
    assert stage.tick() == Status.FAILURE
    assert leaf.outcome.is_a(LIMIT_VIOLATED) and leaf.outcome.cause.reason == reason
    assert leaf.outcome.cause.numbers == pytest.approx({"value": value, "limit": limit})


@pytest.mark.parametrize(("turn", "status"), [(0.3, Status.RUNNING), (0.5, Status.FAILURE)])
def test_what_is_held_may_turn_farther_in_the_hand_than_what_would_fall(toy, turn, status):
    stage = toy(Grasp("cup"))
    stage.tick(3)
    objects, i = stage.world.now.objects.copy(), stage.world.model.object_index("cup")
    turned = np.array([math.cos(turn / 2), math.sin(turn / 2), 0.0, 0.0])
    objects[i, 3:] = poses.quat_multiply(turned, objects[i, 3:])
    stage.world.put(objects=objects, contacts=np.array([1, 1]))
    stage.look()
    assert stage.tick() == status


@pytest.mark.parametrize(
    ("touched", "status"), [(([1, 0], [0, 1]), Status.RUNNING), (([1, 0], [1, 0]), Status.FAILURE)]
)
def test_what_both_sides_have_touched_may_turn_while_contacts_flicker(toy, touched, status):
    stage = toy(Grasp("cup"))
    step, ticks = stage.world.step, []

    def turning(command):
        step(command)
        if stage.world.now.closure > 0.3 and len(ticks) < 3:
            ticks.append(None)
            contacts = np.array((*touched, [0, 0])[len(ticks) - 1], bool)
            changes = {"contacts": contacts, "closure": np.float64(0.31)}
            if len(ticks) == 3:
                objects, i = stage.world.now.objects.copy(), stage.world.model.object_index("cup")
                turned = np.array([math.cos(0.2), math.sin(0.2), 0.0, 0.0])
                changes["objects"] = np.array(objects)
                changes["objects"][i, 3:] = poses.quat_multiply(turned, objects[i, 3:])
            stage.world.put(**changes)
        return stage.world.now

    stage.world.step = turning
    while len(ticks) < 3:
        assert stage.tick() == Status.RUNNING
    stage.look()
    assert stage.tick() == status


@pytest.mark.parametrize("approach", [(1.0, 0.0, 0.0), (0.0, 0.0, -1.0)])
def test_a_wrong_height_is_corrected_whichever_way_the_hand_comes(toy, approach):
    leaf = Grasp("cup", approach=approach)
    stage = toy(leaf)
    ends = []
    for wrong in (0.0, 0.004):
        objects, i = stage.world.now.objects.copy(), stage.world.model.object_index("cup")
        objects[i, 2] += wrong
        stage.world.put(objects=objects)
        stage.look()
        memory = leaf.model.begin(stage.context.seen(ONE, np.zeros(1)))
        along = float(memory.middle[0, ALONG]) * SCALE[ALONG]
        ends.append(memory.path.table[0, -1, :3] + along * poses.z_axis(memory.goal[0, 3:]))
    assert np.allclose(ends[0], ends[1], atol=1e-4)


def test_an_unknown_object_is_named(toy):
    from bt_tasksim.core.errors import InputError

    with pytest.raises(InputError, match="no object 'cupp' in the scene; did you mean 'cup'"):
        toy(Grasp("cupp")).tick()


@pytest.mark.parametrize("closing", [(0.0, 0.0, 1.0), (0.7071, 0.7071, 0.0)])
def test_what_was_given_and_cannot_be_had_is_counted_and_not_ignored(toy, closing):
    leaf = Grasp("box", approach=(0.0, 0.0, -1.0), closing=closing)
    with pytest.raises(NoWayError, match=r"\d+ that do not have the approach and the closing axis given"):
        leaf.model.begin(view(toy, leaf))
