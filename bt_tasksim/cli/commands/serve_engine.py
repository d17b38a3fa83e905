"""``bt-tasksim serve-engine``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.cli.arguments import port as port_number
from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register
from bt_tasksim.engines.remote.address import DEFAULT_PORT, LOOPBACK


@register("command", "serve-engine")
def serve_engine(
    role: Annotated[
        str, typer.Argument(metavar="ROLE", help="kinematics, physics, rendering or postprocess.")
    ],
    name: Annotated[
        str,
        typer.Argument(metavar="NAME", help="pinocchio; sapien or mujoco; sapien; state or camera."),
    ],
    robot: Annotated[str, typer.Option(metavar="R", help="A robot's name or .yaml file.")] = "panda",
    port: Annotated[
        int, typer.Option(parser=port_number, metavar="P", help="TCP port; 0 takes a free one.")
    ] = DEFAULT_PORT,
    address: Annotated[
        str, typer.Option(metavar="A", help="IP address; any but this machine's own needs --key.")
    ] = LOOPBACK,
    key: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The server's key: encrypts, and admits only its clients."),
    ] = None,
    objects: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Mesh files, in addition to the bundled ones.")
    ] = None,
) -> None:
    """Serve an engine of the pipeline to another process."""
    from bt_tasksim.execution.serving import serve

    serve(
        role,
        name,
        robot,
        address,
        port,
        key=key,
        objects=objects,
        say=lambda line: say(line, flush=True),
        complain=lambda line: print(f"bt-tasksim: {line}", file=sys.stderr, flush=True),
    )
