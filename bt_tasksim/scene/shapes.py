"""Kinds of objects by name, and the geometry that they give.

The kinds are in `bt_tasksim.scene.kinds`, one file each; `ShapeKind` says what a kind has to say.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache

from bt_tasksim.core.files import file_version
from bt_tasksim.core.joints import JointModel
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import part, parts
from bt_tasksim.core.world import ObjectModel
from bt_tasksim.scene.geometry import BallPiece, BoxPiece, ConvexPiece, Piece, Shape, ShapeSize, Size
from bt_tasksim.scene.grips import GivenGrip, Grips
from bt_tasksim.scene.part_kind import PART, PartKind
from bt_tasksim.scene.shape_kind import ShapeKind

__all__ = [
    "KINDS",
    "BallPiece",
    "BoxPiece",
    "ConvexPiece",
    "KnownSolid",
    "Piece",
    "Shape",
    "ShapeSize",
    "object_model",
    "resting_height",
    "shape",
    "shape_kind",
    "size_range",
]


class _Kinds(Mapping[str, ShapeKind]):
    """Every kind of object by name, those of plugins included."""

    def __getitem__(self, name: str) -> ShapeKind:
        return _made(parts("shape")[name])

    def __iter__(self) -> Iterator[str]:
        return iter(parts("shape"))

    def __len__(self) -> int:
        return len(parts("shape"))


KINDS: Mapping[str, ShapeKind] = _Kinds()
"""What objects there are."""


def shape_kind(name: str) -> ShapeKind:
    """A kind of object.

    Raises:
        InputError: There is no such kind; says which are near.
    """
    return _made(PartKind if name == PART else part("shape", name))


def shape(kind: str, size: ShapeSize) -> Shape:
    """The geometry of an object; the same arguments give the same object, which nobody may change.

    A mesh whose file has changed is another object.

    Raises:
        InputError: Unknown kind, a size that it cannot have, or a bad mesh.
    """
    found = shape_kind(kind)
    if found.from_file:
        size = ShapeSize(size.size, mesh=size.mesh)  # exponents are drawn, and mean nothing to a file's form
    return _shape(found, size, () if size.mesh is None else file_version(size.mesh))


@lru_cache(maxsize=4096)
def _shape(kind: ShapeKind, size: ShapeSize, version: tuple[int, ...]) -> Shape:
    kind.check(size)
    return kind.shape(size)


def size_range(kind: str, mesh: str | None = None) -> tuple[Size, Size]:
    """Low and high full sizes ``((3,), (3,))`` in metres that a kind has where none are given.

    Raises:
        InputError: Unknown kind, or its shape comes from a file that cannot be read.
    """
    return shape_kind(kind).sizes(mesh)


def object_model(
    name: str,
    kind: str,
    size: ShapeSize,
    grasps: tuple[GivenGrip, ...] = (),
    symmetry: int | None = None,
    joint: JointModel | None = None,
) -> ObjectModel:
    """What is known beforehand about an object of this kind and size, see `ObjectModel`.

    Args:
        name: Its name.
        kind: Its kind.
        size: Its size.
        grasps: Where it may be held, instead of what its kind says.
        symmetry: Order of its symmetry about z, instead of its kind's.
        joint: How it moves, where it is a part of a fixture.

    Raises:
        InputError: Unknown kind, or a size that it cannot have.
    """
    found = shape_kind(kind)
    found.check(size)
    axes = Grips.given(grasps).axes() or found.grasp_axes(size)
    return ObjectModel(
        name,
        kind,
        found.extent(size),
        found.symmetry_of(size) if symmetry is None else symmetry,
        tuple(axis for axis, _ in axes),
        tuple(width for _, width in axes),
        cubic=found.cubic,
        solid=KnownSolid(kind, size, grasps),
        joint=joint,
    )


@dataclass(frozen=True)
class KnownSolid:
    """What an object is taken to be, from its kind and size; see `bt_tasksim.core.world.KnownGeometry`."""

    kind: str
    size: ShapeSize
    given: tuple[GivenGrip, ...] = ()

    @property
    def shape(self) -> Shape:
        """Its geometry."""
        return shape(self.kind, self.size)

    @property
    def pieces(self) -> tuple[Array, ...]:
        """See `KnownGeometry.pieces`."""
        return self.shape.pieces

    @cached_property
    def outer(self) -> Array:
        """See `KnownGeometry.outer`."""
        return self.shape.outer

    @cached_property
    def hollow(self) -> Array:
        """See `KnownGeometry.hollow`."""
        return self.shape.hollow

    @cached_property
    def grips(self) -> Grips:
        """Where two fingers may hold it: as given, else as its kind says."""
        if self.given:
            return Grips.given(self.given)
        return shape_kind(self.kind).grips(self.size)


def resting_height(kind: str, size: ShapeSize) -> float:
    """Metres from the surface an object stands on up to its origin.

    Raises:
        InputError: Unknown kind.
    """
    return shape_kind(kind).resting_height(size)


@cache
def _made(kind: type[ShapeKind]) -> ShapeKind:
    return kind()
