"""Whether a hand of many fingers holds what it closes on at a tool pose.

A gripper of two fingers holds at a grip as the grip says. A hand with more of them is asked what each of its
fingers meets (`bt_tasksim.planning.closing`).
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.closing import Squeeze, closing_of
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import box_corners
from bt_tasksim.robot.kinematics.hand import standing_side

SLANTED = 0.01
"""Metres by which the middle of an action is deeper for a horizontal approach than for one from above: where
a slanted hand meets an object's edge first, its fingers are still before the object's middle. Not at a known
grip, where the hand was looked at among things as deep as it goes."""
SLIPS = math.radians(30.0)
"""Radians between the line of a squeeze and a surface's normal beyond which others are tried first. Friction
of pads on things is 0.75 to 1.05, whose cones are 37 to 46 degrees wide; estimates turn by some degrees."""
PUSHES = 0.18
"""Share of a squeeze by which fingers push a thing out of the hand from which on they have to hold it less
deep, too: where it is wide and low some of them come to lie on its top, and once lifted it is pressed out. Of
random grasps that hold barely 8 of 28 that push more went wrong, and 4 of 23 others; of those that hold
surely 0 of 17, and 6 of 133."""
AHEAD = 0.008
"""Metres by which one side of a hand may push an object until it meets the other side."""
SHALLOWER = 0.007
"""Metres less deep at which the hand is to hold, too: estimates are wrong by millimetres, and fingertips that
meet an upper edge slip over it."""
CENTRED = 0.003
"""Metres beside which a grasp is not moved."""
FARTHEST = 0.02
"""Metres by which it is moved at most."""

RISK = (-3.87, 2.11, 52.7, 145.0)
"""Log odds that what a hand of many fingers takes slips, or turns by more than 10 degrees, until it is
carried: a constant, and so much for each radian of `Squeeze.angle`, for each metre of the lever at which the
weight of the object turns it, and for each metre of width below `NARROW`.

Fitted by logistic regression to 500 random grasps of single things by the Ability hand, taken, lifted and
carried in SAPIEN, of which 58 went wrong; of the fifths held out it ranks 92 % of the pairs of a good grasp
and a bad one rightly: `python -m benchmarks.any_tree.grasp_risk --seed 985000 --episodes 500`."""
NARROW = 0.03
WIDEST = 1.2
"""Radians to which larger angles were cut."""

NEAR = 0.12
"""Metres around an object within which the fingers that close on it move."""
BEARS = 0.005
"""Metres above an object's lowest point up to which things bear the fingertips."""

LOWER, JUMPS = 0.003, 0.12
"""Metres by which a hand may come lower than it should, and by how much of its way a jaw that swings may meet
something sooner then: one that is to close just above the bar of a T meets that, and takes hold of its edge.
Of 14 things that an SO-100 lost or strained its wrist with 5 were held so, and 2 of 47 that it kept."""

SURELY, BARELY, HARDLY = range(3)
"""How a hand holds: also where the estimate is wrong; where it is right; or probably not."""


