"""The way of a hand that holds a part of furniture and goes along its joint, in one world."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterator
from functools import cached_property

import numpy as np

from bt_tasksim.concept_nodes.joint_sweep import met
from bt_tasksim.concept_nodes.turning import POSTURES, elbow_moved
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.joints import Joints
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import FURNITURE
from bt_tasksim.planning.surroundings import pieces_of
from bt_tasksim.planning.things import Held, Leave
from bt_tasksim.planning.ways import WayFinder

STEP = {False: 0.02, True: math.radians(3.0)}
"""Metres or radians between poses of the way, by whether the part turns."""
LEAP = 0.35
"""Radians that no joint of the arm turns between two of them: it would be at the brink of what it can do,
and go through it in a bound."""
ASTRAY = 0.002
"""Metres by which the tool may be beside its way half way between two postures: furniture gives no more."""
SPARE = 0.1
"""Radians that the joints keep from their limits on a way that a grasp is chosen for: hands close, and
postures drift, a little otherwise than was planned."""
SUPPLE = 0.12
"""Metres that the tool is to move for a radian of the arm's joints, in any direction: a hand gives way to a
hinge that is not quite where it is taken to be. At 0.06 m the Panda's drives resist that with 260 N/mm, and
turning a knob strained the wrist with 65 N."""
PIVOTS = (0.0, 0.5, 1.0)
"""Shares of its turn that a part may make between the fingers, where they close along its axis: who lifts a
lid by its edge need not turn the hand over."""
LOOKS = 5
"""Places on the way at which it is looked at whether the arm meets a part that turns so in its hand."""
PARALLEL, FAR = 0.95, 0.03
"""Cosine between closing axis and joint's from which it may, and metres from that one at least."""
ABOUT = 0.01
"""Metres above and beside a part within which the middle of what stands in or on it may be."""


class JointWay:
    """A part of furniture, and whatever goes along with it.

    Args:
        view: The world.
        target: The part.
    """

    def __init__(self, view: WorldView, target: str) -> None:
        joint = view.model(target).joint
        assert joint is not None, "it is a part of furniture"
        self._view, self._target, self._joint = view, target, Joints.of([joint])
        self._turns = joint.turns

    @property
    def now(self) -> float:
        """How far it is taken to be open."""
        return float(self._joint.value(self._view.objects[self._target][None])[0])

    def poses(self, begin: float, end: float) -> Array:
        """Poses ``(n, 7)`` of the part on the way from one value to another, both included."""
        n = max(2, 1 + math.ceil(abs(end - begin) / STEP[self._turns]))
        found: Array = self._joint.pose(np.linspace(begin, end, n))
        return found

    @cached_property
    def carried(self) -> frozenset[str]:
        """Things that stand in or on the part, and go along with it."""
        return carried_by(self._view, self._target)

    @cached_property
    def beside(self) -> frozenset[str]:
        """Furniture and its parts: `met` looks at what the part would meet of these by itself."""
        return beside(self._view, self._target)

    def met(self, begin: float, end: float) -> tuple[float, str] | None:
        """How far the part may go before it meets something, see `met`, and the name of that."""
        parts = self.poses(begin, end)
        found = met(self._view, self._target, parts, self.carried)
        return (
            None if found is None else (begin + (found[0] - 1) / (len(parts) - 1) * (end - begin), found[1])
        )

    def finder(self, tool: Array, closer: float, hand: Array | None = None) -> WayFinder:
        """Ways of an arm whose hand holds the part at a tool pose ``(7,)``."""
        view, at = self._view, self._view.objects[self._target]
        held = Held(self._target, poses.relative(tool, at), pieces_of(view.model(self._target)))
        apart = [self._target, *self.carried]
        return view.finder(apart, held=held, leave=Leave(held=self.beside), closer=closer, hand=hand)

    def alone(self, closer: float) -> WayFinder:
        """Ways of an arm in whose hand the part turns, so that it does not go along with the hand."""
        return self._view.finder([self._target, *self.carried], closer=closer)

    def tools(self, tool: Array, parts: Array, pivot: float = 0.0) -> Array:
        """Tool poses ``(n, 7)`` for poses ``(n, 7)`` of the part, by where the tool holds it now.

        Args:
            tool: Where the tool is now ``(7,)``.
            parts: The part's poses.
            pivot: Share of its turn that the part makes in the hand, see `PIVOTS`.
        """
        grip = poses.relative(self._view.objects[self._target], tool)
        return pivoted(poses.multiply(parts, grip[None]), axis_of(self._view, self._target), pivot)


def axis_of(view: WorldView, target: str) -> Array:
    """Unit vector ``(3,)`` along a part's joint, robot base frame."""
    joint = view.model(target).joint
    assert joint is not None, "it is a part of furniture"
    found: Array = poses.rotate(np.array(joint.zero)[3:], np.array(joint.axis))
    return found


def pivots(view: WorldView, target: str, tool: Array) -> tuple[float, ...]:
    """Which of `PIVOTS` are possible for a hand that holds a thing at a tool pose ``(7,)``."""
    joint = view.model(target).joint
    if joint is None:
        return PIVOTS[:1]
    axis = axis_of(view, target)
    if not joint.turns or abs(float(poses.to_matrix(tool[3:])[:, 1] @ axis)) < PARALLEL:
        return PIVOTS[:1]
    lever = tool[:3] - poses.transform(np.array(joint.zero), np.array(joint.origin))
    return PIVOTS if float(np.linalg.norm(lever - (lever @ axis) * axis)) > FAR else PIVOTS[:1]


