"""What is read from MuJoCo's state: contacts, and the wrench at the wrist."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.engines.mujoco_contacts import Body
from bt_tasksim.poses import Array

SUPPORT_DISTANCE = 5e-4
"""Metres within which two bodies touch."""


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contacts of one instant.

    Attributes:
        tip_force: Contact force ``(n_tips, 3)`` on each fingertip, friction included, N.
        hand_force: Sum ``(n_objects,)`` over the robot's links of the magnitude of each one's force on the
            object, N.
        hand_distance: Metres ``(n_objects,)`` between the robot and each object; infinite out of reach.
        support: ``(n_objects, n_bodies)`` boolean, see `bt_tasksim.world.Hidden`.
    """

    tip_force: Array
    hand_force: Array
    hand_distance: Array
    support: Array


class ContactReader:
    """Reads contacts of a model.

    Args:
        bodies: What each geom belongs to.
        geom_body: Number of the body that carries each geom.
        n_tips: Number of fingertips.
        n_objects: Number of objects.
        n_fixtures: Number of fixtures.
    """

    def __init__(
        self, bodies: tuple[Body, ...], geom_body: Array, n_tips: int, n_objects: int, n_fixtures: int
    ) -> None:
        self._names = [body.name for body in bodies]
        self._carrier = np.asarray(geom_body)
        self._n_carriers = int(np.max(self._carrier)) + 1
        self._judged = np.array([body.role != "base" for body in bodies])
        self._robot = np.array([body.role == "link" for body in bodies])
        self._object = np.array([body.role == "object" for body in bodies])
        self._index = np.array([body.index for body in bodies])
        self._tip = np.array([body.tip for body in bodies])
        self._n_tips, self._n_objects, self._n_bodies = n_tips, n_objects, n_objects + n_fixtures

    def deepest(self, data: Any) -> tuple[float, str, str]:
        """The deepest overlap in metres, and the names of the two bodies; the robot's base does not count."""
        distance = data.contact.dist
        if not len(distance) or float(distance.min()) >= 0.0:
            return 0.0, "", ""
        geom = data.contact.geom
        counted = np.where(self._judged[geom].all(axis=1), distance, np.inf)
        k = int(np.argmin(counted))
        a, b = geom[k]
        return max(-float(counted[k]), 0.0), self._names[a], self._names[b]

    def read(self, data: Any) -> Contacts:
        """The contacts of the state that the forces were last computed for."""
        tip_force = np.zeros((self._n_tips, 3))
        by_link = np.zeros((self._n_carriers, self._n_objects, 3))
        near = np.full(self._n_objects, np.inf)
        support = np.zeros((self._n_objects, self._n_bodies), bool)
        geom, distance = data.contact.geom, data.contact.dist
        kept = self._judged[geom].all(axis=1) if len(geom) else np.zeros(0, bool)
        if kept.any():
            geom, distance = geom[kept], distance[kept]
            force = _force_on_second(data, kept)
            for sign, me, other in ((-1.0, geom[:, 0], geom[:, 1]), (1.0, geom[:, 1], geom[:, 0])):
                tips = self._tip[me] >= 0
                np.add.at(tip_force, self._tip[me[tips]], sign * force[tips])
                held = self._object[me] & self._robot[other]
                k = self._index[me[held]]
                np.add.at(by_link, (self._carrier[other[held]], k), sign * force[held])
                np.minimum.at(near, k, np.maximum(distance[held], 0.0))
                on = self._object[me] & ~self._robot[other] & (distance < SUPPORT_DISTANCE)
                support[self._index[me[on]], self._index[other[on]]] = True
        return Contacts(tip_force, np.linalg.norm(by_link, axis=-1).sum(axis=0), near, support)


def _force_on_second(data: Any, kept: Array) -> Array:
    """Force ``(n, 3)`` of each kept contact on the second of its bodies, base frame, N.

    With elliptic cones the solver's forces are those along the axes of the contact's frame; its first axis
    points from the first body to the second.
    """
    address = data.contact.efc_address[kept]
    force = np.zeros((len(address), 3))
    pressing = address >= 0
    if pressing.any():
        frame = data.contact.frame[kept][pressing].reshape(-1, 3, 3)
        along = data.efc_force[address[pressing][:, None] + np.arange(3)]
        force[pressing] = np.einsum("nij,ni->nj", frame, along)
    return force


def wrist_wrench(data: Any, root: int, wrist: int, tool: Array, rotation: Array) -> Array:
    """External wrench ``(6,)`` at the tool origin in the tool frame, with what the hand's acceleration takes.

    MuJoCo gives torque and force that the wrist's parent exerts on it, about the robot's centre of mass. The
    world's on the hand is its opposite: nothing here has weight but objects.

    Args:
        data: ``mujoco.MjData`` after ``mj_rnePostConstraint``.
        root: Number of the robot's root body.
        wrist: Number of the wrist's body.
        tool: Position ``(3,)`` of the tool.
        rotation: Matrix ``(3, 3)`` of the tool frame.
    """
    torque, force = -data.cfrc_int[wrist, :3], -data.cfrc_int[wrist, 3:]
    torque = torque - np.cross(tool - data.subtree_com[root], force)
    return np.concatenate([force @ rotation, torque @ rotation])
