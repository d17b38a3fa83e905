"""Nearest points on meshes: those that slow and sure ways find, in every library, each row by itself."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.any_tree.meshes import made
from bt_tasksim.scene.mesh_surface import FEW, MeshSurface, nearest_on_triangles, sampled
from bt_tasksim.scene.meshes import TriangleMesh
from tests.array_libraries import agree

MESHES = {name: TriangleMesh(*made(name, 0)) for name in ("corner", "star", "mug", "ladle")}
SURFACES = {name: MeshSurface(mesh) for name, mesh in MESHES.items()}


def sure(mesh, points):
    """Over all triangles, by trimesh's own law."""
    corners = mesh.vertices[mesh.faces]
    nearest = []
    for point in points:
        found = trimesh.triangles.closest_point(corners, np.tile(point, (len(corners), 1)))
        nearest.append(np.min(np.linalg.norm(found - point, axis=1)))
    return np.array(nearest)


@pytest.mark.parametrize("name", MESHES)
def test_they_are_the_nearest(name):
    rng = np.random.default_rng(0)
    mesh, surface = MESHES[name], SURFACES[name]
    samples = sampled(mesh, 150, seed=3)
    near = samples.points + rng.normal(scale=0.006, size=(150, 3))
    found = np.linalg.norm(surface.nearest(near) - near, axis=1)
    assert found == pytest.approx(sure(mesh, near), abs=1e-9 if len(mesh.faces) <= FEW else 3e-4)
    far = mesh.vertices.mean(axis=0) + rng.normal(scale=0.1, size=(150, 3))
    found, wanted = np.linalg.norm(surface.nearest(far) - far, axis=1), sure(mesh, far)
    if len(mesh.faces) <= FEW:
        assert found == pytest.approx(wanted, abs=1e-9)
    assert np.all(found < wanted + np.where(wanted < 0.04, 0.002, 0.15 * wanted))


@pytest.mark.parametrize("name", MESHES)
def test_points_on_it_stay(name):
    points = sampled(MESHES[name], 300, seed=5).points
    np.testing.assert_allclose(SURFACES[name].nearest(points), points, atol=1e-9)


@pytest.mark.parametrize("name", MESHES)
def test_rows_do_not_feel_each_other(name):
    points = np.random.default_rng(1).normal(scale=0.05, size=(60, 2, 3))
    whole = SURFACES[name].nearest(points)
    assert whole.shape == points.shape
    for i in (0, 7, 59):
        np.testing.assert_array_equal(SURFACES[name].nearest(points[i]), whole[i])
        np.testing.assert_array_equal(SURFACES[name].nearest(points[i, 0]), whole[i, 0])


@pytest.mark.parametrize("name", MESHES)
def test_every_library_and_device_finds_the_same(name):
    points = np.random.default_rng(2).normal(scale=0.05, size=(9, 2, 3))
    agree(SURFACES[name].nearest, points, close=1e-12, single_close=1e-4)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=12, max_size=12))
def test_the_nearest_point_of_a_triangle(numbers):
    point, corners = np.array(numbers[:3]), np.array(numbers[3:]).reshape(3, 3)
    area = np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    if area < 1e-3 or np.min(sides) < 1e-2:
        return
    found = nearest_on_triangles(point[None, None], corners[None, None])[0, 0]
    wanted = trimesh.triangles.closest_point(corners[None], point[None])[0]
    assert np.linalg.norm(found - point) == pytest.approx(np.linalg.norm(wanted - point), abs=1e-9)


def test_samples_are_spread_by_area_and_are_the_same_for_a_seed():
    mesh = MESHES["corner"]
    one, other = sampled(mesh, 4000), sampled(mesh, 4000)
    np.testing.assert_array_equal(one.points, other.points)
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    share = np.bincount(one.face, minlength=len(area)) / 4000
    assert share == pytest.approx(area / area.sum(), abs=1e-3)
    np.testing.assert_allclose(np.linalg.norm(one.normals, axis=1), 1.0)
