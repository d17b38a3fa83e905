"""What a check has found: a line for each thing that is wrong, and what was looked at."""

from __future__ import annotations

from dataclasses import dataclass, field

ERROR, WARNING = "ERROR", "WARNING"


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Attributes:
        level: `ERROR` or `WARNING`.
        concept: Name of what is checked: of the concept, the robot, the scene or the object.
        function: Name of its function, or of the field or thing in it; empty for the whole.
        what: What is wrong.
        remedy: What to do.
        line: Line in the file; 0 where none is to blame.
        file: Name of that file.
    """

    level: str
    concept: str
    function: str
    what: str
    remedy: str
    line: int = 0
    file: str = ""

    def __str__(self) -> str:
        where = f"{self.concept}.{self.function}" if self.function else self.concept
        line = f" ({self.file}:{self.line})" if self.line else ""
        return f"{self.level} {where}{line}: {self.what}; {self.remedy}"


@dataclass
class Report:
    """What a check has found.

    Attributes:
        findings: What is wrong.
        seen: What was measured, in lines to read.
    """

    findings: list[Finding] = field(default_factory=list)
    seen: list[str] = field(default_factory=list)
    _done: list[tuple[str, int]] = field(default_factory=list, init=False)
    """What was checked, and up to which finding it is about that."""

    @property
    def checked(self) -> tuple[str, ...]:
        """What was checked, a line for each thing."""
        return tuple(words for words, _ in self._done)

    def done(self, words: str) -> None:
        """Something was checked, and what was found since the last time is about it."""
        self._done.append((words, len(self.findings)))

    def done_rather(self, words: str) -> None:
        """What was checked last is better said in these words."""
        self._done[-1] = words, self._done[-1][1]

    @property
    def errors(self) -> int:
        """How many findings are errors."""
        return sum(f.level == ERROR for f in self.findings)

    def add(self, level: str, thing: str, part: str, what: str, remedy: str) -> None:
        """Note a finding, see `Finding`."""
        self.findings.append(Finding(level, thing, part, what, remedy))

    def lines(self) -> list[str]:
        """What is printed: what was measured, a line for each finding, errors first, and what was checked."""
        order = sorted(self.findings, key=lambda f: (f.concept, f.level != ERROR))
        return [*self.seen, *map(str, order), *self._judged()]

    def _judged(self) -> list[str]:
        """A line for each thing that was checked: whether it is ok, and how much was found about it."""
        lines, first = [], 0
        for k, (words, until) in enumerate(self._done, 1):
            own = self.findings[first : until if k < len(self._done) else None]
            errors = sum(f.level == ERROR for f in own)
            counted = f"{_count(errors, 'error')}, {_count(len(own) - errors, 'warning')}"
            lines.append(f"{'not ok' if errors else 'ok'}: {words}; {counted}")
            first = until
        return lines


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
