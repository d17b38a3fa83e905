"""The laws of how things stand to each other, against exact geometry and in batches."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.scene.outlines import distance, slabs, whole_outline
from bt_tasksim.scene.shapes import ShapeSize, shape
from bt_tasksim.scene.spatial_laws import (
    Hollow,
    PlacedObject,
    _normals,
    between,
    beyond_hollow,
    beyond_opening,
    leaning,
)
from tests.bt_tasksim.scene.solids import solids

QUATERNIONS = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1)


@st.composite
def placed(draw):
    """A solid, and a pose of it within 30 cm."""
    position = [draw(st.floats(-0.15, 0.15)) for _ in range(3)]
    rotation = np.array(draw(QUATERNIONS)) if draw(st.booleans()) else poses.yaw(draw(st.floats(-4, 4)))
    return shape(*draw(solids())), poses.unit_pose(np.array([*position, *rotation]))


def body(*placed):
    """Several solids as one in as many worlds."""
    most = max(len(made.outer) for made, _ in placed)
    corners = [made.outer[np.minimum(np.arange(most), len(made.outer) - 1)] for made, _ in placed]
    return PlacedObject(
        np.array([pose for _, pose in placed]), np.array(corners), np.zeros(len(placed), bool)
    )


def gaps(a, b):
    normals = np.concatenate([_normals(a.pose), _normals(b.pose)], axis=1)
    return between(a.reach[..., :2], b.reach[..., :2], normals)


@settings(deadline=None)
@given(placed(), placed())
def test_the_gap_is_that_between_the_outlines_up_to_a_millimetre(one, other):
    exact = distance(*(whole_outline(slabs(made.collision, pose)) for made, pose in (one, other)))
    found = float(gaps(body(one), body(other))[0])
    assert exact - 1.5e-3 <= found <= exact + 1e-9
    assert np.isclose(found, gaps(body(other), body(one))[0], atol=1e-12)


@settings(deadline=None)
@given(st.floats(-0.03, 0.3), st.floats(-4, 4), st.floats(-4, 4))
def test_the_gap_of_boxes_along_their_edges_is_exact(gap, heading, other):
    made = shape("box", ShapeSize((0.06, 0.04, 0.1)))
    way = np.array([np.cos(heading), np.sin(heading)])
    at = poses.pose([*((gap + 0.06) * way), 0.0], poses.yaw(heading))
    still = poses.pose([0.0, 0.0, 0.0], poses.yaw(heading))
    assert np.isclose(gaps(body((made, still)), body((made, at)))[0], gap)
    turned = poses.pose([*((gap + 0.06) * way), 0.0], poses.yaw(other))
    pair = (made, poses.pose([0.0, 0, 0])), (made, turned)
    exact = distance(*(whole_outline(slabs(m.collision, p)) for m, p in pair))
    if exact < 0.0:
        assert np.isclose(gaps(*map(body, pair))[0], exact)


@settings(deadline=None, max_examples=30)
@given(st.lists(placed(), min_size=2, max_size=4), st.lists(placed(), min_size=4, max_size=4))
def test_a_world_gets_the_same_bits_in_any_company(some, others):
    others = others[: len(some)]
    a, b = body(*some), body(*others)
    boxes = np.stack([shape("cup", ShapeSize((0.1, 0.1, 0.1))).hollow] * len(some))
    inside = beyond_hollow(a, Hollow(b.pose, boxes))
    together, lean = gaps(a, b), leaning(a.pose[:, 3:], a.cubic)
    for k in range(len(some)):
        one, other = (PlacedObject(*(values[k : k + 1] for values in bodies)) for bodies in (a, b))
        assert gaps(one, other)[0] == together[k]
        assert beyond_hollow(one, Hollow(other.pose, boxes[k : k + 1]))[0] == inside[k]
        assert leaning(one.pose[:, 3:], one.cubic)[0] == lean[k]


@settings(deadline=None)
@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-4, 4))
def test_what_reaches_beyond_an_opening_is_measured_from_above(x, y, heading):
    """Two halves of an opening of 20 by 20 cm, against the corners of a box."""
    made = shape("box", ShapeSize((0.06, 0.04, 0.1)))
    there = body((made, poses.pose([x, y, 5.0], poses.yaw(heading))))
    halves = np.array([[[-0.05, 0.0, 0.05, 0.1, 0.0, 0.2], [0.05, 0.0, 0.05, 0.1, 0.0, 0.2]]])
    exact = np.clip(np.max(np.abs(there.reach[0, :, :2])) - 0.1, 0.0, np.inf)
    assert np.isclose(beyond_opening(there, Hollow(poses.pose([0.0, 0, 0])[None], halves))[0], exact)
