"""PressButton: press something in with the fist until its stop is felt, and draw back."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Metres, MetresPerSecond, Newtons, ObjectName
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.closer import CLOSER, TOUCHING, with_room
from bt_tasksim.concept_nodes.handle import NO_PART, OTHER_PART
from bt_tasksim.concept_nodes.limits import PART_FORCE_LIMIT, force_at_tool, force_at_wrist, strain
from bt_tasksim.concept_nodes.view import WorldView, views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import Form, Possible, Statement, register_reason
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.registry import register
from bt_tasksim.core.units import METRES, NEWTONS
from bt_tasksim.core.world import Command
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.hand_collision import beyond, hand_pieces
from bt_tasksim.planning.reference_motion import Path, at_times, plan, position, searched_for
from bt_tasksim.planning.route import Pace, Route, followed
from bt_tasksim.planning.routes import SAMPLES, with_routes
from bt_tasksim.planning.things import Leave
from bt_tasksim.robot.description import RobotDescription

NO_STOP = register_reason(
    "no_stop_felt",
    "no stop of {object} was felt: the fist went in by {value}, its way is {limit}",
    value=METRES,
    limit=METRES,
)
JAMMED = register_reason(
    "button_jammed",
    "{object} jams: before the end of its way it resists with {value}, more than {limit}",
    value=NEWTONS,
    limit=NEWTONS,
)
PRESSING = Form(
    "{object} is pressed in by {value}, {force} at the wrist", {"value": METRES, "force": NEWTONS}
)
AROUND = 12
"""Turns of the hand about the way of the button that are tried."""
DEEPER, YIELDING = 0.012, 0.035
"""Metres beyond the stop to which the hand goes unless it feels it before: one of two fingers, or of more,
which give way as they press."""
TOUCHES, NEAR, GENTLY = 1.5, 0.006, 0.006
"""Newtons from which on the fist is at the button, metres before that from which on it is near, and metres a
second at which it goes on then."""
LEANS = (0.35, 0.7)
"""Radians by which the hand may lean from the button's way where the arm does not reach it straight."""
LEVEL = 0.002
"""Metres from the foremost point of a fist that leans within which others are at its front, too."""
HARD = 1.1
"""Times `press` from which a force counts as the stop's at once; a softer one is felt twice."""
END, MOST_OF = 0.004, 0.65
"""Metres before the end of the button's way from which on a hard contact is its stop, and the share of a
short way that this may be: what soft fingers do is seen too small by up to 3 mm."""
JAMS = 2.0
"""Times `press` from which a force counts as that of something that jams, before that."""
SAMPLES_DOWN = 12
"""Postures on the way from before the button to beyond its stop."""
SHUTS, FIST = 1.0, 0.96
"""Seconds in which the hand becomes a fist, and how far it closes: its fingers need not press each other."""
BACK = 3.0
"""How much faster the fist draws back than it comes."""
SLOW = 0.05
"""Peak speed of the fist before it is felt to touch, m/s."""


class PressMemory(NamedTuple):
    """What a press remembers in ``N`` worlds.

    Attributes:
        come: Tool path to before the button.
        down: Tool path from there to beyond its stop.
        axis: Unit vectors ``(N, 3)`` in which it is pressed, robot base frame.
        start: Closure ``(N,)`` at the begin.
        baseline: Force ``(N,)`` against the way before it is touched, N.
        progress: Seconds ``(N,)`` of the second path that have been commanded.
        felt: Ticks ``(N,)`` for which the stop has been felt.
        deepest: Share ``(N,)`` of the second path that has been gone at most.
    """

    come: Path
    down: Path
    axis: Array
    start: Array
    baseline: Array
    progress: Array
    felt: Array
    deepest: Array


