"""What a kind of object says about itself; each is one file in `bt_tasksim.scene.kinds`, or in a plugin.

A kind is drawn, built in every physics engine, rendered, perceived and grasped from what stands here alone::

    @register("shape", "puck")
    class PuckKind(ShapeKind):
        size_range = ((0.05, 0.05, 0.02), (0.07, 0.07, 0.03))

        def shape(self, size): ...
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import ClassVar

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.world import PlaceModel
from bt_tasksim.scene.geometry import Colour, Shape, ShapeSize, Size
from bt_tasksim.scene.grips import Grips

WIDEST_GRASP = 0.07
"""Metres: a further closing axis is named only where the object is no wider."""
GraspAxis = tuple[tuple[float, float, float], float]
"""A unit vector in the object's frame along which two fingers may close, and the width there in metres."""

BRIGHT: tuple[Colour, ...] = (
    (0.86, 0.16, 0.15),
    (0.95, 0.56, 0.12),
    (0.93, 0.76, 0.15),
    (0.22, 0.60, 0.32),
    (0.13, 0.46, 0.72),
    (0.45, 0.29, 0.64),
)
"""Colours that a camera tells apart, and from furniture."""


class ShapeKind(ABC):
    """A category of objects; an instance holds nothing.

    Attributes:
        size_range: Low and high full sizes ``((3,), (3,))`` in metres, from which sizes are drawn.
        round: Its size along x equals that along y.
        cubic: All its sizes are drawn equal, and it looks the same on each of its faces.
        symmetry: Order of the rotational symmetry about z (2: looks the same after half a turn); 0 for a
            body of revolution.
        from_file: Its shape comes from a mesh file, which an object of this kind has to name.
        colours: RGB colours (sRGB, 0 to 1) it may have.
    """

    size_range: ClassVar[tuple[Size, Size]]
    round: ClassVar[bool] = False
    cubic: ClassVar[bool] = False
    symmetry: ClassVar[int] = 2
    from_file: ClassVar[bool] = False
    colours: ClassVar[tuple[Colour, ...]] = BRIGHT

    @abstractmethod
    def shape(self, size: ShapeSize) -> Shape:
        """The geometry of an object of this kind and size, which `check` has passed."""

    def check(self, size: ShapeSize) -> None:
        """Refuse a size that this kind cannot have; by default all but three positive numbers.

        Raises:
            InputError: Says what is wrong.
        """
        if len(size.size) != 3 or not all(math.isfinite(v) and v > 0 for v in size.size):
            raise InputError(
                f"an object's size should be three positive numbers in metres, found {size.size}"
            )

    def sizes(self, mesh: str | None = None) -> tuple[Size, Size]:
        """Low and high full sizes ``((3,), (3,))`` in metres where none are given; by default `size_range`.

        Args:
            mesh: Path of the object's mesh file, for a kind that is `from_file`.
        """
        return self.size_range

    def extent(self, size: ShapeSize) -> Size:
        """Full size ``(3,)`` of the bounding box, metres; by default the size itself."""
        return size.size

    def symmetry_of(self, size: ShapeSize) -> int:
        """Order of the symmetry of an object of this size; by default its kind's `symmetry`.

        What is the same along x and along y looks the same after a quarter turn where it is as wide as long,
        see `bt_tasksim.scene.symmetry.order_of_quarters`.
        """
        return self.symmetry

    def grasp_axes(self, size: ShapeSize) -> tuple[GraspAxis, ...]:
        """Where two fingers may close, best first; by default along y."""
        return (((0.0, 1.0, 0.0), size.size[1]),)

    def grips(self, size: ShapeSize) -> Grips:
        """Where two fingers may hold it; by default about its middle along its `grasp_axes`."""
        axes = self.grasp_axes(size)
        middle = [(0.0, 0.0, 0.0)] * len(axes)
        return Grips.of(middle, [axis for axis, _ in axes], [width for _, width in axes])

    def resting_height(self, size: ShapeSize) -> float:
        """Metres from the surface that it stands on up to its origin; by default half its height."""
        return size.size[2] / 2

    def area_on(self, place: PlaceModel) -> tuple[float, float]:
        """Half sizes ``(2,)`` in metres of the area about a place's origin in which it is drawn."""
        match place.kind:
            case "board":
                return 0.01, 0.12
            case "table":
                return 0.08, 0.10
            case _:
                return min(0.02, place.extent[0] / 8), min(0.02, place.extent[1] / 8)


def level_grasp_axes(size: ShapeSize, upright: bool = False) -> tuple[GraspAxis, ...]:
    """The axes of a box along which it is narrow enough, the narrowest first; at least one.

    Args:
        size: Its size.
        upright: Along z, too.
    """
    x, y, z = size.size
    axes: list[GraspAxis] = [((0.0, 1.0, 0.0), y), ((1.0, 0.0, 0.0), x)]
    if upright:
        axes.append(((0.0, 0.0, 1.0), z))
    axes.sort(key=lambda axis: axis[1])
    return tuple([axis for axis in axes if axis[1] <= WIDEST_GRASP] or axes[:1])
