"""What was seen in a demonstration and not understood, for people."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class RemarkKind(StrEnum):
    """What a remark is about."""

    MOTION = "motion"
    """An object was moved in a way that no task explains: what was decomposed is not all that happened."""
    EMPTY_HAND = "empty hand"
    """The hand closed and held nothing, as hands often do."""


@dataclass(frozen=True)
class Remark:
    """A remark.

    Attributes:
        kind: What it is about.
        text: One sentence with numbers and units.
    """

    kind: RemarkKind
    text: str

    def __str__(self) -> str:
        return self.text

    def to_json(self) -> dict[str, str]:
        """The remark as plain data."""
        return {"kind": str(self.kind), "text": self.text}
