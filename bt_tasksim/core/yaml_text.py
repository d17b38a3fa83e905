"""YAML with bounds, and with the line of every value.

The text is taken apart into events, by libyaml where it is there, and built up here without recursion: what
is nested thousands of levels deep, or multiplies with each alias, is refused after a few of them. Only plain
data is made. As in YAML 1.2, ``on``, ``off``, ``yes`` and ``no`` are words, dates are text, and ``1e-3`` is a
number.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import yaml
from yaml.constructor import SafeConstructor
from yaml.resolver import Resolver

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.plain import DEEPEST, Plain, Where, shown

MOST_VALUES = 100_000
"""Values of a file, those that aliases stand for counted each time."""

_LOADER: type[Any] = yaml.CSafeLoader if yaml.__with_libyaml__ else yaml.SafeLoader
_TAG = "tag:yaml.org,2002:"


_EXPONENT = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+")


class _Resolver(Resolver):
    """Which type a plain scalar has."""

    yaml_implicit_resolvers = {
        first: [
            (tag, form)
            for tag, form in forms
            if tag not in (f"{_TAG}timestamp", f"{_TAG}value") and (tag != f"{_TAG}bool" or first in "tTfF")
        ]
        for first, forms in Resolver.yaml_implicit_resolvers.items()
    }
    for _first in "-+.0123456789":
        yaml_implicit_resolvers[_first] = [*yaml_implicit_resolvers[_first], (f"{_TAG}float", _EXPONENT)]


@dataclass
class _Open:
    """A mapping or list that is being read."""

    value: dict[str, Plain] | list[Plain]
    where: Where
    anchor: str | None
    count: int = 1
    key: str | None = None
    merging: bool = False
    merged: list[dict[str, Plain]] = field(default_factory=list)


def parse_yaml(text: str, owner: str) -> tuple[Plain, dict[Where, int]]:
    """The value of a YAML text of one document, and the lines on which its values stand.

    Args:
        text: The text.
        owner: What it is, for errors, such as ``scene file 'a.yaml'``.

    Raises:
        InputError: It is not YAML, holds something else than plain data, names a key twice, is nested deeper
            than `bt_tasksim.core.plain.DEEPEST`, or has more than `MOST_VALUES` values.
    """
    builder = _Builder(owner)
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            builder.take(event)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        at = f", line {mark.line + 1}" if mark is not None else ""
        said = ", ".join(part for part in (error.context, error.problem) if part)
        raise InputError(f"{owner}{at}: not YAML: {shown(said, 200)}") from error
    except yaml.YAMLError as error:
        raise InputError(f"{owner}: not YAML: {shown(' '.join(str(error).split()), 200)}") from error
    return builder.value, builder.lines


class _Builder:
    """Builds the value from events."""

    def __init__(self, owner: str) -> None:
        self.owner = owner
        self.value: Plain = None
        self.lines: dict[Where, int] = {}
        self._open: list[_Open] = []
        self._anchors: dict[str, tuple[Plain, int]] = {}
        self._documents = 0
        self._values = 0
        self._resolver = _Resolver()
        self._constructor = SafeConstructor()

    def take(self, event: Any) -> None:
        """One event of the parser."""
        line = event.start_mark.line + 1
        match event:
            case yaml.DocumentStartEvent():
                self._documents += 1
                if self._documents > 1:
                    raise self._error("holds a second document", line)
            case yaml.ScalarEvent():
                self._scalar(event, line)
            case yaml.AliasEvent():
                self._alias(str(event.anchor), line)
            case yaml.MappingStartEvent() | yaml.SequenceStartEvent():
                self._begin(event, line)
            case yaml.MappingEndEvent() | yaml.SequenceEndEvent():
                self._end()

    def _alias(self, name: str, line: int) -> None:
        if name not in self._anchors:
            raise self._error(f"the alias '*{shown(name)}' stands for nothing before it", line)
        value, count = self._anchors[name]
        self._count(count, line)
        self._put(value, count, line)

    def _error(self, sentence: str, line: int) -> InputError:
        return InputError(f"{self.owner}, line {line}: {sentence}")

    def _count(self, more: int, line: int) -> None:
        self._values += more
        if self._values > MOST_VALUES:
            raise self._error(f"it has more than {MOST_VALUES} values, those of aliases counted", line)

    def _where(self) -> Where:
        """Path of the value that comes next."""
        if not self._open:
            return ()
        top = self._open[-1]
        return (*top.where, len(top.value) if isinstance(top.value, list) else top.key or "")

    def _begin(self, event: Any, line: int) -> None:
        mapping = isinstance(event, yaml.MappingStartEvent)
        if event.tag not in (None, "!", f"{_TAG}{'map' if mapping else 'seq'}"):
            raise self._error(f"unknown tag '{shown(event.tag)}': only plain data can be here", line)
        if self._awaits_key():
            raise self._error("a key should be a name, and not a mapping or a list", line)
        if len(self._open) >= DEEPEST:
            raise self._error(f"it is nested deeper than {DEEPEST} levels", line)
        self._count(1, line)
        where = self._where()
        self.lines.setdefault(where, line)
        self._open.append(_Open({} if mapping else [], where, event.anchor))

    def _end(self) -> None:
        done = self._open.pop()
        if isinstance(done.value, dict):
            for other in done.merged:
                for key, value in other.items():
                    done.value.setdefault(key, value)
        if done.anchor is not None:
            self._anchors[done.anchor] = (done.value, done.count)
        self._put(done.value, done.count, self.lines.get(done.where, 1))

    def _awaits_key(self) -> bool:
        top = self._open[-1] if self._open else None
        return top is not None and isinstance(top.value, dict) and top.key is None and not top.merging

    def _scalar(self, event: Any, line: int) -> None:
        self._count(1, line)
        tag = event.tag
        if tag is None or tag == "!":
            tag = self._resolver.resolve(  # type: ignore[no-untyped-call]
                yaml.ScalarNode, event.value, event.implicit
            )
        if self._awaits_key():
            self._key(event.value, tag, line)
            return
        value = self._plain(tag, event.value, line)
        if event.anchor is not None:
            self._anchors[event.anchor] = (value, 1)
        self._put(value, 1, line)

    def _key(self, name: str, tag: str, line: int) -> None:
        top = self._open[-1]
        assert isinstance(top.value, dict)
        if tag == f"{_TAG}merge":
            top.merging = True
            return
        if name in top.value:
            raise self._error(f"'{shown(name)}' stands there twice", line)
        top.key = name
        self.lines[(*top.where, name)] = line

    def _plain(self, tag: str, text: str, line: int) -> Plain:
        node = yaml.ScalarNode(tag, text)
        try:
            match tag.removeprefix(_TAG):
                case "str" | "merge":
                    return text
                case "null":
                    return None
                case "bool":
                    return bool(SafeConstructor.bool_values[text.lower()])
                case "int":
                    return int(self._constructor.construct_yaml_int(node))
                case "float":
                    return float(self._constructor.construct_yaml_float(node))
        except (KeyError, ValueError, IndexError, OverflowError) as error:
            raise self._error(f"'{shown(text, 40)}' is no {tag.removeprefix(_TAG)}", line) from error
        raise self._error(f"unknown tag '{shown(tag)}': only plain data can be here", line)

    def _put(self, value: Plain, count: int, line: int) -> None:
        """A complete value, into what is open or as the document's own."""
        if not self._open:
            self.value = value
            self.lines.setdefault((), line)
            return
        top = self._open[-1]
        top.count += count
        if isinstance(top.value, list):
            self.lines.setdefault((*top.where, len(top.value)), line)
            top.value.append(value)
        elif top.merging:
            top.merging = False
            others = value if isinstance(value, list) else [value]
            for other in others:
                if not isinstance(other, dict):
                    raise self._error("'<<' should be followed by a mapping, or a list of them", line)
                top.merged.append(other)
        elif top.key is None:
            raise self._error("a key should be a name, and not an alias", line)
        else:
            top.value[top.key] = value
            top.key = None
