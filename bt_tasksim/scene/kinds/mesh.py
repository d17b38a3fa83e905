"""Objects from mesh files."""

from __future__ import annotations

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register
from bt_tasksim.scene.geometry import Shape, ShapeSize, Size
from bt_tasksim.scene.mesh_file import mesh_extent, mesh_shape
from bt_tasksim.scene.shape_kind import GraspAxis, ShapeKind, level_grasp_axes


@register("shape", "mesh")
class MeshKind(ShapeKind):
    """A closed mesh in a file; it has the size of its file unless another one is given."""

    size_range = ((0.05, 0.05, 0.05), (0.05, 0.05, 0.05))
    symmetry = 1
    from_file = True

    def check(self, size: ShapeSize) -> None:
        """See `ShapeKind.check`."""
        super().check(size)
        _given(size.mesh)

    def sizes(self, mesh: str | None = None) -> tuple[Size, Size]:
        """See `ShapeKind.sizes`: those of the file.

        Raises:
            InputError: There is no file, or it cannot be read.
        """
        extent = mesh_extent(_given(mesh))
        return extent, extent

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        return mesh_shape(_given(size.mesh), size.size)

    def grasp_axes(self, size: ShapeSize) -> tuple[GraspAxis, ...]:
        """See `ShapeKind.grasp_axes`: those of its bounding box."""
        return level_grasp_axes(size)


def _given(mesh: str | None) -> str:
    if mesh is None:
        raise InputError("an object of kind 'mesh' needs the path of a mesh file")
    return mesh
