"""What a learned grasp sees and does: as laid out, the same in batches, bounded in size and speed."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes import Grasp, grasp_features, grasp_programmed
from bt_tasksim.concept_nodes.grasp import PATIENCE
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
    PUSHING,
    RATE,
    SCALE,
    TIME_SCALING,
)
from bt_tasksim.concept_nodes.grasp_landing import SLOWEST, landing
from bt_tasksim.concept_nodes.grasp_programmed import FEELING, YIELDING
from bt_tasksim.concept_nodes.limits import gentler
from bt_tasksim.core import poses
from bt_tasksim.planning.reference_motion import sample
from bt_tasksim.robot.kinematics.hand import tips_in_tool

SCENARIOS = ("pick_and_place", "shelf_to_shelf")


@pytest.fixture(params=SCENARIOS)
def near(request, situations):
    return situations(Grasp, request.param)


def instant(near, k=0):
    at = near.asked(near.single[k])
    return at.seen, at.memory


@pytest.mark.parametrize("name", ["features", "decides", "programmed_motion"])
def test_each_world_is_treated_as_alone(near, name):
    near.check(name, tolerance=1e-6)  # a count of ticks over three is in single precision in torch


def test_an_action_in_a_batch_is_the_same_as_alone(near, rows_alike):
    """With exploring actions, too: command and advance."""
    torch = pytest.importorskip("torch")
    from bt_tasksim.checking.bundles import different

    actions = np.random.default_rng(0).uniform(-1.5, 1.5, (len(near), len(ACTIONS)))
    for name in ("command", "advance", "carry_out"):

        def ask(rows, situation=near.batch, actions=actions, name=name):
            at = near.asked(situation.at(rows))
            return getattr(near.model, name)(actions[rows], at.seen, at.memory)

        rows_alike(ask, len(near))
        one = [ask(np.array([k])) for k in range(len(near))]
        tensors = ask(torch.arange(len(near)), near.torch, torch.from_numpy(actions))
        assert not different(name, one, tensors, 1e-9, torch.Tensor)


def test_carrying_an_action_out_is_its_command_and_its_memory(near):
    rng = np.random.default_rng(1)
    for k in range(len(near.single)):
        seen, memory = instant(near, k)
        action = rng.uniform(-1.0, 1.0, (1, len(ACTIONS)))
        command, after = near.model.carry_out(action, seen, memory)
        expected = near.model.command(action, seen, memory)
        assert np.array_equal(command.tool, expected.tool) and np.array_equal(command.hand, expected.hand)
        assert all(
            np.array_equal(a, b)
            for a, b in zip(after[1:], near.model.advance(action, seen, memory)[1:], strict=True)
        )


def test_features_are_as_long_as_the_layout_and_of_the_order_of_one(near):
    size = sum(Grasp.layout(near.robot).values())
    for k in range(near.real):
        found = grasp_features.features(*instant(near, k))
        assert found.shape == (1, size) and np.isfinite(found).all()
        assert np.abs(found).max() < 60.0


def test_parts_of_the_features_stand_where_the_layout_says(near):
    seen, memory = instant(near, near.real - 1)
    layout, at, places = Grasp.layout(near.robot), 0, {}
    for name, size in layout.items():
        places[name] = slice(at, at + size)
        at += size
    (found,) = grasp_features.features(seen, memory)
    assert np.array_equal(found[places["contacts"]], seen.contacts[0])
    assert np.allclose(found[places["offsets"]], memory.offset[0] / np.array(SCALE))
    assert np.allclose(found[places["contacts so far"]], memory.touched[0])
    assert np.allclose(found[places["estimate"]], memory.estimate[0])
    local = poses.localise(memory.goal, seen.tool[:, :3])[0]
    assert np.allclose(found[places["tool from grasp pose"]][:3], local / 0.03)


def test_the_programmed_action_is_the_middle_of_an_action_at_the_reference_motions_pace(near):
    for k in range(near.real):
        seen, memory = instant(near, k)
        there = memory._replace(offset=memory.middle * np.array(SCALE))
        action = near.model.programmed_motion(seen, memory)
        assert np.allclose(offsets(action, seen, there), there.offset, atol=1e-12)
        if not (memory.tight[0] or landing(seen, memory).near[0]):
            assert scaling_of(action, seen, memory) == 1.0
    reference = poses.pose([0.4, 0.1, 0.2], poses.yaw(0.3))[None]
    assert np.array_equal(grasp_features.displaced(reference, np.zeros((1, CLOSE + 1))), reference)


def test_offsets_change_no_faster_than_their_rate_and_go_no_farther_than_their_scale(near):
    seen, memory = approaching(near)
    share = near.period / PERIOD
    memory = memory._replace(offset=np.zeros((1, CLOSE + 1)), middle=np.zeros((1, CLOSE + 1)))
    far = np.full((1, len(ACTIONS)), 9.0)
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
    tips = np.zeros((1, len(near.robot.tips)), bool)
    tips[:, :contact] = True
    observation = dataclasses.replace(near.single[0].observation, contacts=tips)
    seen = Seen(observation, seen.world, near.robot, memory.begins + within)
    ahead = poses.multiply(seen.tool, poses.pose([0.0, 0.0, behind], [1.0, 0.0, 0.0, 0.0]))
    return seen, memory._replace(target=ahead, closing=np.array([-1.0]), delay=np.zeros(1))


def offsets(action, seen, memory):
    return grasp_features.moved_offset(action, grasp_features.met(action, seen, memory), seen, memory)


def scaling_of(action, seen, memory):
    met = grasp_features.met(action, seen, memory)
    return float(grasp_features.time_scaling(action, met, seen, memory)[0])


def paced(scaling):
    action = np.zeros((1, len(ACTIONS)))
    action[:, TIME_SCALING] = scaling
    return action


@pytest.mark.parametrize(
    ("asked", "share"),
    [(HASTE, 1.0), (99.0, 1.0), (0.0, CAREFUL), (1.0, CAREFUL + EAGER), (-1.0, CAREFUL - EAGER)],
)
def test_the_middle_of_the_pace_is_a_careful_approach(near, asked, share):
    seen, memory = approaching(near)
    assert scaling_of(paced(asked), seen, memory) == pytest.approx(share)
    after = near.model.advance(paced(asked), seen, memory)
    assert after.delay == pytest.approx([(1.0 - share) * near.period])
    before, _ = approaching(near, within=-0.1)
    assert scaling_of(paced(asked), before, memory) == 1.0


@pytest.mark.parametrize(
    ("contact", "behind", "stands"),
    [(1, 0.004, True), (1, 0.001, False), (0, 0.004, False), (1, -0.004, False)],
)
def test_a_hand_that_stands_on_something_goes_back(near, contact, behind, stands):
    seen, memory = approaching(near, contact=contact, behind=behind)
    memory = memory._replace(offset=np.zeros((1, CLOSE + 1)), middle=np.zeros((1, CLOSE + 1)))
    along = offsets(paced(0.0), seen, memory)[0, ALONG]
    assert bool(grasp_features.met(paced(0.0), seen, memory).stands) == stands
    assert along == pytest.approx(-BACK_RATE if stands else 0.0)
    assert scaling_of(paced(0.0), seen, memory) == (0.0 if stands else CAREFUL)
    assert not grasp_features.met(paced(HASTE), seen, memory).stands
    assert not grasp_features.met(paced(0.0), seen, memory._replace(closing=np.array([0.1]))).stands


@pytest.mark.parametrize(
    ("jaw", "newtons", "stands"), [(True, 6.0, True), (True, 4.0, False), (False, 6.0, False)]
)
def test_a_stiff_arm_stands_on_what_presses_it_back(near, monkeypatch, jaw, newtons, stands):
    """It is not held up as far as others are before it strains its wrist; the hand goes back all the same."""
    monkeypatch.setattr(grasp_features, "standing_side", lambda robot: -0.007 if jaw else None)
    seen, memory = approaching(near, contact=1)
    wrench = np.array([[0.0, 0.0, -newtons, 0.0, 0.0, 0.0]])
    felt = dataclasses.replace(seen.observation, wrench=wrench)
    pressed = Seen(felt, seen.world, near.robot, seen.elapsed)
    assert bool(grasp_features.met(paced(0.0), pressed, memory).stands) == stands


def across(speed):
    action = paced(0.0)
    action[:, ACROSS] = speed
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
    zero = np.zeros((1, CLOSE + 1))
    memory = memory._replace(offset=zero, middle=zero, closing=np.array([closing]))
    action = across(-0.5)
    assert bool(grasp_features.met(action, seen, memory).searches) == searches
    after = near.model.advance(action, seen, memory)
    share = near.period / PERIOD
    expected = -0.5 * share * RATE[ACROSS] if searches else max(-0.25 * SCALE[ACROSS], -share * RATE[ACROSS])
    assert after.offset[0, ACROSS] == pytest.approx(expected)
    assert after.middle[0, ACROSS] * SCALE[ACROSS] == pytest.approx(expected if searches else 0.0)
    calm, _ = approaching(near)
    later = after._replace(closing=np.array([-1.0]), target=memory.target)
    stays = offsets(across(0.0), calm, later)[0, ACROSS]
    assert stays == pytest.approx(expected if searches else 0.0)
    hurried = action.copy()
    hurried[:, TIME_SCALING] = HASTE
    assert not grasp_features.met(hurried, seen, memory).searches


def test_fingers_come_as_slowly_as_the_pace_until_opposing_ones_touch(near):
    seen, memory = approaching(near, contact=1)
    memory = memory._replace(closing=np.array([0.1]), closed=np.array([0.2]))
    step = near.robot.hand_speed * near.period

    def closed(scaling, asked=1.0, seen=seen, tightening=1.0):
        found = grasp_features.closed(np.array([scaling]), np.array([asked]), tightening, seen, memory)
        return float(found[0])

    assert closed(0.25) == pytest.approx(0.2 + 0.25 * step)
    assert closed(0.25, asked=0.21) == 0.21 and closed(0.25, asked=0.1) == 0.1
    assert closed(1.0) == 1.0 and closed(0.0) == pytest.approx(0.2)
    both, _ = approaching(near, contact=len(near.robot.tips))
    assert closed(0.25, seen=both) == 1.0 and closed(0.0, seen=both) == 1.0
    assert closed(0.25, seen=both, tightening=0.1) == pytest.approx(0.2 + 0.1 * step)
    assert closed(1.0, seen=both, tightening=0.1) == 1.0


def test_one_jaw_that_closes_alone_comes_slowly_at_any_pace(near, monkeypatch):
    monkeypatch.setattr(grasp_features, "standing_side", lambda robot: -0.007)
    seen, memory = approaching(near, contact=1)
    memory = memory._replace(closing=np.array([0.1]), closed=np.array([0.2]))
    step = near.robot.hand_speed * near.period
    touching = PUSHING * float(gentler(seen.tool)[0])
    for at, most in ((seen, touching), (without_contacts(seen), PUSHING)):
        for scaling in (0.0, 0.05, 0.25, 1.0):
            found = grasp_features.closed(np.array([scaling]), np.array([1.0]), 1.0, at, memory)
            assert float(found[0]) == pytest.approx(0.2 + min(scaling, most) * step)


def test_displacements_are_in_the_tools_frame():
    reference = poses.pose(
        [0.4, 0.1, 0.2], poses.frame_from_axes(np.array([0.0, 0, -1]), np.array([0.0, 1, 0]))
    )[None]
    offset = np.array([[0.01, 0.02, 0.03, 0.2, 0.4]])
    moved = grasp_features.displaced(reference, offset)
    local = poses.relative(reference, moved)
    assert np.allclose(local[:, :3], offset[:, :3])
    assert np.allclose(poses.rotation_vector(local[:, 3:]), [[0.0, 0.0, 0.2]])
    many = grasp_features.displaced(np.repeat(reference, 2, 0), np.concatenate([offset, 0.0 * offset]))
    assert np.array_equal(many, np.concatenate([moved, reference]))


def test_where_there_is_little_room_the_programmed_motion_feels_its_way(near):
    for k in range(near.real):
        seen, memory = instant(near, k)
        memory = memory._replace(tight=np.array([True]))
        action = near.model.programmed_motion(without_contacts(seen), memory)
        now, period = seen.elapsed - memory.delay, seen.world.control_period
        way = sample(memory.path, now + period)[0, :3] - sample(memory.path, now)[0, :3]
        share = CAREFUL + EAGER * action[0, TIME_SCALING]
        assert SLOWEST - 1e-9 <= share <= 1.0 + 1e-9
        assert share <= SLOWEST + 1e-9 or share * np.linalg.norm(way) / period <= FEELING + 1e-9
        assert not action[0, ACROSS].any(), "nothing is felt"


@pytest.mark.parametrize(("push", "goes"), [(0.0, 0.0), (14.0, 0.0), (22.5, 0.5), (30.0, 1.0), (90.0, 1.0)])
def test_a_hand_that_is_pushed_back_gives_way_and_stays_back(near, push, goes):
    seen, memory = instant(near, near.real - 1)
    wrench = np.array([[0.0, 0.0, -push, 0.0, 0.0, 0.0]])
    touching = without_contacts(seen, but=0)
    felt = dataclasses.replace(touching.observation, wrench=wrench)
    pushed = Seen(felt, seen.world, seen.robot, seen.elapsed, seen.later, seen.failures)
    gone = memory.offset.copy()
    for offset in (0.0, -0.002):
        gone[:, ALONG] = offset
        there = memory._replace(offset=gone, middle=np.zeros_like(memory.middle))
        action = near.model.programmed_motion(pushed, there)
        wanted = -(action[0, ALONG] ** 2) * SCALE[ALONG]
        assert wanted == pytest.approx(offset - goes * YIELDING, abs=1e-9)


def test_a_finger_that_stands_on_something_goes_outwards(near):
    seen, memory = instant(near)
    memory = memory._replace(tight=np.array([True]))
    open_tips = tips_in_tool(near.robot, near.robot.hand_open)[:, 1]
    for finger in range(len(open_tips)):
        action = near.model.programmed_motion(without_contacts(seen, but=finger), memory)
        assert np.sign(action[0, ACROSS]) == np.sign(open_tips[finger])


@pytest.mark.parametrize(
    ("where", "push", "way"),
    [(0.003, 40.0, 1.0), (0.014, 40.0, -1.0), (0.014, 3.0, 1.0)],
    ids=["at its inner edge", "at its outer one", "the wrist feels too little to tell"],
)
def test_a_finger_comes_off_what_it_stands_on_the_way_that_is_out_of_it(near, where, push, way):
    """The wrist feels so many newtons at so many metres beyond the finger's pad."""
    seen, memory = instant(near)
    memory = memory._replace(tight=np.array([True]))
    pads = tips_in_tool(near.robot, near.robot.hand_open)[:, 1]
    for finger, pad in enumerate(pads[:2]):
        touching = without_contacts(seen, but=finger)
        lever, force = np.array([0.0, pad + where * np.sign(pad), 0.0]), np.array([0.0, 0.0, -push])
        felt = dataclasses.replace(
            touching.observation, wrench=np.concatenate([force, np.cross(lever, force)])[None]
        )
        stands = Seen(felt, seen.world, seen.robot, seen.elapsed, seen.later, seen.failures)
        action = near.model.programmed_motion(stands, memory)
        assert np.sign(action[0, ACROSS]) == way * np.sign(pad)


