"""Environments' files: the bundled ones by id, others by path."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from bt_tasksim.core.document import located
from bt_tasksim.core.errors import InputError, nearest, within
from bt_tasksim.core.files import file_version
from bt_tasksim.core.plain import shown
from bt_tasksim.core.resources import asset, is_file
from bt_tasksim.core.typed_file import load_typed
from bt_tasksim.engines.maniskill.schema import EnvironmentFile

NAME = "maniskill"
"""Name of the engine; what follows it after a colon is an environment."""


def bundled() -> tuple[str, ...]:
    """Ids of the environments whose files are bundled."""
    return tuple(sorted(path.stem for path in asset("maniskill").glob("*.yaml")))


def environment_of(engine: str) -> str:
    """What an engine's name says after the colon: an id or a file.

    Raises:
        InputError: It says nothing.
    """
    environment = engine.partition(":")[2]
    if not environment:
        raise InputError(
            f"name the ManiSkill environment, as in {NAME}:{bundled()[0]}; there are files for "
            f"{', '.join(bundled())}, and one of your own comes as {NAME}:FILE.yaml"
        )
    return environment


def load_environment_file(environment: str) -> EnvironmentFile:
    """The file of an environment.

    Args:
        environment: Id of an environment whose file is bundled, or path of a file.

    Raises:
        InputError: There is no such file, or it is no good.
    """
    path = Path(environment).resolve() if is_file(environment) else asset("maniskill", f"{environment}.yaml")
    if environment in bundled() or is_file(environment):
        return _load(path, file_version(path) if path.is_file() else ())
    raise InputError(
        f"no file says what is in the ManiSkill environment '{shown(environment)}': write one and name it, "
        f"{NAME}:FILE.yaml (docs/maniskill.md){nearest(environment, bundled())}"
    )


@lru_cache(maxsize=16)
def _load(path: Path, version: tuple[int, ...]) -> EnvironmentFile:
    """The content of this version of a file."""
    from bt_tasksim.robot.description import load_robot

    content, document = load_typed(EnvironmentFile, path, "ManiSkill environment's file")
    with located(document):
        for theirs, ours in content.robots.items():
            with within("robots", theirs):
                load_robot(ours)
    return content
