"""A scene: a robot, fixtures and objects, and how worlds with them are drawn."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, cast

from bt_tasksim.core.errors import FieldError, InputError, NoDrawError, nearest, within
from bt_tasksim.core.known_arguments import known_arguments
from bt_tasksim.core.names import TOOL, check_name
from bt_tasksim.core.own_files import own_file
from bt_tasksim.core.plain import short, shown
from bt_tasksim.core.renamed import renamed_arguments, renamed_fields
from bt_tasksim.core.resources import FURNITURE, is_file
from bt_tasksim.core.world import HOLE
from bt_tasksim.scene import sampling
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor, check_seed, generator
from bt_tasksim.scene.fixture_overlap import check_fixtures
from bt_tasksim.scene.fixtures import Fixture, check_parameters, load_fixture
from bt_tasksim.scene.goal_functions import GoalFunction, Judge
from bt_tasksim.scene.parts import draw_parts
from bt_tasksim.scene.placing import draw_fixtures
from bt_tasksim.scene.relations import relation_named
from bt_tasksim.scene.specs import FixtureSpec, Goal, HandStart, ObjectSpec, SpotSpec, object_spec
from bt_tasksim.scene.starts import check_hollows, draw_order

UNSAID = cast("Goal", object())
"""What stands for a goal that nobody gave, so that None says that there shall be none."""


class WorldSource(Protocol):
    """Where worlds come from: a `Scene`, or an engine that brings a world of its own."""

    @property
    def name(self) -> str:
        """Its name in results."""

    @property
    def robot(self) -> str:
        """Name of the robot, or path of its data file."""

    @property
    def stages(self) -> Sequence[CurriculumStage]:
        """The curriculum of a training, in order."""

    @property
    def object_names(self) -> Collection[str]:
        """Names of the objects, which trees may name."""

    @property
    def place_names(self) -> Collection[str]:
        """Names of the places, which trees may name."""

    def with_robot(self, robot: str) -> WorldSource:
        """The same with another robot.

        Raises:
            InputError: It cannot be there.
        """

    def sample(self, seed: int, stream: str = "evaluation", stage: int | None = None) -> ActorConfiguration:
        """Draw one world, see `Scene.sample`."""


@dataclass(frozen=True)
class CurriculumStage:
    """A part of a curriculum: how worlds are drawn while it is taught.

    Attributes:
        name: Its name.
        objects: Objects that are drawn otherwise than in the scene itself, by name.
        noise: Names of noise models of the estimate; each world has one of them. None: the engine's.
        hand: Where the hand is at first, in worlds in which it comes from above; else in its rest posture.
        tilt: Lowest and highest angle in radians between straight down and the direction in which a hand
            comes to objects on boards, leaning away from the robot, and aside by up to `sampling.ASIDE`.
        scenes: Scenes that worlds are drawn from, each as often, instead of the scene itself; the tree's
            objects must be in each.
        tolerance: Sufficient cost below which a goal counts as reached: 1 for what is meant in the end.
        until: Share of successes in training from which the next stage begins; the last one never ends.
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
                f"stage '{self.name}': 'tolerance' should be positive and 'until' a share above 0, found "
                f"{self.tolerance:g} and {self.until:g}"
            )


Lesson = CurriculumStage
"""Its name in version 0.1."""


