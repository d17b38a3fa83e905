"""Whether a task is possible at all: full knowledge, no margins, and up to a minute of planning.

Asked about draws that failed. It moves the objects one after the other in thought, in the tree's order and
then in all others that are allowed (`benchmarks.any_tree.handling`), and looks at what physics asks besides:
weight against friction, room in containers, and things that stay where they stand. "Impossible" says that
nothing was found, whether because all samples were tried or because time was over; `Finding.exhausted` tells
the two apart.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import permutations
from typing import Any

import numpy as np

from benchmarks.any_tree.goals import Step, allowed
from benchmarks.any_tree.handling import Mover, State, Stuck
from benchmarks.any_tree.steady import fallen
from benchmarks.any_tree.tasks import Task
from bt_tasksim import load_robot, poses
from bt_tasksim.core.fact_making import rotations
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel, WorldModel
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.outlines import holds, hull

GRAVITY = 9.81
FINGER_FORCE = 10.0
"""Newtons that every hand here presses with."""
PAD_FRICTION = 1.2
HEADINGS = 24
ASIDE = 0.018
"""Metres by which an object may stand off a spot's middle: well within what goals allow."""
TURNED = float(np.deg2rad(7.0))
FIRST = 0.6
"""Share of the time that the tree's own order gets."""
EDGE = 0.004
"""Metres within the edge of its support that a centre of mass has to be."""


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
    began = time.monotonic()
    robot, configuration = load_robot(task.robot), task.sample()
    world = configuration.world_model([tip.name for tip in robot.tips], robot.opening)
    wrong = _physical(task, configuration) or _falls(configuration)
    if wrong is not None:
        told = tuple(step.target for step in task.steps)
        return Finding(False, *wrong, True, told, time.monotonic() - began)
    actors = {actor.name: actor for actor in configuration.objects}
    best: tuple[int, Stuck, tuple[str, ...]] | None = None
    exhausted = True
    for number, order in enumerate(_orders(task.steps, actors)):
        until = began + (FIRST * seconds if number == 0 else seconds)
        if time.monotonic() > until:
            exhausted = False
            break
        names = tuple(step.target for step in order)
        done, stuck, state = _done(order, robot, world, configuration, until)
        if stuck is None:
            loose = fallen(configuration, state.objects)
            if not loose:
                return Finding(True, "", "a way was found", False, names, time.monotonic() - began)
            stuck = Stuck("what was built falls over", f"{loose} does not stay where it was put", False)
        exhausted &= stuck.exhausted
        if best is None or done > best[0]:
            best = (done, stuck, names)
        if stuck.reason == "no grip fits the hand":
            break
    assert best is not None
    _, stuck, names = best
    return Finding(False, stuck.reason, stuck.words, exhausted, names, time.monotonic() - began)


def _orders(steps: Sequence[Step], actors: dict[str, ObjectActor]) -> Iterator[tuple[Step, ...]]:
    """The tree's order first, then all others that are allowed."""
    yield tuple(steps)
    for order in permutations(steps):
        if order != tuple(steps) and allowed(order, actors):
            yield order


def _done(
    order: Sequence[Step],
    robot: RobotDescription,
    world: WorldModel,
    configuration: ActorConfiguration,
    until: float,
) -> tuple[int, Stuck | None, State]:
    """How many steps of an order work, why the next one does not, and where everything is then."""
    rng = np.random.default_rng(configuration.seed)
    actors = {actor.name: actor for actor in configuration.objects}
    state = State({name: np.array(actor.pose) for name, actor in actors.items()}, robot.rest)
    for number, step in enumerate(order):
        goals = goal_poses(step, world, state, rng)
        lowered = not step.drop
        found = Mover(robot, world, actors[step.target], state, until, rng).moved(goals, lowered)
        if isinstance(found, Stuck):
            return number, found, state
        state = found
    return len(order), None, state


