"""What a demonstration must be like; each fault is one clear sentence that says where it is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.demos_decomp.log import Log, Surface, Track, Utterance, checked, checked_log

A, B = (0.45, -0.15, 0.05), (0.5, 0.2, 0.05)


@pytest.fixture(scope="module")
def good(act, carried):
    return act(carried("box", A, B, 0.0), {"box": A})


def with_value(array, index, value):
    changed = np.array(array, dtype=float)
    changed[index] = value
    return changed


def with_track(shown, **changes):
    return {"objects": {"box": dataclasses.replace(shown.objects["box"], **changes)}}


FAULTS = {
    "time runs backwards": (
        lambda d: {"time": with_value(d.time, 5, 0.0)},
        r"x/time runs backwards at index 5 \(0.133333 s, then 0 s\)",
    ),
    "time stands still": (
        lambda d: {"time": with_value(d.time, 5, d.time[4])},
        "x/time stands still at index 5",
    ),
    "NaN in time": (
        lambda d: {"time": with_value(d.time, 7, np.nan)},
        "x/time has NaN or infinity at index 7",
    ),
    "one sample": (lambda d: {"time": d.time[:1]}, "at least 2 samples"),
    "no samples": (lambda d: {"time": d.time[:0]}, "at least 2 samples"),
    "words instead of numbers": (lambda d: {"time": np.array(["a", "b"])}, "does not hold numbers"),
    "NaN in the hand's pose": (
        lambda d: {"hand_pose": with_value(d.hand_pose, (17, 1), np.nan)},
        "x/hand/pose has NaN or infinity at index 17",
    ),
    "zero quaternion of the hand": (
        lambda d: {"hand_pose": with_value(d.hand_pose, (3, slice(3, 7)), 0.0)},
        "x/hand/pose has a zero quaternion at index 3",
    ),
    "quaternion that is not unit": (
        lambda d: {"hand_pose": d.hand_pose * 2},
        "x/hand/pose has a quaternion of length 2 at index 0",
    ),
    "too few hand poses": (
        lambda d: {"hand_pose": d.hand_pose[:-3]},
        r"x/hand/pose has \d+ rows but time has \d+",
    ),
    "hand poses of six numbers": (lambda d: {"hand_pose": d.hand_pose[:, :6]}, "x/hand/pose has shape"),
    "infinite opening": (
        lambda d: {"hand_opening": with_value(d.hand_opening, 2, np.inf)},
        "x/hand/opening has NaN or infinity at index 2",
    ),
    "no objects": (lambda d: {"objects": {}}, "x has no objects"),
    "NaN in an object's pose": (
        lambda d: with_track(d, pose=with_value(d.objects["box"].pose, (9, 0), np.nan)),
        "x/objects/box/pose has NaN or infinity at index 9",
    ),
    "zero quaternion of an object": (
        lambda d: with_track(d, pose=with_value(d.objects["box"].pose, (4, slice(3, 7)), 0.0)),
        "x/objects/box/pose has a zero quaternion at index 4",
    ),
    "size of two numbers": (lambda d: with_track(d, size=np.ones(2)), "x/objects/box attribute size"),
    "size in millimetres below zero": (lambda d: with_track(d, size=-np.ones(3)), "all above zero"),
    "place without extent": (
        lambda d: {"places": {"table": Surface(d.places["table"].pose, np.zeros(2))}},
        "x/places/table attribute extent",
    ),
    "place with a zero quaternion": (
        lambda d: {"places": {"table": Surface(np.zeros(7), np.ones(2))}},
        "x/places/table attribute pose has a zero quaternion",
    ),
    "place with a negative height": (
        lambda d: {"places": {"t": dataclasses.replace(d.places["table"], height=-1.0)}},
        "x/places/t attribute height",
    ),
    "narration at no time": (
        lambda d: {"narration": (Utterance(np.nan, "hm"),)},
        "x/narration/time is not finite",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_is_named(good, name):
    change, message = FAULTS[name]
    with pytest.raises(InputError, match=message) as caught:
        checked(dataclasses.replace(good, **change(good)), "x")
    assert "\n" not in str(caught.value)


def test_a_good_one_passes_and_quaternions_become_unit(good):
    assert checked(good, "x").name == good.name
    longer = dataclasses.replace(good, hand_pose=good.hand_pose * [1, 1, 1, 1.01, 1.01, 1.01, 1.01])
    np.testing.assert_allclose(np.linalg.norm(checked(longer, "x").hand_pose[:, 3:], axis=1), 1.0)


def test_a_log_needs_a_known_source_and_demonstrations_of_different_names(good):
    with pytest.raises(InputError, match="did you mean 'human'"):
        checked_log(Log("humann", (good,)), "x")
    with pytest.raises(InputError) as caught:
        checked_log(Log("x" * 100_000, (good,)), "x")
    assert len(str(caught.value)) < 200
    with pytest.raises(InputError, match="no demonstrations"):
        checked_log(Log("human", ()), "x")
    with pytest.raises(InputError, match="two demonstrations of one name"):
        checked_log(Log("human", (good, good)), "x")


def test_demonstrations_are_found_by_number_and_by_name(good):
    log = Log("human", (good, dataclasses.replace(good, name="second")), path="k.h5")
    assert log.demonstration(1) is log.demonstration("second") is log.demonstration("1")
    for wrong in (2, -1, "third"):
        with pytest.raises(InputError, match="choose a number from 0 to 1"):
            log.demonstration(wrong)


def test_tracks_may_be_lists(good):
    track = good.objects["box"]
    plain = Track(track.pose.tolist(), track.kind, track.size.tolist())
    assert (
        checked(dataclasses.replace(good, objects={"box": plain}), "x").objects["box"].pose.dtype
        == np.float64
    )
