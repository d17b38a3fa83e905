"""Whether an arm can move one object from where it is to where it should be, among everything else.

A search with full knowledge and without margins: grasps from a fine sample of the object's surface, from all
directions; goal poses within the goal's tolerance; postures from many beginnings; ways by several seeds.
Geometry alone: nothing moves by itself.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.any_tree.fine_grips import fine_grips
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import WorldModel
from bt_tasksim.planning.arm import LEANS as TURNED
from bt_tasksim.planning.arm import SWAYS, arm_of
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.closing import closing_of
from bt_tasksim.planning.collision import Collisions
from bt_tasksim.planning.lines import STEP, line
from bt_tasksim.planning.search import Search
from bt_tasksim.planning.surroundings import pieces_of, things_of
from bt_tasksim.planning.things import Held
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ObjectActor

AROUND = 24
"""Directions about a closing axis from which a hand may come."""
STEEPEST = 0.5
"""Largest upward part of a direction in which a hand comes, of length one."""
BACK = (0.0, 0.012, 0.025)
"""Metres by which fingers hold less deep than about the middle of a grip."""
PRESHAPE = 0.014
"""Metres that the hand opens wider than its grip, where it does not open all the way."""
LIFT = 0.003
"""Metres above what bears it at which an object has to be free."""
LIFTS = (0.10, 0.05, 0.02)
HOVERS = (0.06, 0.03, 0.012)
STANDOFFS = (0.10, 0.05, 0.02)
RETREATS = (0.10, 0.05, 0.025)
GOALS = 40
"""Goal poses that are tried with one grasp, so many at once."""
AT_ONCE = 4
SLANTS = (0.0, 0.5, 0.9)
"""Radians between straight down and approaches that are preferred in turn."""
LEANING = 3.0
"""How much a radian beside them counts, in radians of turning."""
POSTURES = 500
"""Random postures that tell which way the arm's hand can point at all."""
NEAR = 0.1
"""Metres from the axis within which a plane through it says little."""
SKETCHED = 24
"""Goals by which grasps are put in order."""
WAYS = (1, 2, 3, 4)
"""Seeds of the search for a way."""
TILT = float(np.deg2rad(9.9))
"""Radians by which an object may lean as it is put down, a hair less than the judge allows in the end."""
DEEPEST = (
    "no grip fits the hand",
    "every grasp is out of reach",
    "no grasp is clear",
    "it cannot be lifted",
    "the goal is out of reach",
    "there is no room at the goal",
    "there is no way",
)
"""How far one may come, in order: reasons why a step is impossible."""


@dataclass(frozen=True)
class State:
    """Where everything is.

    Attributes:
        objects: Poses ``(7,)`` by name.
        arm: The arm's joints ``(n_arm,)``.
        dropped: Objects that were let go above a container, in whose way nothing is after that: name, and
            pose ``(7,)`` in which each was let go, one after the other.
    """

    objects: Mapping[str, Array]
    arm: Array
    dropped: tuple[tuple[str, Array], ...] = ()


@dataclass(frozen=True)
class Stuck:
    """Why a step cannot be done: reason, words, and whether all samples were tried."""

    reason: str
    words: str
    exhausted: bool


@dataclass(eq=False)
class _Grasp:
    """A clear grasp: joints, tool pose, joints when lifted, the tool in the object, and the open hand.

    Thousands of them wait, so they keep no `Collisions`, which are some hundred kB each.
    """

    joints: Array
    tool: Array
    lifted: Array
    back: Array
    hand: Array
    goals: list[int]


@dataclass(frozen=True, eq=False)
class _Plane:
    """The upright plane in which an arm of five joints points its hand, about its first joint.

    Attributes:
        axis: Where the first joint turns everything about, seen from above ``(2,)``, metres.
        most: Radians by which the hand ever points out of the plane: of other arms, any number.
    """

    axis: Array
    most: float

    def holds(self, tools: Array, leans: float) -> Array:
        """Which tool poses ``(n, 7)`` the arm may reach, turned by ``leans`` radians: boolean ``(n,)``."""
        found: Array = _aside(tools, self.axis) <= self.most + leans
        return found


