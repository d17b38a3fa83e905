"""Convex parts: few, always the same, and hardly more than the solid."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from benchmarks.any_tree.meshes import FORMS, made
from bt_tasksim.core.errors import InputError
from bt_tasksim.scene.convex_parts import AT_ONCE, MOST_PARTS, _parts, convex_parts
from bt_tasksim.scene.meshes import TriangleMesh, mass_properties

EXCESS = {"mug": 0.10, "tube": 0.10, "bowl": 0.5, "jar": 0.4, "ladle": 0.4}
"""Largest additional volume; 5 % for all others. Walls that curve twice are not made of 32 parts."""


@pytest.mark.parametrize("name", FORMS)
def test_they_are_few_and_add_little(name):
    mesh = TriangleMesh(*made(name, 0))
    parts = convex_parts(mesh)
    assert len(parts) <= MOST_PARTS
    volume = sum(ConvexHull(part).volume for part in parts)
    assert volume <= (1.0 + EXCESS.get(name, 0.05)) * mass_properties(mesh).volume
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    points = np.concatenate(parts)
    assert points.min(axis=0) == pytest.approx(low, abs=1e-3)
    assert points.max(axis=0) == pytest.approx(high, abs=1e-3)


def test_what_is_convex_is_one_part():
    assert [len(convex_parts(TriangleMesh(*made(name, 1)))) for name in ("book", "egg", "frustum")] == [
        1,
        1,
        1,
    ]


def test_they_are_the_same_each_time():
    mesh = TriangleMesh(*made("mug", 2))
    first = convex_parts(mesh)
    _parts.cache_clear()
    second = convex_parts(mesh)
    assert first is not second and len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_mug_stays_hollow():
    mesh = TriangleMesh(*made("mug", 0))
    inside = [np.array([x, y, 0.03]) for x in (-0.02, 0.0, 0.02) for y in (-0.02, 0.0, 0.02)]
    for part in convex_parts(mesh):
        planes = ConvexHull(part).equations
        for point in inside:
            assert np.max(planes[:, :3] @ point + planes[:, 3]) > 0


def test_a_mesh_of_many_triangles_is_cut_apart_and_gives_the_same(monkeypatch):
    mesh = TriangleMesh(*made("mug", 2))
    here = convex_parts(mesh)
    monkeypatch.setattr("bt_tasksim.scene.convex_parts.AT_ONCE", 10)
    _parts.cache_clear()
    for one, other in zip(here, convex_parts(mesh), strict=True):
        np.testing.assert_array_equal(one, other)


def test_one_that_is_too_rough_is_refused_and_does_not_hang(monkeypatch):
    monkeypatch.setattr("bt_tasksim.scene.convex_parts.MOST_SECONDS", 2)
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.04)
    rough = np.random.default_rng(1).uniform(0.9, 1.1, (len(ball.vertices), 1))
    mesh = TriangleMesh(np.asarray(ball.vertices) * rough, np.asarray(ball.faces))
    assert len(mesh.faces) > AT_ONCE
    with pytest.raises(InputError, match=r"triangles cannot be cut into convex parts in 2 s"):
        convex_parts(mesh)
