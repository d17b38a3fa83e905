"""A file of values as it was read: plain data, and the line on which each value stands."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from bt_tasksim.core.bounded_text import LARGEST, read_text
from bt_tasksim.core.errors import FieldError, InputError
from bt_tasksim.core.json_text import parse_json
from bt_tasksim.core.plain import Plain, Where, printable, where_text
from bt_tasksim.core.yaml_text import parse_yaml

_SHORT = 1 << 16


@dataclass(frozen=True)
class Document:
    """The values of a file.

    Attributes:
        owner: What the file is, for errors, such as ``scene file 'a.yaml'``.
        value: Its content.
        lines: Line, from 1 on, by the path of keys and indices that leads to a value; may lack some.
    """

    owner: str
    value: Plain
    lines: Mapping[Where, int] = field(default_factory=dict)

    def line(self, where: Where) -> int | None:
        """Line of a value; where it is not known, that of the nearest value around it, short of the whole."""
        for length in range(len(where), 0, -1):
            if where[:length] in self.lines:
                return self.lines[where[:length]]
        return None

    def error(self, sentence: str, where: Where = ()) -> InputError:
        """An error about a value, with the file and the line."""
        line = self.line(where)
        at = "" if line is None else f", line {line}"
        return InputError(printable(f"{self.owner}{at}: {sentence}"))

    def named(self, where: Where, sentence: str) -> InputError:
        """As `error`, the sentence beginning with the value's name: ``'arm.lower[3]' should be ...``."""
        return self.error(f"'{where_text(where)}' {sentence}", where)


def read_document(path: str | os.PathLike[str], what: str, largest: int = LARGEST) -> Document:
    """The content of a file in JSON, where its name ends so, or else in YAML.

    Args:
        path: The file.
        what: Its kind, such as ``scene file``.
        largest: Bytes beyond which it is refused.

    Raises:
        InputError: It cannot be read, or is not JSON or YAML within bounds; one sentence says where.
    """
    owner = f"{what} '{path}'"
    text = read_text(path, owner, largest)
    if Path(path).suffix == ".json":
        return Document(owner, parse_json(text, owner), _lines_of_json(text))
    value, lines = parse_yaml(text, owner)
    return Document(owner, value, lines)


@contextmanager
def located(document: Document) -> Iterator[None]:
    """Give errors of a field (`FieldError`) the file and the line, and other ones the file."""
    try:
        yield
    except FieldError as error:
        raise document.error(str(error), error.where) from error
    except InputError as error:
        if str(error).startswith(document.owner):
            raise
        raise document.error(str(error)) from error


def _lines_of_json(text: str) -> Mapping[Where, int]:
    """Lines of short JSON, read as YAML, which it is but for a few escapes; none where that fails."""
    if len(text) > _SHORT:
        return {}
    try:
        return parse_yaml(text, "")[1]
    except InputError:
        return {}
