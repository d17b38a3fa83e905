"""Hulls of mesh files: what is no body is refused, and does not end the process."""

import pytest

from bt_tasksim.core.errors import InputError, NoVolumeError
from bt_tasksim.robot.mesh_hulls import mesh_hull

ONE = (1.0, 1.0, 1.0)
PLATE = "v 0 0 0\nv 0.1 0 0\nv 0.1 0.1 0\nv 0 0.1 0\nf 1 2 3\nf 1 3 4\n"
PYRAMID = PLATE + "v 0.05 0.05 0.1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n"


def test_a_hull_has_the_corners_of_its_file_scaled(tmp_path):
    (tmp_path / "pyramid.obj").write_text(PYRAMID)
    corners = mesh_hull(str(tmp_path / "pyramid.obj"), (2.0, 1.0, 1.0))
    assert len(corners) == 5 and corners.max(axis=0) == pytest.approx([0.2, 0.1, 0.1])


@pytest.mark.parametrize(("text", "scale"), [(PLATE, ONE), (PYRAMID, (1.0, 1.0, 0.0))])
def test_a_mesh_in_one_plane_is_no_body(text, scale, tmp_path):
    (tmp_path / "flat.obj").write_text(text)
    with pytest.raises(NoVolumeError, match=r"flat\.obj' is no body: .* one plane"):
        mesh_hull(str(tmp_path / "flat.obj"), scale)


def test_a_missing_file_is_something_else(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.obj' cannot be read") as error:
        mesh_hull(str(tmp_path / "nowhere.obj"), ONE)
    assert not isinstance(error.value, NoVolumeError)
