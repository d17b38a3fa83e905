"""Meshes of everyday forms: closed, standing, of a size for a hand, and the same for a seed."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from benchmarks.any_tree.meshes import FORMS, made, write
from bt_tasksim.scene.mesh_file import mesh_extent
from bt_tasksim.scene.shapes import ShapeSize, shape_kind


def test_there_are_twenty_and_files_of_them_are_the_same_for_a_seed(tmp_path):
    one, other = write(tmp_path / "a", 5), write(tmp_path / "b", 5)
    assert len(one) >= 20
    assert all(one[name].read_bytes() == other[name].read_bytes() for name in FORMS)
    another = write(tmp_path / "c", 6)
    assert all(one[name].read_bytes() != another[name].read_bytes() for name in FORMS)


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("name", FORMS)
def test_each_is_one_closed_solid_that_stands_on_a_flat_base(name, seed):
    mesh = trimesh.Trimesh(*made(name, seed))
    assert mesh.is_watertight and mesh.body_count == 1 and mesh.volume > 0
    assert 0.04 <= max(mesh.extents) <= 0.14
    assert mesh.bounds[0, 2] == pytest.approx(0.0, abs=1e-6)
    down = (mesh.face_normals[:, 2] < -0.999) & (mesh.triangles_center[:, 2] < 1e-4)
    base = mesh.triangles[down].reshape(-1, 3)[:, :2]
    sides = ConvexHull(base).equations
    assert np.max(sides[:, :2] @ mesh.center_mass[:2] + sides[:, 2]) < -0.004, "its centre of mass is above"


def test_a_file_of_each_has_a_grip_for_a_small_gripper(tmp_path):
    for name, file in write(tmp_path, 3).items():
        size = ShapeSize(mesh_extent(str(file)), mesh=str(file))
        grips = shape_kind("mesh").grips(size)
        assert np.min(grips.widths) < 0.07, name
