"""What both sides tell each other at connect, and one sentence for what differs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from importlib import metadata
from pathlib import Path

from bt_tasksim.core.files import file_version
from bt_tasksim.engines.remote.plain import shown, to_plain
from bt_tasksim.engines.remote.schema import layout_digest
from bt_tasksim.robot.description import RobotDescription

_DIGESTED = {
    "robot": "the robot's data file",
    "urdf": "the robot's URDF file",
    "layouts": "how bt-tasksim lays messages out",
}


@dataclass(frozen=True)
class Identity:
    """What a side says about itself.

    Attributes:
        role: The engine's role.
        version: Version of this package.
        robot: Name of the robot.
        digests: Hashes of the robot's data and URDF, and of the messages' layouts, by name.
    """

    role: str
    version: str
    robot: str
    digests: Mapping[str, str]


def identity(role: str, robot: RobotDescription) -> Identity:
    """This side's own."""
    digests = {
        "robot": _robot_digest(robot),
        "urdf": _file_digest(robot.urdf, file_version(robot.urdf)),
        "layouts": layout_digest(),
    }
    return Identity(role, metadata.version("bt-tasksim"), robot.name, digests)


def mismatch(served: Identity, wanted: Identity) -> str:
    """One sentence that says what differs between a server and a client; empty where nothing does."""
    if served.role != wanted.role:
        return f"this server's engine is for {shown(served.role)}, and the client wants {shown(wanted.role)}"
    if served.version != wanted.version:
        return (
            f"the server has bt-tasksim {shown(served.version)} and the client {shown(wanted.version)}: "
            "install the same version on both"
        )
    if served.robot != wanted.robot:
        return (
            f"the server's robot is {shown(served.robot)} and the client's {shown(wanted.robot)}: start the "
            "server with the client's, by --robot"
        )
    others = (set(served.digests) | set(wanted.digests)) - set(_DIGESTED)
    for name in (*_DIGESTED, *sorted(others)):
        if served.digests.get(name) != wanted.digests.get(name):
            what = _DIGESTED.get(name, shown(name))
            return (
                f"{what} is not the same on the server and the client: bring one of them to the other's state"
            )
    return ""


def _robot_digest(robot: RobotDescription) -> str:
    """Of everything in the data file that engines use; paths differ between machines."""
    data = {
        f.name: to_plain(getattr(robot, f.name)) for f in fields(robot) if f.name not in ("urdf", "source")
    }
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()


@lru_cache(maxsize=32)
def _file_digest(path: Path, version: tuple[int, ...]) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