@renamed_fields(lessons="stages", knock="disturbed")
@known_arguments("a scene", object="objects", fixture="fixtures", spot="spots")
@dataclass(frozen=True, init=False)
class Scene:
    """A robot, fixtures and objects, and how they are drawn.

    Args:
        robot: Name of a bundled robot, or path of a data file.
        fixtures: Names of bundled fixtures or paths of data files, or `FixtureSpec` (`bt_tasksim.Fixture`)
            for one that stands elsewhere, or several times; the table is always there.
        objects: By name: an `ObjectSpec`, or a short form: ``"cup on upper_board"``, or ``"on upper_board"``
            where the name is also the kind; ``inside`` and ``beside`` likewise.
        spots: Spots marked on places.
        goal: What should be true at the end, where that is one thing; ``scene.goal`` is the first goal.
        disturbed: The object named here is knocked out of the hand at a random moment.
        stages: The curriculum of a training in this scene, in order.
        name: Name of the scene in results.
        goals: All that should be true: goals, and functions of a `bt_tasksim.scene.relations.FinalState`
            that answer with true or false, or with that and words.

    Raises:
        InputError: The scene cannot be: one sentence says what and where.
    """

    robot: str = "panda"
    fixtures: Sequence[str | FixtureSpec] = ()
    objects: Mapping[str, ObjectSpec | str] = field(default_factory=dict)
    spots: Sequence[SpotSpec] = ()
    disturbed: str | None = None
    stages: Sequence[CurriculumStage] = ()
    name: str = "scene"
    goals: Sequence[Goal | GoalFunction] = ()

    def __init__(
        self,
        robot: str = "panda",
        fixtures: Sequence[str | FixtureSpec] = (),
        objects: Mapping[str, ObjectSpec | str] | None = None,
        spots: Sequence[SpotSpec] = (),
        goal: Goal | GoalFunction | Judge | None = UNSAID,
        disturbed: str | None = None,
        stages: Sequence[CurriculumStage] = (),
        name: str = "scene",
        goals: Sequence[Goal | GoalFunction | Judge] = (),
    ) -> None:
        put = super().__setattr__
        objects = {} if objects is None else objects
        _check_kinds(
            robot, name, objects, disturbed, {"fixtures": fixtures, "spots": spots, "stages": stages}
        )
        put("robot", str(own_file(robot)) if is_file(robot) else robot)  # found from every folder
        put("spots", spots)
        put("disturbed", disturbed)
        put("stages", stages)
        put("name", name)
        put("goals", _goals(goal, goals))
        put("objects", objects)
        self._check_stages()
        if not name.isprintable():
            raise FieldError(f"the name of a scene should be printable, found '{shown(name)}'", "name")
        specs: dict[str, ObjectSpec] = {}
        for thing, spec in self.objects.items():
            with within("objects", thing):
                specs[check_name(thing, "the name of an object")] = object_spec(thing, spec)
        put("objects", specs)
        put("fixtures", _fixtures(fixtures))
        check_fixtures([load_fixture(fixture) for fixture in self.fixtures])
        self._check_names(specs)

    def _check_stages(self) -> None:
        for stage in self.stages:
            for name in (*stage.objects, *([stage.hand.over] if stage.hand else ())):
                if not all(name in scene.objects for scene in (self, *stage.scenes)):
                    raise InputError(
                        f"stage '{stage.name}' names the object '{name}', which is not in the scene"
                        f"{nearest(name, self.objects)}"
                    )

    def _check_names(self, specs: Mapping[str, ObjectSpec]) -> None:
        """Every name that is used is one of the scene, and means one thing."""
        fixtures = [load_fixture(fixture) for fixture in self.fixtures]
        furniture = [place for fixture in fixtures for place in fixture.places]
        places, containers = {p.name for p in furniture}, [p.name for p in furniture if p.container]
        holes = [p.name for p in furniture if p.kind == HOLE]
        parts = [part for fixture in fixtures for part in fixture.parts]
        moving, moving_parts = [part.name for part in parts], {part.name: part for part in parts}
        if twice := {name for name in moving if name in places or moving.count(name) > 1}:
            raise FieldError(
                f"two things of the fixtures are called '{min(twice)}': give one of the fixtures a 'name' of "
                f"its own",
                "fixtures",
            )
        for i, spot in enumerate(self.spots):
            _require_place(f"spot '{spot.name}'", "on", spot.on, places, ("spots", i, "on"))
            if spot.name in places or spot.name in moving:
                raise FieldError(f"two places are called '{spot.name}': rename the spot", "spots", i, "name")
            places.add(spot.name)
        if TOOL in moving:
            raise FieldError(
                f"a part of a fixture is called '{TOOL}', which is the robot's own: give the fixture another "
                f"'name'",
                "fixtures",
            )
        for name in specs:
            if name == TOOL:
                raise FieldError(
                    f"an object is called '{TOOL}', which is the robot's own: give the object another name, "
                    f"such as 'my_{TOOL}'",
                    "objects",
                    name,
                )
            if name in moving:
                raise FieldError(
                    f"an object and a part of a fixture are both called '{name}': give the object another "
                    f"name, such as 'my_{name}'",
                    "objects",
                    name,
                )
            if name in places:
                raise FieldError(
                    f"an object and a place are both called '{name}': give the object another name, such as "
                    f"'my_{name}'",
                    "objects",
                    name,
                )
        for name, spec in specs.items():
            word, reference = spec.start
            if word == "on":
                _check_no_part(name, reference, fixtures)
            known = set(specs) if word == "beside" else {*places, *specs, *moving}
            _require_place(f"object '{name}'", word, reference, known, ("objects", name, word))
        draw_order(specs)
        for i, goal in enumerate(self.goals):
            if isinstance(goal, Goal):
                where = ("goal",) if len(self.goals) == 1 else ("goals", i)
                _require("goal", goal.object, {*specs, *moving}, (*where, "object"))
                if fault := relation_named(goal.relation).fault(goal, moving_parts.get(goal.object)):
                    raise FieldError(fault, *where)
                if goal.place:
                    _require("goal", goal.place, {*places, *specs, *moving}, (*where, "place"))
                if goal.relation in ("inserted", "out_of") and goal.place not in holes:
                    said = f"such as {', '.join(holes)}" if holes else "such as that of a peg_block"
                    raise FieldError(
                        f"the goal of '{goal.object}' is {goal.relation.replace('_', ' ')} '{goal.place}', "
                        f"which is no hole: name one, {said}",
                        *where,
                        "place",
                    )
                if goal.relation == "inside" and goal.place in places and goal.place not in containers:
                    said = f"such as {', '.join(containers)}" if containers else "such as a trash_bin or tray"
                    raise FieldError(
                        f"the goal of '{goal.object}' is inside '{goal.place}', which is no container: name "
                        f"one, {said}; or write on='{goal.place}'",
                        *where,
                        "place",
                    )
        if self.disturbed is not None:
            _require("disturbed", self.disturbed, specs, ("disturbed",))

    @property
    def goal(self) -> Goal | None:
        """The first goal that is no function, or None."""
        return next((goal for goal in self.goals if isinstance(goal, Goal)), None)

    def _part_names(self) -> list[str]:
        return [part.name for name in self.fixtures for part in load_fixture(name).parts]

    @property
    def object_names(self) -> Collection[str]:
        """Names of its objects, parts of fixtures among them."""
        return [*self.objects, *self._part_names()]

    @property
    def place_names(self) -> Collection[str]:
        """Names of the places of its fixtures, and of its spots."""
        of_fixtures = {place.name for name in self.fixtures for place in load_fixture(name).places}
        return of_fixtures | {spot.name for spot in self.spots}

    def with_robot(self, robot: str) -> Scene:
        """The same scene with another robot."""
        return dataclasses.replace(self, robot=robot)

    @renamed_arguments(lesson="stage")
    def sample(self, seed: int, stream: str = "evaluation", stage: int | None = None) -> ActorConfiguration:
        """Draw one world.

        Args:
            seed: From 0 to `configuration.LARGEST_SEED`; the same seed gives the same world.
            stream: One of `STREAMS`; training and evaluation never share draws.
            stage: Number of the stage to draw it for; None: the scene itself.

        Raises:
            NoDrawError: With this seed the objects do not fit on their places.
            InputError: No seed has such a world, or there is no such stage.
        """
        check_seed(seed)
        if stage is not None and not 0 <= stage < len(self.stages):
            raise InputError(f"scene '{self.name}' has {len(self.stages)} stages, and none number {stage}")
        taught = None if stage is None else self.stages[stage]
        scene = self
        if taught is not None and taught.scenes:
            k = int(generator(seed, stream, "variant").integers(len(taught.scenes)))
            scene = taught.scenes[k].with_robot(self.robot)
        try:
            return scene._draw(seed, stream, taught)
        except NoDrawError as error:
            raise NoDrawError(f"with seed {int(seed)}, {error}") from error

    def _draw(self, seed: int, stream: str, taught: CurriculumStage | None) -> ActorConfiguration:
        rng = generator(seed, stream, "scene")
        fixtures = draw_fixtures(self.fixtures, generator(seed, stream, "fixtures"))
        places = {p.name: p for f in fixtures for p in f.place_models()}
        for spot in self.spots:
            places[spot.name] = sampling.draw_spot(spot, places, rng)
        specs: dict[str, ObjectSpec] = {}
        for name, usual in self.objects.items():
            spec = usual if taught is None else taught.objects.get(name, usual)
            assert isinstance(spec, ObjectSpec)
            specs[name] = spec
        parts = draw_parts(fixtures, generator(seed, stream, "parts"))
        drawn_objects: dict[str, ObjectActor] = {part.name: part for part in parts}
        moving = list(drawn_objects.values())
        for name in draw_order(specs):
            others = list(drawn_objects.values())
            drawn_objects[name] = sampling.draw_object(name, specs[name], places, others, rng, fixtures)
        objects = [*(drawn_objects[name] for name in specs), *moving]
        check_hollows(self.goals, drawn_objects)
        if taught is not None and taught.tilt is not None:
            sampling.tilt_access(taught.tilt, objects, places, generator(seed, stream, "approach"))
        disturbance = None if self.disturbed is None else sampling.draw_disturbance(self.disturbed, rng)
        drawn = ActorConfiguration(
            robot=self.robot,
            objects=tuple(objects),
            fixtures=tuple(dataclasses.replace(fixture, parts=()) for fixture in fixtures),
            places=tuple(places.values()),
            seed=int(seed),
            stream=stream,
            goals=tuple(goal for goal in self.goals if isinstance(goal, Goal)),
            functions=tuple(goal for goal in self.goals if isinstance(goal, GoalFunction)),
            disturbance=disturbance,
        )
        if taught is None:
            return drawn
        hand = (
            ()
            if taught.hand is None
            else sampling.draw_hand(taught.hand, objects, places, generator(seed, stream, "hand"))
        )
        return dataclasses.replace(
            drawn,
            noise=sampling.draw_noise(taught.noise, generator(seed, stream, "noise")),
            tolerance=taught.tolerance,
            stage=taught.name,
            hand_start=hand,
        )