class Firm:
    """How one object would be held.

    Args:
        view: The world.
        target: The object.
    """

    def __init__(self, view: WorldView, target: str) -> None:
        self._closing = closing_of(view.robot) if view.robot.many_fingers else None
        self._jaw = closing_of(view.robot) if standing_side(view.robot) is not None else None
        self._pose, self._pieces = view.objects[target], pieces_of(view.model(target))
        self._others = () if self._closing is None else _beside(view, target)
        self._asked: tuple[Array, Squeeze | None] | None = None  # the last one, which is asked about again

    @property
    def asks(self) -> bool:
        """The hand has more than two fingertips."""
        return self._closing is not None

    def steady(self, tool: Array) -> bool:
        """Whether a jaw that swings meets the same of the object where the hand comes `LOWER`.

        Args:
            tool: Tool pose ``(7,)`` when the hand has closed.
        """
        if self._jaw is None:
            return True
        closures = []
        for further in (0.0, LOWER):
            there = poses.shifted(tool, further * poses.z_axis(tool[3:]))
            met = self._jaw.met(poses.relative(there, self._pose), self._pieces)
            closures.append(float(met.closure[self._jaw.moves].min()))
        return math.isfinite(closures[0]) and abs(closures[1] - closures[0]) < JUMPS

    def holds(self, tool: Array) -> int:
        """How surely fingers that close at a tool pose ``(7,)`` hold the object: `SURELY` or worse."""
        if self._closing is None:
            return SURELY
        found = self._squeeze(tool)
        if not _pressed_well(found):
            return HARDLY
        shallower = self._squeeze(poses.shifted(tool, -SHALLOWER * poses.z_axis(tool[3:])))
        self._asked = tool, found
        if _pressed_well(shallower):
            return SURELY
        return BARELY if found is not None and found.out <= PUSHES else HARDLY

    def risk(self, tool: Array, width: float) -> float:
        """How much likelier than with the best grasps the object slips or turns, see `RISK`; from 0 to 1.

        Args:
            tool: Tool pose ``(7,)``.
            width: Of what is held, metres; infinite where it is not to count.
        """
        if self._closing is None:
            return 0.0
        least, by_angle, by_lever, by_narrow = RISK
        angle, lever, narrow = terms(*self.features(tool), width)
        odds = least + by_angle * angle + by_lever * lever + by_narrow * narrow
        return 1.0 / (1.0 + math.exp(-odds)) - 1.0 / (1.0 + math.exp(-least))

    def features(self, tool: Array) -> tuple[float, float]:
        """Of a squeeze at a tool pose ``(7,)``: its angle, and the lever of the object's weight.

        In radians, infinite where there is none; and metres, about the axis along which the fingers close:
        from wherever the hand comes, what lies straight below the fingers does not turn in them.
        """
        found = self._squeeze(tool)
        closing = poses.to_matrix(tool[3:])[:, 1]
        beside = self._middle - tool[:3]
        lever = abs(float(closing[0] * beside[1] - closing[1] * beside[0]))
        return (math.inf if found is None else found.angle), lever

    @cached_property
    def _middle(self) -> Array:
        """Where the object's centre of mass is ``(3,)``, were it of one material."""
        solids = [convex(piece) for piece in self._pieces]
        volumes = np.array([max(solid.computeVolume(), 1e-12) for solid in solids])
        centres = np.array([np.ravel(solid.computeCOM()) for solid in solids])
        return poses.transform(self._pose, volumes @ centres / volumes.sum())

    def centred(self, tool: Array) -> Array:
        """The tool pose ``(7,)``, or one beside it at which both sides meet the object at once."""
        found = None if self._closing is None else self._squeeze(tool)
        if found is None or not CENTRED < abs(found.ahead) <= FARTHEST:
            return tool
        return poses.shifted(tool, found.ahead * poses.to_matrix(tool[3:])[:, 1])

    def _squeeze(self, tool: Array) -> Squeeze | None:
        assert self._closing is not None
        if self._asked is None or not np.array_equal(self._asked[0], tool):
            grip = poses.relative(tool, self._pose)
            self._asked = tool, self._closing.squeeze(self._closing.met(grip, self._pieces, self._others))
        return self._asked[1]


def terms(angle: float, lever: float, width: float) -> tuple[float, float, float]:
    """What `RISK` weighs: a squeeze's angle in radians, cut at `WIDEST`; a lever; metres below `NARROW`."""
    return min(angle, WIDEST), lever, max(0.0, NARROW - width)


def deeper(tool: Array) -> Array:
    """Where the tool ends whose usual grasp is at a pose ``(7,)``: it goes on where it comes level."""
    along = poses.z_axis(tool[3:])
    return poses.shifted(tool, SLANTED * float(np.hypot(*along[:2])) * along)


def _beside(view: WorldView, target: str) -> list[Array]:
    """Corners ``(n, 3)``, in an object's frame, of pieces that fingers may meet beside it.

    What is no higher than what the object stands on bears the fingertips, and does not stop them.
    """
    pose = view.objects[target]
    own = poses.transform(pose, np.concatenate(pieces_of(view.model(target))))
    least, most = own.min(axis=0), own.max(axis=0)
    found = []
    for thing in view.things([target]):
        pieces = thing.pieces if thing.size is None else [box_corners(thing.size)]
        for piece in pieces:
            corners = poses.transform(thing.pose, piece)
            near = (corners.min(axis=0) < most + NEAR).all() and (corners.max(axis=0) > least - NEAR).all()
            if near and float(corners[:, 2].max()) > least[2] + BEARS:
                found.append(poses.localise(pose, corners))
    return found


def _pressed_well(found: Squeeze | None) -> bool:
    return found is not None and found.angle <= SLIPS and abs(found.ahead) <= AHEAD
