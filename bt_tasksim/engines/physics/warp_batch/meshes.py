"""Convex hulls of all worlds on the device: each in a room of its own, and equal ones once.

MuJoCo Warp lets each world's geoms name another mesh, but keeps the meshes themselves in arrays of one model.
Here these arrays have rooms of one size; a world that begins anew brings its hulls into free rooms.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.warp_batch.words import host_words, words, write

if TYPE_CHECKING:
    import mujoco as mj

PARTS: dict[str, tuple[Any, int]] = {
    "vert": (np.float32, 3),
    "polymapadr": (np.int32, 1),
    "polymapnum": (np.int32, 1),
    "graph": (np.int32, 1),
    "polynormal": (np.float32, 3),
    "polyvertadr": (np.int32, 1),
    "polyvertnum": (np.int32, 1),
    "polyvert": (np.int32, 1),
    "polymap": (np.int32, 1),
}
"""What a mesh consists of: type of the numbers, and how many an element has. The model's fields are named
``mesh_`` and these."""
FIRST_ROOMS = 16


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex mesh, with all addresses counted from its own first element.

    Attributes:
        parts: Its elements ``(n, ...)`` by part.
        has_graph: It has a graph of neighbouring corners; small ones need none.
        degree: The most polygons that meet in a corner.
        polygon: The most corners of a polygon.
    """

    parts: dict[str, Array]
    has_graph: bool

    @property
    def key(self) -> bytes:
        """The same for equal hulls."""
        return b"".join(len(p).to_bytes(4, "little") + p.tobytes() for p in self.parts.values())

    @property
    def degree(self) -> int:
        """The most polygons that meet in a corner."""
        return int(self.parts["polymapnum"].max(initial=0))

    @property
    def polygon(self) -> int:
        """The most corners of a polygon."""
        return int(self.parts["polyvertnum"].max(initial=0))

    @classmethod
    def of(cls, model: mj.MjModel, k: int) -> Hull:
        """The mesh number k of a model."""
        at, n = int(model.mesh_vertadr[k]), int(model.mesh_vertnum[k])
        poly, faces = int(model.mesh_polyadr[k]), int(model.mesh_polynum[k])
        corners = slice(at, at + n)
        sides = slice(poly, poly + faces)
        vertices, maps = model.mesh_polyvertnum[sides], model.mesh_polymapnum[corners]
        first_vertex = int(model.mesh_polyvertadr[poly]) if faces else 0
        first_map = int(model.mesh_polymapadr[at]) if faces else 0
        graph, size = int(model.mesh_graphadr[k]), 0
        if graph >= 0:  # two counts; two numbers a corner, one more for each edge and its end, three a face
            size = 2 + 3 * int(model.mesh_graph[graph]) + 6 * int(model.mesh_graph[graph + 1])
        parts = {
            "vert": model.mesh_vert[corners],
            "polymapadr": model.mesh_polymapadr[corners] - first_map,
            "polymapnum": maps,
            "graph": model.mesh_graph[graph : graph + size] if size else np.zeros(0, np.int32),
            "polynormal": model.mesh_polynormal[sides],
            "polyvertadr": model.mesh_polyvertadr[sides] - first_vertex,
            "polyvertnum": vertices,
            "polyvert": model.mesh_polyvert[first_vertex : first_vertex + int(vertices.sum())],
            "polymap": model.mesh_polymap[first_map : first_map + int(maps.sum())],
        }
        return cls({name: np.array(p, PARTS[name][0]) for name, p in parts.items()}, size > 0)


