"""Where objects and places are taken to be, for the laws of how things stand to each other."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable

import numpy as np

from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.core.poses import Array, array_namespace, constant
from bt_tasksim.core.transfer import sent
from bt_tasksim.core.world import ObjectModel
from bt_tasksim.planning.things import box_corners
from bt_tasksim.scene.hollows import NOTHING
from bt_tasksim.scene.spatial_laws import Hollow, LevelSurface, PlacedObject, Whereabouts


class Estimates(Whereabouts):
    """What is seen, with the geometry that objects are taken to have.

    That geometry is looked up for each world when a law asks for it: it is large, and few laws do.
    """

    def __init__(self, seen: Seen) -> None:
        self._seen = seen

    @classmethod
    def of(cls, seen: Seen) -> Estimates:
        """Those of a view, the same for all who ask."""
        return seen.once("estimates", lambda: cls(seen))

    @property
    def bodies(self) -> Collection[str]:
        """See `Whereabouts.bodies`."""
        return self._seen.world.columns

    @property
    def surfaces(self) -> Collection[str]:
        """See `Whereabouts.surfaces`."""
        return self._seen.world.place_columns

    def body(self, name: str) -> PlacedObject:
        """See `Whereabouts.body`."""
        pose, model = self._seen.object(name), self._seen.model(name)
        nan = array_namespace(pose).full_like(pose, np.nan)
        xp = array_namespace(pose)
        level = xp.zeros_like(pose[:, 3:]) + constant([1.0, 0.0, 0.0, 0.0], pose)
        unturned = xp.concat([pose[:, :3], level], axis=-1)
        pose = xp.where(model.ball[:, None], unturned, pose)
        there = xp.where(model.present[:, None], pose, nan)
        return PlacedObject(there, self._known(name, _outer, (0.0, 0.0, 0.0)), model.cubic)

    def surface(self, name: str) -> LevelSurface:
        """See `Whereabouts.surface`."""
        place = self._seen.place(name)
        return LevelSurface(place.pose, place.centre, place.extent / 2, place.present & place.carries)

    def hollow(self, name: str) -> Hollow:
        """See `Whereabouts.hollow`."""
        if name in self.bodies:
            return Hollow(self._seen.object(name), self._known(name, _hollow, NOTHING))
        place = self._seen.place(name)
        xp = array_namespace(place.pose)
        height = xp.stack([xp.zeros_like(place.height), place.height], axis=-1)
        return Hollow(place.pose, xp.concat([place.centre, place.extent / 2, height], axis=-1)[:, None, :])

    def _known(self, name: str, of: Callable[[ObjectModel], Array], nothing: tuple[float, ...]) -> Array:
        """What is known of an object in each world ``(N, most, ...)``; its last row again where it has fewer.

        Args:
            name: The object.
            of: What is asked for ``(k, ...)``.
            nothing: A row for worlds that lack the object, and where there is none.
        """
        return self._seen.once(("known", name, of), lambda: self._looked_up(name, of, nothing))

    def _looked_up(self, name: str, of: Callable[[ObjectModel], Array], nothing: tuple[float, ...]) -> Array:
        world, found = self._seen.world, []
        for k in range(world.worlds):
            model = world.model_of(k)
            rows = of(model.object(name)) if name in model.index else np.zeros((0, len(nothing)))
            found.append(rows if len(rows) else np.array([nothing]))
        most = max(len(rows) for rows in found)
        padded = [rows[np.minimum(np.arange(most), len(rows) - 1)] for rows in found]
        (there,) = sent([np.stack(padded)], self._seen.tool)
        return there


class Truth(Estimates):
    """Where everything truly is, with the geometry that objects are taken to have."""

    def __init__(self, known: Known) -> None:
        super().__init__(_AsSeen(known))  # type: ignore[arg-type]  # it has what is asked for


class _AsSeen:
    """The hidden state as a view that `Estimates` looks at."""

    def __init__(self, known: Known) -> None:
        self.world, self.tool = known.world, known.hidden.tool_pose
        self.object, self.place, self.model = known.object, known.place, known.world.object

    def once(self, key: Hashable, make: Callable[[], Array]) -> Array:
        """See `Seen.once`; nobody asks twice."""
        return make()


def _outer(model: ObjectModel) -> Array:
    """Corners ``(n, 3)`` of an object's convex hull, as it is known."""
    return box_corners(model.extent) if model.solid is None else model.solid.outer


def _hollow(model: ObjectModel) -> Array:
    """The hollow ``(k, 6)`` of an object; all of the box, where nothing but that is known."""
    if model.solid is not None:
        return model.solid.hollow
    x, y, z = (size / 2 for size in model.extent)
    return np.array([[0.0, 0.0, x, y, -z, z]])
