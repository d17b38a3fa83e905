"""Whether a task is possible at all: full knowledge, all that the judge allows, and a minute of planning.

Asked about draws that failed. It moves the objects one after the other in thought, in the tree's order and
then in all others that are allowed (`benchmarks.any_tree.handling`), lets physics settle what is left, and
asks the judge of every run about that (`benchmarks.any_tree.steady`). "Impossible" says that nothing was
found, whether because all samples were tried or because time was over; `Finding.exhausted` tells the two
apart.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import permutations
from typing import Any

import numpy as np

from benchmarks.any_tree.goals import Step, allowed
from benchmarks.any_tree.handling import LIFT, Mover, State, Stuck
from benchmarks.any_tree.steady import overturned, poses_in, settled, verdict
from benchmarks.any_tree.tasks import Task
from bt_tasksim import load_robot, poses
from bt_tasksim.core.fact_making import rotations
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel, WorldModel
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.outlines import holds, hull, within

GRAVITY = 9.81
FINGER_FORCE = 10.0
"""Newtons that every hand here presses with."""
PAD_FRICTION = 1.2
HEADINGS = 24
UPRIGHT = poses.pose([0.0, 0.0, 0.0])
SHARE = 0.97
"""Part of a goal's tolerances up to which goal poses are tried."""
FIRST = 0.6
"""Share of the time that the tree's own order gets, where there are others."""
FREE = (0.005, 0.02, 0.06, 0.12)
"""Metres above a container's rim in which an object is let go."""
EDGE = 0.005
"""Metres beyond the edge of its support at which a centre of mass is not even tried."""
OFFSETS = 24
"""Places on an object that are looked at, and how many of them are tried: where it stands most firmly."""
TRIED = 8
AGAIN = 4
"""How often an order is tried whose end does not stay as it is left."""


@dataclass(frozen=True)
class Finding:
    """What the oracle says.

    Attributes:
        possible: A way to do it was found.
        reason: Why not, to be counted.
        why: The same with the object and what is touched.
        exhausted: All that was sampled was tried; else time was over.
        order: The objects in the order that works, or in that which came farthest.
        seconds: It took.
    """

    possible: bool
    reason: str
    why: str
    exhausted: bool
    order: tuple[str, ...]
    seconds: float

    def to_data(self) -> dict[str, Any]:
        """As plain data."""
        return {**asdict(self), "order": list(self.order), "seconds": round(self.seconds, 2)}


def judge(task: Task, seconds: float = 60.0) -> Finding:
    """Whether a task is possible.

    Args:
        task: The task.
        seconds: Of planning, at most.
    """
    began, configuration = time.process_time(), task.sample()
    told = tuple(step.target for step in task.steps)
    if (wrong := _physical(task, configuration)) is not None:
        return Finding(False, *wrong, True, told, time.process_time() - began)
    beginning = settled(configuration, {})
    if loose := overturned(configuration, beginning):
        return Finding(False, "the start falls over", loose, True, told, time.process_time() - began)
    search = _Search(load_robot(task.robot), configuration, poses_in(configuration, beginning))
    actors = {actor.name: actor for actor in configuration.objects}
    first, *others = _orders(task.steps, actors)
    best: tuple[int, Stuck, tuple[str, ...]] | None = None
    exhausted: dict[tuple[str, ...], bool] = {}
    for order, share in [
        (first, FIRST if others else 1.0),
        *((order, 1.0) for order in others),
        (first, 1.0),
    ]:
        names = tuple(step.target for step in order)
        if time.process_time() - began > seconds or exhausted.get(names, False):
            continue
        done, stuck = search.done(order, began + share * seconds)
        if stuck is None:
            return Finding(True, "", "a way was found", False, names, time.process_time() - began)
        exhausted[names] = stuck.exhausted
        if best is None or done > best[0]:
            best = (done, stuck, names)
        if stuck.reason == "no grip fits the hand":
            break
    assert best is not None
    _, stuck, names = best
    every = len(exhausted) == 1 + len(others) and all(exhausted.values())
    whole = every or stuck.reason == "no grip fits the hand"
    return Finding(False, stuck.reason, stuck.words, whole, names, time.process_time() - began)


