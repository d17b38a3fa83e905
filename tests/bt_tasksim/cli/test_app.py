"""Commands, options and defaults keep their names and meanings."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer

from bt_tasksim.cli.app import NAME, application, command, summary
from bt_tasksim.cli.options.engines import EngineFlags
from bt_tasksim.cli.options.film import FilmFlags
from bt_tasksim.cli.options.groups import flattened
from bt_tasksim.cli.options.tree import TreeOptions
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.report.video import Film

LINES = json.loads(Path(__file__).with_name("command_lines.json").read_text())
"""Command lines of README, docs and tests, and what the command line of version 0.1 made of them."""


def parsed(line: str) -> dict[str, Any]:
    words, group = shlex.split(line), application()
    context = group.make_context(NAME, words)
    name, found, rest = group.resolve_command(context, words)
    return dict(found.make_context(name, rest, parent=context).params)


def plain(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    return list(value) if isinstance(value, tuple) else value


@pytest.mark.parametrize("line", LINES)
def test_old_command_lines_mean_what_they_meant(line):
    found = {name.rstrip("_"): plain(value) for name, value in parsed(line).items() if name != "plugin"}
    was = LINES[line]
    if shlex.split(line)[0] == "evaluate":  # never an option of it
        was = {k: v for k, v in was.items() if k != "real_time"}
        was = {"batch": None, "cluster": None, "resume": False, **was}
        if "--workers" not in line:
            was["workers"] = None  # which is 1, but on a cluster
    if "connect_timeout" in found:
        was = {"device": "cpu", "laws": "auto", **was}
    if shlex.split(line)[0] in ("run", "evaluate"):
        was = {"longest": None, **was}
    if line.startswith("run "):
        was = {"video_camera": "overview", "video_size": "", "video_fps": 10.0, **was}
    if line.startswith("new "):
        was = {"like": None, "urdf": None, **was}
    if line.startswith("check "):
        was = {"robot": None, "scene": None, **was}
    if line.startswith("decompose"):
        was = {**was, "logs": [was["log"]]}
        del was["log"]
    if line.startswith("train"):
        was = {"engines": None, "cluster": None, **was}
    if line.startswith("replay"):
        was = {"tree": None, "robot": None, "policy": [], "objects": None, **was}
    assert found == {"nodes": None, **was} if "nodes" in found else found == was


def test_defaults_are_those_of_the_options_in_python():
    assert EngineFlags().options() == EngineOptions()


def test_defaults_of_a_film_are_those_in_python():
    assert FilmFlags().film() == Film()


def test_a_group_of_options_is_one_argument_of_the_command():
    def go(
        tree: TreeOptions, often: Annotated[int, typer.Option(help="How often.")] = 2
    ) -> tuple[TreeOptions, int]:
        return tree, often

    assert flattened(go)(tree="t", scene=None, robot="r", nodes=None, often=3) == (
        TreeOptions("t", robot="r"),
        3,
    )
    names = [name for parameter in command("go", go).params for name in parameter.opts]
    assert {"tree", "--scene", "--robot", "--often", "--plugin"} <= set(names)


def test_a_docstring_is_help_up_to_what_is_for_programmers():
    def go() -> None:
        """Goes.

        Far.

        Raises:
            InputError: It cannot.
        """

    assert summary(go) == "Goes.\n\nFar."
