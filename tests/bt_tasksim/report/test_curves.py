"""What the report draws."""

import json

import numpy as np
import pytest

from bt_tasksim.report.curves import _kept, _rounded, _short, report_data, status_spans

pytestmark = pytest.mark.physical


def test_spans():
    status = np.array([[1, 0], [1, 0], [2, 1], [2, 3], [0, 3]], np.int8)
    assert status_spans(status) == [
        [[0, 2, "RUNNING"], [2, 4, "SUCCESS"]],
        [[2, 3, "RUNNING"], [3, 5, "FAILURE"]],
    ]


def test_commands_are_kept():
    nan = np.nan
    np.testing.assert_array_equal(_kept(np.array([nan, 1.0, nan, nan, 2.0, nan])), [nan, 1, 1, 1, 2, 2])


def test_numbers_for_json():
    assert _rounded([1.23456789, np.nan, -np.inf, 0.0]) == [1.2346, None, None, 0.0]


def test_short_joint_names():
    assert _short(("panda_joint1", "panda_joint2")) == ["joint 1", "joint 2"]
    assert _short(("a_lift", "a_turn")) == ["lift", "turn"]
    assert _short(("only",)) == ["only"]
    assert _short(("j", "j2")) == ["j", "j2"]


def test_a_run(run, recorded):
    data = report_data(run)
    json.dumps(data, allow_nan=False)
    assert data["end"] == pytest.approx(recorded.result.sim_time)
    panels = {panel["title"]: panel for panel in data["panels"]}
    assert len(panels) == len(data["panels"]) == 9
    for panel in panels.values():
        for curve in panel["curves"]:
            assert len(curve["values"]) == len(data["time"]), (panel["title"], curve["name"])
    opening = panels["Hand opening"]
    assert opening["unit"] == "mm" and max(opening["curves"][0]["values"]) == pytest.approx(80, abs=1)
    assert [c["name"] for c in panels["Height of tool and objects"]["curves"]] == [
        "tool",
        "tool, commanded",
        "target",
    ]
    assert [c["name"] for c in panels["Necessary cost, of each concept in its own unit"]["curves"]] == [
        f"{concept} target" for concept in ("grasp", "pick", "bring", "place", "release")
    ]
    error = panels["Error of the estimated position"]["curves"][0]["values"]
    assert 0.1 < max(error) < 20
