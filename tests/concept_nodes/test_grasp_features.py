"""What a learned grasp sees and does: as laid out, the same in batches, bounded in size and speed."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.checking.bundles import stacked
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes import Grasp, grasp_features
from bt_tasksim.concept_nodes.grasp_features import (
    ACROSS,
    ACTIONS,
    ALONG,
    BACK_RATE,
    CAREFUL,
    CLOSE,
    EAGER,
    HASTE,
    PERIOD,
    RATE,
    SCALE,
    TIME_SCALING,
)
from bt_tasksim.core import poses
from bt_tasksim.core.world import Observation

SCENARIOS = ("pick_and_place", "shelf_to_shelf")


@pytest.fixture(params=SCENARIOS)
def near(request, situations):
    return situations(Grasp, request.param)


def instant(near, k=0):
    s = near.single[k]
    return Seen(s.observation, near.world, near.robot, s.elapsed), s.memory


@pytest.mark.parametrize("name", ["features", "decides", "programmed_motion"])
def test_one_by_one_and_in_batches_are_the_same(near, name):
    near.check(name, tolerance=1e-6)  # a count of ticks over three is in single precision in torch


def test_an_action_in_batches_is_the_same_one_by_one(near):
    """With exploring actions, too: command and advance."""
    torch = pytest.importorskip("torch")
    from bt_tasksim.checking.bundles import different

    rng = np.random.default_rng(0)
    actions = rng.uniform(-1.5, 1.5, (len(near), len(ACTIONS)))
    for name in ("command", "advance"):
        one = []
        for s, action in zip(near.single, actions, strict=True):
            seen = Seen(s.observation, near.world, near.robot, s.elapsed)
            one.append(getattr(near.leaf, name)(action, seen, s.memory))
        for s, many in ((near.batch, actions), (near.torch, torch.from_numpy(actions))):
            seen = Seen(s.observation, near.world, near.robot, s.elapsed)
            answer = getattr(near.leaf, name)(many, seen, s.memory)
            assert not different(name, one, answer, len(near), 1e-9)


def test_carrying_an_action_out_is_its_command_and_its_memory(near):
    rng = np.random.default_rng(1)
    for k in range(len(near.single)):
        seen, memory = instant(near, k)
        action = rng.uniform(-1.0, 1.0, len(ACTIONS))
        command, after = near.leaf.carry_out(action, seen, memory)
        expected = near.leaf.command(action, seen, memory)
        assert np.array_equal(command.tool, expected.tool) and np.array_equal(command.hand, expected.hand)
        assert all(
            np.array_equal(a, b)
            for a, b in zip(after[1:], near.leaf.advance(action, seen, memory)[1:], strict=True)
        )


def test_features_are_as_long_as_the_layout_and_of_the_order_of_one(near):
    size = sum(Grasp.layout(near.robot).values())
    for k in range(near.real):
        found = grasp_features.features(*instant(near, k))
        assert found.shape == (size,) and np.isfinite(found).all()
        assert np.abs(found).max() < 60.0


def test_parts_of_the_features_stand_where_the_layout_says(near):
    seen, memory = instant(near, near.real - 1)
    layout, at, places = Grasp.layout(near.robot), 0, {}
    for name, size in layout.items():
        places[name] = slice(at, at + size)
        at += size
    found = grasp_features.features(seen, memory)
    assert np.array_equal(found[places["contacts"]], seen.contacts)
    assert np.allclose(found[places["offsets"]], memory.offset / np.array(SCALE))
    assert np.allclose(found[places["contacts so far"]], memory.touched)
    assert np.allclose(found[places["estimate"]], memory.estimate)
    local = poses.transform(poses.inverse(memory.goal), seen.tool[:3])
    assert np.allclose(found[places["tool from grasp pose"]][:3], local / 0.03)


def test_the_programmed_action_is_the_middle_of_an_action_at_the_reference_motions_pace(near):
    for k in range(near.real):
        seen, memory = instant(near, k)
        there = memory._replace(offset=memory.middle * np.array(SCALE))
        action = near.leaf.programmed_motion(seen, memory)
        assert np.allclose(offsets(action, seen, there), there.offset, atol=1e-12)
        assert scaling_of(action, seen, memory) == 1.0
    reference = poses.pose([0.4, 0.1, 0.2], poses.yaw(0.3))
    assert grasp_features.displaced(reference, np.zeros(CLOSE + 1)) is reference


def test_offsets_change_no_faster_than_their_rate_and_go_no_farther_than_their_scale(near):
    seen, memory = approaching(near)
    share = near.world.control_period / PERIOD
    memory = memory._replace(offset=np.zeros(CLOSE + 1), middle=np.zeros(CLOSE + 1))
    far = np.full(len(ACTIONS), 9.0)
    rate = share * np.array(RATE)
    assert np.allclose(offsets(far, seen, memory), rate)
    rate[ALONG] = share * BACK_RATE
    assert np.allclose(offsets(-far, seen, memory), -rate)
    for _ in range(60):
        memory = memory._replace(offset=offsets(far, seen, memory))
    assert np.allclose(memory.offset, SCALE)


def approaching(near, within=0.5, contact=0, behind=0.0):
    """An open hand ``within`` seconds of its straight approach, ``behind`` metres from where it should be,
    ``contact`` of its fingertips touching."""
    seen, memory = instant(near)
    tips = np.zeros(len(near.robot.tips), bool)
    tips[:contact] = True
    found = {f.name: getattr(seen.observation, f.name) for f in dataclasses.fields(Observation)}
    seen = Seen(Observation(**found | {"contacts": tips}), near.world, near.robot, memory.begins + within)
    ahead = poses.multiply(seen.tool, poses.pose([0.0, 0.0, behind], [1.0, 0.0, 0.0, 0.0]))
    return seen, memory._replace(target=ahead, closing=np.float64(-1.0), delay=np.float64(0.0))


def offsets(action, seen, memory):
    return grasp_features.moved_offset(action, grasp_features.met(action, seen, memory), seen, memory)


def scaling_of(action, seen, memory):
    return float(grasp_features.time_scaling(action, grasp_features.met(action, seen, memory), seen, memory))


def paced(scaling):
    action = np.zeros(len(ACTIONS))
    action[TIME_SCALING] = scaling
    return action


@pytest.mark.parametrize(
    ("asked", "share"),
    [(HASTE, 1.0), (99.0, 1.0), (0.0, CAREFUL), (1.0, CAREFUL + EAGER), (-1.0, CAREFUL - EAGER)],
)
def test_the_middle_of_the_pace_is_a_careful_approach(near, asked, share):
    seen, memory = approaching(near)
    assert scaling_of(paced(asked), seen, memory) == pytest.approx(share)
    after = near.leaf.advance(paced(asked), seen, memory)
    assert float(after.delay) == pytest.approx((1.0 - share) * near.world.control_period)
    before, _ = approaching(near, within=-0.1)
    assert scaling_of(paced(asked), before, memory) == 1.0


@pytest.mark.parametrize(
    ("contact", "behind", "stands"),
    [(1, 0.004, True), (1, 0.001, False), (0, 0.004, False), (1, -0.004, False)],
)
def test_a_hand_that_stands_on_something_goes_back(near, contact, behind, stands):
    seen, memory = approaching(near, contact=contact, behind=behind)
    memory = memory._replace(offset=np.zeros(CLOSE + 1), middle=np.zeros(CLOSE + 1))
    along = offsets(paced(0.0), seen, memory)[ALONG]
    assert bool(grasp_features.met(paced(0.0), seen, memory).stands) == stands
    assert along == pytest.approx(-BACK_RATE if stands else 0.0)
    assert scaling_of(paced(0.0), seen, memory) == (0.0 if stands else CAREFUL)
    assert not grasp_features.met(paced(HASTE), seen, memory).stands
    assert not grasp_features.met(paced(0.0), seen, memory._replace(closing=np.float64(0.1))).stands


def across(speed):
    action = paced(0.0)
    action[ACROSS] = speed
    return action


@pytest.mark.parametrize(
    ("contact", "behind", "closing", "searches"),
    [
        (1, 0.004, -1.0, True),
        (1, 0.0, -1.0, False),
        (1, 0.0, 0.1, True),
        (2, 0.0, 0.1, False),
        (0, 0.0, 0.1, False),
    ],
)
def test_a_search_aside_stays_where_it_has_come(near, contact, behind, closing, searches):
    seen, memory = approaching(near, contact=contact, behind=behind)
    zero = np.zeros(CLOSE + 1)
    memory = memory._replace(offset=zero, middle=zero, closing=np.float64(closing))
    action = across(-0.5)
    assert bool(grasp_features.met(action, seen, memory).searches) == searches
    after = near.leaf.advance(action, seen, memory)
    share = near.world.control_period / PERIOD
    expected = -0.5 * share * RATE[ACROSS] if searches else max(-0.25 * SCALE[ACROSS], -share * RATE[ACROSS])
    assert after.offset[ACROSS] == pytest.approx(expected)
    assert after.middle[ACROSS] * SCALE[ACROSS] == pytest.approx(expected if searches else 0.0)
    calm, _ = approaching(near)
    later = after._replace(closing=np.float64(-1.0), target=memory.target)
    stays = offsets(across(0.0), calm, later)[ACROSS]
    assert stays == pytest.approx(expected if searches else 0.0)
    hurried = action.copy()
    hurried[TIME_SCALING] = HASTE
    assert not grasp_features.met(hurried, seen, memory).searches


def test_fingers_come_as_slowly_as_the_pace_until_opposing_ones_touch(near):
    seen, memory = approaching(near, contact=1)
    memory = memory._replace(closing=np.float64(0.1), closed=np.float64(0.2))
    step = near.robot.hand_speed * near.world.control_period

    def closed(scaling, asked=1.0, seen=seen, tightening=1.0):
        found = grasp_features.closed(np.float64(scaling), np.float64(asked), tightening, seen, memory)
        return float(found)

    assert closed(0.25) == pytest.approx(0.2 + 0.25 * step)
    assert closed(0.25, asked=0.21) == 0.21 and closed(0.25, asked=0.1) == 0.1
    assert closed(1.0) == 1.0 and closed(0.0) == pytest.approx(0.2)
    both, _ = approaching(near, contact=len(near.robot.tips))
    assert closed(0.25, seen=both) == 1.0 and closed(0.0, seen=both) == 1.0
    assert closed(0.25, seen=both, tightening=0.1) == pytest.approx(0.2 + 0.1 * step)
    assert closed(1.0, seen=both, tightening=0.1) == 1.0


def test_displacements_are_in_the_tools_frame():
    reference = poses.pose(
        [0.4, 0.1, 0.2], poses.frame_from_axes(np.array([0.0, 0, -1]), np.array([0.0, 1, 0]))
    )
    offset = np.array([0.01, 0.02, 0.03, 0.2, 0.4])
    moved = grasp_features.displaced(reference, offset)
    local = poses.multiply(poses.inverse(reference), moved)
    assert np.allclose(local[:3], offset[:3])
    assert np.allclose(poses.rotation_vector(local[3:]), [0.0, 0.0, 0.2])
    many = grasp_features.displaced(stacked([reference, reference]), stacked([offset, 0.0 * offset]))
    assert np.allclose(many, [moved, reference])