def _goals(one: object, several: Sequence[object]) -> tuple[Goal | GoalFunction, ...]:
    """All goals, from the short form for one or from the list.

    `dataclasses.replace` hands the goals of the former scene on, and the one counts that is given besides.
    """
    if one is not UNSAID and not isinstance(several, _Goals) and one is not None and several:
        raise FieldError(
            "a scene has a 'goal' or 'goals', and both are given: put the one into the list", "goals"
        )
    of_list = one is UNSAID or (one is None and not isinstance(several, _Goals))
    every = several if of_list else () if one is None else (one,)
    found: list[Goal | GoalFunction] = []
    if not isinstance(every, Sequence) or isinstance(every, str):
        raise FieldError(f"'goals' should be a list of goals, found {every!r:.100}", "goals")
    for i, goal in enumerate(every):
        if not isinstance(goal, Goal | GoalFunction) and not callable(goal):
            raise FieldError(
                f"a goal is a Goal, such as Goal('cup', on='table'), or a function, found {goal!r:.100}",
                "goals",
                i,
            )
        found.append(goal if isinstance(goal, Goal | GoalFunction) else GoalFunction.of(goal))
    return _Goals(found)


_LISTED = {
    "fixtures": ((str, FixtureSpec), "names of fixtures, or of Fixture"),
    "spots": ((SpotSpec,), "SpotSpec"),
    "stages": ((CurriculumStage,), "CurriculumStage"),
}
"""What may stand in the lists of a scene."""


