"""Grips of meshes: opposite points of the surface, at handles, rims and either arm."""

import math

import numpy as np
import pytest

from benchmarks.any_tree.meshes import FORMS, corner_of, made, mug_of, triangles
from bt_tasksim.scene.antipodal import FRICTION, MOST, WIDEST, antipodal_grips, width_at
from bt_tasksim.scene.mesh_surface import MeshSurface
from bt_tasksim.scene.meshes import TriangleMesh, mass_properties


def centred(vertices, faces):
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    return TriangleMesh(vertices - middle, faces)


def grips_of(mesh):
    return antipodal_grips(mesh, mass_properties(mesh).pose[:3])


@pytest.mark.parametrize("name", FORMS)
def test_both_contacts_lie_on_the_surface_and_their_normals_in_the_cone(name):
    mesh = centred(*made(name, 0))
    grips = grips_of(mesh)
    assert 1 <= len(grips) <= MOST
    np.testing.assert_allclose(np.linalg.norm(grips.closing, axis=1), 1.0)
    assert np.all((grips.widths > 0) & (grips.widths <= WIDEST))
    assert np.all((grips.firmness >= 0) & (grips.firmness <= 1)) and np.all(np.diff(grips.firmness) <= 0)
    assert np.min(grips.widths) < 0.07, "a hand of 7 cm can hold it"
    surface = MeshSurface(mesh)
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for sign in (-1, 1):
        contacts = grips.points + sign * grips.widths[:, None] / 2 * grips.closing
        np.testing.assert_allclose(surface.nearest(contacts), contacts, atol=1e-4)
        for contact, way in zip(contacts, sign * grips.closing, strict=True):
            on = np.abs(np.sum((contact - corners[:, 0]) * normals, axis=1)) < 1e-4
            assert np.max(normals[on] @ way) > math.cos(math.atan(FRICTION)) - 1e-6


def test_they_are_the_same_each_time():
    mesh = centred(*made("hammer", 1))
    one, other = grips_of(mesh), grips_of(mesh)
    for field in ("points", "closing", "widths", "firmness"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))


def test_a_mug_is_held_by_its_handle_by_its_rim_and_about_its_body():
    mesh = centred(*triangles(mug_of(0.034, 0.082, 0.0045, 0.006)))
    grips = grips_of(mesh)
    x = grips.points[:, 0]
    handle = x > np.max(mesh.vertices[:, 0]) - 0.02
    assert np.any(handle & (np.abs(grips.closing[:, 1]) > 0.9) & (np.abs(grips.widths - 0.012) < 1e-4))
    wall = np.abs(grips.widths - 0.0045) < 1e-3
    assert np.any(wall & (grips.points[:, 2] > 0.02))
    body = np.abs(grips.widths - 0.068) < 1e-3
    assert np.any(body & (np.abs(grips.closing[:, 2]) < 0.1))


def test_an_l_is_held_by_either_arm_and_not_in_the_air():
    length, height, wide, thick = 0.09, 0.075, 0.028, 0.022
    mesh = centred(*triangles(corner_of(length, height, wide, thick)))
    grips = grips_of(mesh)
    upright = (grips.points[:, 0] < -length / 2 + thick) & (grips.points[:, 2] > 0)
    lying = (grips.points[:, 2] < -height / 2 + thick) & (grips.points[:, 0] > 0)
    assert np.any(upright & (np.abs(grips.widths - thick) < 1e-4))
    assert np.any(lying & (np.abs(grips.widths - wide) < 1e-4))
    air = (grips.points[:, 0] > -length / 2 + thick) & (grips.points[:, 2] > -height / 2 + thick)
    assert not np.any(air)


def test_flat_and_central_grips_are_firmer():
    mesh = centred(*made("book", 0))
    grips = grips_of(mesh)
    aside = np.linalg.norm(grips.points, axis=1)
    assert aside[0] < 0.02 and grips.firmness[0] > 0.85
    far = aside > 0.045
    assert np.any(far) and np.max(grips.firmness[far]) < 0.75


def test_the_width_at_a_point():
    box = centred(*triangles(corner_of(0.09, 0.075, 0.028, 0.022)))
    assert width_at(box, np.array([-0.034, 0, 0.01]), np.array([2.0, 0, 0])) == pytest.approx(0.022, abs=1e-6)
    assert width_at(box, np.array([0.2, 0, 0.0]), np.array([0.0, 1, 0])) is None
    tube = centred(*made("tube", 0))
    across = float(np.ptp(tube.vertices[:, 1]))
    assert width_at(tube, np.zeros(3), np.array([0.0, 1, 0])) == pytest.approx(across, abs=1e-4)
