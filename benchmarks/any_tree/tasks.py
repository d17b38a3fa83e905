"""Random tasks: a scene, what should be true in it, and the tree that a person would write for it.

A task is a function of its seed and of the robot alone; only the folder of its meshes is the caller's.
Furniture, objects and goals come from a generator of the task's own, the objects' places from the scene's
draw with the same seed. What does not fit is drawn again, each time a little less crowded.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from py_trees.behaviour import Behaviour

from benchmarks.any_tree.furniture import Room, draw_room
from benchmarks.any_tree.goals import Step, Wish, draw_wish, in_order, settled
from benchmarks.any_tree.settings import Setting, setting
from benchmarks.any_tree.things import FLAT, Thing, bears, draw_things, radius
from benchmarks.any_tree.trees import tree_of
from bt_tasksim import ObjectSpec, Scene, SpotSpec, load_robot
from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.clear_start import TOUCHING, links_at_rest, object_in_robot
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.outlines import distance, rectangle
from bt_tasksim.scene.shape_kind import BRIGHT

TABLE = (0.5, 0.0)
"""Origin of the table, robot base frame, metres."""
MOST = 5
"""Objects that a tree moves."""
MOST_THINGS = 12
"""Objects in all."""
DENSEST = 0.6
"""Objects in a square decimetre of the rectangle in which things begin."""
TRIES = 80
GAPS = (0.01, 0.03)
"""Range of the least gap between objects of one task, metres."""
SPOT = (0.1, 0.1)


@dataclass(frozen=True)
class Task:
    """A task.

    Attributes:
        seed: Its seed.
        robot: Name of the robot.
        stream: Stream of the scene's draw.
        scene: The scene with its goals.
        steps: What the tree does, in order.
        arrangement: Name of the furniture.
        density: Objects on the table in a square decimetre of the rectangle in which they begin.
        gap: Least gap between them, metres.
        words: All of it in a sentence.
    """

    seed: int
    robot: str
    stream: str
    scene: Scene
    steps: tuple[Step, ...]
    arrangement: str
    density: float
    gap: float
    words: str

    def tree(self, kind: str = "obvious", grasp: str | None = None) -> Behaviour:
        """A fresh tree, see `benchmarks.any_tree.trees.tree_of`."""
        return tree_of(self.steps, self.scene.goals, kind, grasp)

    def in_colours(self, count: int) -> Task:
        """The same task with objects in so many colours, in turn; else each has one of its own, if it can."""
        specs = {
            name: replace(spec, colour=BRIGHT[k % min(count, len(BRIGHT))])
            for k, (name, spec) in enumerate(self.scene.objects.items())
        }
        return replace(self, scene=replace(self.scene, objects=specs))

    def sample(self) -> ActorConfiguration:
        """The world as it is drawn."""
        return self.scene.sample(self.seed, self.stream)


def task(seed: int, robot: str, folder: Path, stream: str = "evaluation") -> Task:
    """The task of a seed.

    Args:
        seed: The seed, of the task and of its scene's draw.
        robot: Name of the robot, one of `benchmarks.any_tree.settings.SETTINGS`.
        folder: Where its meshes are written.
        stream: Stream of the scene's draw.

    Raises:
        InputError: There is no setting for the robot, or no try fits.
    """
    world = setting(robot)
    rng = np.random.default_rng([int(seed), zlib.crc32(robot.encode()), zlib.crc32(b"any tree")])
    count = int(rng.integers(1, MOST + 1))
    dense, gap = float(rng.uniform(0.0, DENSEST)), round(float(rng.uniform(*GAPS)), 3)
    things = draw_things(MOST_THINGS, world, seed, folder, rng)
    last: InputError | None = None
    for k in range(TRIES):
        try:
            return _drawn(_Try(seed, robot, stream, world, things, count, dense * 0.97**k, gap), rng)
        except InputError as error:
            last = error
    raise InputError(f"no task for seed {seed} and {robot} in {TRIES} tries; the last one: {last}")


@dataclass(frozen=True)
class _Try:
    seed: int
    robot: str
    stream: str
    setting: Setting
    things: Sequence[Thing]
    count: int
    density: float
    gap: float


def _drawn(plan: _Try, rng: np.random.Generator) -> Task:
    """One try.

    Raises:
        InputError: It does not fit.
    """
    room = draw_room(plan.setting, rng)
    total = max(plan.count, round(plan.density * room.area))
    things = {thing.name: thing for thing in plan.things[: min(total, len(plan.things))]}
    movers = list(things)[: plan.count]
    specs = _starts(things, movers, room, plan, rng)
    wishes = [draw_wish(name, room, rng) for name in movers]
    spots = [_spot(wish, number, plan.setting) for number, wish in enumerate(_on_spots(wishes), 1)]
    scene = Scene(plan.robot, fixtures=room.fixtures, objects=specs, spots=spots, name="any tree")
    drawn = scene.sample(plan.seed, plan.stream)
    actors = {actor.name: actor for actor in drawn.objects}
    forms = {name: thing.form for name, thing in things.items()}
    _check_starts(actors, forms, room)
    links = links_at_rest(load_robot(plan.robot))
    for name in specs:
        if object_in_robot(links, drawn, name).depth > TOUCHING:
            raise InputError(f"{name} begins in the hand of a robot at rest")
    steps, spots = settled(wishes, spots, actors, forms, room, plan.setting, drawn, rng)
    steps = in_order(steps, actors, rng)
    goals = [step.goal for step in steps]
    scene = Scene(
        plan.robot, fixtures=room.fixtures, objects=specs, spots=spots, goals=goals, name="any tree"
    )
    density = sum(not actor.base and actor.on == "table" for actor in drawn.objects) / room.area
    said = "; ".join(f"{_start(specs[step.target])} {_to(step)}" for step in steps)
    words = f"{room.name}, {len(specs)} objects ({density:.2f} per dm2, {1000 * plan.gap:.0f} mm): {said}"
    return Task(plan.seed, plan.robot, plan.stream, scene, tuple(steps), room.name, density, plan.gap, words)


def _start(spec: ObjectSpec) -> str:
    return " ".join(spec.start)


def _to(step: Step) -> str:
    return f"-> {step.goal}{' (dropped)' if step.drop else ''}"


def _on_spots(wishes: Sequence[Wish]) -> list[Wish]:
    return [wish for wish in wishes if wish.how == "spot"]


def _spot(wish: Wish, number: int, world: Setting) -> SpotSpec:
    """The spot of a wish; its place is found once the objects are drawn, with the same random numbers."""
    size = SPOT if world.mesh_scale == 1.0 else (SPOT[0] / 2, SPOT[1] / 2)
    return SpotSpec(f"spot_{number}", wish.place, (0.0, 0.0), (0.0, 0.0), size, yaw=np.pi)


def _starts(
    things: Mapping[str, Thing], movers: Sequence[str], room: Room, plan: _Try, rng: np.random.Generator
) -> dict[str, ObjectSpec]:
    """Where each thing starts: on the table most often."""
    boards = [(name, half) for stand in room.stands for name, half in stand.boards.items()]
    trays = [name for stand in room.stands for name in stand.trays]
    free: set[str] = set()  # flat things on which nothing stands
    specs: dict[str, ObjectSpec] = {}
    for name, thing in things.items():
        ways = {"table": 6.0 if name in movers else 12.0}
        ways |= {"board": 2.0} if boards else {}
        ways |= {"tray": 2.0} if trays else {}
        ways |= {"object": 1.5 if name in movers else 0.7} if free else {}
        chances = np.array(list(ways.values()))
        how = str(rng.choice(list(ways), p=chances / chances.sum()))
        if how == "board":
            board, half = boards[int(rng.integers(len(boards)))]
            specs[name] = thing.starting(on=board, area=half, gap=plan.gap)
        elif how == "tray":
            specs[name] = thing.starting(inside=trays[int(rng.integers(len(trays)))], gap=plan.gap)
        elif how == "object":
            below = str(rng.choice(sorted(free)))
            free.discard(below)
            specs[name] = thing.starting(on=below, area=(0.006, 0.006), gap=plan.gap)
        else:
            centre = (float(room.centre[0] - TABLE[0]), float(room.centre[1] - TABLE[1]))
            half = (float(room.half[0]), float(room.half[1]))
            specs[name] = thing.starting(on="table", centre=centre, area=half, gap=plan.gap)
            if thing.form in FLAT:
                free.add(name)
    return specs


def _check_starts(actors: Mapping[str, ObjectActor], forms: Mapping[str, str], room: Room) -> None:
    """What stands on things stands well, and what stands on the table is not under furniture.

    Raises:
        InputError: It is not so.
    """
    for name, actor in actors.items():
        if actor.base and not bears(actors[actor.base], actor, forms):
            raise InputError(f"{name} would not stand on {actor.base}")
        if actor.on == "table":
            pose, size = np.array(actor.pose), 2 * radius(actor)
            square = rectangle(pose, (0.0, 0.0), (size, size))
            if any(distance(square, outline) < 0.0 for outline in room.outlines):
                raise InputError(f"{name} stands in or under furniture")