def _orders(steps: Sequence[Step], actors: dict[str, ObjectActor]) -> Iterator[tuple[Step, ...]]:
    """The tree's order first, then all others that are allowed."""
    yield tuple(steps)
    for order in permutations(steps):
        if order != tuple(steps) and allowed(order, actors):
            yield order


class _Search:
    """A world in which orders of steps are tried.

    Args:
        robot: The robot.
        configuration: The world as drawn.
        beginning: Poses ``(7,)`` of its objects once they have settled, by name.
    """

    def __init__(
        self, robot: RobotDescription, configuration: ActorConfiguration, beginning: Mapping[str, Array]
    ) -> None:
        self._robot, self._configuration, self._beginning = robot, configuration, beginning
        self._world = configuration.world_model([tip.name for tip in robot.tips], robot.opening)
        self._actors = {actor.name: actor for actor in configuration.objects}
        self._rng = np.random.default_rng(configuration.seed)

    def done(self, order: Sequence[Step], until: float) -> tuple[int, Stuck | None]:
        """How many steps of an order work, and why it does not; None where it does.

        Args:
            order: The steps.
            until: When to give up, on the clock of `time.process_time`.
        """
        stuck = Stuck("time is over", "time is over", False)
        for _ in range(AGAIN):
            done, failed, state = self._handled(order, until)
            if failed is not None:
                return done, failed
            found = verdict(self._configuration, self._raised(order, state), state.dropped)
            if found.success:
                return len(order), None
            stuck = Stuck("what was built falls over", found.why, True)
            if time.process_time() > until:
                return len(order), replace(stuck, exhausted=False)
        return len(order), stuck

    def _handled(self, order: Sequence[Step], until: float) -> tuple[int, Stuck | None, State]:
        """How many steps an arm can do, why not the next one, and where everything is then."""
        state = State(self._beginning, self._robot.rest)
        for number, step in enumerate(order):
            goals = goal_poses(step, self._actors, self._world, state, self._rng)
            if not goals:
                said = f"{step.target} does not stand on {step.place}"
                return number, Stuck("the tower falls over", said, True), state
            mover = Mover(self._robot, self._world, self._actors[step.target], state, until, self._rng)
            found = mover.moved(goals, not step.drop)
            if isinstance(found, Stuck):
                return number, found, state
            state = found
        return len(order), None, state

    def _raised(self, order: Sequence[Step], state: State) -> dict[str, Array]:
        """Where things are, and a hair above what bears them where an arm has put them down."""
        raised = dict(state.objects)
        level = dict.fromkeys(raised, 0)
        for step in order:
            if step.target in raised:
                level[step.target] = 1 + level.get(step.place, 0)
                up = np.array([0.0, 0.0, level[step.target] * LIFT])
                raised[step.target] = poses.shifted(raised[step.target], up)
        return raised


def goal_poses(
    step: Step,
    actors: Mapping[str, ObjectActor],
    world: WorldModel,
    state: State,
    rng: np.random.Generator,
) -> list[Array]:
    """Poses ``(7,)`` of the object in which the goal is reached, or from which it falls to be so."""
    model, goal = world.object(step.target), step.goal
    height = max(model.extent) / 2 if model.cubic else model.extent[2] / 2
    every = [poses.yaw(2 * np.pi * k / HEADINGS) for k in range(HEADINGS)]
    far, turned = SHARE * goal.position_tolerance, SHARE * goal.angle_tolerance
    if step.place not in world.places:
        return _upon(actors[step.target], actors[step.place], state.objects[step.place], height, far, rng)
    place = world.places[step.place]
    frame = np.asarray(place.pose)
    if step.drop:
        room = np.maximum(np.array(place.extent) / 2 - 0.6 * max(model.extent[:2]), 0.0)
        spread = [(0.0, 0.0), *(tuple(rng.uniform(-1, 1, 2) * room) for _ in range(4))]
        offsets = [(x + place.centre[0], y + place.centre[1]) for x, y in spread]
        heights = [height + place.height + free for free in FREE]
        return [pose for high in heights for pose in _about(frame, offsets, high, every)]
    if goal.relation == "on":
        turns = [
            poses.quat_multiply(rotation, poses.yaw(turn))
            for rotation in (np.array(every) if model.symmetry == 0 else rotations(model))
            for turn in (0.0, turned, -turned)
        ]
        return _about(frame, [(0.0, 0.0), *_aside(far / 2, rng, 4), *_aside(far, rng, 4)], height, turns)
    half = np.maximum(np.array(place.extent) / 2 - max(model.extent[:2]) / 2, 0.0)
    offsets = [(0.0, 0.0), *(tuple(np.array(place.centre) + rng.uniform(-1, 1, 2) * half) for _ in range(20))]
    return _about(frame, offsets, height, every)


