"""What is measured of each concept's scenario, on one draw."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks import concepts, concepts_twin


def test_a_row_is_counted_and_felt(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    asked = ["--only", "grasp_then_pick", "--robots", "panda", "--engines", "sapien", "--episodes", "1"]
    assert concepts.main([*asked, "--seed", "500001", "--workers", "1"]) == 0
    assert "grasp_then_pick-panda-sapien" in capsys.readouterr().out
    (file,) = tmp_path.glob("runs/benchmarks/concept-*.json")
    found = json.loads(file.read_text())
    assert found["episodes"] == 1 and found["first_seed"] == 500001
    assert 0.0 < found["force"]["largest"] < 100.0 and found["jerk"]["largest"] > 0.0
    assert found["force"]["within"] == found["force"]["of"] == found["gentle"] == 1


def test_sealed_seeds_are_refused(capsys):
    assert concepts.main(["--only", "grasp_then_pick", "--seed", "9000000"]) == 2
    assert "sealed" in capsys.readouterr().err


def test_the_jerk_of_a_cubic_motion_is_its_third_derivative():
    feeler, period = concepts.Feeler(), 0.05
    feeler.tool[7] = [np.array([(k * period) ** 3, 0.0, 0.0]) for k in range(12)]
    assert feeler.jerk(7, period) == pytest.approx(6.0, rel=1e-6)


def test_rows_on_the_twin_are_measured_where_they_are_asked_for(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    asked = []

    def measure(self, scenario, robot, seeds):
        asked.append((scenario, robot, list(seeds)))
        ok = {"success": True, "leaf": "", "reason": ""}
        return concepts_twin.summary([ok, ok | {"success": False, "leaf": "pour jug", "reason": "spilled"}])

    monkeypatch.setattr(concepts_twin.TwinOfScenarios, "measure", measure)
    rows = ["--only", "make_room", "pour_a_cup", "--engines", "twin", "--episodes", "2", "--seed", "620000"]
    assert concepts.main(rows) == 0
    assert asked == [(name, "panda", [620000, 620001]) for name in ("make_room", "pour_a_cup")]
    assert "pour_a_cup-panda-twin" in capsys.readouterr().out
    found = json.loads((tmp_path / "runs/benchmarks/concept-make_room-panda-twin.json").read_text())
    assert found["successes"] == 1 and found["reasons"] == {"pour jug: spilled": 1}
