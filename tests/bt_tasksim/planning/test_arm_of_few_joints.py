"""An arm of five joints has what it can have of a pose: the place first, and no more turn than it must."""

import numpy as np
import pytest

from bt_tasksim import load_robot
from bt_tasksim.core import poses
from bt_tasksim.planning.arm import LEANS, SWAYS, arm_of

DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def arm():
    return arm_of(load_robot("so100"))


def straight_down(far: float, height: float, bearing: float, turn: float) -> np.ndarray:
    """The tool pose ``(7,)`` so far from the base, in metres; the SO-100 looks towards -y."""
    at = [far * np.sin(bearing), -far * np.cos(bearing), height]
    return np.concatenate([at, poses.frame_from_axes(DOWN, np.array([np.cos(turn), np.sin(turn), 0.0]))])


def found(arm, tool, leans):
    tries = (arm.joints(tool, seed, leans=leans) for seed in (arm.robot.rest, *arm.seeds))
    return next((q for q in tries if q is not None), None)


@pytest.mark.parametrize("turn", np.linspace(-3.0, 3.0, 7))
@pytest.mark.parametrize(("far", "height"), [(0.17, 0.02), (0.2, 0.04), (0.28, 0.02), (0.24, 0.09)])
def test_straight_down_it_has_every_heading_exactly(arm, far, height, turn):
    tool = straight_down(far, height, 0.3, turn)
    q = found(arm, tool, LEANS)
    assert q is not None
    there = arm.tool(q)
    assert np.linalg.norm(there[:3] - tool[:3]) < 1e-3
    assert poses.angle_between(there[3:], tool[3:]) < 0.02


@pytest.mark.parametrize("turn", np.linspace(-3.0, 3.0, 7))
def test_higher_up_and_farther_out_it_leans_where_it_may(arm, turn):
    tool = straight_down(0.27, 0.16, -0.2, turn)
    assert found(arm, tool, LEANS) is None
    q = found(arm, tool, SWAYS)
    assert q is not None
    there = arm.tool(q)
    assert np.linalg.norm(there[:3] - tool[:3]) < 1e-3
    assert LEANS < poses.angle_between(there[3:], tool[3:]) <= SWAYS


def test_it_leans_on_its_way_and_not_at_its_end(arm):
    low, high = straight_down(0.28, 0.03, 0.0, 0.4), straight_down(0.28, 0.12, 0.0, 0.4)
    heights = np.linspace(0.0, 1.0, 20)[1:]
    up = np.array([poses.interpolate(low[None], high[None], np.array([s]))[0] for s in heights])
    start = found(arm, low, LEANS)
    assert arm.along(start, up) is None
    joints = arm.along(start, up, SWAYS)
    assert joints is not None
    back = arm.along(joints[-1], np.concatenate([up[-2::-1], low[None]]))
    assert back is not None
    assert poses.angle_between(arm.tool(back[-1])[3:], low[3:]) < 0.02
