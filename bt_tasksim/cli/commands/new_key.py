"""``bt-tasksim new-key``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register


@register("command", "new-key")
def new_key(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="File for the server's key; the clients' key is put beside it."),
    ],
) -> None:
    """Make keys for an engine's server and its clients."""
    from bt_tasksim.engines.remote.keys import make_keys

    server, client = make_keys(file)
    say(f"wrote {server} for the server, and {client} for its clients; copy that to them, keep both secret")