def _aside(tools: Array, axis: Array) -> Array:
    """How far tools ``(n, 7)`` point out of the upright plane through an axis ``(2,)``: radians ``(n,)``."""
    bearing = np.arctan2(tools[:, 1] - axis[1], tools[:, 0] - axis[0])
    beside = np.stack([-np.sin(bearing), np.cos(bearing), 0.0 * bearing], axis=-1)
    out = np.sum(poses.z_axis(tools[:, 3:]) * beside, axis=-1)
    found: Array = np.arcsin(np.clip(np.abs(out), 0.0, 1.0))
    return found


def _plane(robot: RobotDescription) -> _Plane:
    """In which plane an arm's hand points, found by looking at random postures."""
    rng = np.random.default_rng(0)
    tools = arm_of(robot).tools(rng.uniform(robot.arm_lower, robot.arm_upper, (POSTURES, len(robot.rest))))
    q = np.tile(robot.rest, (2, 1))
    q[1, 0] += 1.0
    before, after = arm_of(robot).tools(q)[:, :2]
    found = []
    for c, s in ((np.cos(1.0), np.sin(1.0)), (np.cos(1.0), -np.sin(1.0))):  # the joint turns to either side
        turn = np.array([[c, -s], [s, c]])
        axis = np.linalg.solve(np.eye(2) - turn, after - turn @ before)
        far = np.linalg.norm(tools[:, :2] - axis, axis=1) > NEAR
        found.append(_Plane(axis, float(_aside(tools[far], axis).max())))
    return min(found, key=lambda plane: plane.most)


