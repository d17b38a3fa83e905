"""Actors, actor configurations, and their seeded sampling.

A `Scene` says which robot, fixtures and objects there are and from which ranges sizes, masses, friction and
poses are drawn. `Scene.sample` draws one `ActorConfiguration`: plain numbers that every engine builds the
same world from, and that travel in a run's log as JSON.
"""

from __future__ import annotations

import dataclasses
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bt_tasksim import poses
from bt_tasksim.errors import InputError, nearest
from bt_tasksim.fixtures import Fixture, load_fixture
from bt_tasksim.shapes import KINDS, Shape, ShapeSize, object_model, resting_height, shape, size_range
from bt_tasksim.world import ObjectModel, Obstacle, PlaceModel, WorldModel

STREAMS = {"evaluation": 0, "training": 1, "validation": 2, "demonstration": 3}
"""Names of the independent streams of draws: the same seed gives unrelated draws in each."""
_STRIPS = 10
ASIDE = 0.5
"""Radians by which a tilted approach may lean aside, see `Lesson`."""
STRIPS = ("all", "even", "odd")
"""Parts of a range from which draws are made, see `ObjectSpec`."""


@dataclass(frozen=True)
class ObjectSpec:
    """What an object may be; ranges are uniform.

    Attributes:
        kinds: Categories drawn from, such as ``("box", "cylinder")``.
        on: Name of the place where it starts.
        area: Half sizes ``(2,)`` in metres of the rectangle on that place in which its centre is drawn; None
            for the place's own default.
        centre: Centre ``(2,)`` of that rectangle in the place's frame, metres.
        yaw: Half width in radians of the range of its heading.
        size: Low and high full sizes ``((3,), (3,))`` in metres; None for the kind's own range, or the size
            of the mesh file.
        mass: Low and high, kg.
        friction: Low and high friction coefficient.
        exponents: Low and high shape exponents ``(e1, e2)`` of a superellipsoid; or ``((e1, e2), (e1, e2))``
            where the two have ranges of their own.
        mesh: Path of a mesh file, for kind ``mesh``.
        strips: Which of the ten equal strips of each range of size and exponents are drawn from: ``all``,
            ``even`` or ``odd`` ones. What is trained on even strips has never seen a value of an odd one.
        size_error: Half width of the relative error with which the size is known beforehand.
    """

    kinds: tuple[str, ...]
    on: str
    area: tuple[float, float] | None = None
    centre: tuple[float, float] = (0.0, 0.0)
    yaw: float = np.pi
    size: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    mass: tuple[float, float] = (0.08, 0.25)
    friction: tuple[float, float] = (0.4, 0.9)
    exponents: tuple[float, float] | tuple[tuple[float, float], tuple[float, float]] = (0.2, 1.0)
    mesh: str | None = None
    strips: str = "all"
    size_error: float = 0.0

    def __post_init__(self) -> None:
        if self.strips not in STRIPS:
            raise InputError(f"unknown strips '{self.strips}'{nearest(self.strips, STRIPS)}")
        if not 0.0 <= self.size_error < 1.0:
            raise InputError(f"'size_error' should be at least 0 and below 1, found {self.size_error:g}")
        for kind in self.kinds:
            if kind not in KINDS:
                raise InputError(f"unknown kind of object '{kind}'{nearest(kind, KINDS)}")


@dataclass(frozen=True)
class SpotSpec:
    """A spot marked on another place, where something is to stand.

    Attributes:
        name: The spot's name, a place like any other.
        on: Name of the place it lies on.
        centre: Centre ``(2,)`` of the rectangle in which it is drawn, in that place's frame, metres.
        area: Half sizes ``(2,)`` of that rectangle, metres.
        extent: Full size ``(2,)`` of the spot, metres.
        yaw: Half width in radians of the range of its heading.
    """

    name: str
    on: str
    centre: tuple[float, float]
    area: tuple[float, float]
    extent: tuple[float, float] = (0.12, 0.12)
    yaw: float = 0.0


