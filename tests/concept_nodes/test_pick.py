"""Pick: each world as alone, a straight way off the support, and what it says when it cannot."""

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept_nodes import Pick
from bt_tasksim.concept_nodes.holding import NOT_HELD
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import CANNOT_START, DONE


@pytest.mark.physical
@pytest.mark.parametrize("scenario", ["pick_and_place", "shelf_to_shelf"])
def test_each_world_is_treated_as_alone(situations, functions, scenario):
    answers = {name: situations(Pick, scenario).check(name) for name in functions}
    for name in ("done", "maintained", "necessary_cost", "sufficient_cost"):
        assert len({float(np.squeeze(a)) for a in answers[name]}) > 1, name


@pytest.mark.parametrize("direction", [(0, 0, 1), (0, 0.6, 0.8)])
def test_it_goes_straight_so_far_in_that_direction(toy, direction):
    leaf = Pick("cup", direction=direction, distance=0.15, speed=0.3)
    stage = toy(leaf)
    stage.world.hold("cup")
    stage.look()
    start = stage.world.now.tool_pose.copy()
    assert stage.tick(100) == Status.SUCCESS
    tools = np.array([c.tool for c in stage.world.steps])
    gap = tools[:, :3] - start[:3]
    along = gap @ np.array(direction, float)
    assert along[-1] == pytest.approx(0.15, abs=1e-3) and np.all(np.diff(along) >= -1e-12)
    assert np.abs(gap - np.outer(along, direction)).max() < 1e-9
    assert np.diff(along).max() / 0.05 < 0.3 * 1.05
    assert np.allclose(tools[:, 3:], start[3:]) and all(c.hand is None for c in stage.world.steps)
    assert leaf.outcome.is_a(DONE) and leaf.outcome.detail.numbers["tool_to_goal"] < 0.0005


def test_a_distance_below_zero_is_refused():
    with pytest.raises(InputError, match=r"'distance' .* should not be below 0"):
        Pick("cup", distance=-1)


def test_without_the_object_in_the_hand_it_cannot_start(toy):
    stage = toy(Pick("cup"))
    assert stage.tick() == Status.FAILURE
    assert stage.tree.outcome.is_a(CANNOT_START) and stage.tree.outcome.is_a(NOT_HELD)
    assert stage.tree.outcome.cause.names == {"object": "cup"}
    assert stage.context.command.tool is None


@pytest.mark.physical
def test_a_lift_is_free_of_its_support_and_in_the_hand(recorded_run):
    from bt_tasksim.concept.seen import Known

    decisions = [d for d in recorded_run("pick_and_place") if type(d.leaf.model) is Pick]
    cost = [
        float(d.leaf.model.sufficient_cost(Known(d.hidden, d.seen.world), d.memory)[0]) for d in decisions
    ]
    assert cost[0] == 10.0 and cost[-1] == 0.0


@pytest.mark.physical
def test_what_may_not_be_squeezed_costs_the_hands_force(recorded_run):
    from bt_tasksim.concept.seen import Known

    decision = [d for d in recorded_run("pick_and_place") if type(d.leaf.model) is Pick][-1]
    now = Known(decision.hidden, decision.seen.world)
    force = float(now.hand_force(decision.leaf.model.target)[0])
    assert force > 1.0
    for squeeze in (force / 2, force / 4):
        pick = Pick.value(decision.leaf.model.target, squeeze=squeeze)
        assert pick.sufficient_cost(now, decision.memory) == pytest.approx([force / squeeze])
    gentle = Pick.value(decision.leaf.model.target, squeeze=1000.0)
    assert gentle.sufficient_cost(now, decision.memory)[0] < 1.0


@pytest.mark.physical
def test_the_squeeze_counts_at_the_beginning_too(recorded_run):
    import dataclasses

    from bt_tasksim.concept.seen import Known

    decision = [d for d in recorded_run("pick_and_place") if type(d.leaf.model) is Pick][-1]
    hidden = decision.hidden
    harder = dataclasses.replace(hidden, hand_force=3.0 * hidden.hand_force)
    pick = Pick.value(decision.leaf.model.target, squeeze=float(hidden.hand_force[0, 0]))
    cost = pick.sufficient_cost(Known(hidden, decision.seen.world, harder), decision.memory)
    assert cost == pytest.approx([3.0])


def test_where_the_arm_cannot_go_straight_up_it_goes_towards_itself(toy, monkeypatch):
    from bt_tasksim.planning.ways import WayFinder

    straight = WayFinder.straight

    def within_reach(self, way, *args, **kwargs):
        far = np.linalg.norm(way[-1][:2]) > np.linalg.norm(way[0][:2]) - 0.005
        return None if far else straight(self, way, *args, **kwargs)

    monkeypatch.setattr(WayFinder, "straight", within_reach)
    stage = toy(Pick("cup", distance=0.1))
    stage.world.hold("cup")
    stage.look()
    start = stage.world.now.tool_pose.copy()
    assert stage.tick(100) == Status.SUCCESS
    gone = stage.world.steps[-1].tool[:3] - start[:3]
    assert gone[2] == pytest.approx(0.1, abs=1e-3)
    assert np.allclose(gone[:2] / 0.05, -start[:2] / np.linalg.norm(start[:2]), atol=0.02)
