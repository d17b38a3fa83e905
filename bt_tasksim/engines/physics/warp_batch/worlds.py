"""Worlds of one structure as MuJoCo Warp has them: one model and one state, stepped together on a device."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import warp as wp

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.mujoco_model import BodyNumbers
from bt_tasksim.engines.physics.warp_batch import kernels
from bt_tasksim.engines.physics.warp_batch.meshes import HullStore
from bt_tasksim.engines.physics.warp_batch.report import Columns
from bt_tasksim.engines.physics.warp_batch.structure import Prepared
from bt_tasksim.engines.physics.warp_batch.words import RowFields, copy, host_words, words, write

GOING = ("qpos", "qvel", "qacc_warmstart", "overflow")
"""The part of a state that steps change, and whether it ever had too little room."""
STATE = (*GOING, "ctrl", "xfrc_applied", "geom_xpos", "geom_xmat")
"""A state, with what stands still in it."""
OVERFLOW = ("NEFC", "NJMAX_NNZ")
"""What MuJoCo Warp says of a world that has too little room, as far as it says it of each world for itself.
That the list of all contacts is full it says of all at once; here they are counted (see `CONTACTS`)."""
CONTACTS = (64, 32)
"""Contacts that each world may have, and more for each object beyond the first. In 48 episodes a scenario of
one object has had 12 at most (`pick_and_place`), 31 (`grasp_fast_heavy`) and 38 (`pick_and_throw`, when a cup
lands), so there is room for half as many again and more; a resting object has 4 or 5. One world of MuJoCo has
as many (``data.ncon``), and needs fewer rows of constraints (81) than there are for these contacts."""
ROWS = 5
"""Rows of constraints for each of these contacts: a finger's takes 4, one between objects 6. Besides them
each joint has room for its limits and for following another one."""


def room(share: int, count: int, pairs: int) -> int:
    """Length of the list of all worlds' contacts, and of that of pairs which may touch.

    The pairs of one world alone always fit.

    Args:
        share: Contacts that a world may have.
        count: How many worlds.
        pairs: Pairs of shapes in a world that can touch at all.
    """
    return share * count + pairs


class WarpWorlds:
    """A model and a state of MuJoCo Warp for some number of worlds.

    Args:
        library: MuJoCo Warp.
        device: Where.
        first: One of the worlds; all rows begin as it.
        bodies: Which bodies are read.
        hulls: Where the hulls are.
        count: How many worlds.

    Raises:
        InputError: MuJoCo Warp does not take this model.
    """

    def __init__(
        self,
        library: ModuleType,
        device: wp.Device,
        first: Prepared,
        bodies: BodyNumbers,
        hulls: HullStore,
        count: int,
    ) -> None:
        self._library, self._device, self._first, self._bodies = library, device, first, bodies
        self._hulls, self._version, self.count = hulls, -1, count
        self._graphs: dict[str, Any] = {}
        self._loaded: set[str] = set()
        model, geoms = first.world.model, first.geoms
        self.n_objects, self.n_bodies = bodies.n_objects, bodies.n_objects + bodies.n_fixtures
        self.share = CONTACTS[0] + CONTACTS[1] * max(self.n_objects - 1, 0)
        kinds = library.OverflowType
        self._overflow = sum(int(kinds[name]) for name in OVERFLOW)
        with wp.ScopedDevice(device):
            try:
                self.model: Any = library.put_model(model)
                self.data: Any = library.make_data(
                    model,
                    nworld=count,
                    naconmax=room(self.share, count, model.npair),
                    njmax=ROWS * self.share + 2 * model.njnt,
                )
            except (NotImplementedError, ValueError) as error:
                raise InputError(f"MuJoCo Warp cannot simulate this world: {error}") from error
            self.model.opt.warn_overflow = 0  # it says so in `overflow`
            self.model.opt.graph_conditional = not device.is_cuda or wp.is_conditional_graph_supported()
            whole = {"judged": geoms.judged, "link": geoms.link, "tip": geoms.tip}
            whole |= {"thing": geoms.thing, "body": geoms.body, "read": bodies.read}
            self._table = {name: wp.array(value, dtype=wp.int32) for name, value in whole.items()}
            n, things = count, max(self.n_objects, 1)
            self._going = wp.zeros(n, dtype=wp.int32)
            self.deepest = wp.zeros(n, dtype=wp.float32)
            self.deepest_pair = wp.zeros(n, dtype=wp.vec2i)
            self._tips = wp.zeros((n, max(bodies.n_tips, 1)), dtype=wp.vec3)
            self._by_link = wp.zeros((n, max(geoms.n_links, 1) * things), dtype=wp.vec3)
            self._hand = wp.zeros((n, things), dtype=wp.float32)
            self._felt = wp.zeros((n, first.timing.sensed, 16), dtype=wp.float32)
            self._sample = wp.zeros(1, dtype=wp.int32)
            self._distance = wp.zeros((n, things), dtype=wp.float32)
            self._support = wp.zeros((n, things * max(self.n_bodies, 1)), dtype=wp.float32)
            self._poses = wp.zeros((n, 7 * len(bodies.read)), dtype=wp.float32)
            self._found, self._most = wp.zeros(n, dtype=wp.int32), wp.zeros(n, dtype=wp.int32)
            self._crowded = wp.zeros(n, dtype=wp.int32)
            noted = {"deepest": self.deepest, "deepest_pair": self.deepest_pair}
            changing = {name: getattr(self.data, name) for name in GOING} | noted
            self._words = {name: words(array) for name, array in changing.items()}
            self._before = {name: wp.clone(array) for name, array in self._words.items()}
        self.state = RowFields({name: getattr(self.data, name) for name in STATE} | noted)
        self.own: dict[str, wp.array] = {}
        """Fields of the model that have a row for each world."""
        self._reported = {
            "qpos": words(self.data.qpos),
            "qvel": words(self.data.qvel),
            "poses": words(self._poses),
            "felt": words(self._felt),
            "tips": words(self._tips),
            "hand": words(self._hand),
            "distance": words(self._distance),
            "support": words(self._support),
            "deepest": words(self.deepest),
            "deepest_pair": words(self.deepest_pair),
            "overflow": words(self.data.overflow),
            "most": words(self._most),
            "crowded": words(self._crowded),
        }
        self.columns = Columns.of({name: array.shape[1] for name, array in self._reported.items()})
        self._report = wp.zeros((count, self.columns.width), dtype=wp.int32, device=device)

    # ---- worlds come and go -----------------------------------------------------------------------------

    def load(self, rows: Array, worlds: list[Prepared], meshes: Array) -> None:
        """Begin worlds of this structure anew at rows ``(k,)``; the others stay.

        Args:
            rows: Which ones.
            worlds: What to begin with.
            meshes: Numbers of their geoms' hulls in the store ``(k, n_geoms)``.
        """
        for name, mine in self._first.fields.items():
            values = np.array([world.fields[name] for world in worlds])
            if name in self.own or (values != mine).any():
                self._make_own(name, mine)
                write(words(self.own[name]), rows, values)
        self._make_own("geom_dataid", host_words(meshes[:1], np.int32)[0])
        write(words(self.own["geom_dataid"]), rows, host_words(meshes, np.int32))
        for name, target in self.state.words.items():
            width = target.shape[1]
            values = np.zeros((len(rows), width), np.int32)
            if name in worlds[0].state:
                values = np.array([world.state[name] for world in worlds])
            write(target, rows, values)

    def write(self, rows: Array, name: str, values: Array) -> None:
        """Write numbers ``(k, n)`` into a part of the state of worlds ``(k,)``."""
        write(self.state.words[name], rows, host_words(values, np.float32))

    def copy_to(self, rows: Array, other: WarpWorlds, other_rows: Array) -> None:
        """Copy whole worlds to rows of another of the same structure."""
        for name in self.own:
            other._make_own(name, None)
        mine = {name: self.own[name] for name in self.own}
        RowFields(mine).copy_to(rows, RowFields({name: other.own[name] for name in mine}), other_rows)
        self.state.copy_to(rows, other.state, other_rows)

    def _make_own(self, name: str, words_of_all: Array | None) -> None:
        """Give each world its own row of a field of the model."""
        if name in self.own:
            return
        shared = getattr(self.model, name)
        row = words(shared)
        own = wp.zeros((self.count, *shared.shape[1:]), dtype=shared.dtype, device=self._device)
        if words_of_all is not None and row.shape[1] != len(words_of_all):
            raise InputError(f"MuJoCo Warp cannot have worlds side by side whose '{name}' differ")
        copy(row, np.zeros(self.count, int), words(own), np.arange(self.count))
        self.own[name] = own
        setattr(self.model, name, own)
        self._graphs.clear()

    # ---- running ----------------------------------------------------------------------------------------

    def period(self, rows: Array, fine: bool) -> Array:
        """Let some worlds go on by one control period; the others are as they were.

        Args:
            rows: Which ones go on.
            fine: In fine steps.

        Returns:
            What is read of all worlds, words ``(count, columns)``.
        """
        timing = self._first.timing
        finer = timing.finer if fine else 1
        self._begin(rows, timing.step / finer)
        for k in range(timing.steps):
            for _ in range(finer):
                self._run("step", self._step)
            if k >= timing.steps - timing.sensed:
                self._run("feel", self._feel)
        return self._end()

    def look(self, rows: Array) -> Array:
        """Read some worlds as they stand, with the forces of this instant; see `period`."""
        self._begin(rows, self._first.timing.step)
        self._run("forward", lambda: self._library.forward(self.model, self.data))
        self._run("feel", self._feel)
        return self._end()

    def undo(self) -> None:
        """All worlds are as they were before the last period or look."""
        for name, before in self._before.items():
            wp.copy(self._words[name], before)

    def crowded(self, reports: Array) -> bool:
        """Whether the list of all worlds' contacts, or of pairs that may touch, was too short in a period.

        Some are lacking then, of whichever worlds: nothing of that period counts.

        Args:
            reports: What was read then ``(k, columns)``, of one world at least.
        """
        return bool(self.columns.integers(reports, "crowded").any())

    def full(self, reports: Array) -> Array:
        """Which worlds ``(k,)`` had more contacts than their share, or constraints than rows for them."""
        over = self.columns.integers(reports, "overflow")[:, 0] & self._overflow
        return (over != 0) | (self.columns.integers(reports, "most")[:, 0] > self.share)

    def _begin(self, rows: Array, step: float) -> None:
        if self._version != self._hulls.version:
            self._hulls.attach(self.model)
            self._version = self._hulls.version
            self._graphs.clear()
        going = np.zeros(self.count, np.int32)
        going[rows] = 1
        self._going.assign(going)
        self.model.opt.timestep.fill_(step)
        self._run("start", self._start)

    def _end(self) -> Array:
        self._run("finish", self._finish)
        return np.asarray(self._report.numpy())

    def _run(self, name: str, work: Callable[[], None]) -> None:
        """Do it: the first time launch by launch, which loads all kernels, and then as a graph.

        A graph costs the interpreter nothing, on a GPU and on the CPU.
        """
        with wp.ScopedDevice(self._device):
            if name not in self._loaded:
                work()
                self._loaded.add(name)
                return
            if name not in self._graphs:
                with wp.ScopedCapture(self._device) as capture:
                    work()
                self._graphs[name] = capture.graph
            wp.capture_launch(self._graphs[name])

    def _step(self) -> None:
        self._library.step(self.model, self.data)
        self._note_contacts()

    def _start(self) -> None:
        for name, before in self._before.items():
            wp.copy(before, self._words[name])
        for array in (self._tips, self._hand, self._felt, self._sample, self._most, self._crowded):
            array.zero_()

    def _finish(self) -> None:
        """Put back those that do not go on, and read all: positions and distances of this instant."""
        for name, before in self._before.items():
            self._launch(kernels.put_back, before.shape, self._going, before, self._words[name])
        model, data, table = self.model, self.data, self._table
        self._library.kinematics(model, data)
        self._library.collision(model, data)
        self._note_contacts()
        self._distance.fill_(float("inf"))
        self._support.zero_()
        self._launch(
            kernels.find_near,
            data.naconmax,
            *self._contacts(),
            table["judged"],
            table["link"],
            table["thing"],
            table["body"],
            max(self.n_bodies, 1),
            self._distance,
            self._support,
        )
        self._launch(
            kernels.take_bodies,
            (self.count, len(self._bodies.read)),
            table["read"],
            data.xpos,
            data.xquat,
            self._poses,
        )
        for name, source in self._reported.items():
            self._launch(kernels.pack, source.shape, source, self.columns.first[name], self._report)

    # ---- reading ----------------------------------------------------------------------------------------

    def _contacts(self) -> tuple[Any, ...]:
        data, contact = self.data, self.data.contact
        return data.nacon, data.naconmax, contact.dist, contact.geom, contact.worldid

    def _note_contacts(self) -> None:
        """How many there are, and the deepest."""
        data = self.data
        worlds, found = data.contact.worldid, self._found
        self._launch(kernels.count_contacts, data.naconmax, data.nacon, data.naconmax, worlds, found)
        counts = (found, data.nacon, data.ncollision, data.naconmax)
        self._launch(kernels.note_most, self.count, *counts, self._most, self._crowded)
        touching = (*self._contacts(), self._table["judged"], self._going, self.deepest)
        self._launch(kernels.note_depth, data.naconmax, *touching)
        self._launch(kernels.note_deepest_pair, data.naconmax, *touching, self.deepest_pair)

    def _feel(self) -> None:
        """Take the forces of the last step."""
        model, data, table, bodies = self.model, self.data, self._table, self._bodies
        self._library.rne_postconstraint(model, data)
        contact, things = data.contact, max(self.n_objects, 1)
        self._launch(
            kernels.add_forces,
            data.naconmax,
            data.nacon,
            data.naconmax,
            contact.frame,
            contact.geom,
            contact.worldid,
            contact.efc_address,
            data.efc.force,
            table["link"],
            table["tip"],
            table["thing"],
            things,
            self._tips,
            self._by_link,
        )
        n_links = self._first.geoms.n_links
        self._launch(kernels.add_hand_forces, self._hand.shape, n_links, things, self._by_link, self._hand)
        self._launch(
            kernels.feel_wrist,
            self.count,
            data.cfrc_int,
            data.subtree_com,
            data.xpos,
            data.xquat,
            bodies.wrist,
            bodies.root,
            bodies.tool,
            self._sample,
            self._felt,
        )
        self._launch(kernels.count_up, 1, self._sample)

    def _launch(self, kernel: Any, size: int | tuple[int, ...], *arguments: Any) -> None:
        wp.launch(kernel, size, list(arguments), device=self._device)