@pytest.mark.parametrize(
    ("behind", "touched", "closing", "waits"),
    [
        (0.002, True, -1.0, True),
        (0.001, True, -1.0, False),
        (0.002, False, -1.0, False),
        (0.002, True, 0.1, False),
    ],
)
def test_a_finger_that_bounces_on_an_edge_is_not_pressed_down_in_between(
    near, behind, touched, closing, waits
):
    """It has touched, does not at this instant, and the hand is held up."""
    seen, memory = approaching(near, within=0.2, behind=behind)
    so_far = np.zeros_like(memory.touched)
    so_far[:, 0] = touched
    memory = memory._replace(tight=np.array([True]), touched=so_far, closing=np.array([closing]))
    action = near.model.programmed_motion(without_contacts(seen), memory)
    assert (scaling_of(action, seen, memory) == 0.0) == waits


def test_what_touches_goes_on_no_faster_than_what_feels_its_way(near, monkeypatch):
    """Near the base of a stiff arm that is slower than the careful pace."""
    monkeypatch.setattr(grasp_programmed, "gentler", lambda tool: np.full(len(tool), 0.02))
    paces = []
    for contact in (0, 1):
        seen, memory = approaching(near, within=0.2, contact=contact)
        memory = memory._replace(tight=np.array([True]), goal=seen.tool)
        paces.append(near.model.programmed_motion(seen, memory)[0, TIME_SCALING])
    assert paces[0] < 0.0 and paces[1] <= paces[0]


