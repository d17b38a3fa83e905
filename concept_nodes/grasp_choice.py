"""Which grasp to take: one in reach that keeps clear of everything and also serves what follows.

The usual grasp is taken where it does. Else others are tried (`bt_tasksim.concept_nodes.grasp_candidates`),
first what costs least to ask: does the hand touch something there, can what follows be done with that grasp,
can the arm come to it.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept_nodes.closer import ROOMS
from bt_tasksim.concept_nodes.grasp_aims import Around, Served
from bt_tasksim.concept_nodes.grasp_candidates import HOLLOW, Candidates
from bt_tasksim.concept_nodes.grasp_firmness import BARELY, HARDLY, SURELY, Firm, deeper
from bt_tasksim.concept_nodes.grasp_opening import Closed, Opening, evenly_opened, wide_along
from bt_tasksim.concept_nodes.grasp_ways import ServedAlong
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.poses import Array
from bt_tasksim.planning.arm import LEANS
from bt_tasksim.planning.closing import closing_of
from bt_tasksim.planning.reach import reach_of
from bt_tasksim.planning.route import Pace, Route, followed, hurries
from bt_tasksim.planning.ways import WayFinder
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.kinematics.hand import SLIDE, opened_about, standing_side

UNLIKE = (0.015, 0.4)
"""Metres or radians by which a grasp differs from one that has failed."""
STANDOFFS = (1.0, 0.6, 0.35)
"""Shares of the standoff that are tried: a small arm, or one in a shelf, has no room for all of it."""
REACH = 0.008
"""Metres that the arm has to reach beyond where an approach begins: corrections of the grasp move it by so
much."""
SPARE = 0.008
"""Metres beside what it takes, on either side, that a partly closed hand is open at least."""
NARROWER = (0.018, 0.013)
"""Metres by which a jaw that swings is wider open than what it takes where it has no room for its usual
`bt_tasksim.robot.kinematics.hand.SPARE`: in the hole of a ring it would meet the far side."""
SLIDES = (1.0, 0.7, 0.4)
"""Shares of the way up to the object that a finger which stands still goes, as far as there is room."""
ENOUGH = 3
"""Postures from which an approach may begin."""
FROM_GRIP = 0.018
"""Metres that the usual grasp of a simple solid may be from a known grip of it; farther off, fingers that
close on a rounded side squeeze it out."""
SAME_GRIP = (0.012, 0.02, 0.96)
"""Metres aside of a known grip, metres along its closing axis, and the cosine of the angle between the axes,
within which a grasp is taken to hold as that grip does."""
MOST = 60
"""Grasps in reach of which it is asked whether they serve."""
ASKED = 250
"""Grasps of which a hand of many fingers is asked what its fingers meet: some milliseconds each."""
FARTHEST = 400
"""Grasps for which joints are looked for."""
LONGER = 4
"""How many times as many where nothing has served: grasps from above that cannot be put down on a high tower
use up all that are asked, before one that comes level has its turn."""
LIKELIEST = 4000
"""Grasps that are looked at then; of some meshes there are 11,000."""
USUAL, FAR = 0.3, 3.0
"""What a grasp costs then of what it costs otherwise, and for each radian that the arm is from it, or from
what follows."""
UNSURE = {SURELY: 0.0, BARELY: 0.8, HARDLY: 1.5}
"""What a grasp costs more that the fingers would not hold surely, in radians of turn from the usual one: of
random grasps a fifth more of those that hold barely went wrong, which makes as much as `RISKY` says."""
RISKY = 4.0
"""The same for one that goes wrong always, where the best hardly ever do."""
RISKIEST = 0.25
"""How much likelier than the best ones a grasp may go wrong that counts as firm."""
TURNS = 0.1
"""Radians by which an object may turn in a hand of many fingers when it closes: measured on the Ability hand,
23 of 32 things turned by less."""
GENTLE = 0.5
"""Peak acceleration of the tool on a straight approach that begins at rest, m/s^2: at 3 the Panda's drives
overshoot its end by 6 to 9 mm, and the palm meets the object."""
SLOWER = 0.4
"""Share of the usual speed at which a hand goes closely past things."""
BESIDE = dict(zip(ROOMS, (1.0, 0.5, 0.0), strict=True))
"""Share of the usual room beside a grasp, by how much closer than usual one may come to things."""


class Choice(NamedTuple):
    """A grasp, and how to come to it.

    Attributes:
        goal: Tool pose ``(7,)``.
        standoff: Metres before it from which the hand comes straight on.
        routes: The motions that lead there; none where the usual way does.
        tight: The opened hand has little room there, beside the object and what else is around, or tips and
            pushes aside what it does not take well: it feels its way.
        usual: It is the usual grasp.
        closure: How far the hand is closed as it comes.
    """

    goal: Array
    standoff: float
    routes: Sequence[Route]
    tight: bool
    usual: bool = False
    closure: float = 0.0


class _Begins(NamedTuple):
    """Where the straight approach to a grasp may begin.

    Attributes:
        standoff: Metres before the grasp.
        starts: Postures ``(k, n_arm)`` there.
    """

    standoff: float
    starts: Array


class Chooser:
    """The choice of a grasp in one world.

    Args:
        view: The world.
        target: The object.
        standoff: Metres before the grasp from which the hand comes straight on.
        pace: How fast the tool may go.
        aims: What is done with the target until it is let go, see `grasp_aims.aims_of`.
        closer: How much closer than usual what follows may come to things.
        firmly: Grasps that the fingers would hardly hold do not count.
        aside: It may be put down a little aside of where it should stand, see `Aim.aside`.
        thoroughly: Nothing has served: more grasps are asked, first those that the arm comes near to, and
            to what follows with them; a hand comes partly closed where it has no room wide open, as to
            parts of furniture always; and with the least room it may let go a little above where the object
            should stand.
    """

    def __init__(
        self,
        view: WorldView,
        target: str,
        standoff: float,
        pace: Pace,
        aims: Sequence[Aim],
        closer: float,
        firmly: bool = False,
        aside: bool = False,
        thoroughly: bool = False,
    ) -> None:
        self._view, self._target, self._standoff, self._pace = view, target, standoff, pace
        self._firmly, self._loses = firmly, loses(view.robot)
        self._thoroughly, self._longer = thoroughly, LONGER if thoroughly else 1
        self._close = close = closer > ROOMS[0]
        self._beside = max((share for room, share in BESIDE.items() if room >= closer), default=0.0)
        self._openings: dict[float, Opening] = {}
        if close:
            self._pace = pace = Pace(SLOWER * pace.speed, acceleration=SLOWER**2 * pace.acceleration)
        around = Around(view, target, closer)
        higher = thoroughly and closer == ROOMS[-1]
        self._aims = [
            ServedAlong(around, aim, closer) if aim.along else Served(around, aim, aside, higher)
            for aim in reversed(aims)  # the last is the hardest
        ]
        self._why: Counter[str] = Counter()
        self._gently = pace._replace(acceleration=GENTLE)

    @property
    def _rigid(self) -> bool:
        """Whether the target is a part of furniture, which does not give way to a finger that pushes it."""
        return self._view.model(self._target).joint is not None

    def usual(self, goal: Array, way: Sequence[Array]) -> Choice | None:
        """The usual grasp, if it serves.

        Args:
            goal: Tool pose ``(7,)``.
            way: Tool poses ``(7,)`` of the usual way to where the straight approach begins.
        """
        solid = self._view.model(self._target).solid
        if solid is not None and solid.given:
            return None  # held as somebody said, and not as is usual
        if self._slide and self._view.model(self._target).kind == HOLLOW:
            return None  # a jaw that swings slips off what is not upright where it meets it
        hand = self._opening(wide_along(self._view, self._target, poses.to_matrix(goal[3:])[:, 1]))
        if not self._grips_there(goal) or self._firm.holds(deeper(goal)) != SURELY:
            return None
        if self._view.model(self._target).kind == HOLLOW and not hand.free(goal):
            return None
        # It is as deep as the robot's file says; others, from wherever they come, stay clear.
        at = hand.deep
        if not self._fits(goal, hand):
            return None
        lines = None if self._slide else _straight([*way, goal], hand.coming, at)
        leads = lines is not None and self._leads_along(lines[-1][-1], goal, hand)
        if lines is not None and leads and self._has_reach(way[-1], hand.coming, lines[0][-1]):
            # An arm that is hurried through a turn of its elbow falls behind, and overshoots the grasp.
            hurried = any(hurries(at.arm, line, self._pace) for line in lines)
            coming, on = lines
            routes = (
                (followed(at.arm, coming, self._pace), followed(at.arm, on, self._gently)) if hurried else ()
            )
            tight = self._loses or self._rigid or hand.tight(goal)
            return Choice(goal, self._standoff, routes, tight, usual=True, closure=hand.closure)
        begins = self._begins(goal, hand, at)
        found = None if begins is None else self._come(goal, begins, hand, at)
        return None if found is None else found._replace(usual=True)

    def _leads_along(self, joints: Array, goal: Array, hand: Opening) -> bool:
        """Whether the arm, with these joints at a grasp, goes along all ways that lead on from there."""
        along = [aim for aim in self._aims if isinstance(aim, ServedAlong)]
        return all(aim.goes_on(joints, self._closed(goal), hand.coming.hand) for aim in along)

    def _opening(self, width: float) -> Opening:
        """The hand that comes about what is ``width`` metres wide."""
        return self._opened(opened_about(self._view.robot, width))

    def _opened(self, hand: Array) -> Opening:
        closure = float(self._view.robot.closure(hand))
        if closure not in self._openings:
            self._openings[closure] = Opening(self._view, self._target, hand, self._close, self._beside)
        return self._openings[closure]

    def other(self, candidates: Candidates, skipped: int = 0, usual: Choice | None = None) -> Choice:
        """The first of other grasps that serves.

        Args:
            candidates: What to try.
            skipped: How many that would serve are passed over, as long as there are others.
            usual: The usual grasp, which is passed over first.

        Raises:
            NoWayError: None does; says how many were excluded by what.
        """
        served, tried, last = 0, 0, usual
        for aim in self._aims:
            aim.screens = True
        skipped -= usual is not None
        if self._thoroughly:
            candidates = self._in_reach(candidates)
        for goal, hand in self._free(candidates):
            if served == self._longer * MOST or tried == self._longer * FARTHEST:
                break
            if last is not None and _alike(goal, last.goal):
                continue
            if not self._has_room_later(goal, hand):
                candidates.no_good(goal)
                continue
            if self._firmly and not self._firm.steady(self._closed(goal)):
                self._no("that would hardly be held")
                continue
            tried += 1
            at = hand.beside
            reached = self._reaches(goal, at)
            served += reached
            begins = self._serves(goal, hand, at) if reached else None
            found = None if begins is None else self._come(goal, begins, hand, at)
            if found is None:
                candidates.no_good(goal)
                continue
            if skipped <= 0:
                return found
            skipped, last = skipped - 1, found
        if last is not None:
            return last
        said = ", ".join(f"{count} {why}" for why, count in self._why.most_common()) or "none fits the hand"
        raise NoWayError(f"no grasp of {self._target} serves: of {sum(self._why.values())}, {said}")

    def leave_out(self, count: int, why: str) -> None:
        """So many candidates were not even asked about; the reason counts them."""
        if count:
            self._why[why] += count

    def _has_room(self, tool: Array, hand: Opening) -> bool:
        """Whether the hand has room at a grasp ``(7,)``; says what it would touch."""
        if hand.free(tool):
            return True
        touch = hand.alone.first(tool)
        return self._no(f"where the hand would touch {touch[1] if touch else 'something'}")

    def _in_reach(self, candidates: Candidates) -> Candidates:
        """Those first to which the arm comes easily, and with which it does what follows."""
        tools = candidates.tools
        far = reach_of(self._view.robot).far(tools) + sum(aim.far(tools) for aim in self._aims[:1])
        found = candidates.costing(USUAL * candidates.costs + FAR * far)
        return found.keeping(np.arange(len(tools)) < LIKELIEST)  # they are in order

    def _with_room(self, tool: Array, width: float) -> Opening | None:
        """The hand that has room at a grasp ``(7,)`` of what is ``width`` metres wide, if any."""
        hand = self._opening(width)
        if (self._thoroughly or self._rigid) and not self._slide and not hand.free(tool):
            less = self._opened(partly_opened(self._view.robot, width + 2 * SPARE))
            if less.closure > hand.closure and less.free(tool):
                return less
        if self._slide and self._close and not hand.free(tool):
            for spare in NARROWER:
                less = self._opened(opened_about(self._view.robot, width, spare))
                if less.closure > hand.closure and less.free(tool):
                    return less
        return hand if self._has_room(tool, hand) else None

    def _free(self, candidates: Candidates) -> Iterator[tuple[Array, Opening]]:
        """Those at which the hand alone touches nothing, moved to hold well; those that do not come later."""
        waiting: list[tuple[float, int, Array, Opening]] = []
        asked = 0
        for number in itertools.count():
            try:
                cost, goal, width = candidates.taken()
            except StopIteration:
                break
            if asked == self._longer * ASKED and self._firm.asks:
                break
            while waiting and waiting[0][0] <= cost:
                yield heapq.heappop(waiting)[2:]
            hand = self._with_room(goal, width)
            if hand is None:
                continue
            if not self._closes(goal, width):
                continue
            asked += 1
            centred = self._firm.centred(goal)
            if centred is not goal and not hand.free(centred):
                centred = goal
            how = self._firm.holds(centred)
            # What is thin is held poorly wherever it is, so its width does not count here.
            if self._firmly and (how == HARDLY or self._firm.risk(centred, np.inf) > RISKIEST):
                self._no("that would hardly be held")
                continue
            more = UNSURE[how] + RISKY * self._firm.risk(centred, width)
            if more:
                heapq.heappush(waiting, (cost + more, number, centred, hand))
            else:
                yield centred, hand
        while waiting:
            yield heapq.heappop(waiting)[2:]

    def _closes(self, goal: Array, width: float) -> bool:
        """Whether fingers that close at a grasp ``(7,)`` of what is so wide touch nothing else."""
        if self._slide or self._firm.asks:  # a jaw that swings comes from afar; of many fingers `Firm` knows
            return True
        touch = self._fingers.touch(goal, width)
        return touch is None or self._no(f"where the fingers would close on {touch[1]}")

    @cached_property
    def _fingers(self) -> Closed:
        return Closed(self._view, self._target, self._close)

    @cached_property
    def _firm(self) -> Firm:
        return Firm(self._view, self._target)

    def _grips_there(self, goal: Array) -> bool:
        """Whether fingers that close at a tool pose ``(7,)`` meet the object: they may close on a hollow."""
        model = self._view.model(self._target)
        if model.solid is None or (model.symmetry == 0 and not model.cubic and model.kind != HOLLOW):
            return True  # around its own axis a body of revolution is the same everywhere
        most = SAME_GRIP[0] if model.kind == HOLLOW else FROM_GRIP
        return bool((self._near(goal, most) & (model.solid.grips.widths < self._view.robot.opening)).any())

    def _near(self, goal: Array, most: float) -> Array:
        """Which of the object's grips ``(k,)`` a hand at a tool pose ``(7,)`` has, ``most`` metres aside."""
        solid, pose = self._view.model(self._target).solid, self._view.objects[self._target]
        assert solid is not None
        points = poses.localise(goal, poses.transform(pose, solid.grips.points))
        axes = poses.rotate(poses.quat_conjugate(goal[3:]), poses.rotate(pose[3:], solid.grips.closing))
        near = (np.hypot(points[:, 0], points[:, 2]) < most) & (abs(points[:, 1]) < SAME_GRIP[1])
        found: Array = near & (abs(axes[:, 1]) > SAME_GRIP[2])
        return found

    def _reaches(self, goal: Array, at: WayFinder) -> bool:
        """Whether the arm comes to a grasp without touching anything, from wherever."""
        end = at.ends(goal[None])
        if not end.reached[0]:
            return self._no(at.unreached(goal))
        if not end.free[0]:
            return self._no(f"where the hand would touch {_other(at.collisions.touches(end.joints[0]))}")
        return True

    def _has_room_later(self, goal: Array, hand: Opening) -> bool:
        """Whether the hand alone has room at a grasp ``(7,)`` in all that comes after it."""
        closed = self._closed(goal)
        for aim in self._aims:
            if not len(aim.tools(closed, hand.hand)):
                return self._no(f"that cannot also {aim.words}{aim.why}")
        return True

    def _closed(self, goal: Array) -> Array:
        """Where the tool is when the hand has closed at a grasp ``(7,)``."""
        return poses.shifted(goal, self._slide * poses.to_matrix(goal[3:])[:, 1])

    def _serves(self, goal: Array, hand: Opening, at: WayFinder) -> _Begins | None:
        """Where the approach to a grasp may begin; None where the grasp is no good."""
        return self._begins(goal, hand, at) if self._fits(goal, hand) else None

    def _fits(self, goal: Array, hand: Opening) -> bool:
        """Whether a grasp serves all that comes after it."""
        closed = self._closed(goal)
        for aim in self._aims:
            if not aim.by(closed, hand.hand, self._turns):
                return self._no(f"that cannot also {aim.words}")
        return True

    def _begins(self, goal: Array, hand: Opening, at: WayFinder) -> _Begins | None:
        """Where the straight approach to a grasp may begin; None where there is no such place."""
        why = ""
        for share in STANDOFFS:
            begins = self._beginnings(goal, hand.coming, at, share * self._standoff)
            if not isinstance(begins, str):
                return begins
            why = why or begins
        return self._no(why) or None

    @property
    def _turns(self) -> tuple[float, ...]:
        """Radians about the tool's x axis by which what follows has to be possible, too.

        In that plane the fingers of a hand of many of them swing, and turn what they close on.
        """
        return (TURNS, -TURNS) if not self._close and self._firm.asks else ()

    def _beginnings(self, goal: Array, coming: WayFinder, at: WayFinder, standoff: float) -> _Begins | str:
        """Postures from which the hand comes straight on; or why there are none, in words."""
        back = poses.shifted(goal, -standoff * poses.z_axis(goal[3:]))
        closed, refused = self._closed(goal), list[str]()
        starts: list[Array] = []
        for leans in coming.leanings:
            for q in () if starts else itertools.islice(coming.postures(back, leans), ENOUGH):
                line = at.straight([back, goal], start=q)
                if line is None or not self._has_reach(back, coming, q, leans):
                    continue
                along = (aim.goes_on(line[-1], closed, coming.hand) for aim in self._aims)
                which = next((k for k, goes in enumerate(along) if not goes), None)
                if which is None:
                    starts.append(q)
                else:
                    refused.append(self._aims[which].words)
        if starts:
            return _Begins(standoff, np.array(starts))
        if refused:
            return f"from which the arm cannot also {refused[0]}"
        for finder, tool, when in ((coming, back, " on its way"), (at, goal, "")):
            end = finder.ends(tool[None])
            if not end.reached[0]:
                return finder.unreached(tool)
            if not end.free[0]:
                return f"where the hand would touch {_other(finder.collisions.touches(end.joints[0]))}{when}"
        return "to which the hand cannot come straight"

    @staticmethod
    def _has_reach(back: Array, coming: WayFinder, start: Array, leans: float = LEANS) -> bool:
        """Whether the arm comes farther than to a tool pose ``(7,)``, where its joints are ``start``."""
        farther = poses.shifted(back, -REACH * poses.z_axis(back[3:]))
        return coming.arm.joints(farther, start, leans=leans) is not None

    def _come(self, goal: Array, begins: _Begins, hand: Opening, at: WayFinder) -> Choice | None:
        back = poses.shifted(goal, -begins.standoff * poses.z_axis(goal[3:]))
        try:
            way = hand.coming.search_posture(begins.starts, self._pace)
        except NoWayError:
            return self._no("to which no way was found") or None
        line = at.straight([back, goal], start=way.joints[-1], spacing=0.01)
        if line is None:
            return self._no("to which no way was found") or None
        straight = followed(at.arm, np.concatenate([way.joints[-1:], line]), self._gently)
        tight = self._loses or self._rigid or hand.tight(goal)
        return self._slid(Choice(goal, begins.standoff, (way, straight), tight, closure=hand.closure), at)

    @cached_property
    def _slide(self) -> float:
        """Metres along the tool's y axis that the hand goes at last; 0 where all of its fingers move."""
        side = standing_side(self._view.robot)
        return 0.0 if side is None else -math.copysign(SLIDE, side)

    def _slid(self, choice: Choice, at: WayFinder) -> Choice:
        """With the finger that does not move brought up to the object, where there is room for that."""
        if not self._slide:
            return choice
        goal, here = choice.goal, choice.routes[-1].joints[-1]
        for share in SLIDES:
            closed = poses.shifted(goal, share * self._slide * poses.to_matrix(goal[3:])[:, 1])
            line = at.straight([goal, closed], start=here)
            if line is not None:
                slide = followed(at.arm, np.concatenate([here[None], line]), self._gently)
                return choice._replace(goal=closed, routes=(*choice.routes, slide))
        return choice

    def _no(self, why: str) -> Literal[False]:
        self._why[why] += 1
        return False


