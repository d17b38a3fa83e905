"""The command line put together: commands are found in the registry, and imported when they are asked for."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from bt_tasksim.cli.options.groups import flattened
from bt_tasksim.cli.options.plugins import Plugins
from bt_tasksim.core import registry
from bt_tasksim.core.errors import InputError

NAME = "bt-tasksim"
SETTINGS = {"help_option_names": ["-h", "--help"]}
SECTIONS = ("Args:", "Returns:", "Raises:")
"""Where the part of a docstring begins that is for programmers."""


class Command(TyperCommand):
    """A command; what it cannot read is one sentence."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Read the words.

        Raises:
            InputError: They make no sense.
        """
        try:
            return super().make_context(info_name, args, parent=parent, **extra)
        except typer.TyperException as error:
            raise InputError(_sentence(error, f"{info_name}: ", f"{NAME} {info_name}")) from None


class Commands(TyperGroup):
    """All registered commands."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Read the words before the command's name.

        Raises:
            InputError: They make no sense.
        """
        try:
            return super().make_context(info_name, args, parent=parent, **extra)
        except typer.TyperException as error:
            raise InputError(_sentence(error, "", NAME)) from None

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of the commands."""
        return sorted(registry.parts("command"))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of this name.

        Raises:
            InputError: There is none.
        """
        if cmd_name not in self.commands:
            if ctx.resilient_parsing and cmd_name not in registry.parts("command"):
                return None  # a shell asks how a word may go on
            self.commands[cmd_name] = command(cmd_name, registry.part("command", cmd_name))
        return self.commands[cmd_name]


def command(name: str, function: Callable[..., Any]) -> Any:
    """A registered function as a command of Typer's.

    Args:
        name: What it is called.
        function: Its parameters are the arguments and options, see `bt_tasksim.cli.options.groups`; it
            returns the exit code, or None for 0.
    """
    single = typer.Typer(add_completion=False, rich_markup_mode=None)
    single.command(name, cls=Command, help=summary(function), context_settings=SETTINGS)(
        _with_plugins(flattened(function))
    )
    return get_command(single)


def application() -> Any:
    """The whole command line."""
    app = typer.Typer(
        name=NAME,
        cls=Commands,
        rich_markup_mode=None,
        context_settings=SETTINGS,
        subcommand_metavar="COMMAND ...",
    )
    app.callback()(_start)
    group = get_command(app)
    for parameter in group.params:
        if parameter.default is None:  # flags: then their values need no library to be read
            parameter.default = False
    return group


def summary(function: Callable[..., Any]) -> str:
    """What a command's docstring says to its users."""
    lines = (inspect.getdoc(function) or "").splitlines()
    end = next((k for k, line in enumerate(lines) if line in SECTIONS), len(lines))
    return "\n".join(lines[:end]).strip()


def _version(asked: bool) -> None:
    from importlib import metadata

    if asked:
        try:
            typer.echo(f"{NAME} {metadata.version(NAME)}")
        except metadata.PackageNotFoundError:
            typer.echo(f"{NAME}, not installed")
        raise typer.Exit


def _start(
    version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_version, help="Show the version and exit."),
    ] = False,
    plugin: Plugins = [],  # noqa: B006  # Typer's way
) -> None:
    """Run robot tasks as behaviour trees: written by hand or from demonstrations."""


def _with_plugins(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same command with ``--plugin`` among its options; `main` has loaded them already."""
    signature = inspect.signature(function)
    option = inspect.Parameter("plugin", inspect.Parameter.KEYWORD_ONLY, default=[], annotation=Plugins)

    def started(plugin: list[str] | None = None, **values: Any) -> Any:
        return function(**values)

    started.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[*signature.parameters.values(), option]
    )
    started.__annotations__ = {}
    return started


def _sentence(error: typer.TyperException, where: str, command: str) -> str:
    text = " ".join(error.format_message().split()).rstrip(".")
    return f"{where}{text[:1].lower()}{text[1:]}; see '{command} --help'"