class Mover:
    """One object's step.

    Args:
        robot: The robot.
        world: Names and facts.
        actor: The object as drawn.
        state: Where everything is.
        until: When to give up, on the clock of `time.process_time`: seconds of computing.
        rng: Random numbers.
    """

    def __init__(
        self,
        robot: RobotDescription,
        world: WorldModel,
        actor: ObjectActor,
        state: State,
        until: float,
        rng: np.random.Generator,
    ) -> None:
        self._robot, self._world, self._actor, self._state = robot, world, actor, state
        self._until, self._rng = until, rng
        self._arm, self._bodies = arm_of(robot), bodies_of(robot)
        self._pieces = pieces_of(world.object(actor.name))
        self._all = things_of(world, state.objects, closer=1.0)
        rest = {name: pose for name, pose in state.objects.items() if name != actor.name}
        self._others = things_of(world, rest, closer=1.0)
        spread = rng.uniform(robot.arm_lower, robot.arm_upper, (5, len(robot.arm_joints)))
        self._seeds = [state.arm, robot.rest, *self._arm.seeds, *spread]
        self._late = False
        self._plane: _Plane = robot.derived("plane of the hand", _plane)
        self._good: dict[int, list[Array]] = {}
        self._open: dict[bool, Collisions] = {}
        self._depth, self._touched = 0, [Counter[str]() for _ in DEEPEST]

    def moved(self, goals: Sequence[Array], lowered: bool) -> State | Stuck:
        """The state afterwards, or why there is none.

        Grasps that are clear are tried with a few goals first, and with more of them later.

        Args:
            goals: Poses ``(7,)`` of the object, any of which will do.
            lowered: It is put down there; else let go.
        """
        pose = self._state.objects[self._actor.name]
        waiting: deque[_Grasp] = deque()
        fresh = self._clear_grasps(pose, np.array(goals))
        ended = False
        while time.process_time() < self._until:
            grasp = None if ended else next(fresh, None)
            ended = ended or grasp is None
            present = [] if grasp is None else [grasp]
            present += [waiting.popleft()] if waiting else []
            for tried in present:
                found = self._with(tried, goals, lowered)
                if found is not None:
                    return found
                if tried.goals:
                    waiting.append(tried)
            if ended and not waiting:
                return self._stuck(exhausted=not self._late)
        return self._stuck(exhausted=False)

    def _clear_grasps(self, pose: Array, goals: Array) -> Iterator[_Grasp]:
        """Grasps that touch nothing, from which the object can be lifted, the likeliest first."""
        for tool, width, order in self._grasps(pose, goals):
            if time.process_time() > self._until:
                self._late = True
                return
            for wide in (True, False):
                hand = self._hand(width, wide)
                coming = self._coming(hand)
                for q in self._postures(coming, tool, 2, 1):
                    actual = self._arm.tool(q)
                    grip = poses.relative(actual, pose)
                    if not self._meets(grip):
                        self._no(2)
                        continue
                    held = self._holding(hand, grip)
                    lifted = self._lifted(held, q, actual)
                    if lifted is None:
                        self._no(3)
                        continue
                    yield _Grasp(q, actual, lifted, poses.inverse(grip), hand, list(order))

    def _meets(self, grip: Array) -> bool:
        """Whether fingers of both sides meet the object when they close, its pose ``(7,)`` in the tool frame.

        Held back from a grip, the curled fingers of a hand of many may close before the object.
        """
        if not self._robot.many_fingers:  # it meets whatever is between its pads
            return True
        closing = closing_of(self._robot)
        return closing.squeeze(closing.met(grip, self._pieces)) is not None

    def _stuck(self, exhausted: bool) -> Stuck:
        most = self._touched[self._depth].most_common(2)
        said = f" ({', '.join(f'{name} {count} times' for name, count in most)})" if most else ""
        reason = DEEPEST[self._depth]
        return Stuck(reason, f"{self._actor.name}: {reason}{said}", exhausted)

    def _no(self, depth: int, what: str = "") -> None:
        self._depth = max(self._depth, depth)
        if what:
            self._touched[depth][what] += 1

    def _grasps(self, pose: Array, goals: Array) -> Iterator[tuple[Array, float, list[int]]]:
        """Tool poses ``(7,)``, widths and goals in order: where the arm is at ease at both ends first."""
        grips = fine_grips(self._actor)
        fits = np.flatnonzero(grips.widths < self._robot.opening - 0.002)
        if not len(fits):
            return
        self._no(1)  # some grip fits, even if time is over before one is reached
        turns = 2 * np.pi * np.arange(AROUND) / AROUND
        tools, widths = [], []
        for k in fits:
            axis = poses.rotate(pose[3:], grips.closing[k])
            point = poses.transform(pose, grips.points[k][None])[0]
            down = np.array([0.0, 0.0, -1.0])
            first = down - axis * float(axis @ down)
            first = np.array([1.0, 0.0, 0.0]) if float(np.linalg.norm(first)) < 1e-6 else first
            first = first / np.linalg.norm(first)
            second = np.cross(axis, first)
            for turn in turns:
                a = np.cos(turn) * first + np.sin(turn) * second
                for sign in (1.0, -1.0) if a[2] <= STEEPEST else ():
                    rotation = poses.frame_from_axes(a, sign * axis)
                    tools += [np.concatenate([point - back * a, rotation]) for back in BACK]
                    widths += [float(grips.widths[k])] * len(BACK)
        every = np.array(tools)
        few = goals[self._rng.permutation(len(goals))[:SKETCHED]]
        at_goal = np.min(
            [self._unease(poses.multiply(g[None], poses.relative(pose[None], every))) for g in few], axis=0
        )
        ease = self._unease(every) + at_goal + self._rng.uniform(0.0, 0.8, len(every))
        # In the open a hand comes best from above, in a shelf slanted or level: take turns.
        leaning = np.arccos(np.clip(-poses.z_axis(every[:, 3:])[:, 2], -1.0, 1.0))
        queues = [np.argsort(ease + LEANING * np.abs(leaning - lean)) for lean in SLANTS]
        rounds = zip(*queues, np.argsort(ease), strict=True)
        able = self._plane.holds(every, TURNED)
        for i in dict.fromkeys(int(k) for each in rounds for k in each if able[k]):
            ends = poses.multiply(goals, poses.relative(pose, every[i])[None])
            unease = self._unease(ends) + self._rng.uniform(0.0, 0.4, len(ends))
            able_there = self._plane.holds(ends, TILT)
            likely = [int(k) for k in np.argsort(unease) if able_there[k]]
            if likely:
                yield every[i], widths[i], likely[:GOALS]

    def _unease(self, tools: Array) -> Array:
        """How far tool poses ``(n, 7)`` are turned from where the arm is at ease, ``(n,)``, radians."""
        bearing = np.arctan2(tools[:, 1], tools[:, 0])
        ahead = np.stack([np.cos(bearing), np.sin(bearing), 0.0 * bearing], axis=-1)
        heading = np.array([poses.yaw(float(b)) for b in bearing])
        approach = poses.z_axis(tools[:, 3:])
        closing = poses.rotate(heading, np.broadcast_to(np.asarray(self._robot.closing, float), ahead.shape))
        neutral = poses.frame_from_axes(approach, closing)
        found: Array = poses.angle_between(neutral, tools[:, 3:]) + 2.0 * np.maximum(
            -np.sum(approach * ahead, axis=-1), 0.0
        )
        return found

    def _hand(self, width: float, wide: bool) -> Array:
        robot = self._robot
        share = 1.0 if wide else min(1.0, (width + PRESHAPE) / robot.opening)
        found: Array = robot.hand_closed + share * (robot.hand_open - robot.hand_closed)
        return found

    def _collisions(self, hand: Array, held: Held | None = None, target: bool = False) -> Collisions:
        return Collisions(self._bodies, hand, self._all if target else self._others, held, own=0.0)

    def _postures(
        self, collisions: Collisions, tool: Array, most: int, depth: int, leans: float = TURNED
    ) -> list[Array]:
        """Joints ``(n_arm,)`` that bring the tool there, turned by ``leans`` at most, and touch nothing."""
        found: list[Array] = []
        touching = None
        for seed in [*self._good.get(depth, ()), *self._seeds]:
            q = self._arm.joints(tool, seed, leans=leans)
            if q is None:
                continue
            if not collisions.free(q):
                touching = q if touching is None else touching
            elif all(float(np.abs(q - other).max()) > 0.2 for other in found):
                found.append(q)
                if len(found) == most:
                    break
        if found:
            self._good[depth] = [found[0], *self._good.get(depth, ())][:2]
        if not found:
            if touching is None:
                self._no(depth)
            else:
                pair = collisions.touches(touching)
                self._no(depth + 1, f"{pair[0][0]} touches {pair[0][1]}" if pair else "")
        return found

    def _along(self, collisions: Collisions, start: Array, tools: Sequence[Array]) -> Array | None:
        """Joints ``(n_arm,)`` at the end of straight lines of the tool that are clear."""
        spaced = np.concatenate(
            [
                poses.interpolate(a[None], b[None], np.linspace(0.0, 1.0, n + 1)[1:])
                for a, b in pairwise(tools)
                for n in [max(1, int(np.ceil(float(np.linalg.norm(b[:3] - a[:3])) / 0.015)))]
            ]
        )
        joints = self._arm.along(start, spaced, SWAYS)
        if joints is None:
            return None
        whole = np.concatenate([start[None], joints])
        steps = np.concatenate([line(a, b, STEP)[1:] for a, b in pairwise(whole)])
        return joints[-1] if all(collisions.free(q) for q in steps) else None

    def _way(self, collisions: Collisions, start: Array, ends: Sequence[Array]) -> bool:
        robot = self._robot
        for seed in WAYS:
            search = Search(collisions.free, robot.arm_lower, robot.arm_upper, robot.rest, seed)
            if search.way(start, np.array(ends)) is not None:
                return True
            if time.process_time() > self._until:
                break
        return False

    def _with(self, grasp: _Grasp, goals: Sequence[Array], lowered: bool) -> State | None:
        """Try the next few goals with a grasp."""
        held, after = self._holding(grasp.hand, poses.inverse(grasp.back)), self._empty(grasp.hand)
        for _ in range(AT_ONCE):
            if not grasp.goals or time.process_time() > self._until:
                return None
            goal = goals[grasp.goals.pop(0)]
            placed = self._placed(held, after, goal, grasp.back, lowered)
            if placed is None:
                continue
            hover, end, final = placed
            coming = self._coming(grasp.hand)
            if self._before(coming, grasp.joints, grasp.tool) and self._way(held, grasp.lifted, [hover]):
                name, state = self._actor.name, self._state
                if lowered:
                    return State({**state.objects, name: final}, end, state.dropped)
                rest = {other: pose for other, pose in state.objects.items() if other != name}
                return State(rest, end, (*state.dropped, (name, final)))
            self._no(6)
        return None

    def _coming(self, hand: Array) -> Collisions:
        """For the hand that comes."""
        return self._kept(hand, target=True)

    def _empty(self, hand: Array) -> Collisions:
        """For the hand that has let go."""
        return self._kept(hand, target=False)

    def _kept(self, hand: Array, target: bool) -> Collisions:
        """That of a hand that opens all the way is kept."""
        if not np.array_equal(hand, self._robot.hand_open):
            return self._collisions(hand, target=target)
        if target not in self._open:
            self._open[target] = self._collisions(hand, target=target)
        return self._open[target]

    def _holding(self, hand: Array, grip: Array) -> Collisions:
        """For the hand with the object, whose pose in the tool frame is ``grip (7,)``."""
        return self._collisions(hand, Held(self._actor.name, grip, self._pieces))

    def _lifted(self, held: Collisions, q: Array, tool: Array) -> Array | None:
        free = self._arm.along(q, poses.shifted(tool, np.array([0.0, 0.0, LIFT]))[None])
        if free is None or not held.free(free[-1]):
            return None
        start = self._arm.tool(free[-1])
        ways = [np.array([0.0, 0.0, lift]) for lift in LIFTS]
        ways += [-lift * poses.z_axis(tool[3:]) for lift in LIFTS]
        for way in ways:
            found = self._along(held, free[-1], [start, poses.shifted(start, way)])
            if found is not None:
                return found
        return None

    def _before(self, coming: Collisions, q: Array, tool: Array) -> bool:
        """There is a way to where the hand comes straight on to the grasp."""
        approach = poses.z_axis(tool[3:])
        for standoff in STANDOFFS:
            back = self._along(coming, q, [tool, poses.shifted(tool, -standoff * approach)])
            if back is not None:
                return self._way(coming, self._state.arm, [back])
        return False

    def _placed(
        self, held: Collisions, after: Collisions, goal: Array, back: Array, lowered: bool
    ) -> tuple[Array, Array, Array] | None:
        """Joints above the goal, joints after the hand has drawn back, and the object's pose there."""
        above = np.array([0.0, 0.0, LIFT if lowered else 0.0])
        down = poses.multiply(poses.shifted(goal, above), back)
        # What is let go above a container may lean; so may an arm of few joints on its way.
        for q in self._postures(held, down, 2, 4, TILT if lowered else SWAYS):
            tool = self._arm.tool(q)
            final = poses.multiply(tool, poses.inverse(back))
            off = float(np.linalg.norm(final[:3] - goal[:3] - above))
            if off > 0.005 or (lowered and abs(poses.tilt(final[3:], goal[3:])) > TILT):
                self._no(4)
                continue
            if not after.free(q):
                self._no(5)
                continue
            if not lowered:
                return q, q, final
            end = self._retreated(after, q, tool)
            hover = None
            for height in HOVERS:
                hover = self._along(held, q, [tool, poses.shifted(tool, np.array([0.0, 0.0, height]))])
                if hover is not None:
                    break
            if hover is not None and end is not None:
                return hover, end, poses.shifted(final, -above)
            self._no(5)
        return None

    def _retreated(self, after: Collisions, q: Array, tool: Array) -> Array | None:
        approach = poses.z_axis(tool[3:])
        for far in RETREATS:
            end = self._along(after, q, [tool, poses.shifted(tool, -far * approach)])
            if end is not None:
                return end
        return None