def rooms(robot: RobotDescription, aside: bool = False) -> list[tuple[float, bool, bool]]:
    """What is tried one after the other: how much closer than usual, only firmly, and aside.

    What a jaw that swings or a hand of many fingers holds poorly it loses, so it rather goes closely past
    things, or puts them down a little aside of where they should stand. A gripper of two fingers holds at
    every grip, and rather keeps room.

    Args:
        robot: The robot.
        aside: Things may be put down a little aside, see `grasp_aims.goes_aside`.
    """
    exactly = [(closer, False) for closer in ROOMS]
    tried = [*exactly, (ROOMS[-1], True)] if aside else exactly
    firmly = (True, False) if loses(robot) else (False,)
    return [(closer, firm, beside) for firm in firmly for closer, beside in tried]


def partly_opened(robot: RobotDescription, wide: float) -> Array:
    """Joints ``(n_hand,)`` of a hand that is open so many metres, of one without a jaw that swings."""
    if robot.many_fingers:
        return robot.hand_position(closing_of(robot).about(wide)[None])
    return evenly_opened(robot, wide)


def loses(robot: RobotDescription) -> bool:
    """A hand with a jaw that swings, or of many fingers: it pushes aside what it does not take well."""
    return standing_side(robot) is not None or robot.many_fingers


def _straight(way: Sequence[Array], coming: WayFinder, at: WayFinder) -> tuple[Array, Array] | None:
    """Joints ``(n, n_arm)`` in which the arm, led by the tool alone, comes clear through poses ``(7,)``.

    The last piece, to the grasp, is looked at in the posture in which the way before it ends: an arm of seven
    joints has others, too.

    Returns:
        Those to where the straight approach begins, and those from there on; None where it does not come so.
    """
    if not coming.goes_straight:
        return None
    there = coming.straight(way[:-1])
    on = None if there is None else at.straight(way[-2:], start=there[-1])
    if there is None or on is None:
        return None
    return np.concatenate([coming.start[None], there]), np.concatenate([there[-1:], on])


def _alike(a: Array, b: Array) -> bool:
    """Whether two tool poses ``(7,)`` are the same grasp to a hand that has failed with one of them."""
    near = float(np.linalg.norm(a[:3] - b[:3])) < UNLIKE[0]
    return near and float(poses.angle_between(a[3:], b[3:])) < UNLIKE[1]


def _other(touches: Sequence[tuple[str, str]]) -> str:
    return touches[0][1] if touches else "something"