@register("concept")
class PressButton(ConceptModel[PressMemory]):
    """Press a button in with the fist until its stop is felt, and draw back (PR to OP).

    Args:
        target: The button, or whatever slides in where it is pressed.
        press: Force at which its stop counts as felt.
        standoff: How far before it the fist comes straight on, and to where it draws back.
        speed: Peak speed of the tool on its way there.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    press: Newtons = 14.0
    standoff: Metres = 0.06
    speed: MetresPerSecond = 0.4
    force_limit: Newtons = PART_FORCE_LIMIT

    contact = ContactChange(ContactState.PR, ContactState.OP)
    presentation = Presentation(
        colour="#a85a5a",
        spoken=r"press|push .* button",
        sayings=("I press the {}", "press the {} now", "push the {}"),
    )
    default_timeout = 15.0
    default_tolerance = 0.01

    def initial_state(self, seen: Seen) -> tuple[Possible, ...]:
        """It must be something that slides."""
        model = seen.model(self.target)
        return (
            NO_PART.where(~model.jointed, object=self.target),
            OTHER_PART[False].where(model.joint_turns, object=self.target),
        )

    def begin(self, seen: Seen) -> PressMemory:
        """The way of the fist to the button, and on to beyond its stop.

        Raises:
            NoWayError: There is none in one of the worlds.
        """
        found = [self._way(view) for view in views(seen)]
        n, still = len(seen.robot.arm_joints), plan([seen.tool], self.speed, samples=SAMPLES)
        come, down = (with_routes(still, {k: [ways[i]] for k, ways in enumerate(found)}, n) for i in (0, 1))
        model = seen.model(self.target)
        axis = poses.rotate(model.joint_zero[:, 3:], model.joint_axis)
        xp, nothing = array_namespace(axis), poses.norm(axis) * 0.0
        felt = xp.astype(nothing, xp.int64)
        return PressMemory(come, down, axis, seen.closure, nothing, nothing, felt, nothing)

    def _way(self, view: WorldView) -> tuple[Route, Route]:
        """The motions in one world."""
        model, pose = view.model(self.target), view.objects[self.target]
        if model.joint is None:
            raise NoWayError(NO_PART(object=self.target).sentence)
        own = np.array(model.joint.axis)
        axis = poses.rotate(np.array(model.joint.zero)[3:], own)
        low, high = model.joint.limits
        deeper = YIELDING if view.robot.many_fingers else DEEPER
        top = pose[:3] - axis * float(np.abs(own) @ np.array(model.extent)) / 2
        hand = view.robot.hand_position(np.array([FIST]))
        tools = [np.concatenate([top - ahead, turn]) for turn, ahead in _fists(view.robot, hand, axis)]

        def find(closer: float) -> tuple[Route, Route]:
            leave = Leave(hand={self.target})
            coming, on = (
                view.finder(hand=hand, closer=closer),
                view.finder(hand=hand, leave=leave, closer=TOUCHING),
            )
            why = ""
            for tool in tools:
                before = poses.shifted(tool, -self.standoff * axis)
                deep = poses.shifted(tool, (high - low + deeper) * axis)
                gone = np.linspace(0.0, self.standoff + high - low + deeper, SAMPLES_DOWN)
                comes = (
                    gone <= self.standoff
                )  # beyond that the fist is at the button, and at what is around it
                for start in coming.postures(before):
                    joints = on.arm.along(start, np.linspace(before, deep, SAMPLES_DOWN)[1:])
                    if joints is None:
                        continue
                    coming_on = np.concatenate([start[None], joints])[comes]
                    if not on.clear(coming_on):
                        touch = on.collisions.touches(coming_on[-1])
                        why = f"{touch[0][0]} would touch {touch[0][1]}" if touch else ""
                        continue
                    there = coming.search_posture(start[None], Pace(self.speed))
                    line = np.concatenate([there.joints[-1:], joints])
                    return there, followed(on.arm, line, Pace(SLOW, acceleration=0.2))
            raise NoWayError(f"the fist cannot press {self.target}: {why or coming.no_end(np.array(tools))}")

        return with_room((CLOSER, TOUCHING), find)

    def _against(self, seen: Seen, memory: PressMemory) -> Array:
        """Force ``(N,)`` against the way, N."""
        return -poses.dot(force_at_tool(seen), memory.axis) - memory.baseline

    def _depth(self, seen: Seen) -> Array:
        """How far ``(N,)`` the button is taken to be pressed in, metres."""
        law = seen.model(self.target).joints
        return law.value(seen.object(self.target)) - law.limits[:, 0]

    def _at_end(self, seen: Seen) -> Array:
        """Whether ``(N,)`` the button is near the end of its way, where what stops it is its stop."""
        limits = seen.model(self.target).joints.limits
        way = limits[:, 1] - limits[:, 0]
        return way - self._depth(seen) <= poses.clip(MOST_OF * way, 0.0, END)

    def command(self, action: Array, seen: Seen, memory: PressMemory) -> Command:
        """Make a fist and come, press, and draw back."""
        return self._commanded(seen, memory, self.advance(action, seen, memory))

    def carry_out(self, action: Array, seen: Seen, memory: PressMemory) -> tuple[Command, PressMemory]:
        """Both, of one step."""
        after = self.advance(action, seen, memory)
        return self._commanded(seen, memory, after), after

    def _commanded(self, seen: Seen, memory: PressMemory, after: PressMemory) -> Command:
        xp, begun = array_namespace(seen.tool), seen.elapsed >= memory.come.duration
        (first, arm), (then, joints) = (
            at_times(memory.come, seen.elapsed),
            at_times(memory.down, after.progress),
        )
        tool = xp.where(begun[:, None], then, first)
        posture = None if arm is None or joints is None else xp.where(begun[:, None], joints, arm)
        share = poses.clip(seen.elapsed / SHUTS, 0.0, 1.0)
        hand = memory.start + (FIST - memory.start) * share
        return Command(tool=tool, hand=hand[:, None], posture=posture)

    def advance(self, action: Array, seen: Seen, memory: PressMemory) -> PressMemory:
        """Go on, gently once the fist touches; draw back when the stop is felt."""
        xp, period = array_namespace(seen.tool), seen.world.control_period
        begun, before = seen.elapsed >= memory.come.duration, memory.felt >= 2
        against, one = self._against(seen, memory), xp.ones_like(memory.felt)
        more = xp.where(against > HARD * self.press, 2 * one, xp.where(against > self.press, one, 0 * one))
        more = xp.where(self._at_end(seen), more, 0 * one)
        felt = xp.where(before, memory.felt, xp.where(more > 0, memory.felt + more, 0 * one))
        felt = xp.where(begun, felt, 0 * one)
        here, ahead = (position(memory.down, memory.progress + dt) for dt in (0.0, period))
        far = poses.clip(poses.norm(ahead - here), 1e-9, math.inf)
        gently = poses.clip(GENTLY * period / far, 0.0, 1.0)
        near = poses.norm(here - memory.down.table[:, 0, :3]) > self.standoff - NEAR
        share = xp.where(near | (against > TOUCHES), gently, xp.ones_like(gently))
        share = xp.where(felt > 0, xp.zeros_like(share), share)
        share = xp.where(felt >= 2, xp.full_like(share, -BACK), share)
        progress = memory.progress + xp.where(begun, share, xp.zeros_like(share)) * period
        progress = poses.clip(xp.minimum(progress, memory.down.duration), 0.0, math.inf)
        baseline = xp.where(begun, memory.baseline, memory.baseline + against)
        deepest = xp.maximum(memory.deepest, progress / memory.down.duration)
        return memory._replace(progress=progress, felt=felt, baseline=baseline, deepest=deepest)

    def planned(self, memory: PressMemory) -> Array | float:
        """How long the ways take."""
        return searched_for(memory.come) + 2.0 * searched_for(memory.down)

    def limits(self, seen: Seen, memory: PressMemory) -> tuple[Limit, ...]:
        """The force at the wrist; something jams; the fist is at the end of its way, and has felt no stop."""
        limits = seen.model(self.target).joints.limits
        most, against, names = (
            limits[:, 1] - limits[:, 0],
            self._against(seen, memory),
            {"object": self.target},
        )
        before = (seen.elapsed >= memory.come.duration) & (memory.felt < 1) & ~self._at_end(seen)
        deeper = YIELDING if seen.robot.many_fingers else DEEPER
        over = (memory.deepest >= 1.0) & (memory.felt < 2) & (before | (against < self.press))
        return (
            strain(seen, self.force_limit),
            Limit(JAMMED, against, JAMS * self.press, names, counts=before),
            Limit(NO_STOP, most + deeper, most, names, counts=over),
        )

    def done(self, seen: Seen, memory: PressMemory) -> Array:
        """The stop was felt, and the fist has drawn back."""
        gap = poses.norm(seen.tool[:, :3] - memory.down.table[:, 0, :3])
        return (memory.felt >= 2) & (memory.progress <= 0.0) & (gap < self.tolerance)

    def necessary_cost(self, seen: Seen, memory: PressMemory) -> Array:
        """How much is missing until the stop, metres; 0 once it was felt."""
        limits = seen.model(self.target).joints.limits
        left = limits[:, 1] - limits[:, 0] - self._depth(seen)
        return array_namespace(left).where(memory.felt >= 2, 0.0 * left, left)

    def explain(self, seen: Seen, memory: PressMemory) -> Statement:
        """How deep it is pressed, and the force at the wrist."""
        return PRESSING(object=self.target, value=self._depth(seen), force=force_at_wrist(seen))


def _fists(robot: RobotDescription, hand: Array, axis: Array) -> Iterator[tuple[Array, Array]]:
    """Tool orientations ``(4,)`` to press along a direction ``(3,)``, straight ones first.

    And where the front of the fist, with its joints ``(n_hand,)``, is from the tool then ``(3,)``, metres.
    """
    yield from ((turn, beyond(robot) * axis) for turn in _turns(axis))
    corners = np.concatenate(hand_pieces(bodies_of(robot), hand))
    for lean, side, turn in itertools.product(LEANS, np.eye(3)[:2], _turns(axis)):
        rotation = poses.quat_multiply(turn, poses.from_rotation_vector(lean * side))
        there = poses.rotate(rotation, corners)
        ahead = there @ axis
        yield rotation, there[ahead >= ahead.max() - LEVEL].mean(axis=0)


def _turns(axis: Array) -> list[Array]:
    """Tool orientations ``(4,)`` whose z axis is along a direction ``(3,)``."""
    side = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
    first = np.cross(axis, side) / np.linalg.norm(np.cross(axis, side))
    second = np.cross(axis, first)
    angles = 2 * np.pi * np.arange(AROUND) / AROUND
    return [poses.frame_from_axes(axis, math.cos(a) * first + math.sin(a) * second) for a in angles]
