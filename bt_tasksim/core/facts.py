"""What is known beforehand of the worlds of a batch, as arrays with a leading axis of worlds.

`WorldModel` says it of one world, with names. Here names are columns, the same for all worlds: a world that
lacks an object has a column for it all the same, in which `ObjectFacts.present` is false. Symmetries and
grasp axes, of which objects have unlike many, are padded, with masks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from bt_tasksim.core.columns import filled, with_rows
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.fact_arrays import FILLING, ObjectFacts, ObstacleFacts, PlaceFacts, take_rows
from bt_tasksim.core.fact_making import object_facts, obstacle_facts, place_facts
from bt_tasksim.core.poses import Array
from bt_tasksim.core.transfer import Index, sent
from bt_tasksim.core.world import WorldModel


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
        models: What the facts were made of, for what cannot be computed with arrays, such as the search for a
            way.
        numbers: Which of ``models`` each world has ``(N,)``, in NumPy.
    """

    columns: Mapping[str, int]
    place_columns: Mapping[str, int]
    tips: tuple[str, ...]
    opening: float
    control_period: float
    object_facts: ObjectFacts
    place_facts: PlaceFacts
    obstacle_facts: ObstacleFacts
    models: tuple[WorldModel, ...]
    numbers: np.ndarray

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
            object_facts=object_facts(worlds, names),
            place_facts=place_facts(worlds, places),
            obstacle_facts=obstacle_facts(worlds),
            models=tuple(worlds),
            numbers=np.arange(len(worlds)),
        )

    def model_of(self, world: int) -> WorldModel:
        """What is known beforehand of one world, with names."""
        return self.models[int(self.numbers[world])]

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
            self.models,
            change(self.numbers),
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
        sources: list[int | None] = [None] * self.worlds
        for k, row in enumerate(rows.tolist()):
            sources[row] = k

        def bundle(kind: str) -> Any:
            mine, others = getattr(self, kind), getattr(other, kind)
            return type(mine)(
                **{
                    f.name: with_rows(
                        getattr(mine, f.name), index, getattr(others, f.name), FILLING.get(f.name, 0)
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
            *_gathered(
                [self.model_of(k) if at is None else other.model_of(at) for k, at in enumerate(sources)]
            ),
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
                f.name: _concatenated([getattr(b, f.name) for b in bundles], FILLING.get(f.name, 0))
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
        *_gathered([facts.model_of(k) for facts in worlds for k in range(facts.worlds)]),
    )


def _gathered(models: Sequence[WorldModel]) -> tuple[tuple[WorldModel, ...], np.ndarray]:
    """What worlds were made of, one a world, and their numbers."""
    return tuple(models), np.arange(len(models))


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
