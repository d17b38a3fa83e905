"""What is known beforehand of the worlds of a batch, as arrays with a leading axis of worlds.

`WorldModel` says it of one world, with names. Here names are columns, the same for all worlds: a world that
lacks an object has a column for it all the same, in which `ObjectFacts.present` is false. Symmetries and
grasp axes, of which objects have unlike many, are padded, with masks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.columns import Order, filled, with_rows
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.transfer import Index, sent
from bt_tasksim.core.world import Hidden, ObjectModel, Observation, PlaceModel, WorldModel

_T = TypeVar("_T", bound="FactArrays")
_B = TypeVar("_B", Observation, Hidden)


@dataclass(frozen=True)
class FactArrays:
    """A bundle of arrays with the same leading dimensions."""

    def map(self: _T, change: Callable[[Array], Array]) -> _T:
        """The same facts, each array changed when somebody first looks at it: few of them are."""
        made = object.__new__(type(self))
        made.__dict__["_made_of"] = (self, change)
        return made

    def __getattr__(self, name: str) -> Any:
        """A field of facts that `map` has made."""
        if name not in type(self).__dataclass_fields__ or "_made_of" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__} has no '{name}'")
        source, change = self.__dict__["_made_of"]
        found = self.__dict__[name] = change(getattr(source, name))
        return found


@dataclass(frozen=True)
class ObjectFacts(FactArrays):
    """What is known beforehand of objects; leading dimensions ``(...)``, see `ObjectModel`.

    Attributes:
        present: Boolean ``(...)``: the world has it; else the numbers are of no meaning.
        extent: Full nominal bounding-box size ``(..., 3)``, metres.
        revolved: Boolean ``(...)``: a body of revolution about z.
        cubic: Boolean ``(...)``: it looks the same on each of its faces.
        rotations: Rotations ``(..., most, 4)`` that bring it onto itself, in its own frame; the first one is
            the identity. Of a body of revolution only that.
        rotation_counts: Boolean ``(..., most)``: there is such a rotation.
        grasp_axes: Directions ``(..., most, 3)`` along which two fingers may close on it, best first.
        grasp_widths: Widths ``(..., most)`` along these, metres; infinite where there is no further axis.
    """

    present: Array
    extent: Array
    revolved: Array
    cubic: Array
    rotations: Array
    rotation_counts: Array
    grasp_axes: Array
    grasp_widths: Array

    @property
    def standing_height(self) -> Array:
        """Height ``(...)`` of its centre above what it stands on: a cube may stand on any face, metres."""
        xp = array_namespace(self.extent)
        return xp.where(self.cubic, xp.max(self.extent, axis=-1), self.extent[..., 2]) / 2


@dataclass(frozen=True)
class PlaceFacts(FactArrays):
    """Calibrated places; leading dimensions ``(...)``, see `PlaceModel`.

    Attributes:
        present: Boolean ``(...)``: the world has it; else the numbers are of no meaning.
        pose: Poses ``(..., 7)``.
        extent: Full size ``(..., 2)``, metres.
        centre: Centre ``(..., 2)`` in the place's frame, metres.
        height: Free height ``(...)``, metres.
        access: Unit vectors ``(..., 3)``.
        exit: Unit vectors ``(..., 3)``.
        clearance: ``(...)`` metres.
        container: Boolean ``(...)``: it is one, such as a bin, and ``height`` is that of its walls.
        rank: ``(...)`` its number among the places of its own world, whichever column it has.
    """

    present: Array
    pose: Array
    extent: Array
    centre: Array
    height: Array
    access: Array
    exit: Array
    clearance: Array
    container: Array
    rank: Array

    @property
    def rim(self) -> Array:
        """Height ``(...)`` above the place's origin that a thing has to be lifted over, metres."""
        xp = array_namespace(self.height)
        return xp.where(self.container, self.height, xp.zeros_like(self.height))


