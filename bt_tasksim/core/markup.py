"""Text in pictures and in notebooks: escaped, since names come from files.

The tables name no colour, so that light and dark themes show them in their own.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from html import escape

_LEFT = ' style="text-align:left;vertical-align:top;padding:2px 14px 2px 4px"'


def escaped(text: str) -> str:
    """Text for SVG and HTML; what cannot be printed, which XML does not take, becomes a space."""
    return escape(_printable(text))


def wrapped(text: str, letters: int) -> list[str]:
    """Lines of at most so many letters, one at least; a longer word is broken."""
    return textwrap.wrap(_printable(text), max(letters, 1), break_long_words=True) or [" "]


def html_pairs(pairs: Mapping[str, str]) -> str:
    """A table of names and values, one a row, every text escaped.

    Args:
        pairs: Value by name; an empty value leaves its row out.
    """
    rows = (f"<tr>{_cell('th', name)}{_cell('td', value)}</tr>" for name, value in pairs.items() if value)
    return f"<table>{''.join(rows)}</table>"


def html_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table with a head for each column, every text escaped."""
    head = "".join(_cell("th", name) for name in heads)
    body = "".join(f"<tr>{''.join(_cell('td', value) for value in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _cell(kind: str, text: str) -> str:
    return f"<{kind}{_LEFT}>{escaped(text)}</{kind}>"


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
