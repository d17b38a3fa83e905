"""What a scene says of its things, and from which ranges they are drawn."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core.errors import FieldError, nearest, within
from bt_tasksim.core.known_arguments import known_arguments
from bt_tasksim.core.names import check_name
from bt_tasksim.core.own_files import beside_code, not_there
from bt_tasksim.core.plain import short, shown
from bt_tasksim.core.registry import parts
from bt_tasksim.core.renamed import renamed_fields
from bt_tasksim.core.resources import asset, is_file
from bt_tasksim.core.typed_file import Model, checked, plain
from bt_tasksim.scene.geometry import Colour
from bt_tasksim.scene.grips import GivenGrip
from bt_tasksim.scene.object_file import given_grip, load_object, object_fields, object_file
from bt_tasksim.scene.object_schema import GraspEntry
from bt_tasksim.scene.shapes import shape_kind
from bt_tasksim.scene.spec_fields import (
    FixtureFields,
    GoalFields,
    HandFields,
    ObjectFields,
    Parameter,
    SpotFields,
)

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

SPLITS = ("all", "even", "odd")
"""Parts of a range from which draws are made, see `ObjectSpec`."""
STARTS = ("on", "inside", "beside")
"""Words that say where an object starts, and in goals where it should be."""
MOMENTS = ("end", "once", "kept")
"""When a goal has to be true, see `Goal`."""
OLD_RELATION = "stands"
"""What files of version 0.1 call the goal relation ``on``."""


@renamed_fields(strips="split")
@known_arguments("an object", at="centre", heading="yaw", kind="kinds", object="file", scale="size")
@dataclass(frozen=True)
class ObjectSpec:
    """What an object may be; ranges are uniform.

    It starts ``on`` a place or an object, ``inside`` a container or an object, or ``beside`` an object: one
    of the three.

    Attributes:
        kinds: One or several to draw from, such as ``("box", "cylinder")``; may be left out with a ``file``.
        on: Name of the place where it starts, or of the object on top of which it starts.
        area: Half sizes ``(2,)`` in metres of the rectangle on that place in which its centre is drawn; None
            for the place's own default.
        centre: Centre ``(2,)`` of that rectangle in the place's frame, metres.
        yaw: Half width in radians of the range of its heading about that of what it is on; or the lowest and
            the highest heading.
        size: Full size ``(3,)``, or low and high ones ``((3,), (3,))``, in metres; None for the kind's own
            range, or the size of the mesh file.
        mass: In kg, or low and high.
        friction: Friction coefficient, or low and high.
        exponents: Low and high shape exponents ``(e1, e2)`` of a superellipsoid; or ``((e1, e2), (e1, e2))``
            where the two have ranges of their own.
        mesh: Path of a mesh file, or the name of a bundled one such as ``mug.obj``, for kind ``mesh``.
        split: Which of the ten equal strips of each range of size and exponents are drawn from: ``all``,
            ``even`` or ``odd`` ones. This keeps draws apart where both have the same ranges; where these
            differ, strips overlap.
        size_error: Half width of the relative error with which the size is known beforehand.
        inside: Name of the container, a place or an object, in which it starts; ``area`` is all of it by
            default.
        beside: Name of the object beside which it starts, on the same place.
        distance: Metres between its outline and that of the object beside which it starts, at most.
        gap: Metres between it and what stands at the same height, at least.
        movable: It may be shifted and tilted in a run: then it does not count as knocked over.
        file: Path of an object file, or name of a bundled one, which says what is left at its default here.
        colour: RGB colour (sRGB, 0 to 1), or the name of one; None for one of its kind's.
        grasps: Where two fingers may hold it, in its own frame; empty for what its kind says.
        symmetry: Order of its symmetry about z, 0 for a body of revolution; None for its kind's.
        category: What people call things like it; empty for its kind.

    Raises:
        FieldError: A field is no good, or it is said in no way or in several ways where it starts.
    """

    kinds: tuple[str, ...] | str = ()
    on: str = ""
    area: tuple[float, float] | None = None
    centre: tuple[float, float] = (0.0, 0.0)
    yaw: float | tuple[float, float] = np.pi
    size: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    mass: tuple[float, float] = (0.08, 0.25)
    friction: tuple[float, float] = (0.4, 0.9)
    exponents: tuple[float, float] | tuple[tuple[float, float], tuple[float, float]] = (0.2, 1.0)
    mesh: str | None = None
    split: str = "all"
    size_error: float = 0.0
    inside: str = ""
    beside: str = ""
    distance: float = 0.10
    gap: float = 0.005
    movable: bool = False
    file: str | None = None
    colour: Colour | None = None
    grasps: tuple[GivenGrip, ...] = ()
    symmetry: int | None = None
    category: str = ""

    def __post_init__(self) -> None:
        for item in dataclasses.fields(self):
            object.__setattr__(self, item.name, plain(getattr(self, item.name)))
        if self.file is not None:
            if not isinstance(self.file, str):
                raise FieldError(f"an object: 'file' should be text, found {short(self.file)}", "file")
            self._complete(self.file)
        if isinstance(self.mesh, str):
            own, bundled = beside_code(self.mesh), asset("objects", Path(self.mesh).name)
            by_name = self.mesh == bundled.name and bundled.is_file() and not Path(own).is_file()
            object.__setattr__(self, "mesh", str(bundled) if by_name else own)
            if not Path(self.mesh).is_file():
                raise FieldError(not_there("mesh file", self.mesh), "mesh")
        if isinstance(self.kinds, str):
            object.__setattr__(self, "kinds", (self.kinds,))
        if self.kinds in ((), []) and self.mesh is not None:
            object.__setattr__(self, "kinds", ("mesh",))
        if self.kinds is None or self.kinds in ((), []):
            raise FieldError("an object needs 'kinds', a 'mesh', or a 'file' that says what it is", "kind")
        fields = checked(
            ObjectFields, {name: getattr(self, name) for name in ObjectFields.model_fields}, "an object"
        )
        for name in ObjectFields.model_fields:
            object.__setattr__(self, name, getattr(fields, name))
        said = [word for word in STARTS if getattr(self, word)]
        if len(said) != 1:
            found = f"found {' and '.join(map(repr, said))}" if said else "and none is given"
            raise FieldError(f"an object starts 'on', 'inside' or 'beside' one thing: {found}", *said[1:2])
        if not self.beside and self.distance != ObjectSpec.distance:
            raise FieldError("'distance' is for an object that starts 'beside' another one", "distance")
        if self.split not in SPLITS:
            raise FieldError(f"unknown split '{self.split}'{nearest(self.split, SPLITS)}", "split")
        if not 0.0 <= self.size_error < 1.0:
            raise FieldError(
                f"'size_error' should be at least 0 and below 1, found {self.size_error:g}", "size_error"
            )
        for kind in self.kinds:
            with within("kind"):
                shape_kind(kind)
        if (self.mesh is not None) != any(shape_kind(kind).from_file for kind in self.kinds):
            raise FieldError(
                "an object's 'mesh' belongs to a kind that comes from a file, such as 'mesh': "
                + (
                    f"its kind is '{self.kinds[0]}'"
                    if self.mesh is not None
                    else "the path of a file is missing"
                ),
                "mesh",
            )
        object.__setattr__(
            self, "grasps", tuple(map(self._measured, range(len(fields.grasps)), fields.grasps))
        )

    def _measured(self, i: int, grasp: GivenGrip | GraspEntry) -> GivenGrip:
        """A grasp whose width is known."""
        with within("grasps", i):
            return (
                grasp
                if isinstance(grasp, GivenGrip)
                else given_grip(grasp, self.kinds[0], self.size, self.mesh)
            )

    @property
    def start(self) -> tuple[str, str]:
        """How it starts and what that refers to, such as ``("on", "table")``."""
        return next((word, getattr(self, word)) for word in STARTS if getattr(self, word))

    def _complete(self, file: str) -> None:
        """Take from an object file what is at its default; afterwards it is as if written here."""
        path = object_file(file)
        told = object_fields(load_object(path), path)
        for item in dataclasses.fields(self):
            if item.name in told and getattr(self, item.name) == item.default:
                object.__setattr__(self, item.name, told[item.name])
        object.__setattr__(self, "file", None)


@dataclass(frozen=True)
class FixtureSpec:
    """A fixture and where it stands; `bt_tasksim.Fixture` is this class.

    Attributes:
        fixture: Name of a bundled fixture, or path of a data file.
        at: Where its origin is ``(x, y)`` or ``(x, y, z)``, robot base frame, metres; None for where its file
            says.
        yaw: Its heading in the robot base frame, radians, or the lowest and the highest one that it may have;
            None for the file's.
        area: Half sizes ``(2,)`` in metres of the rectangle about ``at``, along the axes of the robot base
            frame, in which its origin is drawn; by default it is always there.
        name: Its own name, where the same fixture is there several times. The place that has the fixture's
            name gets this one, and other places ``<name>_<place>``; its parts likewise.
        sensed: The robot sees how far its parts are open; None for what the file says.
        parameters: Of a fixture that is made by numbers, by name: a value, two numbers between which each
            world draws one, or several words of which it chooses one; the others as the fixture says.

    Raises:
        FieldError: A number is no good, or the name cannot be one.
    """

    fixture: str
    at: tuple[float, ...] | None = None
    yaw: float | tuple[float, float] | None = None
    name: str = ""
    area: tuple[float, float] = (0.0, 0.0)
    sensed: bool | None = None
    parameters: Mapping[str, Parameter] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        _keep(self, FixtureFields, "a fixture")
        if self.name:
            check_name(self.name, "the name of a fixture")


@known_arguments("a spot", at="centre", heading="yaw")
@dataclass(frozen=True)
class SpotSpec:
    """A spot marked on another place, where something is to stand.

    Attributes:
        name: The spot's name, a place like any other.
        on: Name of the place it lies on.
        centre: Centre ``(2,)`` of the rectangle in which it is drawn, in that place's frame, metres.
        area: Half sizes ``(2,)`` of that rectangle, metres; by default it is always at its centre.
        extent: Full size ``(2,)`` of the spot, metres.
        yaw: Half width in radians of the range of its heading about that of what it is on; or the lowest and
            the highest heading.

    Raises:
        FieldError: A field is no good.
    """

    name: str
    on: str
    centre: tuple[float, float] = (0.0, 0.0)
    area: tuple[float, float] = (0.0, 0.0)
    extent: tuple[float, float] = (0.12, 0.12)
    yaw: float | tuple[float, float] = 0.0

    def __post_init__(self) -> None:
        check_name(self.name, "the name of a spot")
        _keep(self, SpotFields, f"spot '{self.name}'")


@dataclass(frozen=True)
class HandStart:
    """Where the hand is when an episode begins, instead of in its rest posture.

    Attributes:
        over: Name of the object that it is above.
        height: Lowest and highest height above the object's centre, metres.
        aside: Half width of the square about the object's centre, metres.
        turn: Half width of the range of its turn from its neutral orientation, pointing down, radians.

    Raises:
        FieldError: A field is no good.
    """

    over: str
    height: tuple[float, float] = (0.20, 0.30)
    aside: float = 0.04
    turn: float = 0.4

    def __post_init__(self) -> None:
        _keep(self, HandFields, "the start of a hand")
        if self.height[0] > self.height[1]:
            raise FieldError(
                f"the start of a hand: 'height' should be the lower one first, found {self.height}", "height"
            )


TOLERANCES = ("position_tolerance", "angle_tolerance")
"""Fields of a goal that a relation may have its own default of."""


@known_arguments("a goal")
@dataclass(frozen=True, init=False)
class Goal:
    """Where an object should be, judged by the hidden state.

    ``Goal("can", inside="trash_bin")``, ``Goal("cup", on="lower_board")``, ``Goal("red", on="blue")`` and
    ``Goal("box", beside="cup")`` say the reference and the relation in one; ``Goal("cup", "table")`` means
    ``on``.

    Attributes:
        object: Name of the object.
        place: What it refers to: name of a place, or of another object, wherever that is then. Empty where
            the relation needs none.
        relation: Name of a goal relation (`bt_tasksim.scene.relations`): ``on`` (upright on a place's origin,
            with its heading up to the object's symmetry; or on the middle of an object's top), ``anywhere``
            (upright anywhere on a place or an object), ``inside`` (within a container, below its rim, or
            within an object), ``beside`` (at the same level, ``distance`` away at most), ``lifted`` (held in
            the hand alone, ``height`` above where it stood, and as upright), ``on_end`` and ``lying``
            (it rests with its longest axis upright, or level), ``turned``, ``oriented`` and ``pointing_up``
            (it hangs in the hand, turned by ``value`` about ``axis`` from how it stood or from how a place or
            another object is turned, or with its own ``axis`` upwards), or one of your own.
        position_tolerance: Metres; None for the relation's own, 0.03 of most, 0.01 of parts of fixtures
            and of what is inserted.
        angle_tolerance: Radians; pi for any heading and any way up. None for the relation's own, 10 degrees
            of most and 5 of parts of fixtures.
        height: Metres, for ``lifted``.
        when: ``end``: true at the end of the run. ``once``: true at some moment of it. ``kept``: true for
            ``duration`` of it without a break.
        distance: Metres between the two outlines: for ``beside`` at most, for ``clear_of`` at least.
        value: How far a part of a fixture should be open, for ``open`` (at least) and ``set``: metres or
            radians; None for the relation's own. Of ``turned`` and ``oriented`` an angle, radians.
        axis: Of ``turned`` (robot base frame), ``oriented`` (the place's) and ``pointing_up`` (the object's):
            a direction ``(3,)``; None for that of z.
        duration: Seconds, of ``kept``.

    Raises:
        FieldError: A field is no good, or the reference is missing or named twice.
    """

    object: str
    place: str = ""
    relation: str = "on"
    position_tolerance: float = 0.03
    angle_tolerance: float = float(np.deg2rad(10.0))
    height: float = 0.3
    when: str = "end"
    distance: float = 0.10
    value: float | None = None
    axis: tuple[float, float, float] | None = None
    duration: float = 1.0

    def __init__(
        self,
        object: str,
        place: str = "",
        relation: str = "on",
        position_tolerance: float | None = None,
        angle_tolerance: float | None = None,
        height: float = 0.3,
        when: str = "end",
        distance: float = 0.10,
        value: float | None = None,
        axis: tuple[float, float, float] | None = None,
        duration: float = 1.0,
        *,
        on: str = "",
        inside: str = "",
        beside: str = "",
    ) -> None:
        lengths = {
            "position_tolerance": position_tolerance,
            "angle_tolerance": angle_tolerance,
            "height": height,
            "distance": distance,
            "value": value,
            "axis": axis,
            "duration": duration,
        }
        words = {"place": place, "on": on, "inside": inside, "beside": beside}
        words = {name: "" if word is None else word for name, word in words.items()}
        told = {"object": object, "relation": relation, "when": when}
        fields = checked(GoalFields, {**told, **words, **lengths}, "a goal")
        object, place = fields.object, fields.place
        named = {word: name for word in STARTS if (name := getattr(fields, word))}
        if len(named) + bool(place) > 1:
            said = [f"{word}='{name}'" for word, name in named.items()]
            said = [f"'{place}'", *said] if place else said
            raise FieldError(f"a goal of '{object}' has one reference, found {' and '.join(said)}", "place")
        relation = "on" if relation == OLD_RELATION else relation
        for word, name in named.items():
            if word != "on" and relation not in ("on", word):
                raise FieldError(
                    f"a goal of '{object}' is {word} '{name}' or it is '{relation}': for another relation "
                    f"write on='{name}', relation='{relation}'",
                    "relation",
                )
            place, relation = name, word if relation == "on" else relation
        relations = parts("goal relation")
        if relation not in relations:
            raise FieldError(f"unknown relation '{relation}'{nearest(relation, relations)}", "relation")
        if not place and getattr(relations[relation], "needs_place", True):
            raise FieldError(
                f"the goal '{relation}' of '{object}' names no place and no object: write "
                f"Goal('{object}', on='table')",
                "place",
            )
        if place == object:
            raise FieldError(f"the goal of '{object}' refers to '{object}' itself", "place")
        if when not in MOMENTS:
            raise FieldError(f"'when' of a goal is 'end', 'once' or 'kept', found '{when}'", "when")
        if when != "kept" and fields.duration != type(self).duration:
            raise FieldError(
                f"'duration' of the goal '{relation}' of '{object}' goes with when='kept', and 'when' is "
                f"'{when}'",
                "duration",
            )
        given = {"object": object, "place": place, "relation": relation, "when": when}
        own = {name: getattr(relations[relation], name, getattr(type(self), name)) for name in TOLERANCES}
        for name, kept in {**given, **{name: getattr(fields, name) for name in lengths}}.items():
            super().__setattr__(name, own.get(name) if kept is None else kept)

    def __str__(self) -> str:
        """In words: ``cup on lower_board``."""
        return " ".join(word for word in (self.object, self.relation, self.place) if word)


def _keep(spec: DataclassInstance, model: type[Model], owner: str) -> None:
    """Check a spec's fields, and keep them as the model has them.

    Raises:
        FieldError: One is no good.
    """
    fields = checked(model, {name: getattr(spec, name) for name in model.model_fields}, owner)
    for name in model.model_fields:
        object.__setattr__(spec, name, getattr(fields, name))


def object_spec(name: str, spec: ObjectSpec | str) -> ObjectSpec:
    """The spec that ``"cup on upper_board"``, ``"mug.yaml on table"`` or ``"box beside cup"`` stands for.

    Args:
        name: The object's name, and its kind where the text names none.
        spec: The text, or a spec, which is handed on.

    Raises:
        InputError: The text does not read like that.
    """
    if isinstance(spec, ObjectSpec):
        return spec
    found = split_start(spec) if isinstance(spec, str) else None
    if found is None:
        raise FieldError(
            f"object '{name}': {shown(repr(spec))} should read '<kind> on <place>' or 'on <place>', and "
            f"'inside' or 'beside' likewise, or be an ObjectSpec"
        )
    kind, word, reference = found
    on, inside, beside = (reference if word == each else "" for each in STARTS)
    if is_file(kind):
        return ObjectSpec(on=on, inside=inside, beside=beside, file=kind)
    return ObjectSpec(kinds=(kind or name,), on=on, inside=inside, beside=beside)


def split_start(text: str) -> tuple[str, str, str] | None:
    """``"cup on table"`` as ``("cup", "on", "table")``; None where it does not read like that."""
    found = re.fullmatch(rf"\s*(?:(\S.*?)\s+)?({'|'.join(STARTS)})\s+(\S.*?)\s*", text)
    if found is None:
        return None
    kind, word, reference = found.groups()
    return kind or "", word, reference
