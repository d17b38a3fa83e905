"""Synthetic demonstrations are labelled, repeatable, plausible, and those shipped are the maker's."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.demos_decomp.decompose import decompose_log
from bt_tasksim.demos_decomp.readers import open_log
from bt_tasksim.demos_decomp.recognition import recognise
from bt_tasksim.demos_decomp.synthetic import SHIPPED, main, make, shipped
from bt_tasksim.demos_decomp.synthetic_motion import FINE_RATE, Hand, Sensing, minimum_jerk, tremor
from bt_tasksim.demos_decomp.synthetic_scenes import SCRIPTS

WHOLE = ["grasp", "pick", "bring", "place", "release"]
EXPECTED = {"pick_and_place": WHOLE, "shelf_to_shelf": WHOLE, "pick_and_throw": [*WHOLE[:3], "release"]}
DESTINATION = {"pick_and_place": "goal", "shelf_to_shelf": "lower_board", "pick_and_throw": "trash_bin"}


@pytest.mark.parametrize("scenario", SCRIPTS)
def test_shipped_logs_are_recognised_with_their_places(scenario):
    for number in range(SHIPPED):
        log = open_log(asset("demonstrations", scenario, f"{number:02d}.h5"))
        assert log.source == "synthetic"
        tasks, remarks = recognise(log.demonstrations[0])
        assert [task.concept for task in tasks] == EXPECTED[scenario], remarks
        bring = next(task for task in tasks if task.concept == "bring")
        assert bring.parameters["to"] == DESTINATION[scenario]


@pytest.mark.parametrize("scenario", SCRIPTS)
def test_shipped_logs_are_what_the_maker_makes(scenario):
    for number, (made, _) in enumerate(shipped(scenario)):
        (kept,) = open_log(asset("demonstrations", scenario, f"{number:02d}.h5")).demonstrations
        same = len(kept.time) == len(made.time) and np.allclose(kept.hand_pose, made.hand_pose, atol=1e-6)
        assert same, "run: python -m demos_decomp.synthetic --out assets/demonstrations"
        for name, surface in made.places.items():
            np.testing.assert_allclose(kept.places[name].pose, surface.pose, atol=1e-9)


@pytest.mark.parametrize("scenario", SCRIPTS)
def test_ten_logs_merge_into_a_chain(scenario):
    logs = [open_log(asset("demonstrations", scenario, f"{number:02d}.h5")) for number in range(SHIPPED)]
    found = decompose_log(logs)
    assert [task.concept for task in found.tasks] == EXPECTED[scenario]
    assert found.graph.graph["alternatives"] == []


@pytest.mark.parametrize("scenario", SCRIPTS)
def test_same_seed_same_demonstration_and_labels_in_order(scenario):
    (one, labels), (two, _), (other, _) = make(scenario, 5), make(scenario, 5), make(scenario, 6)
    assert np.array_equal(one.hand_pose, two.hand_pose)
    assert not np.array_equal(one.hand_pose[:50], other.hand_pose[:50])
    assert [label.concept for label in labels] == EXPECTED[scenario]
    assert all(a.end == b.start for a, b in pairwise(labels))
    assert labels[-1].end < one.time[-1]


@pytest.mark.parametrize("scenario", SCRIPTS)
def test_without_errors_things_touch_nothing_they_should_not(scenario):
    clean = Sensing(
        tremor=0, hand=0, hand_angle=0, object=0, object_angle=0, bias=0, opening=0, dropped=0, gaps=0
    )
    for seed in range(20):
        shown, _ = make(scenario, seed, clean)
        for name, track in shown.objects.items():
            assert track.pose[:, 2].min() > 0.0, name
            steps = np.linalg.norm(np.diff(track.pose[:, :3], axis=0), axis=1) / np.diff(shown.time)
            assert steps.max() < 3.0
        if scenario == "shelf_to_shelf":
            track = shown.objects["cup"].pose
            board = shown.places["upper_board"].pose
            passing = np.abs(track[:, 2] - board[2]) < 0.07  # level with the upper board: in front of it
            front = board[0] - 0.07
            started = track[:, 2] < track[0, 2] - 0.01
            assert (track[passing & started, 0] < front - 0.035).all()


def test_unknown_scenario():
    with pytest.raises(InputError, match="did you mean 'pick_and_throw'"):
        make("pick_and_trow", 1)


def test_the_maker_writes_all_logs(tmp_path, capsys):
    assert main(["--out", str(tmp_path)]) == 0
    assert len(list(tmp_path.glob("*/*.h5"))) == SHIPPED * len(SCRIPTS)


def test_motion_is_minimum_jerk_and_tremor_has_its_size():
    assert minimum_jerk(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])).tolist() == [0, 0, 0.5, 1, 1]
    time = np.arange(0, 20, 1 / FINE_RATE)
    shaking = tremor(time, 0.0005, np.random.default_rng(0))
    assert shaking.std() == pytest.approx(0.0005, rel=0.1)
    spectrum = np.abs(np.fft.rfft(shaking[:, 0]))
    assert 8 <= np.fft.rfftfreq(len(time), 1 / FINE_RATE)[np.argmax(spectrum)] <= 12


def test_a_hand_ends_where_it_was_told():
    start, end = np.array([0.3, 0, 0.3, 1, 0, 0, 0]), np.array([0.5, 0.1, 0.1, 0, 1, 0, 0])
    hand = Hand(start, 0.02, 1.0)
    hand.set_opening(0.08, 0.4, start=0.2)
    hand.move(end, overlap=0.3)
    hand.set_opening(0.05, 0.3)
    _, pose, opening = hand.trajectory()
    np.testing.assert_allclose(pose[0], start, atol=1e-9)
    np.testing.assert_allclose(pose[-1, :3], end[:3], atol=1e-9)
    assert abs(pose[-1, 3:] @ end[3:]) == pytest.approx(1.0)
    assert opening[-1] == pytest.approx(0.05)
