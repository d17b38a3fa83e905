"""A kind of object from outside: upright prisms on a regular hexagon."""

import numpy as np

from bt_tasksim.core.registry import register
from bt_tasksim.scene import meshes
from bt_tasksim.scene.geometry import polygon, prism_shape, upright_piece
from bt_tasksim.scene.shape_kind import ShapeKind

TURN = np.pi / 3


@register("shape", "hexagon")
class HexagonKind(ShapeKind):
    """Its size is corner to corner, the same again, and height; the bounding box is narrower along y."""

    size_range = ((0.05, 0.05, 0.07), (0.07, 0.07, 0.11))
    round = True  # the two first sizes are drawn equal
    symmetry = 6

    def extent(self, size):
        x, _, z = size.size
        return x, x * np.cos(TURN / 2), z

    def shape(self, size):
        x, _, z = size.size
        outline = meshes.circle(6) * x / 2
        solid = upright_piece(outline, -z / 2, z / 2)
        return prism_shape(self.extent(size), outline, outline, polygon(outline), (solid,))

    def grasp_axes(self, size):
        width = self.extent(size)[1]
        return tuple(((-np.sin(k * TURN), np.cos(k * TURN), 0.0), width) for k in range(3))
