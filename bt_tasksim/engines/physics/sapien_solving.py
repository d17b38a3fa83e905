"""How long PhysX's solver works on what the hand holds.

PhysX goes from contact to contact, so many times a step. A thing that is held far from its centre of mass is
kept from turning by small differences between the forces at the corners of the pads, which take the solver
longest: with 15 iterations a ladle of 0.2 kg that hangs 70 mm beside the Panda's fingers trembles between
them by some degrees in each control period, and creeps by 18 degrees on a way on which it turns by less than
1 with 30 of them, or with 15 in steps half as long. Where many fingers hold, their forces may go to and fro,
too, from one period to the next and by as much as they are on average: of 83 things that the Ability hand
held in 30 random tasks 35 were held so, and three of them crept out of it or turned until they leaned. With
30 iterations it is 20 of 86, and none of the three; 60 are no better.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.sapien_world import floats

if TYPE_CHECKING:
    from sapien import physx

LEVER = 0.035
"""Metres between the tool and the centre of mass of what it holds from which the solver works longer."""
LONG = 60
"""Its position iterations then."""
MANY = 30
"""Those for whatever a hand of many fingers holds."""
HELD = 0.5
"""Newtons with which the hand presses on what it holds."""


class Solving:
    """The solver's iterations for the objects of one world.

    Args:
        hand: The link that carries the tool.
        tool: Position ``(3,)`` of the tool in its frame, metres.
        bodies: The objects.
        many: The hand has more than two fingertips.
    """

    def __init__(
        self,
        hand: physx.PhysxArticulationLinkComponent,
        tool: Array,
        bodies: Sequence[physx.PhysxRigidDynamicComponent],
        many: bool = False,
    ) -> None:
        self._most, self._long = (0.0, MANY) if many else (LEVER, LONG)
        self._hand, self._bodies = hand, bodies
        self._tool = [float(v) for v in tool]
        self._centres = [floats(body.get_cmass_local_pose())[:3] for body in bodies]
        self._usual = [body.get_solver_position_iterations() for body in bodies]
        self._far = -1

    def look(self, hand_force: Sequence[float]) -> None:
        """Have the solver work as long as what is held needs.

        Args:
            hand_force: Of the robot on each object, N.
        """
        which = max(range(len(hand_force)), key=hand_force.__getitem__, default=-1)
        far = which if which >= 0 and hand_force[which] > HELD and self._lever(which) > self._most else -1
        if far == self._far:
            return
        if self._far >= 0:
            self._bodies[self._far].set_solver_position_iterations(self._usual[self._far])
        if far >= 0:
            self._bodies[far].set_solver_position_iterations(max(self._usual[far], self._long))
        self._far = far

    def _lever(self, which: int) -> float:
        """Metres between the tool and an object's centre of mass."""
        hand, thing = (list(floats(body.entity_pose)) for body in (self._hand, self._bodies[which]))
        return math.dist(poses.point(hand, self._tool), poses.point(thing, self._centres[which]))
