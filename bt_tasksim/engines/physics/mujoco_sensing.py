"""What is read from MuJoCo's state: contacts, and the wrench at the wrist."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.mujoco_contacts import Body

if TYPE_CHECKING:
    import mujoco as mj


@dataclass(frozen=True, eq=False)
class Near:
    """What is near what at one instant.

    Attributes:
        hand_distance: Metres ``(n_objects,)`` between the robot and each object; infinite out of reach.
        support: ``(n_objects, n_bodies)`` boolean, see `bt_tasksim.core.world.Hidden`.
    """

    hand_distance: Array
    support: Array


@dataclass(frozen=True, eq=False)
class Felt:
    """Forces at one instant, or their mean.

    Attributes:
        tip_force: Contact force ``(n_tips, 3)`` on each fingertip, friction included, base frame, N.
        hand_force: Sum ``(n_objects,)`` over the robot's links of the magnitude of each one's force on the
            object, N.
        wrench: External wrench ``(6,)`` at the tool origin in the tool frame, N and Nm.
    """

    tip_force: Array
    hand_force: Array
    wrench: Array

    @classmethod
    def mean(cls, samples: Sequence[Felt]) -> Felt:
        """The mean of some instants."""
        return cls(
            np.mean([s.tip_force for s in samples], axis=0),
            np.mean([s.hand_force for s in samples], axis=0),
            np.mean([s.wrench for s in samples], axis=0),
        )


class ContactReader:
    """Reads the contacts of a model.

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

    def deeper(self, data: mj.MjData, than: float) -> tuple[float, str, str] | None:
        """The deepest overlap in metres and the names of the two bodies, if it is deeper than that.

        The robot's base does not count.
        """
        distance = data.contact.dist
        if not len(distance) or -distance.min() <= than:
            return None
        geom = data.contact.geom
        counted = np.where(self._judged[geom].all(axis=1), distance, np.inf)
        k = int(np.argmin(counted))
        if -counted[k] <= than:
            return None
        a, b = geom[k]
        return -float(counted[k]), self._names[a], self._names[b]

    def near(self, data: mj.MjData) -> Near:
        """What is near what, from the contacts that were last looked for."""
        distances = np.full(self._n_objects, np.inf)
        support = np.zeros((self._n_objects, self._n_bodies), bool)
        geom, distance = data.contact.geom, data.contact.dist
        if len(geom):
            kept = self._judged[geom].all(axis=1)
            geom, distance = geom[kept], distance[kept]
            for me, other in ((geom[:, 0], geom[:, 1]), (geom[:, 1], geom[:, 0])):
                held = self._object[me] & self._robot[other]
                np.minimum.at(distances, self._index[me[held]], np.maximum(distance[held], 0.0))
                on = self._object[me] & ~self._robot[other]
                support[self._index[me[on]], self._index[other[on]]] = True
        return Near(distances, support)

    def forces(self, data: mj.MjData) -> tuple[Array, Array]:
        """``tip_force`` and ``hand_force`` of `Felt`, from the contacts that forces were last computed for.

        With elliptic cones the solver's forces are those along the axes of the contact's frame; its first
        axis points from the first body to the second.
        """
        tip_force = np.zeros((self._n_tips, 3))
        by_link = np.zeros((self._n_carriers, self._n_objects, 3))
        if not len(data.contact.dist):
            return tip_force, np.zeros(self._n_objects)
        address, geom = data.contact.efc_address, data.contact.geom
        kept = (address >= 0) & self._robot[geom].any(axis=1)
        address, geom = address[kept], geom[kept]
        if len(geom):
            frame = data.contact.frame[kept].reshape(-1, 3, 3)
            force = np.einsum("nij,ni->nj", frame, data.efc_force[address[:, None] + np.arange(3)])
            for sign, me, other in ((-1.0, geom[:, 0], geom[:, 1]), (1.0, geom[:, 1], geom[:, 0])):
                tips = self._tip[me] >= 0
                np.add.at(tip_force, self._tip[me[tips]], sign * force[tips])
                held = self._object[me] & self._robot[other]
                np.add.at(by_link, (self._carrier[other[held]], self._index[me[held]]), sign * force[held])
        return tip_force, np.linalg.norm(by_link, axis=-1).sum(axis=0)


def wrist_wrench(
    data: mj.MjData, root: int, wrist: int, tool: Sequence[float]
) -> tuple[list[float], list[float]]:
    """External force and torque ``(3,)`` each at the tool origin, base frame.

    What the hand's own acceleration takes is in them, as a sensor at the wrist has it. MuJoCo gives torque
    and force that the wrist's parent exerts on it, about the robot's centre of mass. The world's on the
    hand is its opposite: nothing here has weight but objects.

    Args:
        data: ``mujoco.MjData`` after ``mj_rnePostConstraint``.
        root: Number of the robot's root body.
        wrist: Number of the wrist's body.
        tool: Position ``(3,)`` of the tool origin.
    """
    u, v, w, x, y, z = data.cfrc_int[wrist].tolist()
    rx, ry, rz = (t - c for t, c in zip(tool, data.subtree_com[root].tolist(), strict=True))
    return [-x, -y, -z], [ry * z - rz * y - u, rz * x - rx * z - v, rx * y - ry * x - w]
