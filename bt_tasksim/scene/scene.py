"""A scene: a robot, fixtures and objects, and how worlds with them are drawn."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from bt_tasksim.core.errors import FieldError, InputError, nearest, within
from bt_tasksim.core.names import check_name
from bt_tasksim.core.plain import shown
from bt_tasksim.core.renamed import renamed_arguments, renamed_fields
from bt_tasksim.core.resources import is_file
from bt_tasksim.scene import sampling
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor, check_seed, generator
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.specs import Goal, HandStart, ObjectSpec, SpotSpec, object_spec


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
        disturbed: The object named here is knocked out of the hand at a random moment.
        stages: The curriculum of a training in this scene, in order.
        name: Name of the scene in results.
    """

    robot: str = "panda"
    fixtures: Sequence[str] = ()
    objects: Mapping[str, ObjectSpec | str] = field(default_factory=dict)
    spots: Sequence[SpotSpec] = ()
    goal: Goal | None = None
    disturbed: str | None = None
    stages: Sequence[CurriculumStage] = ()
    name: str = "scene"

    def __post_init__(self) -> None:
        for stage in self.stages:
            for name in (*stage.objects, *([stage.hand.over] if stage.hand else ())):
                if not all(name in scene.objects for scene in (self, *stage.scenes)):
                    raise InputError(
                        f"stage '{stage.name}' names the object '{name}', which is not in the scene"
                        f"{nearest(name, self.objects)}"
                    )
        if not self.name.isprintable():
            raise FieldError(f"the name of a scene should be printable, found '{shown(self.name)}'", "name")
        specs = {}
        for name, spec in self.objects.items():
            with within("objects", name):
                specs[check_name(name, "the name of an object")] = object_spec(name, spec)
        if is_file(self.robot):  # found from every folder that the scene travels to
            object.__setattr__(self, "robot", str(Path(self.robot).resolve()))
        object.__setattr__(self, "objects", specs)
        for i, name in enumerate(self.fixtures):
            with within("fixtures", i):
                load_fixture(name)
        fixtures = (str(Path(name).resolve()) if is_file(name) else name for name in self.fixtures)
        object.__setattr__(self, "fixtures", tuple(dict.fromkeys(("table", *fixtures))))
        places = {p.name for f in self.fixtures for p in load_fixture(f).places}
        for i, spot in enumerate(self.spots):
            _require_place(f"spot '{spot.name}'", spot.on, places, ("spots", i, "on"))
            places.add(spot.name)
        for name, spec in specs.items():
            _require_place(f"object '{name}'", spec.on, places, ("objects", name, "on"))
        if self.goal is not None and self.goal.place in specs and self.goal.place not in places:
            raise FieldError(
                f"the scene's goal is on the object '{self.goal.place}', and goals on objects are "
                f"not supported: name a place instead: {', '.join(sorted(places))}",
                "goal",
                "place",
            )
        for where, wanted, known in (
            (("goal", "object"), self.goal.object if self.goal else None, specs),
            (("disturbed",), self.disturbed, specs),
            (("goal", "place"), self.goal.place if self.goal else None, places),
        ):
            if wanted is not None and wanted not in known:
                raise FieldError(
                    f"the scene's {where[0]} names '{wanted}', which is not in it{nearest(wanted, known)}",
                    *where,
                )

    @property
    def object_names(self) -> Collection[str]:
        """Names of its objects."""
        return self.objects.keys()

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
            InputError: The objects do not fit on their places, or there is no such stage.
        """
        check_seed(seed)
        if stage is not None and not 0 <= stage < len(self.stages):
            raise InputError(f"scene '{self.name}' has {len(self.stages)} stages, and none number {stage}")
        taught = None if stage is None else self.stages[stage]
        if taught is not None and taught.scenes:
            k = int(generator(seed, stream, "variant").integers(len(taught.scenes)))
            return taught.scenes[k].with_robot(self.robot)._draw(seed, stream, taught)
        return self._draw(seed, stream, taught)

    def _draw(self, seed: int, stream: str, taught: CurriculumStage | None) -> ActorConfiguration:
        rng = generator(seed, stream, "scene")
        fixtures = tuple(load_fixture(name) for name in self.fixtures)
        places = {p.name: p for f in fixtures for p in f.place_models()}
        for spot in self.spots:
            places[spot.name] = sampling.draw_spot(spot, places, rng)
        objects: list[ObjectActor] = []
        for name, usual in self.objects.items():
            spec = usual if taught is None else taught.objects.get(name, usual)
            assert isinstance(spec, ObjectSpec)
            objects.append(sampling.draw_object(name, spec, places, objects, rng))
        if taught is not None and taught.tilt is not None:
            sampling.tilt_access(taught.tilt, objects, places, generator(seed, stream, "approach"))
        disturbance = None if self.disturbed is None else sampling.draw_disturbance(self.disturbed, rng)
        drawn = ActorConfiguration(
            robot=self.robot,
            objects=tuple(objects),
            fixtures=fixtures,
            places=tuple(places.values()),
            seed=int(seed),
            stream=stream,
            goal=self.goal,
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


def _require_place(what: str, place: str, places: set[str], where: tuple[str | int, ...]) -> None:
    if place not in places:
        raise FieldError(
            f"{what} is on '{place}', which is not a place of the scene{nearest(place, places)}", *where
        )
