"""Where worlds of SAPIEN write what they read, and the laws of states over it."""

from __future__ import annotations

import numpy as np

from bt_tasksim.engines.physics.layout import wider_support


class SapienReadings:
    """What PhysX says of all worlds of a batch, each of which writes into a row of its own.

    A world's numbers are written while they are in the processor's cache: gathered when all other worlds have
    been stepped, too, they would have to come from memory.

    Args:
        worlds: How many worlds, N.
        tips: Number of fingertips.

    Attributes:
        time: Seconds ``(N,)`` since the episodes began.
        position: Of all joints of the articulations ``(N, joints)``, in their own order.
        velocity: The same.
        incoming: Forces and torques ``(N, links, 6)`` that each link's parent exerts on it.
        frames: Poses ``(N, 1 + tips, 7)`` of `Robot.frames`.
        objects: Poses ``(N, objects, 7)``, NaN behind the last of a world; so in all that objects have.
        linear: Linear velocities ``(N, objects, 3)``.
        angular: Angular ones.
        tip_force: Contact forces ``(N, tips, 3)`` on the fingertips.
        hand_force: Force ``(N, objects)`` of the robot on each object.
        hand_distance: Metres ``(N, objects)`` between the robot and each object.
        support: What the objects touch ``(N, objects, objects + fixtures)``, see `Hidden.support`.
        penetration: The deepest overlaps so far ``(N,)``, metres.
    """

    def __init__(self, worlds: int, tips: int) -> None:
        self._worlds, self._tips = worlds, tips
        self.time, self.penetration = np.zeros(worlds), np.zeros(worlds)
        self.position = self.velocity = np.zeros((worlds, 0))
        self.incoming = np.zeros((worlds, 0, 6))
        self.frames = np.zeros((worlds, 1 + tips, 7))
        self.tip_force = np.zeros((worlds, tips, 3))
        self.objects, self.support = np.zeros((worlds, 0, 7)), np.zeros((worlds, 0, 0), bool)
        self.linear = self.angular = np.zeros((worlds, 0, 3))
        self.hand_force = self.hand_distance = np.zeros((worlds, 0))

    def fit(self, joints: int, links: int, objects: int, fixtures: int) -> None:
        """Make room for articulations with so many joints and links, and for so many objects and fixtures.

        Where there is less of them than before, all worlds are new ones, and what was read is forgotten.
        """
        n, had = self._worlds, self.objects.shape[1]
        if self.position.shape[1] != joints or self.incoming.shape[1] != links:
            self.position, self.velocity = np.zeros((n, joints)), np.zeros((n, joints))
            self.incoming = np.zeros((n, links, 6))
        if self.support.shape == (n, objects, objects + fixtures):
            return
        narrower = objects < had or fixtures < self.support.shape[2] - had
        for name in ("objects", "linear", "angular", "hand_force", "hand_distance"):
            before = getattr(self, name)
            room = np.full((n, objects, *before.shape[2:]), np.nan)
            if not narrower:
                room[:, :had] = before
            setattr(self, name, room)
        before = self.support[:, :0, :0] if narrower else self.support
        self.support = wider_support(before, 0 if narrower else had, objects, fixtures)

    def clear(self, row: int) -> None:
        """Forget what the last world of a row has had."""
        for values in (self.objects, self.linear, self.angular, self.hand_force, self.hand_distance):
            values[row] = np.nan