@dataclass(frozen=True)
class HandStart:
    """Where the hand is when an episode begins, instead of in its rest posture.

    Attributes:
        over: Name of the object that it is above.
        height: Lowest and highest height above the object's centre, metres.
        aside: Half width of the square about the object's centre, metres.
        turn: Half width of the range of its turn from its neutral orientation, pointing down, radians.
    """

    over: str
    height: tuple[float, float] = (0.20, 0.30)
    aside: float = 0.04
    turn: float = 0.4


@dataclass(frozen=True)
class Lesson:
    """A part of a curriculum: how worlds are drawn while it is taught.

    Attributes:
        name: Its name.
        objects: Objects that are drawn otherwise than in the scene itself, by name.
        noise: Names of noise models of the estimate; each world has one of them. None: the engine's.
        hand: Where the hand is at first, in worlds in which it comes from above; else in its rest posture.
        tilt: Lowest and highest angle in radians between straight down and the direction in which a hand
            comes to objects on boards, leaning away from the robot, and aside by up to `ASIDE`.
        scenes: Scenes that worlds are drawn from, each as often, instead of the scene itself; the tree's
            objects must be in each.
        tolerance: Sufficient cost below which a goal counts as reached: 1 for what is meant in the end.
        until: Share of successes in training from which the next lesson begins; the last one never ends.
    """

    name: str
    objects: Mapping[str, ObjectSpec] = field(default_factory=dict)
    noise: tuple[str, ...] = ()
    hand: HandStart | None = None
    tilt: tuple[float, float] | None = None
    scenes: tuple[Scene, ...] = ()
    tolerance: float = 1.0
    until: float = 0.9

    def __post_init__(self) -> None:
        if not (self.tolerance > 0.0 and 0.0 < self.until <= 1.0):
            raise InputError(
                f"lesson '{self.name}': 'tolerance' should be positive and 'until' a share above 0, found "
                f"{self.tolerance:g} and {self.until:g}"
            )


@dataclass(frozen=True)
class Goal:
    """Where an object should be at the end, judged by the hidden state.

    Attributes:
        object: Name of the object.
        place: Name of the place.
        relation: ``stands`` (upright on the place's origin, with its heading up to the object's symmetry),
            ``inside`` (within the container, below its rim) or ``lifted`` (held in the hand alone, ``height``
            above where it stood on the place, and as upright).
        position_tolerance: Metres.
        angle_tolerance: Radians.
        height: Metres, for ``lifted``.
    """

    object: str
    place: str
    relation: str = "stands"
    position_tolerance: float = 0.03
    angle_tolerance: float = float(np.deg2rad(10.0))
    height: float = 0.3


@dataclass(frozen=True)
class Disturbance:
    """Something that happens to an object during the episode.

    Attributes:
        object: Name of the object.
        delay: Seconds between the moment at which the hand first holds the object clear of its support and
            the push.
        force: Force ``(3,)`` in N, robot base frame, kept up until the object has left the hand.
        speed: Speed along the force, m/s, above which it pauses: a push rather than a shot.
        limit: Longest time in seconds for which it is kept up.
    """

    object: str
    delay: float
    force: tuple[float, float, float]
    speed: float = 0.5
    limit: float = 0.5


@dataclass(frozen=True)
class ObjectActor:
    """One object as drawn: everything that an engine needs to build it."""

    name: str
    kind: str
    size: tuple[float, float, float]
    exponents: tuple[float, float]
    mass: float
    friction: float
    pose: tuple[float, ...]
    colour: tuple[float, float, float]
    mesh: str | None = None
    known_size: tuple[float, float, float] | None = None
    """The size it is taken to have; None where that is its true one."""
    on: str = ""
    """Name of the place where it starts."""

    def shape(self) -> Shape:
        """Its geometry."""
        return shape(self.kind, ShapeSize(self.size, self.exponents, self.mesh))

    def known_shape(self) -> Shape:
        """The geometry it is taken to have."""
        return shape(self.kind, ShapeSize(self.known_size or self.size, self.exponents, self.mesh))

    def model(self) -> ObjectModel:
        """What is known about it beforehand."""
        size = ShapeSize(self.known_size or self.size, self.exponents, self.mesh)
        return object_model(self.name, self.kind, size)


