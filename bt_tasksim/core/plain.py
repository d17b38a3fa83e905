"""Plain data as files hold it, and paths into it."""

from __future__ import annotations

from typing import TypeAlias

Plain: TypeAlias = "bool | int | float | str | list[Plain] | dict[str, Plain] | None"
"""What YAML and JSON have in common."""
Where: TypeAlias = "tuple[str | int, ...]"
"""Keys and indices that lead to a value."""

DEEPEST = 64
"""Levels of mappings and lists within one another."""


def where_text(where: Where) -> str:
    """A path as people write it: ``objects.cup.size[0]``."""
    out = ""
    for part in where:
        out += f"[{part}]" if isinstance(part, int) else f".{part}" if out else part
    return shown(out, 120)


def printable(text: str) -> str:
    r"""The text with whatever a terminal would obey, or could not show, spelled as ``\\x1b``."""
    return "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)


def shown(text: str, longest: int = 60) -> str:
    """Text for a sentence: short, and without anything that a terminal would obey."""
    clean = printable(text[: longest + 1])
    return clean if len(clean) <= longest else clean[: longest - 3] + "..."


def short(value: object) -> str:
    """A value for a sentence, cut where it is long."""
    if value is None:
        return "nothing"
    if isinstance(value, dict):
        return "a mapping" if value else "an empty mapping"
    if isinstance(value, (list, tuple)) and (len(value) > 8 or any(map(_holds_more, value))):
        return f"a list of {len(value)}"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 10**20:
        return "a whole number of more than 20 digits"
    if isinstance(value, str):
        return shown(repr(value[:80]))
    return shown(repr(value))


def _holds_more(value: object) -> bool:
    return isinstance(value, (dict, list, tuple))
