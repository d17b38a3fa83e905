"""Parts of fixtures that move on a joint: made of boxes, as a fixture's data file says."""

from __future__ import annotations

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.scene import meshes
from bt_tasksim.scene.geometry import BoxPiece, Shape, ShapeSize, polygon
from bt_tasksim.scene.grips import Grips
from bt_tasksim.scene.meshes import TriangleMesh
from bt_tasksim.scene.shape_kind import ShapeKind
from bt_tasksim.scene.surfaces import PrismSurface

PART = "part"
"""The name of this kind: no object of a scene is of it, but the parts of its fixtures are."""


class PartKind(ShapeKind):
    """A drawer, a door, a knob: it comes with its fixture, and is held where the fixture says."""

    size_range = ((0.1, 0.1, 0.1), (0.1, 0.1, 0.1))
    symmetry = 1

    def check(self, size: ShapeSize) -> None:
        """See `ShapeKind.check`."""
        super().check(size)
        if not size.boxes:
            raise InputError(
                "an object of kind 'part' is a part of a fixture, and comes with it: put the fixture into "
                "the scene, such as fixtures=['chest']"
            )

    def shape(self, size: ShapeSize) -> Shape:
        """See `ShapeKind.shape`."""
        pieces = tuple(BoxPiece(np.array(box.pose, float), np.array(box.size) / 2) for box in size.boxes)
        half = np.array(size.size) / 2
        corners = np.array(
            [[half[0], half[1]], [-half[0], half[1]], [-half[0], -half[1]], [half[0], -half[1]]]
        )
        solid = _mesh(pieces)
        return Shape(
            extent=size.size,
            collision=pieces,
            draw=lambda: solid,
            weigh=lambda: meshes.mass_properties(solid),
            surface=PrismSurface(polygon(corners), half[2]),
        )

    def grips(self, size: ShapeSize) -> Grips:
        """See `ShapeKind.grips`: none but those that are given."""
        return Grips.given(())


def _mesh(pieces: tuple[BoxPiece, ...]) -> TriangleMesh:
    """The faces of all boxes; where two overlap it is twice as heavy."""
    vertices, faces, n = [], [], 0
    for piece in pieces:
        x, y, z = piece.half_size
        box = meshes.prism(np.array([[x, y], [-x, y], [-x, -y], [x, -y]]), 2 * z)
        vertices.append(poses.transform(piece.pose, box.vertices))
        faces.append(box.faces + n)
        n += len(box.vertices)
    return TriangleMesh(np.concatenate(vertices), np.concatenate(faces))