@pytest.mark.parametrize(
    ("tight", "delay", "more"), [(True, 3.0, 3.0), (True, 99.0, PATIENCE), (False, 3.0, 0.0)]
)
def test_a_grasp_that_feels_its_way_may_last_longer(near, tight, delay, more):
    _, memory = instant(near)
    usual = near.model.planned(memory._replace(tight=np.array([False])))
    feeling = memory._replace(tight=np.array([tight]), delay=np.array([delay]))
    assert near.model.planned(feeling) - usual == pytest.approx(more)


def test_jaws_that_go_down_beside_something_tall_feel_their_way_from_its_top(near, monkeypatch):
    """Others do so where fingers may meet an edge of what they hold; these reach far below it."""
    seen, memory = approaching(near, within=0.2)
    far = poses.shifted(memory.goal, -0.06 * poses.z_axis(memory.goal[:, 3:]))
    memory = memory._replace(tight=np.array([True]), goal=far)
    monkeypatch.setattr(grasp_programmed, "gentler", lambda tool: np.full(len(tool), 0.3))
    monkeypatch.setattr(grasp_programmed, "beyond", lambda robot: 1.0)
    others = near.model.programmed_motion(seen, memory)[0, TIME_SCALING]
    monkeypatch.setattr(grasp_programmed, "standing_side", lambda robot: -0.007)
    jaws = near.model.programmed_motion(seen, memory)[0, TIME_SCALING]
    monkeypatch.setattr(grasp_programmed, "beyond", lambda robot: -1.0)
    assert jaws < others == near.model.programmed_motion(seen, memory)[0, TIME_SCALING]


def without_contacts(seen, but=None):
    """The same with no fingertip, or with one alone, in contact."""
    contacts = np.arange(seen.contacts.shape[1])[None] == (-1 if but is None else but)
    observation = dataclasses.replace(seen.observation, contacts=contacts)
    return Seen(observation, seen.world, seen.robot, seen.elapsed, seen.later, seen.failures)