@dataclass(frozen=True)
class ActorConfiguration:
    """One drawn world, as plain data.

    Attributes:
        robot: Name of the robot or path of its data file.
        objects: The objects as drawn.
        fixtures: Fixtures with their poses.
        places: Places by name, spots included, as ``PlaceModel`` data.
        joint_position: Initial joint positions in the robot's joint order; empty for its rest posture.
        seed: The seed and stream it was drawn with.
        hand_start: Position of the tool (m) and its turn from the neutral orientation (rad), pointing down,
            ``(4,)``; then the joints follow from it. Empty: ``joint_position`` counts.
        physics_frequency: Hz.
        control_frequency: Hz.
        goal: What should be true at the end, or None.
        disturbance: What happens on the way, or None.
        noise: Name of the noise model of the estimate; empty for the engine's own.
        tolerance: In training, the sufficient cost below which a goal counts as reached.
        lesson: Name of the lesson it was drawn for.
    """

    robot: str
    objects: tuple[ObjectActor, ...]
    fixtures: tuple[Fixture, ...]
    places: tuple[PlaceModel, ...]
    seed: int
    stream: str = "evaluation"
    joint_position: tuple[float, ...] = ()
    physics_frequency: int = 100
    control_frequency: int = 20
    goal: Goal | None = None
    disturbance: Disturbance | None = None
    noise: str = ""
    tolerance: float = 1.0
    lesson: str = ""
    hand_start: tuple[float, ...] = ()

    def generator(self, purpose: str) -> np.random.Generator:
        """Random numbers for one purpose (such as ``"estimate"``), independent of every other."""
        return generator(self.seed, self.stream, purpose)

    def world_model(self, tips: Sequence[str], opening: float) -> WorldModel:
        """Names and calibrated facts of this world, for a robot with these fingertips."""
        obstacles = tuple(
            Obstacle(poses.multiply(fixture.pose_array(), np.array(box.pose)), box.size, fixture.name)
            for fixture in self.fixtures
            for box in fixture.boxes
        )
        return WorldModel(
            objects=tuple(actor.model() for actor in self.objects),
            places={place.name: place for place in self.places},
            tips=tuple(tips),
            opening=opening,
            control_period=1.0 / self.control_frequency,
            obstacles=obstacles,
        )

    def to_json(self) -> str:
        """As JSON; `from_json` gives an equal configuration."""
        return json.dumps(dataclasses.asdict(self), default=lambda a: np.asarray(a).tolist())

    @classmethod
    def from_json(cls, text: str) -> ActorConfiguration:
        """The configuration written by `to_json`.

        Raises:
            InputError: The text is not such a configuration.
        """
        try:
            data = _tuples(json.loads(text))
            data["objects"] = tuple(ObjectActor(**o) for o in data["objects"])
            data["fixtures"] = tuple(Fixture.from_data(f) for f in data["fixtures"])
            data["places"] = tuple(
                PlaceModel(
                    **{
                        **p,
                        "pose": np.array(p["pose"]),
                        "access": np.array(p["access"]),
                        "exit": np.array(p["exit"]),
                    }
                )
                for p in data["places"]
            )
            data["goal"] = Goal(**data["goal"]) if data["goal"] else None
            data["disturbance"] = Disturbance(**data["disturbance"]) if data["disturbance"] else None
            return cls(**data)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"not an actor configuration: {error}") from error


def generator(seed: int, stream: str, purpose: str) -> np.random.Generator:
    """A random generator that depends on the seed, the stream and the purpose, and on nothing else."""
    return np.random.default_rng([int(seed), STREAMS[stream], zlib.crc32(purpose.encode())])


