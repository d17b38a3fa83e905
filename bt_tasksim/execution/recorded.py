"""What the log of a run says about the run: checked, and believed in numbers and names only.

A log may come from anybody. What a replay trusts is this machine's own simulation, the bundled robots, meshes
and policies, and what its caller names. An address, a file or a robot that stands in the log is never opened
because it stands there: where the run needs one, the caller has to name it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.json_text import parse_json
from bt_tasksim.core.registry import parts
from bt_tasksim.core.renamed import former_names, with_present_names
from bt_tasksim.core.resources import asset
from bt_tasksim.core.world import PlaceModel
from bt_tasksim.demos_decomp.log import Demonstration, Log
from bt_tasksim.engines.base import engine_class
from bt_tasksim.engines.remote.configurations import check
from bt_tasksim.engines.remote.plain import from_plain, shown
from bt_tasksim.execution.pipelines import EngineOptions, local_engines
from bt_tasksim.execution.run_log import ABOUT, read_text
from bt_tasksim.execution.runner import LONGEST
from bt_tasksim.policy.library import PROGRAMMED, is_bundled
from bt_tasksim.policy.policy import concept_name
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.configuration import ActorConfiguration, Disturbance, ObjectActor, goals_in
from bt_tasksim.scene.fixtures import Fixture, FixturePlace
from bt_tasksim.scene.goal_functions import GoalFunction
from bt_tasksim.scene.specs import Goal
from bt_tasksim.trees.load import Leaves
from bt_tasksim.trees.walk import nodes_of

ROLES = {"engines": "physics", "perception": "postprocess", "kinematics": "kinematics"}
"""Options that name an engine, and its role."""
LATER = 5.0
"""Seconds for which a repetition may go on when the recorded run has ended, or as long again if that is more:
concepts may be slower by now."""
MOST_PHYSICS = 2_000
"""Hz of physics."""


@dataclass(frozen=True)
class Given:
    """What the caller of a replay names, and so trusts.

    Attributes:
        robot: Name or file of the robot; by default a bundled one that the log names.
        policies: Concepts, and the policies that their leaves take.
        objects: Folder of mesh files, besides the bundled ones.
        nodes: Concepts and conditions by name, besides the bundled ones.
    """

    robot: str | None = None
    policies: Sequence[tuple[str, str]] = ()
    objects: str | Path | None = None
    nodes: Leaves = field(default_factory=dict)


@dataclass(frozen=True)
class Recorded:
    """A run as its log tells it.

    Attributes:
        demonstration: The log's content.
        configuration: The world as drawn; its files are bundled ones or the caller's.
        options: Which engines; all of them of this machine's own.
        longest: Seconds after which the repetition is stopped.
        scenario: What was run.
        versions: Versions by name, and policies by leaf.
        tree: Its tree as XML; empty where XML cannot hold it.
        policies: For each concept, the number of its node and what it named to get its policy.
        success: Whether it says that it succeeded; None where it does not say it.
        reason: Why not, by name; empty where it does not say it.
        about: All that it says about the run, by name.
        description: What the whole log says of it; may be empty.
        robot_named: The robot is the caller's, and may be called otherwise.
    """

    demonstration: Demonstration
    configuration: ActorConfiguration
    options: EngineOptions
    longest: float
    scenario: str
    versions: Mapping[str, str]
    tree: str
    policies: Sequence[tuple[int, str]]
    success: bool | None
    reason: str
    about: Mapping[str, Any]
    description: str
    robot_named: bool


def recorded_run(log: Log, given: Given, where: str) -> Recorded:
    """The run in a log.

    Args:
        log: The log, of one run.
        given: What the caller names.
        where: The log, for messages.

    Raises:
        InputError: It is no run's, its content is faulty, or it wants something that the caller has to name.
    """
    demonstration = log.demonstrations[0]
    texts = {name: _text(demonstration, name, where) for name in ("about", "configuration", "tree")}
    about = _mapping(_json(texts["about"], f"{where}: run/about"), f"{where}: run/about")
    for key in about:
        if key not in ABOUT:
            raise InputError(f"{where}: run/about has an unknown key {shown(key)}{nearest(key, ABOUT)}")
    recorded = float(demonstration.time[-1])
    duration = recorded + max(recorded, LATER)
    longest = from_plain(float, about.get("longest", LONGEST), f"{where}: longest")
    versions = {
        **_words(about.get("versions", {}), f"{where}: versions"),
        **{
            f"policy of '{leaf}'": name
            for leaf, name in _words(about.get("policies", {}), f"{where}: policies").items()
        },
    }
    return Recorded(
        demonstration=demonstration,
        configuration=_configuration(texts["configuration"], given, where),
        options=_options(_mapping(about.get("options", {}), f"{where}: options"), where),
        longest=max(min(longest, duration), 0.0),
        scenario=from_plain(str, about.get("scenario", ""), f"{where}: scenario"),
        versions=versions,
        tree=texts["tree"],
        policies=_policies(demonstration, where),
        success=from_plain(bool, about["success"], f"{where}: success") if "success" in about else None,
        reason=from_plain(str, about.get("reason", ""), f"{where}: reason"),
        about=about,
        description=log.description,
        robot_named=given.robot is not None,
    )


def take_policies(
    root: Behaviour, recorded: Recorded, given: Given, where: str, *, trusted: bool = False
) -> None:
    """Have each leaf take the policy that it had, whatever is pinned by now.

    Args:
        root: The tree.
        recorded: What the log says.
        given: What the caller names, which counts for more.
        where: The log, for messages.
        trusted: The tree comes from the caller, and its leaves may name policies by path.

    Raises:
        InputError: The tree is not the recorded one, or a policy is wanted that the caller has to name.
    """
    nodes = nodes_of(root)
    named = {concept.lower(): policy for concept, policy in given.policies}
    had = dict(recorded.policies)
    statuses = recorded.demonstration.extra["tree/status"]
    other = trusted and statuses.shape[1:] != (len(nodes),)
    for number in had:
        other = other or not 0 <= number < len(nodes) or not isinstance(nodes[number], ConceptNode)
    if other:
        raise InputError(f"{where} was recorded with another tree; give that one")
    concepts = {concept_name(type(leaf.model)) for leaf in nodes if isinstance(leaf, ConceptNode)}
    for concept in named:
        if concept not in concepts:
            raise InputError(
                f"a policy is given for '{concept}', and the run has no leaf of this concept"
                f"{nearest(concept, concepts)}"
            )
    for number, leaf in enumerate(nodes):
        if not isinstance(leaf, ConceptNode):
            continue
        concept, source = concept_name(type(leaf.model)), had.get(number, "")
        if concept in named:
            leaf.policy = named[concept]
        elif trusted and leaf.policy and not is_bundled(source):
            continue
        elif source:
            leaf.policy = source
        if leaf.policy and concept not in named and leaf.policy != PROGRAMMED and not is_bundled(leaf.policy):
            raise InputError(
                f"{where}: leaf {shown(leaf.name)} ran with the policy {leaf.policy[:200]!r}, which is not a "
                f"bundled one; name it: --policy {concept}=FOLDER"
            )


# ---- parts of the log -------------------------------------------------------------------------------------


def _text(demonstration: Demonstration, name: str, where: str) -> str:
    values = demonstration.extra.get(f"run/{name}")
    if values is None or "tree/status" not in demonstration.extra:
        raise InputError(f"{where} is a demonstration, not the log of a run; only a run can be replayed")
    if values.size != 1 or values.dtype.kind not in "SO":
        raise InputError(f"{where}: run/{name} should hold one text")
    return read_text(values)


def _json(text: str, where: str) -> Any:
    return parse_json(text, where)


def _mapping(value: Any, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where} should be a mapping, found {shown(value)}")
    return value


def _words(value: Any, where: str) -> dict[str, str]:
    found: dict[str, str] = from_plain(dict[str, str], value, where)
    return found


def _options(content: Mapping[str, Any], where: str) -> EngineOptions:
    """Engines of this machine; files and keys that a log names count for nothing."""
    known = {f.name for f in dataclasses.fields(EngineOptions)}
    unknown = sorted(set(content) - known)
    if unknown:
        raise InputError(
            f"{where} was run with the option {shown(unknown[0])}, which this version does not have"
        )
    chosen: dict[str, Any] = {}
    for option, role in ROLES.items():
        if option not in content:
            continue
        engines = local_engines(role)
        name = from_plain(str, content[option], f"{where}: {option}")
        if name.partition(":")[0] not in engines or not engine_class(role, name).in_logs(name):
            raise InputError(
                f"{where} was run with {option} {shown(name)}; only a run in which all engines were this "
                f"machine's own ({', '.join(engines)}) can be replayed"
            )
        chosen[option] = name
    chosen |= {
        name: from_plain(kind, content[name], f"{where}: {name}")
        for name, kind in (("noise", str), ("safety", bool))
        if name in content
    }
    return EngineOptions(**chosen)


def _policies(demonstration: Demonstration, where: str) -> list[tuple[int, str]]:
    if "run/policies" not in demonstration.extra:  # an older log: all were programmed
        return []
    entries = _json(_text(demonstration, "policies", where), f"{where}: run/policies")
    if not isinstance(entries, list):
        raise InputError(f"{where}: run/policies should be a list, found {shown(entries)}")
    found = []
    for entry in entries:
        entry = _mapping(entry, f"{where}: run/policies")
        number, source = entry.get("node"), entry.get("source")
        found.append(
            (
                from_plain(int, number, f"{where}: node of a policy"),
                from_plain(str, source, f"{where}: source of a policy"),
            )
        )
    return found


# ---- the world --------------------------------------------------------------------------------------------

_PARTS: Mapping[type, Mapping[str, type]] = {
    ActorConfiguration: {
        "objects": ObjectActor,
        "fixtures": Fixture,
        "places": PlaceModel,
        "goals": Goal,
        "functions": GoalFunction,
        "disturbance": Disturbance,
    },
    Fixture: {"boxes": Box, "places": FixturePlace},
}
"""Dataclasses in fields of dataclasses, one or several."""


def _configuration(text: str, given: Given, where: str) -> ActorConfiguration:
    data = _json(text, f"{where}: run/configuration")
    data = _with_defaults(ActorConfiguration, _mapping(data, f"{where}: run/configuration"))
    configuration: ActorConfiguration = from_plain(ActorConfiguration, data, f"{where}: run/configuration")
    robot = load_robot(_robot(configuration.robot, given, where))
    try:
        check(dataclasses.replace(configuration, robot=robot.name), robot)
        if configuration.physics_frequency > MOST_PHYSICS:
            raise InputError(
                f"physics runs at {configuration.physics_frequency} Hz, more than {MOST_PHYSICS}"
            )
    except InputError as error:
        raise InputError(f"{where}: run/configuration: {error}") from error
    objects = tuple(
        dataclasses.replace(actor, mesh=_mesh(actor.mesh, given, where)) if actor.mesh else actor
        for actor in configuration.objects
    )
    named = given.robot if given.robot is not None else configuration.robot
    return dataclasses.replace(configuration, robot=named, objects=objects)


def _with_defaults(kind: Any, data: Any) -> Any:
    """Plain data of a dataclass, with what an older log lacks or calls otherwise."""
    if not isinstance(data, dict):
        return data
    parts = _PARTS.get(kind, {})
    full = {
        f.name: list(f.default) if isinstance(f.default, tuple) else f.default
        for f in dataclasses.fields(kind)
        if f.default is not dataclasses.MISSING
    }
    for name, value in with_present_names(data, former_names(kind)).items():
        part = parts.get(name)
        if name == "goals":
            value = list(goals_in(value))
        if part is not None and isinstance(value, list):
            value = [_with_defaults(part, v) for v in value]
        elif part is not None:
            value = _with_defaults(part, value)
        full[name] = value
    return full


def _robot(name: str, given: Given, where: str) -> str:
    if given.robot is not None:
        return given.robot
    if name not in parts("robot"):
        raise InputError(
            f"{where} was run with the robot {name[:200]!r}, which is no bundled one; name it: --robot FILE, "
            f"or --plugin FILE where a plugin has it"
        )
    return name


def _mesh(path: str, given: Given, where: str) -> str:
    """A mesh file of this name in the caller's folder, or among the bundled ones."""
    name, home = PurePath(path).name, asset("objects")
    folders = [Path(given.objects)] if given.objects is not None else []
    if PurePath(path).parent.parts[-2:] == home.parts[-2:]:
        folders.append(home)
    for folder in folders:
        if (folder / name).is_file():
            return str(folder / name)
    raise InputError(
        f"{where} was run with the mesh file {path[:200]!r}, which is not a bundled one; name its folder: "
        "--objects FOLDER"
    )
