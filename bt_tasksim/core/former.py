"""Where the modules of version 0.1 are now, and the conversion of people's files that import them.

Nothing is imported here of what a file names: definitions are looked up in the modules' source.
"""

from __future__ import annotations

import ast
import functools
import importlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from bt_tasksim._names import SHORT
from bt_tasksim.core.errors import InputError

PACKAGE = "bt_tasksim"
FORMER: Mapping[str, str] = {
    "safety": "hardware.safety",
    "engines.ros": "hardware.ros",
    "twin": "hardware.twin",
    "poses": "core.poses",
    "errors": "core.errors",
    "files": "core.files",
    "resources": "core.resources",
    "world": "core.world",
    "interrupts": "core.interrupts",
    "robot": "robot.description",
    "safety.limits": "robot.limits",
    "engines.urdf_links": "robot.urdf_links",
    "engines.urdf_visuals": "robot.urdf_visuals",
    "scene": "scene.scene",
    "scene_file": "scene.scene_file",
    "fixtures": "scene.fixtures",
    "shapes": "scene.shapes",
    "meshes": "scene.meshes",
    "mesh_file": "scene.mesh_file",
    "surfaces": "scene.surfaces",
    "collision": "scene.overlap",
    "judge": "scene.success",
    "planning": "planning.ways",
    "motion": "planning.reference_motion",
    "pacing": "engines.clock",
    "engines.registry": "execution.pipelines",
    "engines.kinematics_pinocchio": "engines.kinematics.pinocchio",
    "engines.pinocchio_models": "robot.kinematics.models",
    "engines.physics_sapien": "engines.physics.sapien",
    "engines.physics_mujoco": "engines.physics.mujoco",
    "engines.mujoco_model": "engines.physics.mujoco_model",
    "engines.mujoco_robot": "engines.physics.mujoco_robot",
    "engines.mujoco_contacts": "engines.physics.mujoco_contacts",
    "engines.mujoco_sensing": "engines.physics.mujoco_sensing",
    "engines.disturbance": "engines.physics.disturbance",
    "engines.rendering_sapien": "engines.rendering.sapien",
    "engines.looks": "engines.rendering.materials",
    "engines.camera_errors": "engines.perception.camera_errors",
    "engines.postprocess_state": "engines.perception.state",
    "engines.postprocess_opencv": "engines.perception.opencv",
    "engines.features": "engines.perception.features",
    "engines.noise": "engines.perception.noise",
    "engines.pose_estimation": "engines.perception.pose_estimation",
    "engines.registration": "engines.perception.registration",
    "engines.segmentation": "engines.perception.segmentation",
    "concept": "concept.model",
    "context": "concept.context",
    "parameters": "concept.parameters",
    "policy": "policy.policy",
    "network": "policy.network",
    "policy_files": "policy.files",
    "policy_library": "policy.library",
    "runner": "execution.runner",
    "launch": "report.launch",
    "replay": "execution.replay",
    "report.run_log": "execution.run_log",
    "training.episode": "training.env",
    "training.follower": "training.judge",
    "training.command": "training.session",
    "checking.command": "checking.concept_file",
    "safety.checks": "hardware.safety.checks",
    "safety.engine": "hardware.safety.engine",
    "safety.guard": "hardware.safety.guard",
    "safety.guarded_robot": "hardware.safety.guarded_robot",
    "safety.guarded_simulation": "hardware.safety.guarded_simulation",
    "safety.motion": "hardware.safety.motion",
    "safety.watchdog": "hardware.safety.watchdog",
    "safety.watchdog_process": "hardware.safety.watchdog_process",
    "engines.ros.address": "hardware.ros.address",
    "engines.ros.button": "hardware.ros.button",
    "engines.ros.cameras": "hardware.ros.cameras",
    "engines.ros.engine": "hardware.ros.engine",
    "engines.ros.hold": "hardware.ros.hold",
    "engines.ros.joints": "hardware.ros.joints",
    "engines.ros.link": "hardware.ros.link",
    "engines.ros.messages": "hardware.ros.messages",
    "engines.ros.sensors": "hardware.ros.sensors",
    "engines.ros.setting": "hardware.ros.setting",
    "engines.ros.start": "hardware.ros.start",
    "engines.ros.websocket": "hardware.ros.websocket",
    "twin.button": "hardware.twin.button",
    "twin.camera": "hardware.twin.camera",
    "twin.cell": "hardware.twin.cell",
    "twin.controller": "hardware.twin.controller",
    "twin.environment": "hardware.twin.environment",
    "twin.evaluation": "hardware.twin.evaluation",
    "twin.gap": "hardware.twin.gap",
    "twin.launch": "hardware.twin.launch",
    "twin.loop": "hardware.twin.loop",
    "twin.node": "hardware.twin.node",
    "twin.orphans": "hardware.twin.bridge_cleanup",
    "training.decorator": "trees.nodes.train",
    "trees.authoring": "trees.nodes",
    "demos_decomp.readers": "demos_decomp.readers.base",
    "demos_decomp.maniskill": "demos_decomp.readers.maniskill",
}
"""Modules of version 0.1 and what they became, both without ``bt_tasksim.``; where one was cut up, a name is
looked for beside it, too, and then everywhere."""