@dataclass(frozen=True)
class Scene:
    """A robot, fixtures and objects, and how they are drawn.

    Args:
        robot: Name of a bundled robot, or path of a data file.
        fixtures: Names of bundled fixtures or paths of data files; the table is always there.
        objects: By name: an `ObjectSpec`, or a short form: ``"cup on upper_board"``, or ``"on upper_board"``
            where the name is also the kind.
        spots: Spots marked on places.
        goal: What should be true at the end.
        knock: The object named here is knocked out of the hand at a random moment.
        lessons: The curriculum of a training in this scene, in order.
        name: Name of the scene in results.
    """

    robot: str = "panda"
    fixtures: Sequence[str] = ()
    objects: Mapping[str, ObjectSpec | str] = field(default_factory=dict)
    spots: Sequence[SpotSpec] = ()
    goal: Goal | None = None
    knock: str | None = None
    lessons: Sequence[Lesson] = ()
    name: str = "scene"

    def __post_init__(self) -> None:
        for lesson in self.lessons:
            for name in (*lesson.objects, *([lesson.hand.over] if lesson.hand else ())):
                if not all(name in scene.objects for scene in (self, *lesson.scenes)):
                    raise InputError(
                        f"lesson '{lesson.name}' names the object '{name}', which is not in the scene"
                        f"{nearest(name, self.objects)}"
                    )
        specs = {name: _object_spec(name, spec) for name, spec in self.objects.items()}
        object.__setattr__(self, "objects", specs)
        object.__setattr__(self, "fixtures", tuple(dict.fromkeys(("table", *self.fixtures))))
        places = {p.name for f in self.fixtures for p in load_fixture(f).places}
        for spot in self.spots:
            _require_place(f"spot '{spot.name}'", spot.on, places)
            places.add(spot.name)
        for name, spec in specs.items():
            _require_place(f"object '{name}'", spec.on, places)
        for label, wanted, known in (
            ("goal", self.goal.object if self.goal else None, specs),
            ("knock", self.knock, specs),
            ("goal", self.goal.place if self.goal else None, places),
        ):
            if wanted is not None and wanted not in known:
                raise InputError(
                    f"the scene's {label} names '{wanted}', which is not in it{nearest(wanted, known)}"
                )

    def with_robot(self, robot: str) -> Scene:
        """The same scene with another robot."""
        return dataclasses.replace(self, robot=robot)

    def sample(self, seed: int, stream: str = "evaluation", lesson: int | None = None) -> ActorConfiguration:
        """Draw one world.

        Args:
            seed: Any non-negative integer; the same seed gives the same world.
            stream: One of `STREAMS`; training and evaluation never share draws.
            lesson: Number of the lesson to draw it for; None: the scene itself.

        Raises:
            InputError: The objects do not fit on their places, or there is no such lesson.
        """
        if lesson is not None and not 0 <= lesson < len(self.lessons):
            raise InputError(f"scene '{self.name}' has {len(self.lessons)} lessons, and none number {lesson}")
        taught = None if lesson is None else self.lessons[lesson]
        if taught is not None and taught.scenes:
            k = int(generator(seed, stream, "variant").integers(len(taught.scenes)))
            return taught.scenes[k].with_robot(self.robot)._draw(seed, stream, taught)
        return self._draw(seed, stream, taught)

    def _draw(self, seed: int, stream: str, taught: Lesson | None) -> ActorConfiguration:
        rng = generator(seed, stream, "scene")
        fixtures = tuple(load_fixture(name) for name in self.fixtures)
        places = {p.name: p for f in fixtures for p in f.place_models()}
        for spot in self.spots:
            places[spot.name] = _draw_spot(spot, places, rng)
        objects: list[ObjectActor] = []
        for name, usual in self.objects.items():
            spec = usual if taught is None else taught.objects.get(name, usual)
            assert isinstance(spec, ObjectSpec)
            objects.append(_draw_object(name, spec, places, objects, rng))
        if taught is not None and taught.tilt is not None:
            _tilt_access(taught.tilt, objects, places, generator(seed, stream, "approach"))
        disturbance = None
        if self.knock is not None:
            disturbance = _draw_disturbance(self.knock, rng)
        return ActorConfiguration(
            robot=self.robot,
            objects=tuple(objects),
            fixtures=fixtures,
            places=tuple(places.values()),
            seed=int(seed),
            stream=stream,
            goal=self.goal,
            disturbance=disturbance,
            noise=_draw_noise(taught, seed, stream),
            tolerance=1.0 if taught is None else taught.tolerance,
            lesson="" if taught is None else taught.name,
            hand_start=_draw_hand(taught, objects, places, seed, stream),
        )