class HullStore:
    """The hulls that worlds use, in rooms.

    Args:
        device: Where.

    Attributes:
        version: Counts up whenever the arrays are others: models take them anew with `attach`.
    """

    def __init__(self, device: wp.Device) -> None:
        self.version = 0
        self._device = device
        self._sizes = dict.fromkeys(PARTS, 1)  # elements of a room
        self._rooms = 0
        self._degree = self._polygon = 1
        self._hulls: dict[int, Hull] = {}
        self._number: dict[bytes, int] = {}
        self._keys: dict[int, bytes] = {}
        self._users: dict[int, int] = {}
        self._free: list[int] = []
        self._new: list[int] = []
        self._arrays: dict[str, wp.array] = {}

    def enter(self, hull: Hull) -> int:
        """The number of a hull, which has one user more; `flush` brings it to the device."""
        key = hull.key
        room = self._number.get(key)
        if room is None:
            if not self._free:
                self._widen(dict.fromkeys(PARTS, 0), max(FIRST_ROOMS, self._rooms))
            room = self._free.pop()
            self._hulls[room], self._number[key], self._keys[room], self._users[room] = hull, room, key, 0
            self._new.append(room)
            self._widen({name: len(part) for name, part in hull.parts.items()}, 0)
            if hull.degree > self._degree or hull.polygon > self._polygon:
                self._degree = max(self._degree, hull.degree)
                self._polygon = max(self._polygon, hull.polygon)
                self.version += 1
        self._users[room] += 1
        return room

    def leave(self, room: int) -> None:
        """A hull has one user less."""
        self._users[room] -= 1
        if self._users[room] == 0:
            del self._hulls[room], self._users[room], self._number[self._keys.pop(room)]
            self._free.append(room)

    def flush(self) -> None:
        """Bring what is new to the device."""
        rooms = np.array(sorted({room for room in self._new if room in self._hulls}), int)
        self._new = []
        if not len(rooms):
            return
        for name, (kind, width) in PARTS.items():
            values = np.zeros((len(rooms), self._sizes[name], width), kind)
            for k, room in enumerate(rooms.tolist()):
                part = self._hulls[room].parts[name]
                values[k, : len(part)] = part.reshape(-1, width)
                if name == "polyvertadr":
                    values[k] += room * self._sizes["polyvert"]
                if name == "polymapadr":
                    values[k] += room * self._sizes["polymap"]
            write(self._as_rooms(name), rooms, host_words(values, kind))
        for name, column in self._addresses(rooms).items():
            write(words(self._arrays[name]), rooms, host_words(column[:, None], np.int32))

    def attach(self, model: Any) -> None:
        """Let a model of MuJoCo Warp use these hulls."""
        for name, array in self._arrays.items():
            setattr(model, f"mesh_{name}", array)
        model.nmeshdegmax, model.npolygonmax = self._degree, self._polygon

    def _addresses(self, rooms: Array) -> dict[str, Array]:
        hulls = [self._hulls[room] for room in rooms.tolist()]
        graph = np.array([hull.has_graph for hull in hulls])
        return {
            "vertadr": rooms * self._sizes["vert"],
            "vertnum": np.array([len(hull.parts["vert"]) for hull in hulls]),
            "graphadr": np.where(graph, rooms * self._sizes["graph"], -1),
            "polyadr": rooms * self._sizes["polynormal"],
            "polynum": np.array([len(hull.parts["polynormal"]) for hull in hulls]),
        }

    def _as_rooms(self, name: str) -> wp.array:
        """An array as ``(rooms, words of a room)``."""
        array = self._arrays[name]
        view = wp.array(
            ptr=array.ptr,
            dtype=wp.int32,
            shape=(self._rooms, self._sizes[name] * PARTS[name][1]),
            device=self._device,
            copy=False,
        )
        view.kept = array
        return view

    def _widen(self, sizes: dict[str, int], rooms: int) -> None:
        """Make rooms larger, or more of them; everything is brought to the device anew."""
        if not rooms and all(sizes[name] <= self._sizes[name] for name in PARTS):
            return
        # What lies beside each other by corner or by side has rooms of one size.
        for one, *others in (
            ("vert", "polymapadr", "polymapnum"),
            ("polynormal", "polyvertadr", "polyvertnum"),
        ):
            most = max(sizes[one], self._sizes[one])
            self._sizes |= dict.fromkeys((one, *others), most)
        for name in ("graph", "polyvert", "polymap"):
            self._sizes[name] = max(self._sizes[name], sizes[name])
        self._free += range(self._rooms + rooms - 1, self._rooms - 1, -1)
        self._rooms += rooms
        kinds = {np.int32: wp.int32, np.float32: wp.vec3}
        with wp.ScopedDevice(self._device):
            for name, (kind, _) in PARTS.items():
                self._arrays[name] = wp.zeros(self._rooms * self._sizes[name], dtype=kinds[kind])
            for name in ("vertadr", "vertnum", "graphadr", "polyadr", "polynum"):
                self._arrays[name] = wp.zeros(self._rooms, dtype=wp.int32)
        self._new = list(self._hulls)
        self.version += 1
