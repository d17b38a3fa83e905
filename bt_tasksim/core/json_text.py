"""JSON with bounds: standard JSON, nothing twice, nothing deep, and one sentence where it is not."""

from __future__ import annotations

import json
import re
from typing import NoReturn

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.plain import DEEPEST, Plain, shown

_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"?|[\[{]|[\]}]', re.DOTALL)


def parse_json(text: str | bytes, owner: str) -> Plain:
    """The value of a JSON text.

    Args:
        text: The text; bytes are UTF-8.
        owner: What it is, for errors, such as ``card 'a.json'``.

    Raises:
        InputError: It is not JSON, names a key twice, is nested deeper than `DEEPEST`, or has a number that
            is not finite or has thousands of digits.
    """
    try:
        if isinstance(text, bytes):
            text = text.decode("utf-8-sig")
        _check_depth(text)
        value: Plain = json.loads(text, parse_constant=_no_constant, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        raise InputError(f"{owner}, line {error.lineno}: not JSON: {error.msg}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{owner} is not text in UTF-8") from error
    except ValueError as error:
        said = "a number has too many digits" if "digits" in str(error) else str(error)
        raise InputError(f"{owner}: {said}") from error
    return value


def parse_json_object(text: str | bytes, owner: str) -> dict[str, Plain]:
    """As `parse_json`, where the value is to be an object.

    Raises:
        InputError: As for `parse_json`, or it is no object.
    """
    value = parse_json(text, owner)
    if not isinstance(value, dict):
        raise InputError(f"{owner} should hold names and values in braces")
    return value


def _check_depth(text: str) -> None:
    depth = 0
    for token in _TOKEN.finditer(text):
        if token.group() in "[{":
            depth += 1
            if depth > DEEPEST:
                raise ValueError(f"it is nested deeper than {DEEPEST} levels")
        elif token.group() in "]}":
            depth -= 1


def _once(pairs: list[tuple[str, Plain]]) -> dict[str, Plain]:
    out: dict[str, Plain] = {}
    for key, value in pairs:
        if key in out:
            raise ValueError(f"'{shown(key)}' stands there twice")
        out[key] = value
    return out


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number in JSON")