def _object_spec(name: str, spec: ObjectSpec | str) -> ObjectSpec:
    if isinstance(spec, ObjectSpec):
        return spec
    kind, _, place = spec.partition("on ")
    kind = kind.strip() or name
    if not place.strip():
        raise InputError(f"object '{name}': '{spec}' should read '<kind> on <place>' or 'on <place>'")
    return ObjectSpec(kinds=(kind,), on=place.strip())


def _require_place(what: str, place: str, places: set[str]) -> None:
    if place not in places:
        raise InputError(f"{what} is on '{place}', which is not a place of the scene{nearest(place, places)}")


def _draw_spot(spec: SpotSpec, places: Mapping[str, PlaceModel], rng: np.random.Generator) -> PlaceModel:
    base = places[spec.on]
    offset = np.array(spec.centre) + rng.uniform(-1, 1, 2) * np.array(spec.area)
    local = poses.pose([*offset, 0.0], poses.yaw(rng.uniform(-1, 1) * spec.yaw))
    return dataclasses.replace(
        base,
        name=spec.name,
        kind="spot",
        pose=poses.multiply(base.pose, local),
        extent=spec.extent,
        centre=(0.0, 0.0),
    )


def _draw_object(
    name: str,
    spec: ObjectSpec,
    places: Mapping[str, PlaceModel],
    others: Sequence[ObjectActor],
    rng: np.random.Generator,
) -> ObjectActor:
    kind = spec.kinds[int(rng.integers(len(spec.kinds)))]
    entry = KINDS[kind]
    low, high = spec.size or size_range(kind, spec.mesh)
    size = _draw_in(low, high, spec.strips, rng)
    if entry.round:
        size = (size[0], size[0], size[2])
    if entry.cubic_range and spec.size is None:
        size = (size[0],) * 3
    e_low, e_high = (np.broadcast_to(np.array(v, float), 2) for v in spec.exponents)
    if isinstance(spec.exponents[0], tuple):
        e_low, e_high = np.array(spec.exponents, float).T
    exponents = _draw_in(e_low, e_high, spec.strips, rng)
    geometry = ShapeSize((size[0], size[1], size[2]), (exponents[0], exponents[1]), spec.mesh)
    mass, friction = float(rng.uniform(*spec.mass)), float(rng.uniform(*spec.friction))
    place = places[spec.on]
    area = np.array(spec.area if spec.area is not None else entry.area_on(place))
    model = object_model(name, kind, geometry)
    radius = float(np.hypot(*model.extent[:2])) / 2
    for _ in range(200):
        offset = np.array(spec.centre) + rng.uniform(-1, 1, 2) * area
        heading = rng.uniform(-1, 1) * spec.yaw
        local = poses.pose([*offset, resting_height(kind, geometry)], poses.yaw(heading))
        pose = poses.multiply(place.pose, local)
        if all(
            np.hypot(*(pose[:2] - np.array(o.pose[:2]))) > radius + float(np.hypot(*o.size[:2])) / 2 + 0.01
            or abs(pose[2] - o.pose[2]) > (model.extent[2] + o.size[2]) / 2
            for o in others
        ):
            break
    else:
        raise InputError(
            f"object '{name}' finds no free spot on '{spec.on}' beside the others: "
            f"widen its area, or take fewer or smaller objects"
        )
    taken = {o.colour for o in others}
    colours = [c for c in entry.colours if c not in taken] or entry.colours
    colour = colours[int(rng.integers(len(colours)))]
    known_size = _known_size(size, entry, spec, rng)
    return ObjectActor(
        name=name,
        kind=kind,
        size=geometry.size,
        exponents=geometry.exponents,
        mass=mass,
        friction=friction,
        pose=tuple(float(v) for v in pose),
        colour=colour,
        mesh=spec.mesh,
        known_size=known_size,
        on=spec.on,
    )


