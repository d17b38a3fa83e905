"""An engine served to another process: ``bt-tasksim serve-engine``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.engines.base import engine_class
from bt_tasksim.engines.remote.address import listening
from bt_tasksim.execution.pipelines import build_engine
from bt_tasksim.robot.description import load_robot


def serve(
    role: str,
    name: str,
    robot: str,
    host: str,
    port: int,
    *,
    key: Path | None = None,
    objects: Path | None = None,
    say: Callable[[str], None],
    complain: Callable[[str], None],
) -> None:
    """Serve an engine until an interrupt.

    Args:
        role: Its role, see `bt_tasksim.engines.base.ROLES`.
        name: Its name.
        robot: Name or file of the robot.
        host: IP address to listen at.
        port: Port; 0 for a free one.
        key: The server's key file.
        objects: Folder with mesh files, besides the bundled ones.
        say: Takes one line: what is served where.
        complain: Takes one line for a refusal.

    Raises:
        InputError: Something of this is no good.
        MachineError: The engine cannot start, or the address is taken.
    """
    try:
        from bt_tasksim.engines.remote.keys import SERVER, load_key
        from bt_tasksim.engines.remote.refusals import RefusalLog
        from bt_tasksim.engines.remote.server import EngineServer, check_address
        from bt_tasksim.engines.remote.session import ServedSession
    except ImportError as error:
        raise MachineError(
            f"serving an engine needs the extra 'remote' ({error}): pip install 'bt-tasksim[remote]'"
        ) from error
    found = engine_class(role, name)
    if found.real or found.takes_address:
        what = "is a robot, which runs behind its guard" if found.real else "is elsewhere already"
        raise InputError(f"'{name}' {what}: only engines that are simulated in one process are served")
    address = listening(host, port)
    own = load_key(key, SERVER) if key is not None else None
    check_address(address, own)
    if objects is not None and not objects.is_dir():
        raise InputError(f"no folder '{objects}' with mesh files")
    description = load_robot(robot)
    refused = RefusalLog(complain)
    engine = build_engine(role, name, description)
    session = ServedSession(engine, role, name, description, objects, refused)
    server = EngineServer(session, address, own, refused)
    try:
        say(f"serving {server.sentence}")
        server.serve()
    finally:
        server.close()