@dataclass(frozen=True)
class ObstacleFacts(FactArrays):
    """Boxes to keep clear of; leading dimensions ``(N, most)``.

    Attributes:
        present: Boolean: there is one.
        pose: Poses ``(..., 7)``.
        size: Full sizes ``(..., 3)``, metres.
    """

    present: Array
    pose: Array
    size: Array


@dataclass(frozen=True)
class WorldFacts:
    """What is known beforehand of ``N`` worlds.

    Attributes:
        columns: Column of each object's name in all arrays of objects, those of `Observation` and `Hidden`
            too, as concepts see them. When a world begins anew, names may come to have other columns.
        place_columns: Column of each place's name, likewise.
        tips: Names of the fingertips.
        opening: Widest distance between opposing fingertips, metres.
        control_period: Seconds from one tick to the next, the same in all worlds.
        object_facts: ``(N, n_objects)``.
        place_facts: ``(N, n_places)``.
        obstacle_facts: ``(N, most)``.
    """

    columns: Mapping[str, int]
    place_columns: Mapping[str, int]
    tips: tuple[str, ...]
    opening: float
    control_period: float
    object_facts: ObjectFacts
    place_facts: PlaceFacts
    obstacle_facts: ObstacleFacts

    @classmethod
    def of(
        cls,
        worlds: Sequence[WorldModel],
        names: Sequence[str] | None = None,
        places: Sequence[str] | None = None,
    ) -> WorldFacts:
        """The facts of worlds, one row each.

        Args:
            worlds: What is known of each.
            names: The objects' names in the order of the columns; by default all that there are.
            places: The places' names, likewise.

        Raises:
            InputError: They have unlike control rates or hands, or there is none.
        """
        if not worlds:
            raise InputError("a batch needs at least one world")
        first = worlds[0]
        for world in worlds:
            _check_alike(first, world)
        if names is None:
            names = list(dict.fromkeys(model.name for world in worlds for model in world.objects))
        if places is None:
            places = list(dict.fromkeys(name for world in worlds for name in world.places))
        return cls(
            columns={name: k for k, name in enumerate(names)},
            place_columns={name: k for k, name in enumerate(places)},
            tips=first.tips,
            opening=first.opening,
            control_period=first.control_period,
            object_facts=_object_facts(
                [[w.objects[w.index[n]] if n in w.index else None for n in names] for w in worlds]
            ),
            place_facts=_place_facts(worlds, places),
            obstacle_facts=_obstacle_facts(worlds),
        )

    @property
    def worlds(self) -> int:
        """How many there are."""
        return int(self.object_facts.present.shape[0])

    def map(self, change: Callable[[Array], Array]) -> WorldFacts:
        """The same facts, each array changed: taken by rows, or brought to another library or device."""
        return WorldFacts(
            self.columns,
            self.place_columns,
            self.tips,
            self.opening,
            self.control_period,
            self.object_facts.map(change),
            self.place_facts.map(change),
            self.obstacle_facts.map(change),
        )

    def sent(self, like: Array) -> WorldFacts:
        """The same facts in the library and on the device of an array."""
        if isinstance(like, np.ndarray):
            return self
        bundles = (self.object_facts, self.place_facts, self.obstacle_facts)
        named = [(bundle, f.name) for bundle in bundles for f in fields(bundle)]
        there = iter(sent([getattr(*part) for part in named], like))
        made: dict[str, Any] = {
            name: type(bundle)(**{f.name: next(there) for f in fields(bundle)})
            for name, bundle in zip(("object_facts", "place_facts", "obstacle_facts"), bundles, strict=True)
        }
        return replace(self, **made)

    def replaced(self, rows: Array, other: WorldFacts) -> WorldFacts:
        """The same facts, with those of other worlds, of the same columns, at ``rows (k,)``.

        Raises:
            InputError: They have unlike control rates or hands.
        """
        _check_alike(self, other)

        index = Index(rows)

        def bundle(kind: str) -> Any:
            mine, others = getattr(self, kind), getattr(other, kind)
            return type(mine)(
                **{
                    f.name: with_rows(
                        getattr(mine, f.name), index, getattr(others, f.name), _FILLING.get(f.name, 0)
                    )
                    for f in fields(mine)
                }
            )

        return WorldFacts(
            self.columns,
            self.place_columns,
            self.tips,
            self.opening,
            self.control_period,
            bundle("object_facts"),
            bundle("place_facts"),
            bundle("obstacle_facts"),
        )

    def column(self, name: str) -> int:
        """Column of an object.

        Raises:
            InputError: No world has such an object.
        """
        try:
            return self.columns[name]
        except KeyError:
            raise InputError(f"no object '{name}' in the scene{nearest(name, self.columns)}") from None

    def place_column(self, name: str) -> int:
        """Column of a place.

        Raises:
            InputError: No world has such a place.
        """
        try:
            return self.place_columns[name]
        except KeyError:
            raise InputError(f"no place '{name}' in the scene{nearest(name, self.place_columns)}") from None

    def object(self, name: str) -> ObjectFacts:
        """What is known of an object: leading dimension ``(N,)``.

        Raises:
            InputError: No world has such an object.
        """
        column = self.column(name)
        return self.object_facts.map(lambda values: values[:, column, ...])

    def place(self, name: str) -> PlaceFacts:
        """A place: leading dimension ``(N,)``.

        Raises:
            InputError: No world has such a place.
        """
        column = self.place_column(name)
        return self.place_facts.map(lambda values: values[:, column, ...])

    def place_at(self, index: Array) -> PlaceFacts:
        """The places of columns ``(N,)``, one in each world."""
        return self.place_facts.map(lambda values: take_rows(values, index))


