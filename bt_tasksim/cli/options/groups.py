"""Groups of options: a command takes a dataclass, the command line one option for each of its fields."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable
from typing import Any, get_type_hints


def flattened(function: Callable[..., Any]) -> Callable[..., Any]:
    """A command in which each parameter that is a dataclass is replaced by the fields of that class.

    Args:
        function: The command. Its parameters, and the fields of its groups, carry what Typer needs to know:
            ``Annotated[str, typer.Option(help="...")]``.

    Returns:
        A function of keyword arguments that makes the groups and calls the command.
    """
    hints = get_type_hints(function, include_extras=True)
    parameters: list[inspect.Parameter] = []
    groups: dict[str, tuple[type, list[str]]] = {}
    for name, parameter in inspect.signature(function).parameters.items():
        hint = hints.get(name, str)
        if isinstance(hint, type) and dataclasses.is_dataclass(hint):
            inner = get_type_hints(hint, include_extras=True)
            fields = dataclasses.fields(hint)
            groups[name] = (hint, [field.name for field in fields])
            parameters += [_keyword(field.name, inner[field.name], _default(field)) for field in fields]
        else:
            parameters.append(_keyword(name, hint, parameter.default))

    @functools.wraps(function)
    def command(**values: Any) -> Any:
        made = {name: group(**{f: values.pop(f) for f in fields}) for name, (group, fields) in groups.items()}
        return function(**made, **values)

    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    return command


def _keyword(name: str, hint: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=hint)


def _default(field: dataclasses.Field[Any]) -> Any:
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return inspect.Parameter.empty if field.default is dataclasses.MISSING else field.default
