"""Synthetic demonstrations of what trees do, whatever their leaves are."""

from __future__ import annotations

import numpy as np
import pytest

from bt_tasksim.demos_decomp import decompose_log, open_log
from bt_tasksim.execution import performed


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    file = tmp_path_factory.mktemp("shown") / "shown.h5"
    assert performed.main(["pick_and_place", "--episodes", "1", "--seed", "500003", "--out", str(file)]) == 0
    return file


def test_a_run_becomes_a_recording_that_decomposes_again(log):
    found = decompose_log(open_log(log))
    assert [task.concept for task in found.tasks] == ["grasp", "pick", "bring", "place", "release"]


def test_it_says_what_was_really_done_when(log):
    (demonstration,) = open_log(log).demonstrations
    concepts = [word.decode() for word in np.asarray(demonstration.extra["labels/concept"]).tolist()]
    seconds = demonstration.extra["labels/seconds"]
    assert concepts == ["grasp", "pick", "bring", "place", "release"]
    assert np.all(seconds[:, 0] < seconds[:, 1]) and np.all(seconds[1:, 0] >= seconds[:-1, 1] - 1e-9)
    assert seconds[0, 0] >= 0.0 and seconds[-1, 1] <= demonstration.time[-1] + 1e-9


def test_it_has_the_errors_of_a_recording(log):
    (demonstration,) = open_log(log).demonstrations
    gaps = np.diff(demonstration.time)
    assert gaps.std() > 1e-3, "samples are lost"
    still = next(iter(demonstration.objects.values())).pose[:5, :3]
    assert 1e-4 < np.std(still, axis=0).max() < 5e-3


def test_none_is_refused(tmp_path, capsys):
    assert performed.main(["pick_and_place", "--episodes", "0", "--out", str(tmp_path / "a.h5")]) == 2
    assert "at least 1" in capsys.readouterr().err