def take_rows(values: Array, index: Array) -> Array:
    """Of ``values (N, n, ...)`` the entry ``index (N,)`` of each row: ``(N, ...)``."""
    xp = array_namespace(values)
    if values.ndim == 2:
        return xp.take_along_axis(values, index[:, None], axis=1)[:, 0]
    shape = (values.shape[0], 1, *values.shape[2:])
    spread = xp.broadcast_to(xp.reshape(index, (-1, *(1,) * (values.ndim - 1))), shape)
    return xp.take_along_axis(values, spread, axis=1)[:, 0, ...]


def _object_facts(rows: Sequence[Sequence[ObjectModel | None]]) -> ObjectFacts:
    models = [model for row in rows for model in row]
    turns = [_IDENTITY if model is None else rotations(model) for model in models]
    axes = [((0.0, 1.0, 0.0),) if model is None else model.grasp_axes for model in models]
    widths = [(np.inf,) if model is None else model.grasp_widths for model in models]
    shape = (len(rows), len(rows[0]))
    turned, counts = _padded(turns, shape, "rotations")
    return ObjectFacts(
        present=np.array([model is not None for model in models], bool).reshape(shape),
        extent=np.array([(1.0,) * 3 if m is None else m.extent for m in models], float).reshape(*shape, 3),
        revolved=np.array([m is not None and m.symmetry == 0 and not m.cubic for m in models], bool).reshape(
            shape
        ),
        cubic=np.array([m is not None and m.cubic for m in models], bool).reshape(shape),
        rotations=turned,
        rotation_counts=counts,
        grasp_axes=_padded(axes, shape, "grasp_axes")[0],
        grasp_widths=_padded(widths, shape, "grasp_widths")[0],
    )


