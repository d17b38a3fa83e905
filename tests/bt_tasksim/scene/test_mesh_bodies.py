"""Bodies that touch, overlap or lie within each other are read as what they are together."""

import numpy as np
import pytest
import trimesh

from bt_tasksim.core.errors import InputError
from bt_tasksim.scene.mesh_bodies import separate, solids_and_cavities, united
from bt_tasksim.scene.mesh_file import mesh_extent, mesh_shape
from bt_tasksim.scene.meshes import mass_properties
from bt_tasksim.scene.shapes import ConvexPiece

SIDE = 0.04


def cube(at, side=SIDE, **turned):
    mesh = trimesh.creation.box((side, side, side))
    mesh.apply_translation(at)
    return mesh


def merged(*parts):
    whole = trimesh.util.concatenate(parts)
    whole.merge_vertices()
    return np.array(whole.vertices), np.array(whole.faces)


def volume_of(*parts):
    solids, cavities = solids_and_cavities(separate(*merged(*parts)))
    return len(solids), len(cavities), mass_properties(united(solids, cavities)).volume / SIDE**3


TOUCHING = {
    "a face": (SIDE, 0, 0),
    "half a face": (SIDE, SIDE / 2, 0),
    "an edge": (SIDE, SIDE, 0),
    "a corner": (SIDE, SIDE, SIDE),
}


@pytest.mark.parametrize("at", TOUCHING.values(), ids=TOUCHING)
def test_two_cubes_that_share_something_are_two_bodies_of_twice_the_volume(at):
    solids, cavities, volume = volume_of(cube((0, 0, 0)), cube(at))
    assert (solids, cavities) == (2, 0)
    assert volume == pytest.approx(2.0)


def test_a_shared_face_cut_along_the_other_diagonal():
    other = cube((SIDE, 0, 0))
    other.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0], [SIDE, 0, 0]))
    assert volume_of(cube((0, 0, 0)), other) == (2, 0, pytest.approx(2.0))


def test_overlapping_bodies_weigh_what_they_fill():
    assert volume_of(cube((0, 0, 0)), cube((SIDE / 2, 0, 0)))[2] == pytest.approx(1.5)
    assert volume_of(cube((0, 0, 0)), cube((0, 0, 0), side=SIDE / 2))[2] == pytest.approx(1.0)
    assert volume_of(cube((0, 0, 0)), cube((0, 0, 0)))[2] == pytest.approx(1.0)


def test_what_faces_inwards_is_a_cavity_within_a_body_and_else_was_saved_inside_out():
    inner, aside = cube((0, 0, 0), side=SIDE / 2), cube((0.1, 0, 0))
    for mesh in (inner, aside):
        mesh.invert()
    assert volume_of(cube((0, 0, 0)), inner) == (1, 1, pytest.approx(1 - 1 / 8))
    assert volume_of(cube((0, 0, 0)), aside) == (2, 0, pytest.approx(2.0))


@pytest.mark.parametrize("form", ["stl", "obj", "ply"])
def test_two_cubes_that_share_a_face_are_read_from_a_file(tmp_path, form):
    path = tmp_path / f"two.{form}"
    trimesh.util.concatenate([cube((0, 0, 0)), cube((SIDE, 0, 0))]).export(path)
    assert mesh_extent(str(path)) == pytest.approx((2 * SIDE, SIDE, SIDE))
    geometry = mesh_shape(str(path), (2 * SIDE, SIDE, SIDE))
    assert geometry.volume == pytest.approx(2 * SIDE**3)
    assert len(geometry.collision) == 2
    assert all(isinstance(piece, ConvexPiece) for piece in geometry.collision)


def test_holes_and_faces_that_look_both_ways_are_said():
    vertices, faces = merged(cube((0, 0, 0)), cube((SIDE, 0, 0)))
    with pytest.raises(InputError, match="is not watertight: 3 of its edges"):
        separate(vertices, faces[1:])
    vertices, faces = merged(cube((0, 0, 0)))
    faces[0] = faces[0, ::-1]
    with pytest.raises(InputError, match="face different ways"):
        separate(vertices, faces)


def test_a_mesh_that_encloses_nothing_is_flat(tmp_path):
    """Two triangles, each there and back."""
    path = tmp_path / "flat.obj"
    corners = "v 0 0 0\nv .05 0 0\nv 0 .05 0\nv 0 0 .05\n"
    path.write_text(corners + "f 1 2 3\nf 1 3 2\nf 1 2 4\nf 1 4 2\n")
    with pytest.raises(InputError, match="is flat: it encloses no volume"):
        mesh_extent(str(path))
