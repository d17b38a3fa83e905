"""What a random task asks for: where each object goes, and in which order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from benchmarks.any_tree.furniture import Room, in_base
from benchmarks.any_tree.settings import Setting
from benchmarks.any_tree.things import FLAT, bears, extent, radius
from bt_tasksim import Goal, SpotSpec, poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import PlaceModel
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.outlines import distance, rectangle

MORE = 0.01
"""Metres between the circles about things, where people put something down."""
MOVED = 0.05
"""Metres by which a thing is moved at least."""
TRIES = 150
HEIGHT = 0.25
"""Metres above a spot in which it has to be free."""


@dataclass(frozen=True)
class Wish:
    """Where an object should go, before everything has its place.

    Attributes:
        target: The object.
        how: ``spot``, ``board``, ``object``, ``bin`` or ``tray``.
        place: What the spot is marked on, or the board or container.
        drop: It is let go above the tray, instead of put down in it.
    """

    target: str
    how: str
    place: str = ""
    drop: bool = False


@dataclass(frozen=True)
class Step:
    """What a tree does with one object.

    Attributes:
        target: The object.
        goal: Where it should be.
        place: What the tree brings it to.
        drop: It is let go there, instead of put down.
    """

    target: str
    goal: Goal
    place: str
    drop: bool = False


def draw_wish(target: str, room: Room, rng: np.random.Generator) -> Wish:
    """Where an object should go in this room."""
    ways: dict[Wish, float] = {Wish(target, "spot", "table"): 5.0, Wish(target, "object"): 1.5}
    for stand in room.stands:
        for name in stand.bins:
            ways[Wish(target, "bin", name, drop=True)] = 3.0
        for name in stand.trays:
            ways |= {Wish(target, "tray", name): 1.0, Wish(target, "tray", name, drop=True): 1.0}
            ways[Wish(target, "spot", name)] = 1.5
        for name in stand.boards:
            ways |= {Wish(target, "board", name): 1.5, Wish(target, "spot", name): 1.0}
    wishes, chances = list(ways), np.array(list(ways.values()))
    return wishes[int(rng.choice(len(wishes), p=chances / chances.sum()))]


def settled(
    wishes: Sequence[Wish],
    spots: Sequence[SpotSpec],
    actors: Mapping[str, ObjectActor],
    forms: Mapping[str, str],
    room: Room,
    world: Setting,
    drawn: ActorConfiguration,
    rng: np.random.Generator,
) -> tuple[list[Step], list[SpotSpec]]:
    """Goals with their places, once the objects are drawn.

    Args:
        wishes: Where objects should go.
        spots: A spot for each wish that has one, in their order, wherever it is.
        actors: The objects as drawn.
        forms: Kind or form of each.
        room: The furniture.
        world: What is within reach.
        drawn: The world.
        rng: Random numbers.

    Raises:
        InputError: There is no room for one of them.
    """
    places = {place.name: place for place in drawn.places}
    taken = [_Circle(np.array(a.pose)[:2], radius(a), _bottom(a), name) for name, a in actors.items()]
    covered = {actor.base for actor in actors.values() if actor.base}
    found: list[SpotSpec] = []
    steps: list[Step] = []
    for wish in sorted(wishes, key=lambda wish: wish.how == "object"):
        target = actors[wish.target]
        if wish.how == "spot":
            spot = _free_spot(spots[len(found)], target, places, taken, room, world, rng)
            found.append(spot)
            steps.append(Step(wish.target, Goal(wish.target, on=spot.name), spot.name))
        elif wish.how == "board":
            _claim(places[wish.place], target, taken)
            relation = str(rng.choice(["on", "anywhere"]))
            steps.append(Step(wish.target, Goal(wish.target, wish.place, relation), wish.place))
        elif wish.how == "object":
            base = _base(target, actors, forms, covered, steps, wishes, rng)
            covered.add(base)
            steps.append(Step(wish.target, Goal(wish.target, on=base), base))
        else:
            place = places[wish.place]
            if wish.how == "tray":
                _claim(place, target, taken)
            goal = Goal(wish.target, inside=wish.place)
            steps.append(Step(wish.target, goal, wish.place, wish.drop))
    return steps, found


@dataclass(frozen=True, eq=False)
class _Circle:
    """Room that is taken: middle ``(2,)``, radius and lowest point, metres, by what."""

    middle: Array
    radius: float
    low: float
    owner: str


def _bottom(actor: ObjectActor) -> float:
    return actor.pose[2] - extent(actor)[2] / 2


def _clear(middle: Array, low: float, target: ObjectActor, taken: Sequence[_Circle]) -> bool:
    for other in taken:
        apart = float(np.linalg.norm(middle - other.middle))
        if other.owner == target.name:
            if apart < MOVED and abs(low - other.low) < 0.02:
                return False
        elif -0.02 < other.low - low < HEIGHT and apart < other.radius + radius(target) + MORE:
            return False
    return True


def _claim(place: PlaceModel, target: ObjectActor, taken: list[_Circle]) -> None:
    """Take a place's origin.

    Raises:
        InputError: It is taken.
    """
    middle, low = np.asarray(place.pose)[:2], float(place.pose[2])
    if not _clear(middle, low, target, taken):
        raise InputError(f"{place.name} is taken")
    taken.append(_Circle(middle, radius(target), low, f"goal of {target.name}"))


def _free_spot(
    spot: SpotSpec,
    target: ObjectActor,
    places: Mapping[str, PlaceModel],
    taken: list[_Circle],
    room: Room,
    world: Setting,
    rng: np.random.Generator,
) -> SpotSpec:
    """The spot where there is room for an object.

    Raises:
        InputError: There is none.
    """
    place = places[spot.on]
    boards = {name: half for stand in room.stands for name, half in stand.boards.items()}
    for _ in range(TRIES):
        if spot.on == "table":
            low, high = world.forward
            ahead = np.array([rng.uniform(low, high), rng.uniform(-world.aside, world.aside)])
            local = in_base(world, ahead) - np.asarray(place.pose)[:2]
        else:
            on_board = boards.get(spot.on)
            half = np.array(on_board) if on_board else np.array(place.extent) / 2 - radius(target)
            local = rng.uniform(-1, 1, 2) * np.maximum(half, 0.0)
            local = local + (0.0 if spot.on in boards else np.array(place.centre))
        local = np.round(local, 3)
        at = poses.multiply(np.asarray(place.pose), poses.pose([*local.tolist(), 0.0]))
        if float(np.hypot(*at[:2])) > world.farthest or not _clear(at[:2], float(at[2]), target, taken):
            continue
        size = 2 * (radius(target) + MORE)
        square = rectangle(poses.pose([*at[:2].tolist(), 0.0]), (0.0, 0.0), (size, size))
        if spot.on == "table" and any(distance(square, outline) < 0.0 for outline in room.outlines):
            continue
        taken.append(_Circle(at[:2], radius(target), float(at[2]), f"goal of {target.name}"))
        return replace(spot, centre=(float(local[0]), float(local[1])))
    raise InputError(f"no room for {spot.name} on {spot.on}")


def _base(
    target: ObjectActor,
    actors: Mapping[str, ObjectActor],
    forms: Mapping[str, str],
    covered: set[str],
    steps: Sequence[Step],
    wishes: Sequence[Wish],
    rng: np.random.Generator,
) -> str:
    """What an object may be put on.

    Raises:
        InputError: There is nothing.
    """
    goals = {step.target: step for step in steps}
    waiting = {wish.target for wish in wishes} - set(goals)
    fit = []
    for name, actor in actors.items():
        if name == target.name or name in covered or name in waiting or forms[name] not in FLAT:
            continue
        step = goals.get(name)
        below = actors.get(step.place) if step is not None else actors.get(actor.base)
        height = 0.0 if below is None else extent(below)[2]
        stands = step is None or not step.drop
        if stands and bears(actor, target, forms, height) and actor.base != target.name:
            fit.append(name)
    if not fit:
        raise InputError(f"there is nothing that {target.name} could stand on")
    return str(rng.choice(fit))


def allowed(order: Sequence[Step], actors: Mapping[str, ObjectActor]) -> bool:
    """An order of steps in which nothing is taken from under another thing, and what bears stands first."""
    done: set[str] = set()
    moved = {step.target for step in order}
    for step in order:
        above = [name for name, actor in actors.items() if actor.base == step.target]
        if any(name not in done for name in above):
            return False
        if step.place in moved and step.place not in done:
            return False
        done.add(step.target)
    return True


def in_order(
    steps: Sequence[Step], actors: Mapping[str, ObjectActor], rng: np.random.Generator
) -> list[Step]:
    """The steps in the first order, from a random one on, that is allowed.

    Raises:
        InputError: There is none.
    """
    shuffled = [steps[int(i)] for i in rng.permutation(len(steps))]
    for order in permutations(shuffled):
        if allowed(order, actors):
            return list(order)
    raise InputError("the goals contradict the start")
