"""The file of an evaluation: written while it is made, whole at any time, and gone on from after a kill.

Each episode is appended at once to a journal beside the file, ``FILE.episodes``: a line of JSON for what is
evaluated, then one for each episode, each with a checksum. The file itself is written anew every few seconds
and at the end, when the journal goes. So a killed process loses the episodes that had not ended, and a
machine without power those of the last seconds.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shlex
import time
import zlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeGuard

from bt_tasksim.core.bounded_text import read_bytes
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.files import check_writable, write_bytes, write_text
from bt_tasksim.core.identity import differences, differing
from bt_tasksim.core.json_text import parse_json_object
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, Evaluation, outcomes_hash

LARGEST = 1 << 32
"""Bytes of a file that is gone on from; an episode has about a thousand."""

SUFFIX = ".episodes"
"""What a journal's name has more than its file's."""
BEGIN = re.compile(rb'\{"check": "[0-9a-f]{8}", "subject": ')
"""How a journal begins."""


def journal_of(path: str | Path) -> Path:
    """Where the episodes of an evaluation are appended, by its file."""
    path = _real(path)
    return path.with_name(f"{path.name}{SUFFIX}")


def check_ended(path: str | Path) -> None:
    """Check that no evaluation that was killed waits to be gone on from: beginning anew would lose it.

    Raises:
        InputError: One does, or something that is no journal has its journal's name.
    """
    journal = journal_of(path)
    if _check_ours(journal):
        raise InputError(
            f"'{path}' holds an evaluation that did not end: go on with --resume, or remove '{journal}' and "
            "evaluate anew"
        )


class EvaluationFile:
    """Keeps an evaluation in a file while it is made: give it to `evaluate` as ``keep``.

    Args:
        path: Where to; what is there stays until the first episode has ended.

    Raises:
        InputError: The folder does not exist, the path is a folder or a device, or something that is no
            journal has its journal's name.
        MachineError: It is not writable.
    """

    EVERY = 2.0
    """Seconds between two writings of the whole file, and after which a line is surely on the disk."""
    SHARE = 0.05
    """Of the time, that writings of the whole file take at most: a long one is written less often."""

    def __init__(self, path: str | Path) -> None:
        self.path, self.journal = _real(path), journal_of(path)
        for place in (self.path, self.journal):
            check_writable(place)
        _check_ours(self.journal)
        self._lines: int | None = None
        self._next_whole = self._next_flush = 0.0

    def add(self, outcome: EpisodeOutcome, seconds: float, evaluation: Callable[[], Evaluation]) -> None:
        """Keep an episode.

        Args:
            outcome: How it ended.
            seconds: That all of it has taken so far.
            evaluation: Gives what there is, this episode included.
        """
        # A disk that is full now may not be so at the end, when it counts; and what is not ours stays.
        with contextlib.suppress(InputError, MachineError, OSError):
            self._append(outcome, seconds, evaluation)
        began = time.monotonic()
        if began >= self._next_whole:
            with contextlib.suppress(MachineError):
                self._write(evaluation())
            took = time.monotonic() - began
            self._next_whole = began + max(self.EVERY, took / self.SHARE)

    def end(self, evaluation: Evaluation) -> None:
        """Write all that there is; there will be no more.

        Raises:
            MachineError: It cannot be written; the journal stays.
        """
        self._close()
        self._write(evaluation)
        with contextlib.suppress(OSError, InputError):  # what is not ours stays
            if _check_ours(self.journal):
                self.journal.unlink()

    def _append(self, outcome: EpisodeOutcome, seconds: float, evaluation: Callable[[], Evaluation]) -> None:
        now = time.monotonic()
        if self._lines is None:
            if now < self._next_flush:
                return  # it could not be written a moment ago
            self._next_flush = now + self.EVERY
            whole = evaluation()
            lines = [_line({"subject": whole.subject, "versions": whole.versions})]
            lines += [_line({"episode": o.to_data()}) for o in whole.outcomes[:-1]]
            lines += [_line({"episode": whole.outcomes[-1].to_data(), "seconds": seconds})]
            _check_ours(self.journal)
            write_bytes(self.journal, b"".join(lines))
            self._lines = os.open(self.journal, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC)
            return
        try:
            line = _line({"episode": outcome.to_data(), "seconds": seconds})
            if os.write(self._lines, line) < len(line):
                raise OSError("the disk is full")
            if now >= self._next_flush:
                self._next_flush = now + self.EVERY
                os.fsync(self._lines)
        except OSError:
            self._close()  # with half a line, perhaps: begin anew
            raise

    def _write(self, evaluation: Evaluation) -> None:
        write_text(self.path, json.dumps(evaluation.to_json(), indent=2, allow_nan=False) + "\n")

    def _close(self) -> None:
        if self._lines is not None:
            os.close(self._lines)
            self._lines = None


@dataclass(frozen=True)
class KeptEvaluation:
    """What the file of an evaluation holds that has not ended.

    Attributes:
        path: The file that was read, of the two.
        subject: What was evaluated, as hashes by name.
        outcomes: The episodes that had ended.
        seconds: Time that they took.
        lost: Lines at the journal's end that are none: a killed process leaves half a one, at most.
    """

    path: Path
    subject: Mapping[str, str]
    outcomes: tuple[EpisodeOutcome, ...]
    seconds: float
    lost: int = 0

    @property
    def line(self) -> str:
        """What people read: how many episodes there are."""
        words = f"found {len(self.outcomes)} episodes in '{self.path}'"
        return words if not self.lost else f"{words}, whose end is torn (lines lost: {self.lost})"

    def check(self, subject: Mapping[str, str], seeds: Collection[int]) -> None:
        """Check that an evaluation may go on from it.

        Raises:
            InputError: It is one of something else, or of seeds that are not asked for; says which.
        """
        if others := differing(self.subject, subject):
            raise InputError(
                f"'{self.path}' holds an evaluation with another {others}: go on with the same, or evaluate "
                "anew without --resume"
            )
        asked = set(seeds)
        if beyond := [o.seed for o in self.outcomes if o.seed not in asked]:
            raise InputError(
                f"'{self.path}' holds {len(beyond)} episodes that are not asked for, such as seed "
                f"{beyond[0]}: go on with the same --seed and at least as many --episodes, or evaluate anew "
                "without --resume"
            )


def read_kept(path: str | Path, versions: Mapping[str, str]) -> KeptEvaluation:
    """What there is of an evaluation, to go on from.

    Args:
        path: Its file.
        versions: Of this program, see `bt_tasksim.core.identity.identity`.

    Raises:
        InputError: There is none, it is damaged elsewhere than at the journal's end, or it is of another
            version.
    """
    path, journal = Path(path), journal_of(path)
    if _check_ours(journal):
        return _from_journal(journal, versions)
    if path.exists():
        return _from_file(path, versions)
    raise InputError(f"there is no evaluation in '{path}' to go on from: evaluate without --resume")


def _from_file(path: Path, versions: Mapping[str, str]) -> KeptEvaluation:
    text = read_bytes(path, f"'{path}'", LARGEST)
    try:
        content = parse_json_object(text, f"'{path}'")
    except InputError as error:
        raise InputError(f"{error}; remove it and evaluate anew") from error
    subject = _about(path, content, versions)
    episodes, seconds = content.get("outcomes"), content.get("seconds")
    if not isinstance(episodes, list) or outcomes_hash(episodes) != content.get("sha256"):
        raise _damaged(path, "its episodes are not what was written")
    found: dict[int, EpisodeOutcome] = {}
    for number, data in enumerate(episodes, start=1):
        outcome = _episode(data)
        if outcome is None or outcome.seed in found:
            raise _damaged(path, f"episode {number} is none")
        found[outcome.seed] = outcome
    if not _is_time(seconds):
        raise _damaged(path, "it does not say how long it took")
    return KeptEvaluation(path, subject, tuple(found.values()), float(seconds))


def _from_journal(journal: Path, versions: Mapping[str, str]) -> KeptEvaluation:
    *lines, rest = read_bytes(journal, f"'{journal}'", LARGEST).split(b"\n")
    first = _entry(lines[0]) if lines else None
    if first is None:
        whole = journal.with_name(journal.name.removesuffix(SUFFIX))
        there = f"; '{whole}' holds what had ended a little before" if whole.exists() else ""
        raise InputError(
            f"'{journal}' is damaged in line 1, which says what was evaluated: move it away and go on with "
            f"--resume, or evaluate anew{there}"
        )
    subject, seconds = _about(journal, first, versions), 0.0
    found: dict[int, EpisodeOutcome] = {}
    bad: list[int] = []
    last = 1
    for number, line in enumerate(lines[1:], start=2):
        entry = _entry(line)
        outcome = None if entry is None else _episode(entry.get("episode"))
        if entry is None or outcome is None or outcome.seed in found:
            bad.append(number)
            continue
        found[outcome.seed], last = outcome, number
        if _is_time(then := entry.get("seconds")):
            seconds = float(then)
    if within := [number for number in bad if number < last]:
        good = len(found)
        raise InputError(
            f"'{journal}' is damaged in line {', '.join(map(str, within[:9]))}{', ...' * (len(within) > 9)}, "
            f"and {good} episodes in it are whole: take these lines out (sed -i "
            f"'{';'.join(f'{number}d' for number in within)}' {shlex.quote(str(journal))}) and go on with "
            "--resume, which runs their episodes again"
        )
    return KeptEvaluation(journal, subject, tuple(found.values()), seconds, len(bad) + bool(rest))


def _real(path: str | Path) -> Path:
    """Where a path leads: there the file is, and its journal beside it, by whatever name it is reached."""
    real = os.path.realpath(path)
    return Path(path) if real == os.path.abspath(path) else Path(real)  # sentences name it as it was given


def _check_ours(journal: Path) -> bool:
    """Whether there is a journal.

    Raises:
        InputError: Something else has its name.
    """
    if not os.path.lexists(journal):
        return False
    begin = b""
    if journal.is_file() and not journal.is_symlink():
        with contextlib.suppress(OSError), open(journal, "rb") as file:
            begin = file.read(64)
    if not BEGIN.match(begin):
        raise InputError(
            f"'{journal}' is no journal of an evaluation, or its beginning is damaged, and that is where the "
            "episodes would be appended: move it away, or give --json another name"
        )
    return True


def _episode(data: Any) -> EpisodeOutcome | None:
    """An episode from plain data; None where it is none."""
    try:
        outcome = EpisodeOutcome.from_data(data)
        return outcome if outcome.to_data() == data else None
    except (InputError, ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError):
        return None


def _is_time(seconds: Any) -> TypeGuard[int | float]:
    return isinstance(seconds, int | float) and 0.0 <= seconds < float("inf")


def _about(path: Path, content: Mapping[str, Any], versions: Mapping[str, str]) -> Mapping[str, str]:
    subject, then = content.get("subject"), content.get("versions")
    if not isinstance(subject, dict) or not isinstance(then, dict):
        raise InputError(
            f"'{path}' does not say what was evaluated, as files of earlier versions do not: evaluate anew, "
            "without --resume"
        )
    if differ := differences(then, versions):
        raise InputError(
            f"'{path}' was written by another version ({differ}): go on with the same, or evaluate anew "
            "without --resume"
        )
    return subject


def _line(entry: Mapping[str, Any]) -> bytes:
    return json.dumps({"check": _check(entry), **entry}, allow_nan=False).encode() + b"\n"


def _entry(line: bytes) -> dict[str, Any] | None:
    """What a line says; None where it is not what was written."""
    try:
        entry: dict[str, Any] = parse_json_object(line, "it")
    except InputError:
        return None
    return entry if entry.pop("check", None) == _check(entry) else None


def _check(entry: Mapping[str, Any]) -> str:
    return f"{zlib.crc32(json.dumps(entry).encode()):08x}"


def _damaged(path: Path, reason: str) -> InputError:
    return InputError(f"'{path}' is damaged ({reason}): remove it and evaluate anew")
