"""``bt-tasksim policies``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.cli.streams import say
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register


@register("command", "policies")
def policies(
    folder: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Also list the policies in this folder.")
    ] = None,
    json_: Annotated[Path | None, typer.Option("--json", metavar="F", help="Write the list as JSON.")] = None,
    pin: Annotated[
        str | None, typer.Option(metavar="NAME", help="Use this policy in leaves that name none.")
    ] = None,
    unpin: Annotated[
        tuple[str, str] | None, typer.Option(metavar="CONCEPT ROBOT", help="Undo --pin.")
    ] = None,
) -> None:
    """List learned policies, or pin the one that leaves use."""
    from bt_tasksim.concept.model import ConceptModel
    from bt_tasksim.concept_nodes import catalogue
    from bt_tasksim.core.files import write_text
    from bt_tasksim.policy import library
    from bt_tasksim.policy.policy import concept_name

    if pin is not None and unpin is not None:
        raise InputError("policies: --pin and --unpin cannot be given together")
    concepts = {concept_name(c): c for c in catalogue().values() if issubclass(c, ConceptModel)}
    if pin is not None:
        card = library.pin(pin, concepts)
        say(f"pinned {pin}@{card.hash} for '{card.concept}' on '{card.robot}'")
    if unpin is not None:
        concept, robot = unpin
        say(f"'{library.unpin(concept, robot)}' is no longer pinned for '{concept}' on '{robot}'")
    found = library.list_policies(None, concepts)
    if folder is not None:
        found += library.list_policies(folder, concepts)
    lines = [*library.pinned_programmed(), *map(library.describe, found)]
    say("\n".join(lines) or "there is no learned policy")
    if json_ is not None:
        write_text(json_, json.dumps([entry.to_json() for entry in found], indent=2) + "\n")
        say(f"wrote {json_}")
