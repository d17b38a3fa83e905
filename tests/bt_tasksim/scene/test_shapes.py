"""Laws of the geometry: what collides, what is seen, what is weighed and what is known agree."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.scene import meshes
from bt_tasksim.scene.geometry import polygon
from bt_tasksim.scene.kinds.cup import WALL
from bt_tasksim.scene.kinds.diamond import diamond_width
from bt_tasksim.scene.mesh_file import mesh_extent
from bt_tasksim.scene.mesh_symmetry import symmetry_about_z
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.shapes import KINDS, BoxPiece, ShapeSize, object_model, resting_height, shape
from tests.bt_tasksim.scene.solids import MADE, solids


def corners(geometry):
    return np.concatenate([piece.corners() for piece in geometry.collision])


def support_width(points, axis):
    return float(np.ptp(points @ np.array(axis)))


@settings(max_examples=120, deadline=None)
@given(solids())
def test_pieces_and_visual_fill_the_bounding_box_and_stay_in_it(case):
    kind, size = case
    geometry, extent = shape(*case), np.array(object_model("it", *case).extent)
    assert geometry.extent == pytest.approx(extent)
    for points in (corners(geometry), geometry.visual.vertices):
        assert np.all(np.max(points, axis=0) <= extent / 2 + 1e-9)
        assert np.all(np.min(points, axis=0) >= -extent / 2 - 1e-9)
        assert np.ptp(points, axis=0) == pytest.approx(extent, abs=1e-6)
    assert resting_height(kind, size) == pytest.approx(extent[2] / 2)


@settings(max_examples=120, deadline=None)
@given(solids())
def test_grasp_widths_are_the_true_support_widths_and_fit_the_gripper(case):
    model, points = object_model("it", *case), corners(shape(*case))
    assert len(model.grasp_axes) == len(model.grasp_widths) >= 1
    assert model.grasp_axes[0] == (0.0, 1.0, 0.0)
    for axis, width in zip(model.grasp_axes, model.grasp_widths, strict=True):
        assert np.linalg.norm(axis) == pytest.approx(1)
        assert support_width(points, axis) == pytest.approx(width, abs=1e-9)
        assert 0.03 <= width <= 0.0725
    assert list(model.grasp_widths) == sorted(model.grasp_widths)


@settings(max_examples=60, deadline=None)
@given(solids())
def test_volume_and_inertia(case):
    kind, size = case
    x, y, z = size.size
    geometry = shape(*case)
    wall, base = WALL, 0.005
    expected = {
        "box": x * y * z,
        "book": x * y * z,
        "peg": x * y * z,
        "sponge": x * y * z,
        "cube": x * y * z,
        "cylinder": np.pi / 4 * x * y * z,
        "oval": np.pi / 4 * x * y * z,
        "diamond": x * y * z / 2,
        "cup": np.pi / 4 * (x**2 * z - (x - 2 * wall) ** 2 * (z - base)),
    }
    if kind in expected:
        assert geometry.volume == pytest.approx(expected[kind], rel=0.01)
    else:
        assert np.pi / 6 * x * y * z * 0.97 < geometry.volume <= x * y * z
    a, b, c = sorted(geometry.mass.inertia)
    assert a > 0 and c <= a + b
    if kind in ("box", "cube"):
        assert geometry.mass.inertia == pytest.approx(
            [(y**2 + z**2) / 12, (x**2 + z**2) / 12, (x**2 + y**2) / 12]
        )
    if kind == "cup":
        assert geometry.mass.pose[2] < -0.002
    else:
        assert geometry.mass.pose[:3] == pytest.approx([0, 0, 0], abs=1e-6)


def test_principal_axes_of_a_turned_box():
    turned = meshes.prism(meshes.rounded_rectangle(0.05, 0.02, 0.0, 1), 0.1)
    c, s = np.cos(0.5), np.sin(0.5)
    mesh = meshes.TriangleMesh(turned.vertices @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), turned.faces)
    mass = meshes.mass_properties(mesh)
    R = poses.to_matrix(mass.pose[3:])
    tensor = R @ np.diag(mass.inertia) @ R.T
    Q = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    plain = np.diag([0.04**2 + 0.1**2, 0.1**2 + 0.1**2, 0.1**2 + 0.04**2]) / 12
    assert tensor == pytest.approx(Q @ plain @ Q.T, abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(solids())
def test_visual_is_closed_and_faces_outwards(case):
    mesh = shape(*case).visual
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    directed = {tuple(e) for e in edges.tolist()}
    assert len(directed) == len(edges)
    assert all((b, a) in directed for a, b in directed)
    assert meshes.mass_properties(mesh).volume > 0
    _, normals, _ = meshes.shaded(mesh)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1)


def inside_a_piece(geometry, point):
    for piece in geometry.collision:
        if isinstance(piece, BoxPiece):
            local = poses.transform(poses.inverse(piece.pose), point)
            if np.all(np.abs(local) <= piece.half_size + 1e-9):
                return True
        else:
            planes = ConvexHull(piece.vertices).equations
            if np.all(planes[:, :3] @ point + planes[:, 3] <= 1e-9):
                return True
    return False


@settings(max_examples=40, deadline=None)
@given(solids(kinds=("cup",)), st.floats(0, 2 * np.pi), st.floats(-0.4, 0.5), st.floats(0, 1))
def test_cup_is_hollow_and_its_wall_has_no_gaps(case, angle, height, radius):
    geometry = shape(*case)
    x, _, z = case[1].size
    way = np.array([np.cos(angle), np.sin(angle), 0])
    up = np.array([0, 0, height * (z - 2e-4)])
    assert not inside_a_piece(geometry, radius * (x / 2 - 1.03 * WALL - 5e-4) * way + up)
    assert inside_a_piece(geometry, (x / 2 - WALL / 2) * way + up)
    assert inside_a_piece(geometry, radius * (x / 2) * way - np.array([0, 0, z / 2 - 0.002]))
    radii = np.linalg.norm(geometry.visual.vertices[:, :2], axis=1)
    inner = geometry.visual.vertices[np.abs(radii - (x / 2 - WALL)) < 1e-6]
    assert np.ptp(inner[:, 2]) > 0.85 * z


def test_diamond_turns_its_sides_to_the_fingers():
    model = object_model("it", "diamond", ShapeSize((0.08, 0.06, 0.1)))
    assert model.grasp_widths == pytest.approx((0.048, 0.048))
    assert diamond_width(0.08, 0.06) == pytest.approx(0.048)
    hull = shape("diamond", ShapeSize((0.08, 0.06, 0.1))).collision[0].corners()
    for axis in model.grasp_axes:
        level = np.sort(np.unique(np.round(hull @ np.array(axis), 9)))
        assert len(level) == 2, "a pair of faces, not corners"


@settings(max_examples=80, deadline=None)
@given(solids(), st.tuples(*[st.floats(-0.15, 0.15)] * 3))
def test_nearest_points_lie_on_the_surface_alone_and_in_batches(case, point):
    geometry = shape(*case)
    p = np.array(point)
    found = geometry.surface.nearest(p)
    batch = geometry.surface.nearest(np.tile(p, (5, 7, 1)))
    assert batch.shape == (5, 7, 3)
    # From the very middle several points are equally near.
    assert np.linalg.norm(batch[2, 3] - p) == pytest.approx(np.linalg.norm(found - p), abs=1e-9)
    extent = np.array(geometry.extent)
    assert np.all(np.abs(found) <= extent / 2 + 1e-9)
    again = geometry.surface.nearest(found)
    assert again == pytest.approx(found, abs=1e-6)


@settings(max_examples=60, deadline=None)
@given(solids(), st.floats(0.001, 0.05))
def test_nearest_point_to_a_finger_on_the_closing_axis(case, gap):
    model, geometry = object_model("it", *case), shape(*case)
    axis, width = np.array(model.grasp_axes[0]), model.grasp_widths[0]
    for sign in (-1, 1):
        found = geometry.surface.nearest(sign * (width / 2 + gap) * axis)
        assert found == pytest.approx(sign * width / 2 * axis, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(solids(kinds=("box", "cube", "cylinder", "diamond")), st.integers(0, 1000))
def test_nearest_point_is_the_nearest_of_many(case, seed):
    geometry = shape(*case)
    p = np.random.default_rng(seed).normal(size=3) * 0.06
    found = np.linalg.norm(geometry.surface.nearest(p) - p)
    rng = np.random.default_rng(1)
    candidates = geometry.surface.nearest(rng.normal(size=(2000, 3)) * 0.06)
    assert found <= np.min(np.linalg.norm(candidates - p, axis=1)) + 1e-9


def test_superellipsoid_between_ellipsoid_and_box():
    size = (0.08, 0.05, 0.06)
    ellipsoid, box = (shape("superellipsoid", ShapeSize(size, (e, e))) for e in (1.0, 1e-6))
    assert ellipsoid.volume == pytest.approx(np.pi / 6 * np.prod(size), rel=0.01)
    assert box.volume == pytest.approx(np.prod(size), rel=0.02)
    assert len(ellipsoid.collision[0].corners()) <= 64


@pytest.mark.parametrize(
    ("kind", "size", "words"),
    [
        ("cupp", ShapeSize((1, 1, 1)), "did you mean 'cup'"),
        ("box", ShapeSize((0.1, -1, 0.1)), "three positive numbers"),
        ("box", ShapeSize((0.1, float("nan"), 0.1)), "three positive numbers"),
        ("superellipsoid", ShapeSize((0.1, 0.1, 0.1), (2.5, 1.0)), "at most 2"),
        ("cup", ShapeSize((0.01, 0.01, 0.1)), "no room inside"),
        ("mesh", ShapeSize((0.1, 0.1, 0.1)), "path of a mesh file"),
    ],
)
def test_bad_shapes_are_refused(kind, size, words):
    with pytest.raises(InputError, match=words):
        shape(kind, size)


def test_mesh_file_is_scaled_centred_and_made_of_convex_pieces():
    path = str(asset("objects", "bottle.obj"))
    size = (0.056, 0.042, 0.146)
    geometry = shape("mesh", ShapeSize(size, mesh=path))
    assert np.ptp(geometry.visual.vertices, axis=0) == pytest.approx(size)
    assert np.max(geometry.visual.vertices, axis=0) == pytest.approx(np.array(size) / 2)
    assert 0.0002 < geometry.volume < 0.0003
    assert 1 <= len(geometry.collision) <= 4
    assert all(len(piece.corners()) <= 64 for piece in geometry.collision)
    model = object_model("bottle", "mesh", ShapeSize(size, mesh=path))
    assert model.grasp_widths == pytest.approx((0.042, 0.056)) and model.symmetry == 2


@pytest.mark.parametrize(
    ("kind", "size", "order"),
    [
        ("box", (0.06, 0.04, 0.1), 2),
        ("box", (0.06, 0.0602, 0.1), 4),
        ("diamond", (0.05, 0.05, 0.1), 4),
        ("diamond", (0.05, 0.04, 0.1), 2),
        ("superellipsoid", (0.05, 0.05, 0.08), 4),
        ("round", (0.05, 0.05, 0.08), 0),
        ("oval", (0.06, 0.0599, 0.1), 0),
        ("oval", (0.06, 0.05, 0.1), 2),
    ],
)
def test_what_is_as_wide_as_long_looks_the_same_after_a_quarter_turn(kind, size, order):
    kind, exponents = ("superellipsoid", (0.5, 1.0)) if kind == "round" else (kind, (0.5, 0.5))
    solid = ShapeSize(size, exponents)
    model, mesh = object_model("it", kind, solid), shape(kind, solid).visual
    assert model.symmetry == order
    # The mesh itself agrees, as far as its facets allow.
    found = symmetry_about_z(mesh)
    assert found == order or (order in (0, 4) and found % 4 == 0)


def test_same_arguments_give_the_same_object_and_nobody_can_change_it():
    size = ShapeSize((0.06, 0.05, 0.1))
    assert shape("box", size) is shape("box", ShapeSize((0.06, 0.05, 0.1)))
    with pytest.raises(ValueError, match="read-only"):
        shape("box", size).visual.vertices[0] = 0


def test_a_mesh_file_that_has_changed_is_another_object(tmp_path):
    file, size = tmp_path / "mine.obj", ShapeSize((0.056, 0.042, 0.146), mesh=str(tmp_path / "mine.obj"))
    with pytest.raises(InputError, match="no mesh file"):
        shape("mesh", size)
    text = asset("objects", "bottle.obj").read_text()
    file.write_text(text)
    before, extent = shape("mesh", size), mesh_extent(str(file))
    assert shape("mesh", size) is before
    file.write_text("# the same, longer" + chr(10) + text)
    assert shape("mesh", size) is not before and mesh_extent(str(file)) == extent


def test_shapes_need_no_simulator():
    import subprocess
    import sys

    code = (
        "import sys; from bt_tasksim.scene import shapes;"
        "[shapes.shape(k, shapes.ShapeSize(v.size_range[0]))"
        " for k, v in shapes.KINDS.items() if k != 'mesh'];"
        "bad = {'trimesh', 'scipy', 'sapien', 'torch', 'mani_skill'} & set(sys.modules); sys.exit(bool(bad))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_every_kind_is_drawn_by_a_scene():
    for kind in MADE:
        actor = Scene(objects={"it": f"{kind} on table"}).sample(11).objects[0]
        low, high = KINDS[kind].size_range
        assert np.all(np.array(actor.size) >= np.array(low) - 1e-12)
        assert np.all(np.array(actor.size) <= np.array(high) + 1e-12)
        assert actor.pose[2] == pytest.approx(actor.size[2] / 2)


def test_corners_may_be_given_clockwise():
    outline = meshes.circle(7) * 0.03
    for bevel in (0.0, 0.001):
        one, other = (meshes.prism(order, 0.1, bevel) for order in (outline, outline[::-1]))
        assert meshes.mass_properties(one).volume == pytest.approx(meshes.mass_properties(other).volume)
    point = np.array([0.001, 0.001])
    found, inside = polygon(outline[::-1]).nearest(point)
    assert inside and found == pytest.approx(polygon(outline).nearest(point)[0])