_HELD = {"holding": "holding", "not_held": "not_held"}
ONE_WORLD: Mapping[str, Mapping[str, str]] = {
    "bt_tasksim": {"ConceptModel": "OneWorldConcept"},
    "bt_tasksim.concept": {"ConceptModel": "OneWorldConcept"},
    "bt_tasksim.motion": {"plan": "plan"},
    "concept_nodes.holding": _HELD,
    "bt_tasksim.concept_nodes.holding": _HELD,
}
"""What concepts of version 0.1 are and call where they were written for one world, by the module of then, and
its name today."""
ONE_WORLD_HOME = "concept_nodes.former"
"""Where it is."""


@dataclass(frozen=True)
class Converted:
    """A converted file.

    Attributes:
        text: Its new text.
        changes: One line for each statement that was changed.
        unknown: One line for each name that no module of today defines.
    """

    text: str
    changes: tuple[str, ...]
    unknown: tuple[str, ...]


def advice(error: BaseException) -> str:
    """What to do about an import that failed because a module has moved; empty where it failed otherwise."""
    if not isinstance(error, ImportError) or error.name is None:
        return ""
    if not _moved(error.name) and not (error.name == PACKAGE and _names_a_former(error)):
        return ""
    trace, file = error.__traceback__, "FILE"
    while trace is not None:
        name = trace.tb_frame.f_code.co_filename
        file, trace = (file if name.startswith("<") else name), trace.tb_next
    return f"; modules have moved since version 0.1: 'bt-tasksim convert {file}' puts the imports right"