def _upon(
    upper: ObjectActor, lower: ObjectActor, below: Array, height: float, far: float, rng: np.random.Generator
) -> list[Array]:
    """Poses ``(7,)`` of an object upright on another one, where its weight is borne; the firmest places."""
    top = _face(lower, below, highest=True)
    foot = _face(upper, UPRIGHT, highest=False)
    weight = np.asarray(upper.shape().mass.pose)[:2]
    highest = max(poses.transform(below, p.corners())[:, 2].max() for p in lower.shape().collision)
    frame = poses.pose([*below[:2].tolist(), float(highest)])
    if len(top) < 3 or len(foot) < 3 or not holds(foot, weight[None], -EDGE):
        return []
    found: list[Array] = []
    for turn in (poses.yaw(2 * np.pi * k / HEADINGS) for k in range(HEADINGS)):
        borne = poses.rotate(turn, np.array([*weight, 0.0]))[:2]
        aside = np.array([(0.0, 0.0), *_aside(far, rng, OFFSETS)])
        room = within(top, frame[:2] + aside + borne)
        likely = [k for k in np.argsort(-room)[:TRIED] if room[k] > -EDGE]
        found += _about(frame, [tuple(aside[k]) for k in likely], height, [turn])
    return found


def _aside(far: float, rng: np.random.Generator, count: int) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in rng.uniform(-1, 1, (count, 2)) * far / np.sqrt(2)]


def _about(
    frame: Array, offsets: Sequence[tuple[float, ...]], height: float, turns: Sequence[Array]
) -> list[Array]:
    return [
        poses.multiply(frame, poses.pose([offset[0], offset[1], height], turn))
        for offset in offsets
        for turn in turns
    ]


def _physical(task: Task, configuration: ActorConfiguration) -> tuple[str, str] | None:
    """What physics forbids: reason and words; None where nothing."""
    actors = {actor.name: actor for actor in configuration.objects}
    places = {place.name: place for place in configuration.places}
    for step in task.steps:
        actor = actors[step.target]
        model = actor.model()
        friction = (PAD_FRICTION + actor.friction) / 2
        if actor.mass * GRAVITY > 2 * friction * FINGER_FORCE:
            return "too heavy", f"{step.target} weighs {actor.mass:.2f} kg"
        place = places.get(step.place)
        if place is not None and place.container and not _fits(model, place.extent):
            return "too large for the container", f"{step.target} does not fit into {step.place}"
    return None


def _fits(model: ObjectModel, extent: Sequence[float]) -> bool:
    return sorted(model.extent)[1] < max(extent) and sorted(model.extent)[0] < min(extent)


def _face(actor: ObjectActor, pose: Array, highest: bool) -> Array:
    """The convex outline ``(n, 2)`` of an object's highest or lowest points."""
    corners = np.concatenate([poses.transform(pose, p.corners()) for p in actor.shape().collision])
    heights = corners[:, 2]
    near = heights > heights.max() - 1e-3 if highest else heights < heights.min() + 1e-3
    return hull(corners[near, :2])