def pivoted(tools: Array, axis: Array, share: float) -> Array:
    """Tool poses ``(n, 7)`` of a hand that turns less about an axis ``(3,)`` than the part that it holds."""
    if not share:
        return tools
    turns = poses.quat_multiply(tools[:, 3:], poses.quat_conjugate(tools[:1, 3:]))
    angles = np.unwrap(poses.rotation_vector(turns) @ axis)
    back = poses.from_rotation_vector(-share * angles[:, None] * axis)
    return np.concatenate([tools[:, :3], poses.quat_multiply(back, tools[:, 3:])], axis=-1)


def keeps_clear(view: WorldView, target: str, parts: Array, joints: Array, hand: Array | None = None) -> bool:
    """Whether the arm does not meet a part at poses ``(n, 7)`` with its joints ``(n, n_arm)`` there.

    Its hand may, since it holds the part.
    """
    for k in np.linspace(0, len(parts) - 1, LOOKS).astype(int):
        there = view._replace(objects={target: parts[k]})
        finder = there.finder(leave=Leave(hand={target}), closer=1.0, hand=hand, taken=target, palm=False)
        if not finder.collisions.free(joints[k]):
            return False
    return True


def gone_along(
    finder: WayFinder, start: Array, tools: Array, spare: float = 0.0, supple: float = 0.0
) -> Array | None:
    """Joints ``(n, n_arm)`` in which the arm leads what it holds through tool poses ``(n, 7)``.

    An arm of more joints than it needs goes there in many ways. What moves least follows best, so it keeps
    its posture; where that leads nowhere it is drawn to that at rest, or to one in which it may end.

    Args:
        finder: What is around.
        start: Joints ``(n_arm,)`` where the tool is before the first pose.
        tools: The poses, close together.
        spare: Radians that the joints keep from their limits.
        supple: Metres that the tool is to move for a radian at least, see `SUPPLE`.
    """
    arm, robot = finder.arm, finder.arm.robot
    low, high = robot.arm_lower + spare, robot.arm_upper - spare
    before = arm.tool(start)[None]
    middle = poses.interpolate(np.concatenate([before, tools[:-1]]), tools, 0.5 + 0.0 * tools[:, 0])

    def serves(joints: Array) -> bool:
        line = np.concatenate([start[None], joints])
        if float(np.abs(np.diff(line, axis=0)).max()) > LEAP:
            return False
        if spare and not bool(((joints > low) & (joints < high)).all()):
            return False
        if supple and float(arm.supple(line).min()) < supple:
            return False
        halfway = arm.tools(0.5 * (line[1:] + line[:-1]))[:, :3]
        return float(np.linalg.norm(halfway - middle[:, :3], axis=-1).max()) <= ASTRAY and finder.clear(line)

    for towards in _ends(finder, start, tools[-1]):
        joints = arm.along(start, tools, towards=towards)
        if joints is not None and serves(joints):
            return joints
    return None


def gone_anyhow(finder: WayFinder, tools: Array) -> Array | None:
    """Joints ``(n, n_arm)`` from where the arm is through tool poses ``(k, 7)``, as `gone_along`.

    Where it cannot go there as it is, its elbow moves first, while the tool stays. It goes in stiff postures
    where it has no others.
    """
    for supple in (SUPPLE, 0.0):
        found = gone_along(finder, finder.start, tools, supple=supple)
        if found is not None:
            return found
        if not finder.goes_straight:
            continue
        here = finder.arm.tool(finder.start)
        for start in itertools.islice(finder.postures(here), POSTURES):
            after = gone_along(finder, start, tools, supple=supple)
            moved = None if after is None else elbow_moved(finder, start, here)
            if after is not None and moved is not None:
                return np.concatenate([moved[1:], after])
    return None


def _ends(finder: WayFinder, start: Array, tool: Array) -> Iterator[Array | None]:
    """Postures ``(n_arm,)`` to which the arm may be drawn on its way to a tool pose; None: at rest."""
    if not finder.goes_straight:
        yield None
        return
    yield start
    yield None
    found: list[Array] = []
    for seed in (start, *finder.arm.seeds):
        end = finder.arm.joints(tool, seed)
        if end is not None and all(float(np.abs(end - other).max()) > LEAP for other in found):
            found.append(end)
            yield end


def carried_by(view: WorldView, target: str) -> frozenset[str]:
    """Names of what is within the box about an object, or stands on it."""
    size, here = np.array(view.model(target).extent) / 2, view.objects[target]
    found = set()
    for name, pose in view.objects.items():
        model = view.model(name)
        if name == target or model.joint is not None or not np.isfinite(pose).all():
            continue
        at = poses.localise(here, pose[:3])
        x, y = np.abs(at[:2]) - size[:2]
        if max(x, y) < ABOUT and -size[2] < at[2] < size[2] + ABOUT + max(model.extent) / 2:
            found.add(name)
    return frozenset(found)


def beside(view: WorldView, target: str) -> frozenset[str]:
    """Names of furniture and of its parts, but for one of them."""
    fixtures: Collection[str] = {box.fixture or FURNITURE for box in view.world.obstacles}
    others = {m.name for m in view.world.objects if m.joint is not None and m.name != target}
    return frozenset({*fixtures, *others})
