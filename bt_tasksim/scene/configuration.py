"""One drawn world as plain numbers: every engine builds the same from it, and logs hold it as JSON."""

from __future__ import annotations

import dataclasses
import json
import operator
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.json_text import parse_json
from bt_tasksim.core.names import check_name
from bt_tasksim.core.renamed import former_names, renamed_fields, with_present_names
from bt_tasksim.core.world import ObjectModel, Obstacle, PlaceModel, WorldModel
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.fixtures import Fixture
from bt_tasksim.scene.goal_functions import GoalFunction
from bt_tasksim.scene.grips import GivenGrip
from bt_tasksim.scene.joints import Joint
from bt_tasksim.scene.shapes import Shape, ShapeSize, object_model, shape
from bt_tasksim.scene.specs import Goal

STREAMS = {"evaluation": 0, "training": 1, "validation": 2, "demonstration": 3}
"""Names of the independent streams of draws: the same seed gives unrelated draws in each."""
LARGEST_SEED = 2**64 - 1
"""Seeds are kept in logs, as unsigned numbers of 64 bits."""


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
    """Name of the place where it starts, whatever is between them."""
    base: str = ""
    """Name of the object that it starts on or in; empty where it starts on the place itself."""
    movable: bool = False
    """It may be shifted and tilted in a run."""
    grasps: tuple[GivenGrip, ...] = ()
    """Where two fingers may hold it; empty where its kind says so."""
    symmetry: int | None = None
    """Order of its symmetry about z; None for that of its kind."""
    category: str = ""
    """What people call things like it; empty for its kind."""
    boxes: tuple[Box, ...] = ()
    """Of a part of a fixture: what it is made of, in its own frame."""
    joint: Joint | None = None
    """Of a part of a fixture: how it moves; None for what is free."""

    @classmethod
    def from_data(cls, data: Any) -> ObjectActor:
        """From what JSON holds of it, lists as tuples."""
        joint = data.get("joint")
        return cls(
            **{
                **data,
                "grasps": tuple(GivenGrip(**grip) for grip in data.get("grasps", ())),
                "boxes": tuple(Box(**box) for box in data.get("boxes", ())),
                "joint": None if joint is None else Joint.from_data(joint),
            }
        )

    def shape(self) -> Shape:
        """Its geometry."""
        return shape(self.kind, ShapeSize(self.size, self.exponents, self.mesh, self.boxes))

    def known_shape(self) -> Shape:
        """The geometry it is taken to have."""
        size = self.known_size or self.size
        return shape(self.kind, ShapeSize(size, self.exponents, self.mesh, self.boxes))

    def model(self) -> ObjectModel:
        """What is known about it beforehand."""
        return self._model(self.known_size or self.size)

    def true_model(self) -> ObjectModel:
        """The same of its true size."""
        return self._model(self.size)

    def _model(self, size: tuple[float, float, float]) -> ObjectModel:
        of_size = ShapeSize(size, self.exponents, self.mesh, self.boxes)
        joint = None if self.joint is None else self.joint.model()
        return object_model(self.name, self.kind, of_size, self.grasps, self.symmetry, joint)


@renamed_fields(lesson="stage", goal="goals")
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
        goals: What should be true; one goal alone, or None, will do.
        disturbance: What happens on the way, or None.
        noise: Name of the noise model of the estimate; empty for the engine's own.
        tolerance: In training, the sufficient cost below which a goal counts as reached.
        stage: Name of the stage it was drawn for.
        functions: Goals that are functions, of which a log knows no more than the names.
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
    goals: tuple[Goal, ...] = ()
    disturbance: Disturbance | None = None
    noise: str = ""
    tolerance: float = 1.0
    stage: str = ""
    hand_start: tuple[float, ...] = ()
    functions: tuple[GoalFunction, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "goals", goals_in(self.goals))
        for kind, things in (("an object", self.objects), ("a place", self.places)):
            for thing in things:
                check_name(thing.name, f"the name of {kind}")

    @property
    def goal(self) -> Goal | None:
        """The first goal, or None."""
        return self.goals[0] if self.goals else None

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
            data = _tuples(parse_json(text, "a drawn world"))
            data["objects"] = tuple(ObjectActor.from_data(o) for o in data["objects"])
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
            data = with_present_names(data, former_names(cls))
            data["goals"] = tuple(Goal(**goal) for goal in goals_in(data.get("goals")))
            data["functions"] = tuple(GoalFunction(**known) for known in data.get("functions", ()))
            data["disturbance"] = Disturbance(**data["disturbance"]) if data["disturbance"] else None
            return cls(**data)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"not an actor configuration: {error}") from error


def goals_in(said: Any) -> tuple[Any, ...]:
    """Several goals, where former versions had one or None; in plain data likewise."""
    if isinstance(said, list | tuple):
        return tuple(said)
    return () if said is None else (said,)


def check_seed(seed: int) -> None:
    """Check that a draw with this seed can be kept and drawn again.

    Raises:
        InputError: It cannot.
    """
    try:
        fits = 0 <= operator.index(seed) <= LARGEST_SEED
    except TypeError:
        fits = False
    if not fits:
        raise InputError(f"a seed is a whole number from 0 to {LARGEST_SEED}, found {seed!r}")


def generator(seed: int, stream: str, purpose: str) -> np.random.Generator:
    """A random generator that depends on the seed, the stream and the purpose, and on nothing else."""
    return np.random.default_rng([int(seed), STREAMS[stream], zlib.crc32(purpose.encode())])


def _tuples(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_tuples(v) for v in value)
    if isinstance(value, dict):
        return {k: _tuples(v) for k, v in value.items()}
    return value