def convert(source: str, file: str) -> Converted:
    """A Python file's imports of modules of version 0.1, as imports of where they are now.

    Args:
        source: The file's text.
        file: Its name, for errors.

    Raises:
        InputError: It is not Python.
    """
    try:
        tree = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError) as error:
        line = f", line {error.lineno}" if isinstance(error, SyntaxError) else ""
        raise InputError(f"'{file}'{line} is not Python: {error}") from error
    text = _Text(source)
    unknown: list[str] = []
    dotted, former = False, _is_former(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module is not None:
            text.replace(node, _from(node, f"'{file}', line {node.lineno}", unknown, former))
        elif isinstance(node, ast.Import):
            text.replace(node, _import(node))
            dotted = dotted or any(_moved(alias.name) and alias.asname is None for alias in node.names)
    if dotted:
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and (new := _moved(_chain(node))):
                text.replace(node, [new])
    return Converted(text.result(), tuple(text.changes), tuple(unknown))


def _is_former(tree: ast.Module) -> bool:
    """A file imports a module that has moved since version 0.1."""
    return any(
        _moved(name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom | ast.Import)
        for name in ([a.name for a in node.names] if isinstance(node, ast.Import) else [node.module or ""])
    )


def _from(node: ast.ImportFrom, where: str, unknown: list[str], former: bool) -> list[str] | None:
    """The statements that replace ``from old import ...``; None where it stays."""
    assert node.module is not None
    homes: dict[str, list[str]] = {}
    for alias in node.names:
        home, name = _home(node.module, alias.name)
        if former and name in (today := ONE_WORLD.get(node.module, {})):
            home, name = ONE_WORLD_HOME, today[name]
        if home is None:
            unknown.append(f"{where}: nothing of today defines '{alias.name}' of '{node.module}'")
            home = _moved(node.module) or node.module
        shown = alias.asname or alias.name
        homes.setdefault(home, []).append(name if name == shown else f"{name} as {shown}")
    if list(homes) == [node.module]:
        return None
    return [f"from {home} import {', '.join(names)}" for home, names in homes.items()]


def _import(node: ast.Import) -> list[str] | None:
    if not any(_moved(alias.name) for alias in node.names):
        return None
    words = (
        (_moved(alias.name) or alias.name) + (f" as {alias.asname}" if alias.asname else "")
        for alias in node.names
    )
    return [f"import {', '.join(words)}"]


def _home(module: str, name: str) -> tuple[str | None, str]:
    """The module from which a name of an old module is imported today, and its name there."""
    if whole := _moved(f"{module}.{name}"):  # the name is a module
        parent, _, leaf = whole.rpartition(".")
        return (PACKAGE, name) if _handed_on().get(name) == whole else (parent, leaf)
    new = _moved(module)
    if new is None or name == "*":
        return new or module, name
    found = next((beside for beside in _beside(new) if name in _defined(beside)), None)
    if found is None:
        others = [other for other in _everywhere() if name in _defined(other)]
        found = others[0] if len(others) == 1 else None
    home = _handed_on().get(name)
    ours = found is not None and home is not None and (found == home or found.startswith(f"{home}."))
    if ours or found is None:
        return (PACKAGE if ours else None), name
    return _door(found, name, full=module.startswith(f"{PACKAGE}.")), name


def _door(home: str, name: str, full: bool) -> str:
    """The package that hands a name of this module on to authors, where one does; else the module itself.

    Its short name, ``trees``, unless the file has names in ``full``.
    """
    for short in SHORT:
        if home.startswith(f"{PACKAGE}.{short}.") and name in _offered(f"{PACKAGE}.{short}"):
            return f"{PACKAGE}.{short}" if full else short
    return home


def _moved(module: str) -> str | None:
    """The full name of what a module of version 0.1 is now; None for a module that is where it was."""
    inner = module.removeprefix(f"{PACKAGE}.")
    full = inner != module or inner.split(".")[0] in SHORT
    return f"{PACKAGE}.{FORMER[inner]}" if full and inner in FORMER else None


def _names_a_former(error: ImportError) -> bool:
    """``from bt_tasksim import poses`` and the like: the sentence of the import system ends with the name."""
    name = getattr(error, "name_from", None)  # Python 3.12 says it
    return name in FORMER if name is not None else any(f"'{old}'" in str(error) for old in FORMER)


def _beside(module: str) -> Iterator[str]:
    """A module, then those in its folder."""
    yield module
    folder = _file(module).parent
    room = module if _file(module).name == "__init__.py" else module.rpartition(".")[0]
    for file in sorted(folder.glob("*.py")):
        if file.stem != "__init__":
            yield f"{room}.{file.stem}"


def _everywhere() -> Iterator[str]:
    """Every module of the package, those of the linked folders once."""
    root = Path(__file__).resolve().parents[1]
    for file in sorted(root.rglob("*.py")):
        yield ".".join([PACKAGE, *file.relative_to(root).with_suffix("").parts]).removesuffix(".__init__")


def _file(module: str) -> Path:
    """A module's source, found without importing it."""
    root = Path(__file__).resolve().parents[1]
    path = root.joinpath(*module.split(".")[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@functools.cache
def _defined(module: str) -> frozenset[str]:
    """Names that a module defines at its top level, imported ones left out."""
    file = _file(module)
    if not file.is_file():
        return frozenset()
    found: set[str] = set()
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Assign):
            found |= {target.id for target in node.targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found.add(node.target.id)
    return frozenset(found)


@functools.cache
def _offered(package: str) -> frozenset[str]:
    """Names in a package's ``__all__``."""
    for node in ast.parse(_file(package).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return frozenset(ast.literal_eval(node.value))
    return frozenset()


@functools.cache
def _handed_on() -> Mapping[str, str]:
    """Names of ``bt_tasksim`` itself, and their homes."""
    package = importlib.import_module(PACKAGE)
    homes: Mapping[str, str] = package._HOME
    return homes


def _chain(node: ast.Attribute) -> str:
    """``a.b.c`` of an attribute of names; empty for any other."""
    parts = [node.attr]
    value = node.value
    while isinstance(value, ast.Attribute):
        parts.append(value.attr)
        value = value.value
    return ".".join([value.id, *reversed(parts)]) if isinstance(value, ast.Name) else ""


class _Text:
    """A text in which statements are replaced.

    Args:
        source: The text.
    """

    def __init__(self, source: str) -> None:
        self.changes: list[str] = []
        self._source = source.encode()  # the parser counts columns in bytes
        self._starts = [0]
        for line in self._source.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))
        self._edits: list[tuple[int, int, bytes]] = []

    def replace(self, node: ast.stmt | ast.expr, statements: list[str] | None) -> None:
        """Put statements, or one expression, where a node is."""
        if statements is None:
            return
        assert node.end_lineno is not None and node.end_col_offset is not None
        begin = self._starts[node.lineno - 1] + node.col_offset
        end = self._starts[node.end_lineno - 1] + node.end_col_offset
        line = self._source[self._starts[node.lineno - 1] : begin]
        joint = "\n" + line.decode() if not line.strip() else "; "
        self._edits.append((begin, end, joint.join(statements).encode()))
        self.changes.append(f"line {node.lineno}: {'; '.join(statements)}")

    def result(self) -> str:
        """The text with everything replaced."""
        out, at = [], 0
        for begin, end, new in sorted(self._edits):
            if begin >= at:  # a chain within a longer chain is part of it
                out += [self._source[at:begin], new]
                at = end
        return b"".join([*out, self._source[at:]]).decode()
