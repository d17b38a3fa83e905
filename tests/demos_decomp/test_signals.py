"""Sampling, smoothing and turning points."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError
from bt_tasksim.demos_decomp.log import Demonstration, Track
from bt_tasksim.demos_decomp.signals import (
    RATE,
    evenly_sampled,
    left_noise,
    simplified,
    smooth,
    speed,
    swings,
)

walks = st.lists(st.floats(-0.01, 0.01), min_size=3, max_size=120).map(np.cumsum)


def test_a_gap_of_a_day_is_refused_before_it_is_filled():
    time = np.append(np.arange(1000) * 1e-9, 86_000.0)
    still = np.tile([0.4, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0], (len(time), 1))
    shown = Demonstration("000", time, still, np.zeros(len(time)), {"cup": Track(still, "cup", np.ones(3))})
    with pytest.raises(InputError, match="'000' lasts 86000 s, too long"):
        evenly_sampled(shown)


def test_swings_are_the_large_changes():
    ramp = np.concatenate([np.full(20, 0.08), np.linspace(0.08, 0.03, 11), np.full(40, 0.03)])
    signal = np.concatenate([ramp, np.linspace(0.03, 0.1, 15), np.full(9, 0.1)])
    closing, opening = swings(signal, 0.006)
    assert closing.change < 0 < opening.change
    assert 19 <= closing.first <= 22
    assert 28 <= closing.last <= 31
    assert swings(signal + 0.002 * np.sin(np.arange(len(signal))), 0.006)[0].change < 0
    assert len(swings(signal + 0.002 * np.sin(np.arange(len(signal))), 0.006)) == 2
    assert swings(np.full(30, 0.05), 0.006) == []


@given(walks, st.floats(0.001, 0.05))
def test_swings_alternate_are_in_order_and_large_enough(signal, threshold):
    found = swings(signal, threshold)
    for swing in found:
        assert abs(swing.change) > threshold
        assert swing.first <= swing.last
    for earlier, later in pairwise(found):
        assert earlier.change * later.change < 0
        assert earlier.last <= later.first + 1


@given(walks, st.floats(0.001, 0.05), st.floats(-1, 1))
def test_swings_turn_with_the_signal_and_do_not_know_its_zero(signal, threshold, offset):
    upside_down = swings(-signal, threshold)
    assert [(s.first, s.last, -s.change) for s in upside_down] == [
        (s.first, s.last, s.change) for s in swings(signal, threshold)
    ]


@settings(deadline=None)
@given(st.integers(0, 10000), st.floats(0.005, 0.05))
def test_a_simplified_path_stays_within_the_tolerance(seed, tolerance):
    path = np.cumsum(np.random.default_rng(seed).normal(0, 0.01, (60, 3)), axis=0)
    kept = simplified(path, tolerance)
    assert kept[0] == 0
    assert kept[-1] == 59
    for a, b in pairwise(kept):
        along = path[b] - path[a]
        share = np.clip((path[a : b + 1] - path[a]) @ along / (along @ along), 0, 1)
        assert (
            np.linalg.norm(path[a : b + 1] - path[a] - share[:, None] * along, axis=1).max()
            <= tolerance + 1e-12
        )


def test_a_straight_path_needs_no_points_between():
    assert simplified(np.linspace([0, 0, 0], [1, 2, 3], 20), 0.001).tolist() == [0, 19]
    assert simplified(np.zeros((5, 3)), 0.001).tolist() == [0, 4]


def test_smoothing_keeps_lines_and_takes_off_tremor():
    time = np.arange(0, 3, 1 / RATE)
    inner = slice(20, -20)
    np.testing.assert_allclose(smooth(0.1 * time)[inner], 0.1 * time[inner], atol=1e-9)
    assert np.abs(smooth(np.sin(2 * np.pi * 9 * time))[inner]).max() < 0.02
    np.testing.assert_allclose(speed(np.stack([0.1 * time] * 3, axis=1))[inner], 0.1 * np.sqrt(3), rtol=1e-6)


def test_noise_is_judged_from_a_moving_signal():
    rng = np.random.default_rng(0)
    time = np.arange(0, 20, 1 / 30)
    moving = np.sin(time)[:, None] * [0.2, 0.1, 0.3] + rng.normal(0, 0.002, (len(time), 3))
    assert 0.0005 < left_noise(moving, 30) < 0.0015


def test_dropped_samples_are_filled_in_and_known(act, carried):
    shown = act(carried("box", (0.45, -0.15, 0.05), (0.5, 0.2, 0.05), 0.0), {"box": (0.45, -0.15, 0.05)})
    keep = (shown.time < 2.5) | (shown.time > 2.9)
    keep[::7] &= False
    keep[[0, -1]] = True
    track = dataclasses.replace(shown.objects["box"], pose=shown.objects["box"].pose[keep])
    sparse = dataclasses.replace(
        shown,
        time=shown.time[keep],
        hand_pose=shown.hand_pose[keep],
        hand_opening=shown.hand_opening[keep],
        objects={"box": track},
    )
    whole, filled = evenly_sampled(shown), evenly_sampled(sparse)
    assert len(whole.time) == len(filled.time)
    np.testing.assert_allclose(np.diff(filled.time), 1 / RATE)
    np.testing.assert_allclose(whole.hand[:, :3], filled.hand[:, :3], atol=0.02)
    assert filled.gap(filled.at(2.0), filled.at(3.0)) > 0.35
    assert filled.gap(filled.at(3.5), filled.at(4.0)) < 0.1


def test_a_flipped_quaternion_is_the_same_rotation(act, carried):
    shown = act(carried("box", (0.45, -0.15, 0.05), (0.5, 0.2, 0.05), 0.0), {"box": (0.45, -0.15, 0.05)})
    flipped = shown.hand_pose.copy()
    flipped[::2, 3:] *= -1
    a, b = evenly_sampled(shown).hand, evenly_sampled(dataclasses.replace(shown, hand_pose=flipped)).hand
    np.testing.assert_allclose(np.abs(np.sum(a[:, 3:] * b[:, 3:], axis=1)), 1.0, atol=1e-9)