def _check_kinds(
    robot: object, name: object, objects: object, disturbed: object, lists: Mapping[str, object]
) -> None:
    """What a scene is made of is of the right types.

    Raises:
        FieldError: Something is not.
    """
    for field_name, said, none in (
        ("robot", robot, False),
        ("name", name, False),
        ("disturbed", disturbed, True),
    ):
        if not isinstance(said, str) and not (none and said is None):
            raise FieldError(f"'{field_name}' should be text, found {short(said)}", field_name)
    if not isinstance(objects, Mapping):
        raise FieldError(
            f"'objects' should be a mapping of names to objects, found {short(objects)}", "objects"
        )
    for field_name, found in lists.items():
        kinds, words = _LISTED[field_name]
        if not isinstance(found, Sequence) or isinstance(found, str):
            raise FieldError(f"'{field_name}' should be a list of {words}, found {short(found)}", field_name)
        for i, entry in enumerate(found):
            if not isinstance(entry, kinds):
                raise FieldError(
                    f"'{field_name}' should be a list of {words}, found {short(entry)} in it", field_name, i
                )


class _Goals(tuple[Goal | GoalFunction, ...]):
    """Goals of a scene that was made."""

    __slots__ = ()


def _fixtures(said: Sequence[str | FixtureSpec]) -> tuple[str | FixtureSpec, ...]:
    """All fixtures, the table among them, files by paths that are found from every folder."""
    out: list[str | FixtureSpec] = ["table"]
    for i, entry in enumerate(said):
        with within("fixtures", i):
            check_parameters(entry)
            load_fixture(entry)
        if isinstance(entry, FixtureSpec):
            if is_file(entry.fixture, FURNITURE):
                entry = dataclasses.replace(entry, fixture=str(own_file(entry.fixture)))
            if entry.fixture == "table" and not entry.name and out[0] == "table":
                out[0] = entry
                continue
        elif is_file(entry, FURNITURE):
            entry = str(own_file(entry))
        if isinstance(entry, FixtureSpec) or entry not in out:
            out.append(entry)
    return tuple(out)


def _require(what: str, name: str, known: Collection[str], where: tuple[str | int, ...]) -> None:
    if name not in known:
        raise FieldError(
            f"the scene's {what} names '{name}', which is not in it{nearest(name, known)}", *where
        )


def _check_no_part(name: str, reference: str, fixtures: Sequence[Fixture]) -> None:
    """An object starts on no part of a fixture, which has no surface for it as a place has."""
    for fixture in fixtures:
        if reference in [part.name for part in fixture.parts]:
            near = next((place.name for place in fixture.places), "table")
            raise FieldError(
                f"object '{name}' is on '{reference}', which is a part that moves, and no place: name a "
                f"place of the furniture, such as '{near}', or 'inside {reference}' where that is hollow",
                "objects",
                name,
                "on",
            )


def _require_place(
    what: str, word: str, name: str, known: Collection[str], where: tuple[str | int, ...]
) -> None:
    if name not in known:
        kind = "an object" if word == "beside" else "a place"
        nor = "" if word == "beside" or where[0] == "spots" else ", nor an object of it"
        raise FieldError(
            f"{what} is {word} '{name}', which is not {kind} of the scene{nor}{nearest(name, known)}", *where
        )
