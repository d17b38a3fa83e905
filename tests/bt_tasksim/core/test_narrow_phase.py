"""coal answers the same, whatever a process asked it first."""

import subprocess
import sys

import pytest

ASK = """
import numpy as np
from bt_tasksim.core.narrow_phase import coal

def depths():
    rng = np.random.default_rng(0)
    for _ in range(50):
        turn = coal.Quaternion(*rng.normal(size=4)).normalized()
        at = coal.Transform3s(turn, rng.uniform(-0.1, 0.1, 3))
        boxes = coal.Box(0.1, 0.2, 0.05), coal.Box(0.03, 0.04, 0.06)
        yield coal.distance(
            boxes[0], coal.Transform3s.Identity(), boxes[1], at, coal.DistanceRequest(), coal.DistanceResult()
        ).hex()
"""
PLAN = """
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.robot.description import load_robot
bodies_of(load_robot("panda"))
"""
SLANTED = """
request = coal.DistanceRequest()
request.gjk_initial_guess = coal.GJKInitialGuess.CachedGuess
request.cached_gjk_guess = np.array([1.0, 0.5, 0.2])
box, at = coal.Box(1.0, 1.0, 1.0), coal.Transform3s.Identity()
coal.distance(box, at, box, at, request, coal.DistanceResult())
"""


def depths(first: str) -> str:
    found = subprocess.run(
        [sys.executable, "-c", f"{ASK}{first}\nprint(*depths())"], capture_output=True, text=True, check=True
    )
    return found.stdout


@pytest.mark.parametrize("first", [PLAN, SLANTED], ids=["plans for a robot", "begins along no axis"])
def test_what_is_asked_first_changes_no_answer(first: str) -> None:
    assert depths(first) == depths("")
