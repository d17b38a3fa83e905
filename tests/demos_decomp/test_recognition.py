"""The five concepts are recognised, whatever the frame, the clock, the rate and the noise."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.demos_decomp.log import Surface, Track, Utterance
from bt_tasksim.demos_decomp.recognition import recognise
from bt_tasksim.demos_decomp.remarks import RemarkKind
from bt_tasksim.demos_decomp.synthetic import make
from bt_tasksim.demos_decomp.synthetic_motion import Sensing

WHOLE = ["grasp", "pick", "bring", "place", "release"]
EXPECTED = {"pick_and_place": WHOLE, "shelf_to_shelf": WHOLE, "pick_and_throw": [*WHOLE[:3], "release"]}
A, B = (0.45, -0.15, 0.05), (0.5, 0.2, 0.05)
ABOVE_BIN = (0.45, -0.38, 0.36)


def concepts(demonstration):
    return [task.concept for task in recognise(demonstration)[0]]


@pytest.mark.parametrize("scenario", EXPECTED)
def test_fresh_synthetic_demonstrations_are_recognised(scenario):
    right = 0
    for seed in range(700000, 700060):
        right += concepts(make(scenario, seed)[0]) == EXPECTED[scenario]
    assert right >= 58


@pytest.mark.parametrize("scenario", EXPECTED)
def test_three_times_the_noise_loses_few(scenario):
    right = 0
    for seed in range(710000, 710040):
        right += concepts(make(scenario, seed, Sensing().worse(3))[0]) == EXPECTED[scenario]
    assert right >= 37


def test_boundaries_are_where_the_script_has_them():
    late = []
    for seed in range(720000, 720020):
        demonstration, labels = make("shelf_to_shelf", seed)
        for task, label in zip(recognise(demonstration)[0], labels, strict=True):
            late.append(task.end - label.end)
    assert abs(np.mean(late)) < 0.1
    assert np.std(late) < 0.15


def test_parameters_of_a_transport(act, carried):
    tasks, remarks = recognise(act(carried("box", A, B, 0.0), {"box": A}))
    grasp, pick, bring, place, release = (task.parameters for task in tasks)
    assert remarks == []
    assert grasp["target"] == release["target"] == "box"
    np.testing.assert_allclose(grasp["approach"], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(grasp["closing"], [0, 1, 0], atol=1e-6)
    assert (pick["off"], bring["to"], place["on"]) == ("table", "table", "table")
    np.testing.assert_allclose(pick["direction"], [0, 0, 1], atol=0.1)
    assert pick["distance"] == pytest.approx(0.12, abs=0.01)
    np.testing.assert_allclose(place["direction"], [0, 0, -1], atol=0.1)
    assert place["distance"] == pytest.approx(0.12, abs=0.01)
    assert bring["via"] == []
    assert "into" not in release
    assert all(0.9 < task.confidence <= 1 for task in tasks)
    assert all(a.end == b.start for a, b in pairwise(tasks))


def test_via_points_are_relative_to_the_destination(act):
    frames = [
        (0, (0.45, -0.15, 0.2), 0.09, None),
        (1, A, 0.09, None),
        (1.4, A, 0.05, "box"),
        (2.2, (0.45, -0.15, 0.2), 0.05, "box"),
        (3.0, (0.7, -0.15, 0.2), 0.05, "box"),
        (4.0, (0.7, 0.2, 0.2), 0.05, "box"),
        (5.0, (0.5, 0.2, 0.2), 0.05, "box"),
        (6.0, B, 0.05, "box"),
        (6.5, B, 0.09, None),
        (7.0, (0.5, 0.2, 0.3), 0.09, None),
    ]
    goal = Surface(np.array([0.5, 0.2, 0.0, 1, 0, 0, 0]), np.array([0.1, 0.1]), "spot")
    shown = act(frames, {"box": A})
    shown = dataclasses.replace(shown, places={**shown.places, "goal": goal})
    bring = recognise(shown)[0][2].parameters
    assert bring["to"] == "goal"
    np.testing.assert_allclose(bring["via"], [[0.2, -0.35, 0.2], [0.2, 0, 0.2]], atol=0.02)


@settings(max_examples=25, deadline=None, derandomize=True)  # see the log below that breaks it
@given(
    scenario=st.sampled_from(sorted(EXPECTED)),
    seed=st.integers(730000, 730200),
    shift=st.floats(-1e4, 1e4),
    turn=st.floats(-np.pi, np.pi),
    move=st.tuples(*[st.floats(-2, 2)] * 3),
)
def test_clock_and_frame_do_not_matter(scenario, seed, shift, turn, move):
    """Time shift, and rigid motion of everything about the vertical: same concepts, places and distances."""
    demonstration, _ = make(scenario, seed)
    frame = poses.pose(np.array(move), poses.yaw(turn))

    def moved(track):
        return poses.multiply(np.broadcast_to(frame, track.shape), track)

    changed = dataclasses.replace(
        demonstration,
        time=demonstration.time + shift,
        hand_pose=moved(demonstration.hand_pose),
        objects={n: dataclasses.replace(t, pose=moved(t.pose)) for n, t in demonstration.objects.items()},
        places={n: dataclasses.replace(s, pose=moved(s.pose)) for n, s in demonstration.places.items()},
        narration=tuple(Utterance(u.time + shift, u.text) for u in demonstration.narration),
    )
    before, after = recognise(demonstration)[0], recognise(changed)[0]
    assert [t.concept for t in before] == [t.concept for t in after]
    for a, b in zip(before, after, strict=True):
        assert a.start == pytest.approx(b.start - shift, abs=0.05)
        for name in ("target", "off", "on", "to", "into"):
            assert a.parameters.get(name) == b.parameters.get(name)
        assert a.parameters.get("distance") == pytest.approx(b.parameters.get("distance"), abs=2e-3)
        if "direction" in a.parameters:
            turned = poses.rotate(frame[3:], np.asarray(a.parameters["direction"]))
            np.testing.assert_allclose(turned, b.parameters["direction"], atol=0.03)


@pytest.mark.xfail(strict=False, reason="a turn of the frame moves the start of a task of this log by 0.16 s")
def test_a_log_for_which_the_frame_does_matter():
    law = test_clock_and_frame_do_not_matter.hypothesis.inner_test
    law("pick_and_place", 730079, shift=0.0, turn=0.375, move=(0.0, 0.0, 0.0))


@settings(max_examples=20, deadline=None)
@given(rate=st.floats(12, 200), noise=st.floats(0, 0.002), seed=st.integers(0, 1000), slow=st.floats(0.6, 3))
def test_rate_noise_and_pace_do_not_matter(act, carried, rate, noise, seed, slow):
    frames = [(t * slow, p, o, held) for t, p, o, held in carried("box", A, B, 0.0)]
    assert concepts(act(frames, {"box": A}, rate=rate, noise=noise, seed=seed)) == WHOLE


def test_without_places_supports_are_not_named_but_tasks_are_recognised(act, carried):
    tasks, _ = recognise(act(carried("box", A, B, 0.0), {"box": A}, places={}))
    assert [t.concept for t in tasks] == WHOLE
    assert "off" not in tasks[1].parameters
    assert "on" not in tasks[3].parameters
    np.testing.assert_allclose(tasks[3].parameters["position"], B, atol=2e-3)


def test_one_object_is_put_onto_another(act, carried):
    lower, top = (0.5, 0.2, 0.05), (0.5, 0.2, 0.15)
    tasks, _ = recognise(act(carried("cube", A, top, 0.0), {"cube": A, "base": lower}))
    assert [t.concept for t in tasks] == WHOLE
    assert tasks[3].parameters["on"] == tasks[2].parameters["to"] == "base"


def test_two_objects_one_after_the_other(act, carried):
    c, d = (0.6, -0.1, 0.05), (0.6, 0.3, 0.05)
    frames = [*carried("one", A, B, 0.0), *carried("two", c, d, 6.5)]
    tasks, _ = recognise(act(frames, {"one": A, "two": c}))
    assert [t.concept for t in tasks] == WHOLE * 2
    assert [t.parameters["target"] for t in tasks] == ["one"] * 5 + ["two"] * 5


def test_a_demonstration_may_end_with_the_object_in_the_hand(act, carried):
    tasks, _ = recognise(act(carried("box", A, B, 0.0)[:5], {"box": A}))
    assert [t.concept for t in tasks] == WHOLE[:3]
    assert "to" not in tasks[2].parameters
    np.testing.assert_allclose(tasks[2].parameters["position"], [0.5, 0.2, 0.17], atol=3e-3)


def test_lifting_straight_up_is_a_pick_and_no_bring(act, carried):
    assert concepts(
        act([*carried("box", A, B, 0.0)[:4], (4, (0.45, -0.15, 0.17), 0.05, None)], {"box": A})
    ) == [
        "grasp",
        "pick",
    ]


def test_a_demonstration_may_begin_with_the_object_in_the_hand(act, carried):
    frames = carried("box", A, B, 0.0)[3:]
    tasks, _ = recognise(act(frames, {"box": (0.45, -0.15, 0.17)}))
    assert [t.concept for t in tasks] == ["bring", "place", "release"]


def test_thrown_into_a_bin(act, trash_bin):
    up = (0.45, -0.15, 0.36)
    frames = [
        (0, (0.45, -0.15, 0.2), 0.09, None),
        (1, A, 0.09, None),
        (1.4, A, 0.05, "cup"),
        (2.4, up, 0.05, "cup"),
        (3.4, ABOVE_BIN, 0.05, "cup"),
        (3.5, ABOVE_BIN, 0.055, None),
        (3.8, ABOVE_BIN, 0.09, None),
        (5.0, up, 0.09, None),
    ]
    tasks, _ = recognise(act(frames, {"cup": A}, places=trash_bin, floors={"cup": 0.06}))
    assert [t.concept for t in tasks] == [*WHOLE[:3], "release"]
    assert tasks[2].parameters["to"] == tasks[3].parameters["into"] == "trash_bin"


def test_dropped_over_nothing_known_names_no_bin(act):
    frames = [
        (0, (0.45, -0.15, 0.2), 0.09, None),
        (1, A, 0.09, None),
        (1.4, A, 0.05, "cup"),
        (2.4, (0.45, -0.15, 0.36), 0.05, "cup"),
        (3.4, (0.45, 0.1, 0.36), 0.05, "cup"),
        (3.5, (0.45, 0.1, 0.36), 0.055, None),
        (3.8, (0.45, 0.1, 0.36), 0.09, None),
        (5.0, (0.45, 0.1, 0.4), 0.09, None),
    ]
    tasks, _ = recognise(act(frames, {"cup": A}, floors={"cup": 0.05}))
    assert [t.concept for t in tasks] == [*WHOLE[:3], "release"]
    assert "into" not in tasks[3].parameters
    assert "to" not in tasks[2].parameters


def test_a_shifted_grip_is_no_release(act, carried):
    frames = carried("box", A, B, 0.0)
    air = (0.5, 0.2, 0.17)
    frames = [
        *frames[:5],
        (3.7, air, 0.061, "box"),
        (4.0, air, 0.05, "box"),
        *[(t + 0.7, p, o, held) for t, p, o, held in frames[5:]],
    ]
    assert concepts(act(frames, {"box": A})) == WHOLE


def test_put_down_and_lifted_again_without_letting_go(act):
    frames = [
        (0, (0.45, -0.15, 0.2), 0.09, None),
        (1, A, 0.09, None),
        (1.4, A, 0.05, "box"),
        (2.2, (0.45, -0.15, 0.17), 0.05, "box"),
        (3.2, (0.45, 0.05, 0.17), 0.05, "box"),
        (4.0, (0.45, 0.05, 0.05), 0.05, "box"),
        (4.8, (0.45, 0.05, 0.05), 0.05, "box"),
        (5.6, (0.45, 0.05, 0.17), 0.05, "box"),
        (6.6, (0.5, 0.2, 0.17), 0.05, "box"),
        (7.4, B, 0.05, "box"),
        (7.7, B, 0.05, None),
        (8.0, B, 0.09, None),
        (8.8, (0.5, 0.2, 0.2), 0.09, None),
    ]
    assert concepts(act(frames, {"box": A})) == ["grasp", *WHOLE[1:4], *WHOLE[1:4], "release"]


def test_closing_beside_the_object_is_remarked_and_not_recognised(act):
    beside = (0.45, 0.1, 0.05)
    frames = [(0, beside, 0.09, None), (1, beside, 0.03, None), (2, (0.5, 0.3, 0.2), 0.03, None)]
    tasks, remarks = recognise(act(frames, {"box": A}))
    assert tasks == []
    assert remarks[0].kind == RemarkKind.EMPTY_HAND
    assert "held no object" in str(remarks[0])
    assert "box" in str(remarks[0])


def test_sliding_without_lifting_is_remarked(act):
    frames = [
        (0, (0.45, -0.15, 0.2), 0.09, None),
        (1, A, 0.09, None),
        (1.4, A, 0.05, "box"),
        (3, (0.45, 0.1, 0.05), 0.05, "box"),
        (4, (0.45, 0.1, 0.05), 0.09, None),
    ]
    tasks, remarks = recognise(act(frames, {"box": A}))
    assert [t.concept for t in tasks] == ["grasp", "release"]
    assert remarks[0].kind == RemarkKind.MOTION
    assert "without being lifted" in str(remarks[0])


@pytest.mark.parametrize("slid", [0.01, 0.34])
@pytest.mark.parametrize("when", ["before", "after"])
def test_sliding_before_a_lift_or_after_a_landing_is_no_sure_pick_or_place(act, slid, when):
    """It comes out as a pick or a place over all that way, which it was not."""
    aside = (A[0], A[1] + slid, A[2])
    start, end = (aside, aside) if when == "before" else (A, aside)
    high = (start[0], start[1], 0.2)
    frames = [
        (0, (*A[:2], 0.2), 0.09, None),
        (1, A, 0.09, None),
        (1.4, A, 0.05, "box"),
        (3, start, 0.05, "box"),
        (4, high, 0.05, "box"),
        (5, (high[0] + 0.1, *high[1:]), 0.05, "box"),
        (6, (start[0] + 0.1, *start[1:]), 0.05, "box"),
        (8, (end[0] + 0.1, *end[1:]), 0.05, "box"),
        (8.5, (end[0] + 0.1, *end[1:]), 0.09, None),
        (9, (end[0] + 0.1, end[1], 0.2), 0.09, None),
    ]
    tasks, remarks = recognise(act(frames, {"box": A}))
    sure = {task.concept: task.confidence for task in tasks}
    assert list(sure) == WHOLE
    doubtful = {"before": "pick", "after": "place"}[when] if slid > 0.1 else None
    assert {name for name, confidence in sure.items() if confidence < 0.5} == ({doubtful} - {None})
    assert [remark.kind for remark in remarks] == ([RemarkKind.MOTION] if doubtful else [])


def test_narration_settles_what_motion_leaves_open_and_no_more(act, carried):
    """A lift of 7 mm is below the limit of 8 mm; who says "I lift it" is believed, at 1 mm not."""

    def lifted(height, words):
        frames = [
            *carried("box", A, B, 0.0)[:3],
            (2.2, (0.45, -0.15, 0.05 + height), 0.05, "box"),
            (3.4, (0.45, -0.05, 0.05 + height), 0.05, "box"),
        ]
        said = [Utterance(1.8, words)] if words else []
        return "pick" in concepts(act(frames, {"box": A}, narration=said))

    assert not lifted(0.007, "")
    assert lifted(0.007, "now I lift the box")
    assert not lifted(0.001, "now I lift the box")


def test_confidence_falls_with_noise():
    def mean(factor):
        shown = [
            make("pick_and_place", s, Sensing().worse(factor), talk=False)[0] for s in range(740000, 740015)
        ]
        return np.mean([np.prod([t.confidence for t in recognise(d)[0]]) for d in shown])

    calm, rough = mean(0.5), mean(3)
    assert 0 < rough < calm <= 1


def test_wrong_sequences_are_less_confident():
    """Where noise makes the recognition wrong, its confidence is lower than where it is right."""
    right, wrong = [], []
    for seed in range(750000, 750060):
        tasks = recognise(make("shelf_to_shelf", seed, Sensing().worse(8))[0])[0]
        sure = float(np.prod([t.confidence for t in tasks])) if tasks else 0.0
        (right if [t.concept for t in tasks] == WHOLE else wrong).append(sure)
    assert wrong
    assert np.mean(wrong) < 0.5 * np.mean(right)


def test_a_peg_that_turns_in_the_grip_is_held(act, carried):
    demonstration = act(carried("peg", A, B, 0.0), {"peg": A})
    track = demonstration.objects["peg"].pose.copy()
    angle = np.interp(demonstration.time, [2.2, 3.4], [0, 0.8])
    turn = poses.from_rotation_vector(angle[:, None] * np.array([0.0, 1, 0]))
    track[:, 3:] = poses.quat_multiply(track[:, 3:], turn)
    peg = Track(track, "box", demonstration.objects["peg"].size)
    assert concepts(dataclasses.replace(demonstration, objects={"peg": peg}))[:3] == WHOLE[:3]
