"""Routes among the paths of a batch: each in its own world, one after the other, and the rest unchanged."""

import numpy as np
import pytest

from bt_tasksim.planning.reference_motion import at_times, plan, sample
from bt_tasksim.planning.route import Pace, Route, timed
from bt_tasksim.planning.routes import SAMPLES, in_postures, joints_along, with_routes

N_ARM = 7


@pytest.fixture
def batch(panda):
    """Straight paths of three worlds, and two routes that follow one another."""
    ends = np.array([panda.pose(0.4, y, 0.4) for y in (0.1, 0.2, 0.3)])
    starts = np.array([panda.pose(0.4, 0.0, 0.4)] * 3)
    a, b, c = (panda.posture(0.4, y, 0.4) for y in (0.0, -0.2, -0.1))
    routes = [timed(panda.arm, way, Pace(0.5), None) for way in ([a, b], [b, c])]
    return plan([starts, ends], 0.5, samples=SAMPLES), routes


def test_without_routes_all_is_as_before_and_no_posture_is_asked_for(batch):
    path, _ = batch
    found = with_routes(path, {}, N_ARM)
    assert np.array_equal(found.table, path.table) and np.isnan(found.joints).all() and not found.even.any()
    now = np.full(3, 0.4)
    assert np.array_equal(sample(found, now), sample(path, now)) and np.isnan(at_times(found, now)[1]).all()
    assert at_times(path, now)[1] is None


def test_a_world_with_a_route_leaves_the_others_alone(batch):
    path, routes = batch
    found = with_routes(path, {1: routes}, N_ARM)
    now = np.full(3, 0.4)
    others = np.array([0, 2])
    assert np.array_equal(sample(found, now)[others], sample(path, now)[others])
    assert np.isnan(at_times(found, now)[1][others]).all() and np.isfinite(at_times(found, now)[1][1]).all()
    assert found.duration[1] == pytest.approx(sum(r.duration for r in routes))
    alone = with_routes(path._replace(table=path.table[1:2], duration=path.duration[1:2]), {0: routes}, N_ARM)
    assert np.array_equal(alone.table[0], found.table[1]) and np.array_equal(alone.joints[0], found.joints[1])


def test_routes_follow_one_another_each_from_rest_to_rest(batch, panda):
    path, routes = batch
    found = with_routes(path, {0: routes}, N_ARM)
    middle = np.full(3, routes[0].duration)
    assert np.allclose(at_times(found, middle)[1][0], routes[0].joints[-1], atol=5e-3)
    assert np.allclose(at_times(found, np.zeros(3))[1][0], routes[0].joints[0])
    assert np.allclose(at_times(found, np.full(3, 99.0))[1][0], routes[1].joints[-1])
    for time in np.linspace(0.0, float(found.duration[0]), 30):
        joints = at_times(found, np.full(3, time))[1][0]
        assert np.allclose(panda.arm.tool(joints)[:3], sample(found, np.full(3, time))[0, :3], atol=5e-3)


def test_a_route_in_whatever_posture_has_none(batch):
    path, (first, second) = batch
    free = Route(second.tools, np.zeros((len(second.tools), 0)), second.duration)
    found = with_routes(path, {0: [first, free]}, N_ARM)
    assert np.isfinite(at_times(found, np.zeros(3))[1][0]).all()
    assert np.isnan(at_times(found, found.duration)[1][0]).all()


@pytest.mark.parametrize("kind", ["float32", "float64"])
def test_in_torch_it_is_the_same(batch, kind):
    torch = pytest.importorskip("torch")
    path, routes = batch
    there = path._replace(table=torch.from_numpy(path.table), duration=torch.from_numpy(path.duration))
    there = there._replace(**{k: getattr(there, k).to(getattr(torch, kind)) for k in ("table", "duration")})
    found, here = with_routes(there, {1: routes}, N_ARM), with_routes(path, {1: routes}, N_ARM)
    assert found.joints.dtype == found.table.dtype == getattr(torch, kind)
    assert np.allclose(found.joints.numpy(), here.joints, atol=1e-6, equal_nan=True)
    assert np.allclose(found.table.numpy(), here.table, atol=1e-6)


def test_a_path_is_followed_in_the_arms_own_posture_where_it_can_be(batch, panda):
    path, _ = batch
    start = panda.posture(0.4, 0.0, 0.4)
    found = in_postures(with_routes(path, {}, N_ARM), joints_along(path, panda.arm, {1: start}))
    assert np.array_equal(found.table, path.table) and np.isnan(found.joints[[0, 2]]).all()
    assert np.allclose(found.joints[1, 0], start, atol=1e-3)
    tools = panda.arm.tools(found.joints[1])
    assert np.allclose(tools[:, :3], path.table[1, :, :3], atol=2e-3)
    assert np.abs(np.diff(found.joints[1], axis=0)).max() < 0.05, "without a jump"
    away = path._replace(table=path.table + np.array([3.0, 0, 0, 0, 0, 0, 0]))
    assert not joints_along(away, panda.arm, {1: start}), "out of reach"
