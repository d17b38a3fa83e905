"""What each geom of a structure belongs to, as numbers that kernels read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.mujoco_model import World


@dataclass(frozen=True, eq=False)
class GeomTable:
    """Numbers ``(n_geoms,)`` of the geoms; -1: none.

    Attributes:
        judged: 1 where an overlap counts: the robot's base does not.
        link: Number of the moving link, counted from 0.
        tip: Number of the fingertip.
        thing: Number of the object.
        body: Number of the object, or of the fixture behind the objects.
        n_links: How many links have shapes.
    """

    judged: Array
    link: Array
    tip: Array
    thing: Array
    body: Array
    n_links: int

    @classmethod
    def of(cls, world: World) -> GeomTable:
        """The table of a model."""
        carrier = np.asarray(world.model.geom_bodyid)
        role = np.array([body.role for body in world.bodies])
        index = np.array([body.index for body in world.bodies], np.int32)
        links = sorted(set(carrier[role == "link"].tolist()))
        number = {body: k for k, body in enumerate(links)}
        return cls(
            judged=(role != "base").astype(np.int32),
            link=np.array(
                [number[b] if r == "link" else -1 for b, r in zip(carrier.tolist(), role, strict=True)],
                np.int32,
            ),
            tip=np.array([body.tip for body in world.bodies], np.int32),
            thing=np.where(role == "object", index, -1).astype(np.int32),
            body=index,
            n_links=len(links),
        )

    @property
    def key(self) -> bytes:
        """The same for equal tables."""
        return b"".join(part.tobytes() for part in (self.judged, self.link, self.tip, self.thing, self.body))