def _place_facts(worlds: Sequence[WorldModel], names: Sequence[str]) -> PlaceFacts:
    shape = (len(worlds), len(names))
    places = [world.places.get(name) for world in worlds for name in names]
    ranked = [{name: k for k, name in enumerate(world.places)} for world in worlds]
    ranks = [own.get(name, 0) for own in ranked for name in names]

    def each(value: Callable[[PlaceModel], Any], nothing: Any) -> Array:
        found = [nothing if place is None else value(place) for place in places]
        return np.array(found, bool if isinstance(nothing, bool) else float).reshape(
            *shape, *np.shape(nothing)
        )

    up = (0.0, 0.0, 1.0)
    return PlaceFacts(
        present=each(lambda place: True, False),
        pose=each(lambda place: place.pose, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)),
        extent=each(lambda place: place.extent, (0.0, 0.0)),
        centre=each(lambda place: place.centre, (0.0, 0.0)),
        height=each(lambda place: place.height, 0.0),
        access=each(lambda place: place.access, up),
        exit=each(lambda place: place.exit, up),
        clearance=each(lambda place: place.clearance, 0.0),
        container=each(lambda place: place.kind == "bin", False),
        rank=np.array(ranks, float).reshape(shape),
    )


def _obstacle_facts(worlds: Sequence[WorldModel]) -> ObstacleFacts:
    most = max(len(world.obstacles) for world in worlds)
    shape = (len(worlds), most)
    present, size = np.zeros(shape, bool), np.zeros((*shape, 3))
    pose = np.broadcast_to(_FILLING["pose"], (*shape, 7)).copy()
    for i, world in enumerate(worlds):
        for k, box in enumerate(world.obstacles):
            present[i, k], pose[i, k], size[i, k] = True, box.pose, box.size
    return ObstacleFacts(present, pose, size)