def _draw_in(low: Any, high: Any, strips: str, rng: np.random.Generator) -> tuple[float, ...]:
    """Uniform draws from ranges, or from every other one of ten strips of them."""
    if strips == "all":
        return tuple(float(v) for v in rng.uniform(low, high))
    low, high = np.asarray(low, float), np.asarray(high, float)
    u = rng.uniform(0.0, 1.0, low.shape) * (_STRIPS / 2)
    k = np.floor(u)
    share = (2 * k + (strips == "odd") + (u - k)) / _STRIPS
    return tuple(float(v) for v in low + share * (high - low))


def _known_size(
    size: tuple[float, ...], entry: Any, spec: ObjectSpec, rng: np.random.Generator
) -> tuple[float, float, float] | None:
    """The size with a relative error, the same along x and y for what is round."""
    if spec.size_error == 0.0:
        return None
    x, y, z = (1.0 + rng.uniform(-1.0, 1.0, 3) * spec.size_error).tolist()
    if entry.round:
        y = x
    return size[0] * x, size[1] * y, size[2] * z


def _draw_noise(lesson: Lesson | None, seed: int, stream: str) -> str:
    if lesson is None or not lesson.noise:
        return ""
    return lesson.noise[int(generator(seed, stream, "noise").integers(len(lesson.noise)))]


def _draw_hand(
    lesson: Lesson | None,
    objects: Sequence[ObjectActor],
    places: Mapping[str, PlaceModel],
    seed: int,
    stream: str,
) -> tuple[float, ...]:
    if lesson is None or lesson.hand is None:
        return ()
    start, rng = lesson.hand, generator(seed, stream, "hand")
    actor = next(o for o in objects if o.name == start.over)
    if float(places[actor.on].access[2]) > -0.999:
        return ()
    centre = actor.pose
    x, y = rng.uniform(-start.aside, start.aside, 2).tolist()
    z, turn = float(rng.uniform(*start.height)), float(rng.uniform(-start.turn, start.turn))
    return centre[0] + x, centre[1] + y, centre[2] + z, turn


def _tilt_access(
    tilt: tuple[float, float],
    objects: Sequence[ObjectActor],
    places: dict[str, PlaceModel],
    rng: np.random.Generator,
) -> None:
    angle, aside = float(rng.uniform(*tilt)), float(rng.uniform(-ASIDE, ASIDE))
    for actor in objects:
        if places[actor.on].kind != "board":
            continue
        heading = np.arctan2(actor.pose[1], actor.pose[0]) + aside
        level = np.sin(angle)
        access = np.array([level * np.cos(heading), level * np.sin(heading), -np.cos(angle)])
        places[actor.on] = dataclasses.replace(places[actor.on], access=access)


def _draw_disturbance(name: str, rng: np.random.Generator) -> Disturbance:
    heading = rng.uniform(-np.pi, np.pi)
    side = rng.uniform(0.0, 20.0)
    return Disturbance(
        object=name,
        delay=float(rng.uniform(0.0, 1.6)),
        force=(float(side * np.cos(heading)), float(side * np.sin(heading)), -120.0),
    )


def _tuples(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_tuples(v) for v in value)
    if isinstance(value, dict):
        return {k: _tuples(v) for k, v in value.items()}
    return value
