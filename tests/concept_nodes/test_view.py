"""One world as a search looks at it: each row by itself, in any library, with names."""

import numpy as np
import pytest

from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.concept_nodes.view import host_numbers, views
from bt_tasksim.core import poses
from bt_tasksim.planning.surroundings import CLEAR_OF_OBJECTS


@pytest.fixture
def view(toy):
    """The toy's world."""
    stage = toy(Grasp("cup"))
    return views(stage.context.seen(ONE, np.zeros(1)))[0]


def test_it_has_what_is_observed_by_name(toy):
    stage = toy(Grasp("cup"))
    (found,) = views(stage.context.seen(ONE, np.zeros(1)))
    now, model = stage.world.now, stage.world.model
    assert np.array_equal(found.tool, now.tool_pose) and np.array_equal(found.arm, now.arm_position)
    assert np.array_equal(found.objects["box"], now.objects[model.object_index("box")])
    assert found.model("cup") == model.object("cup") and found.robot is stage.world.robot


def test_in_torch_it_is_the_same(toy):
    torch = pytest.importorskip("torch")
    import dataclasses

    from bt_tasksim.concept.seen import Seen

    seen = toy(Grasp("cup")).context.seen(ONE, np.zeros(1))
    fields = dataclasses.fields(type(seen.observation)) if dataclasses.is_dataclass(seen.observation) else ()
    names = [f.name for f in fields] or ["objects", "tool_pose", "arm_position", "hand_position", "contacts"]
    there = type("There", (), {n: torch.from_numpy(np.array(getattr(seen.observation, n))) for n in names})()
    known = seen.world.map(lambda values: torch.from_numpy(np.array(values)))
    (one,), (other,) = views(seen), views(Seen(there, known, seen.robot, seen.elapsed))
    assert np.array_equal(one.tool, other.tool) and np.array_equal(one.arm, other.arm)
    assert one.world is other.world and all(isinstance(v, np.ndarray) for v in other.objects.values())


def test_things_leave_out_what_is_named(view):
    assert {"cup", "box"} <= {thing.name for thing in view.things()}
    assert "cup" not in {thing.name for thing in view.things(["cup"])}
    near = {thing.name: thing.margin for thing in view.things(closer=0.5)}
    assert near["cup"] == pytest.approx(0.5 * CLEAR_OF_OBJECTS)


def test_what_is_held_lies_in_the_tool_as_it_now_does(view):
    held = view.held("cup")
    assert np.allclose(poses.multiply(view.tool, held.grip), view.objects["cup"])
    other = poses.pose([0.0, 0.0, 0.1])
    assert np.array_equal(view.held("cup", other).grip, other)


def test_a_finder_begins_where_the_arm_is(view):
    assert np.array_equal(view.finder().start, view.arm)


def test_numbers_that_differ_in_the_last_bit_are_the_same_to_a_search():
    value = np.array([0.1 + 0.2, 1.0])
    (one,), (other,) = host_numbers([value]), host_numbers([np.nextafter(value, 2.0)])
    assert np.array_equal(one, other) and np.allclose(one, value, atol=1e-9)


@pytest.mark.parametrize(("contacts", "gone"), [((False, False), True), ((True, True), False)])
def test_what_was_last_seen_in_the_air_is_in_nobodys_way_unless_it_is_held(toy, contacts, gone):
    stage = toy(Grasp("cup"))
    objects = stage.world.now.objects.copy()
    objects[stage.world.model.object_index("box"), :3] = stage.world.now.tool_pose[:3]
    stage.world.put(objects=objects, contacts=np.array(contacts))
    stage.look()
    (found,) = views(stage.context.seen(ONE, np.zeros(1)))
    assert ("box" in found.adrift) is gone
    assert ("box" in {thing.name for thing in found.things()}) is not gone
    assert "box" in {thing.name for thing in found.things(taken="box")}, "what is taken is always there"