_FILLING: Mapping[str, Any] = {
    "rotations": (1.0, 0.0, 0.0, 0.0),
    "grasp_axes": (0.0, 1.0, 0.0),
    "grasp_widths": np.inf,
    "pose": (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
}
"""What stands in the arrays of facts where a world has fewer entries than others; else zeros."""


def _padded(rows: Sequence[Any], shape: tuple[int, int], name: str) -> tuple[Array, Array]:
    """Lists of unlike lengths as one array ``(*shape, most, ...)``, and which entries are there."""
    most, filling = max((len(row) for row in rows), default=1) or 1, _FILLING[name]
    inner = np.shape(filling)
    out = np.broadcast_to(filling, (len(rows), most, *inner)).copy()
    there = np.zeros((len(rows), most), bool)
    for i, row in enumerate(rows):
        out[i, : len(row)] = np.reshape(row, (len(row), *inner))
        there[i, : len(row)] = True
    return out.reshape(*shape, most, *inner), there.reshape(*shape, most)


def rotations(model: ObjectModel) -> Array:
    """Rotations ``(k, 4)`` that bring an object onto itself, in its own frame."""
    if model.cubic:
        return _CUBE
    if model.symmetry == 0:
        return _IDENTITY
    return np.array([poses.yaw(2 * np.pi * k / model.symmetry) for k in range(model.symmetry)])


def _cube_rotations() -> Array:
    quarter = np.array([poses.yaw(k * np.pi / 2) for k in range(4)])
    turns = [(0.0, 0, 0), (1.0, 0, 0), (2.0, 0, 0), (-1.0, 0, 0), (0.0, 1, 0), (0.0, -1, 0)]
    tips = poses.from_rotation_vector(np.array(turns) * np.pi / 2)
    return poses.quat_multiply(quarter[None], tips[:, None]).reshape(-1, 4)


_IDENTITY = np.array([[1.0, 0.0, 0.0, 0.0]])
_CUBE = _cube_rotations()


class FactsTable:
    """The facts of a batch whose worlds begin anew one by one.

    Args:
        worlds: How many there are.
        like: An array of the library, type and device of the facts; by default NumPy.
    """

    def __init__(self, worlds: int, like: Array | None = None) -> None:
        self._like: Array = np.empty(0) if like is None else like
        self._models: list[WorldModel | None] = [None] * worlds
        self._facts: WorldFacts | None = None
        self._order: Order | None = None
        self._stale: set[int] = set()
        self._taken: dict[bytes, WorldFacts] = {}
        self._single: dict[int, FactsTable] = {}

    def replace(self, rows: Array, models: Sequence[WorldModel]) -> None:
        """Other worlds begin at ``rows (k,)``.

        Raises:
            InputError: See `WorldFacts.of`.
        """
        for row, model in zip(rows.tolist(), models, strict=True):
            self._models[row] = model
            self._stale.add(row)
            self._single.pop(row, None)
        self._taken.clear()

    @property
    def facts(self) -> WorldFacts | None:
        """The facts of all worlds; those that never began have the facts of one that did. None before any.

        Raises:
            InputError: See `WorldFacts.of`.
        """
        if self._stale:
            rows, known = sorted(self._stale), self._facts
            begun = [model for model in self._models if model is not None]
            if known is None or _names(begun) != (set(known.columns), set(known.place_columns)):
                worlds = [begun[0] if model is None else model for model in self._models]
                made = WorldFacts.of(worlds)
                self._facts = made.sent(self._like)
                self._order = Order.of(worlds, list(made.columns))
            else:
                fresh = [model for row in rows if (model := self._models[row]) is not None]
                anew = WorldFacts.of(fresh, list(known.columns), list(known.place_columns))
                self._facts = known.replaced(np.array(rows), anew.sent(self._like))
                assert self._order is not None, "it is made with the facts"
                self._order = self._order.replaced(np.array(rows), Order.of(fresh, list(known.columns)))
            self._stale.clear()
        return self._facts

    def arranged(self, bundle: _B, rows: Array | None = None) -> _B:
        """An observation or a hidden state ``(k, ...)`` with the columns of the facts, see `Order.arranged`.

        Args:
            bundle: Of worlds whose objects stand in their own orders.
            rows: Which ``(k,)``; by default all.
        """
        return bundle if self.facts is None or self._order is None else self._order.arranged(bundle, rows)

    def of_world(self, row: int) -> FactsTable:
        """The facts of one world alone, in NumPy, with columns for its own objects and places only."""
        if row not in self._single:
            table, model = FactsTable(1), self._models[row]
            if model is not None:
                table.replace(np.zeros(1, int), [model])
            self._single[row] = table
        return self._single[row]

    def taken(self, index: Index) -> WorldFacts:
        """The facts of some worlds."""
        key = index.rows.tobytes()
        if key not in self._taken:
            facts = self.facts
            assert facts is not None, "worlds have begun"
            if len(self._taken) > 64:
                self._taken.clear()
            self._taken[key] = facts.map(index.of)
        return self._taken[key]


def _names(models: Sequence[WorldModel]) -> tuple[set[str], set[str]]:
    """Names of all objects, and of all places."""
    return {n for model in models for n in model.index}, {n for model in models for n in model.places}


def joined(worlds: Sequence[WorldFacts]) -> WorldFacts:
    """The facts of several batches as those of one; names are those of the first one.

    Raises:
        InputError: They have unlike control rates or hands.
    """
    first = worlds[0]
    for other in worlds:
        _check_alike(first, other)

    def join(kind: str) -> Any:
        bundles = [getattr(facts, kind) for facts in worlds]
        return type(bundles[0])(
            **{
                f.name: _concatenated([getattr(b, f.name) for b in bundles], _FILLING.get(f.name, 0))
                for f in fields(bundles[0])
            }
        )

    return WorldFacts(
        first.columns,
        first.place_columns,
        first.tips,
        first.opening,
        first.control_period,
        join("object_facts"),
        join("place_facts"),
        join("obstacle_facts"),
    )


def _concatenated(arrays: Sequence[Array], filling: Any) -> Array:
    """Arrays ``(n, ...)`` one below the other; what is shorter is filled up."""
    shapes = {array.shape[1:] for array in arrays}
    if len(shapes) > 1:
        most = tuple(np.max(list(shapes), axis=0).tolist())
        arrays = [filled(array, most, filling) for array in arrays]
    return np.concatenate(arrays)


def _check_alike(first: WorldModel | WorldFacts, other: WorldModel | WorldFacts) -> None:
    if (other.control_period, other.opening, other.tips) != (first.control_period, first.opening, first.tips):
        raise InputError("the worlds of a batch should have one robot and one control rate")
