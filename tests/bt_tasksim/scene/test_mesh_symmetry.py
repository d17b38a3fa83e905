"""How often meshes look the same in one turn: prisms of every order, bodies of revolution, and neither."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.any_tree.meshes import made
from bt_tasksim.scene.mesh_symmetry import symmetry_about_z
from bt_tasksim.scene.meshes import TriangleMesh


def prism(corners, height=0.05, turned=0.0, aside=(0.0, 0.0)):
    """An upright prism over a polygon ``(n, 2)`` that is convex."""
    n = len(corners)
    cosine, sine = np.cos(turned), np.sin(turned)
    flat = corners @ np.array([[cosine, sine], [-sine, cosine]]) + np.array(aside)
    low, high = (np.column_stack([flat, np.full(n, z)]) for z in (-height / 2, height / 2))
    k, after = np.arange(n), (np.arange(n) + 1) % n
    sides = [np.stack([k, after, after + n], -1), np.stack([k, after + n, k + n], -1)]
    inner = np.arange(1, n - 1)
    lids = [np.stack([0 * inner, inner + 1, inner], -1), np.stack([0 * inner, inner, inner + 1], -1) + n]
    return TriangleMesh(np.concatenate([low, high]), np.concatenate([*sides, *lids]))


def regular(n, radius=0.03):
    angle = 2 * np.pi * np.arange(n) / n
    return radius * np.stack([np.cos(angle), np.sin(angle)], -1)


@given(st.integers(3, 7), st.floats(0.02, 0.1), st.floats(-3.0, 3.0))
def test_a_regular_prism_has_the_order_of_its_polygon(n, radius, turned):
    assert symmetry_about_z(prism(regular(n, radius), turned=turned)) == n


@given(st.floats(1.15, 3.0), st.floats(-3.0, 3.0))
def test_a_box_looks_the_same_after_half_a_turn(long, turned):
    corners = 0.02 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [long, 1.0]
    assert symmetry_about_z(prism(corners, turned=turned)) == 2


def test_a_round_thing_has_order_none():
    assert symmetry_about_z(prism(regular(48))) == 0


def test_an_axis_far_from_the_frames_is_none():
    assert symmetry_about_z(prism(regular(6), aside=(0.004, 0.0))) == 6
    assert symmetry_about_z(prism(regular(6), aside=(0.006, 0.0))) == 1


@pytest.mark.parametrize(
    ("form", "order"),
    [
        ("mug", 1),
        ("hammer", 1),
        ("wedge", 1),
        ("basket", 2),
        ("plus", 4),
        ("star", 5),
        ("nut", 6),
        ("jar", 0),
    ],
)
def test_everyday_forms(form, order):
    for seed in range(3):
        vertices, faces = made(form, seed)
        middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        assert symmetry_about_z(TriangleMesh(vertices - middle, faces)) == order


def test_a_spout_of_few_corners_is_seen_on_a_fine_mesh():
    """Of 9,000 corners, four make the spout: a sample of them may miss it."""
    around, up = 300, 30
    angle = 2 * np.pi * np.arange(around) / around
    ring = 0.03 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    heights = np.linspace(-0.04, 0.04, up)
    side = np.concatenate([np.column_stack([ring, np.full(around, h)]) for h in heights])
    side[-around + 1 : -around + 5, :2] *= 1.3
    vertices = np.concatenate([side, [[0, 0, -0.04], [0, 0, 0.04]]])
    k = np.arange(around)
    following = (k + 1) % around
    faces = []
    for level in range(up - 1):
        low, high = level * around, (level + 1) * around
        faces += [np.stack([low + k, low + following, high + following], axis=-1)]
        faces += [np.stack([low + k, high + following, high + k], axis=-1)]
    top = (up - 1) * around
    faces += [np.stack([np.full(around, len(side)), following, k], axis=-1)]
    faces += [np.stack([np.full(around, len(side) + 1), top + k, top + following], axis=-1)]
    assert symmetry_about_z(TriangleMesh(vertices, np.concatenate(faces))) == 1