def goal_poses(step: Step, world: WorldModel, state: State, rng: np.random.Generator) -> list[Array]:
    """Poses ``(7,)`` of the object in which the goal is reached, or from which it falls to be so."""
    model = world.object(step.target)
    height = max(model.extent) / 2 if model.cubic else model.extent[2] / 2
    every = [poses.yaw(2 * np.pi * k / HEADINGS) for k in range(HEADINGS)]
    if step.place not in world.places:
        below = state.objects[step.place]
        base = world.object(step.place)
        top = below[2] + (max(base.extent) / 2 if base.cubic else base.extent[2] / 2)
        frame = poses.pose([*below[:2].tolist(), float(top)])
        return _about(frame, [(0.0, 0.0), *_aside(ASIDE / 2, rng, 3)], height, every)
    place = world.places[step.place]
    frame = np.asarray(place.pose)
    if step.drop:
        room = np.maximum(np.array(place.extent) / 2 - 0.6 * max(model.extent[:2]), 0.0)
        spread = [(0.0, 0.0), *(tuple(rng.uniform(-1, 1, 2) * room) for _ in range(4))]
        offsets = [(x + place.centre[0], y + place.centre[1]) for x, y in spread]
        heights = (place.height + 0.02, place.height + 0.06)
        return [pose for free in heights for pose in _about(frame, offsets, height + free, every)]
    if step.goal.relation == "on":
        turns = [
            poses.quat_multiply(rotation, poses.yaw(turn))
            for rotation in (np.array(every) if model.symmetry == 0 else rotations(model))
            for turn in (0.0, TURNED, -TURNED)
        ]
        return _about(frame, [(0.0, 0.0), *_aside(ASIDE, rng, 5)], height, turns)
    half = np.maximum(np.array(place.extent) / 2 - max(model.extent[:2]) / 2, 0.0)
    offsets = [(0.0, 0.0), *(tuple(np.array(place.centre) + rng.uniform(-1, 1, 2) * half) for _ in range(20))]
    return _about(frame, offsets, height, every)


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
    for actor in actors.values():
        if actor.base and not stands_on(actor, actors[actor.base], np.array(actor.pose)):
            return "the start falls over", f"{actor.name} does not stand on {actor.base}"
    for step in task.steps:
        actor = actors[step.target]
        model = actor.model()
        friction = (PAD_FRICTION + actor.friction) / 2
        if actor.mass * GRAVITY > 2 * friction * FINGER_FORCE:
            return "too heavy", f"{step.target} weighs {actor.mass:.2f} kg"
        place = places.get(step.place)
        if place is None:
            if not stands_on(actor, actors[step.place]):
                return "the tower falls over", f"{step.target} does not stand on {step.place}"
        elif place.kind == "bin" and not _fits(model, place.extent):
            return "too large for the container", f"{step.target} does not fit into {step.place}"
    return None


def _falls(configuration: ActorConfiguration) -> tuple[str, str] | None:
    """The start does not stay as it is: reason and words."""
    loose = fallen(configuration, {})
    return ("the start falls over", f"{loose} does not stay where it starts") if loose else None


def _fits(model: ObjectModel, extent: Sequence[float]) -> bool:
    return sorted(model.extent)[1] < max(extent) and sorted(model.extent)[0] < min(extent)


def stands_on(upper: ObjectActor, lower: ObjectActor, pose: Array | None = None) -> bool:
    """An object's centre of mass is over the top of another one, and over its own foot.

    Args:
        upper: The upper object.
        lower: The lower one, where it starts.
        pose: Pose ``(7,)`` of the upper one; None for the middle of the lower one's top, upright.
    """
    top = _face(lower, np.array(lower.pose), highest=True)
    at = np.array([*lower.pose[:2], 0.0, 1.0, 0.0, 0.0, 0.0]) if pose is None else pose
    foot = _face(upper, at, highest=False)
    centre = poses.transform(at, np.asarray(upper.shape().mass.pose)[None, :3])[:, :2]
    return all(len(face) > 2 and holds(face, centre, EDGE) for face in (top, foot))


def _face(actor: ObjectActor, pose: Array, highest: bool) -> Array:
    """The convex outline ``(n, 2)`` of an object's highest or lowest points."""
    corners = np.concatenate([poses.transform(pose, p.corners()) for p in actor.shape().collision])
    heights = corners[:, 2]
    near = heights > heights.max() - 1e-3 if highest else heights < heights.min() + 1e-3
    return hull(corners[near, :2])
