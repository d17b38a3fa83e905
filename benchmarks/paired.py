"""Two codes on the same draws: what a pair of outcomes for each draw says.

    python -m benchmarks.paired OLD NEW

takes two folders of result files and pairs those of the same name, draw by draw: of any benchmark that
writes its ``outcomes`` with ``seed`` and ``success``, such as `benchmarks.gap`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bt_tasksim.core.errors import BtTasksimError, InputError
from bt_tasksim.training.evaluation_outcomes import wilson

LEVEL = 0.01
"""A row is worse where chance alone would do this to it in fewer than one case of a hundred."""


@dataclass(frozen=True)
class Paired:
    """Outcomes of two codes on the same draws.

    Attributes:
        table: Which table the row belongs to.
        name: Name of the row.
        old: Whether the old code succeeded, by draw.
        new: Whether the new one did, for the same draws.
    """

    table: str
    name: str
    old: Mapping[str, bool]
    new: Mapping[str, bool]

    @property
    def draws(self) -> int:
        """Draws on which both ran."""
        return len(self.both)

    @property
    def both(self) -> list[str]:
        """The draws on which both ran."""
        return [draw for draw in self.old if draw in self.new]

    @property
    def only_old(self) -> list[str]:
        """Draws that only the old code did."""
        return [draw for draw in self.both if self.old[draw] and not self.new[draw]]

    @property
    def only_new(self) -> list[str]:
        """Draws that only the new code did."""
        return [draw for draw in self.both if self.new[draw] and not self.old[draw]]

    def successes(self, side: str) -> int:
        """Successes of a side, ``old`` or ``new``."""
        outcomes = self.old if side == "old" else self.new
        return sum(outcomes[draw] for draw in self.both)

    def to_json(self) -> dict[str, object]:
        """Counts, intervals and tests."""
        n, lost, won = self.draws, len(self.only_old), len(self.only_new)
        return {
            "table": self.table,
            "row": self.name,
            "draws": n,
            **{side: self.successes(side) for side in ("old", "new")},
            **{f"{side}_interval": list(wilson(self.successes(side), n)) for side in ("old", "new") if n},
            "only_old": lost,
            "only_new": won,
            "p": mcnemar(lost, won),
            "p_worse": worse(lost, won),
            "worse": worse(lost, won) < LEVEL,
            "failed_in_new_alone": self.only_old,
            "failed_in_old_alone": self.only_new,
        }


def mcnemar(only_old: int, only_new: int) -> float:
    """Exact two-sided p of McNemar's test: the two codes differ.

    Source: Q. McNemar, "Note on the sampling error of the difference between correlated proportions or
    percentages", Psychometrika 12, 1947; exact as a binomial test of the draws that only one of them did.
    """
    return _binomial(only_old, only_old + only_new, "two-sided")


def worse(only_old: int, only_new: int) -> float:
    """Exact one-sided p of the same test: the new code is worse."""
    return _binomial(only_old, only_old + only_new, "greater")


def _binomial(count: int, of: int, alternative: str) -> float:
    from scipy.stats import binomtest

    return float(binomtest(count, of, 0.5, alternative=alternative).pvalue) if of else 1.0


def difference(rows: Iterable[Paired]) -> float:
    """Points of success, per cent of all draws together, by which the new code is better."""
    rows = list(rows)
    draws = sum(row.draws for row in rows)
    gained = sum(row.successes("new") - row.successes("old") for row in rows)
    return 100.0 * gained / draws if draws else 0.0


def report(rows: Sequence[Paired]) -> dict[str, object]:
    """Everything as JSON: each row, each table, and all together."""
    tables = {
        name: [row for row in rows if row.table == name] for name in dict.fromkeys(r.table for r in rows)
    }
    return {
        "level": LEVEL,
        "rows": [row.to_json() for row in rows],
        "tables": {name: summary(part) for name, part in tables.items()},
        "together": summary(rows),
        "worse_rows": [row.name for row in rows if row.to_json()["worse"]],
    }


def summary(rows: Sequence[Paired]) -> dict[str, object]:
    """Several rows together."""
    return {
        "draws": sum(row.draws for row in rows),
        "old": sum(row.successes("old") for row in rows),
        "new": sum(row.successes("new") for row in rows),
        "points": round(difference(rows), 3),
    }


def markdown(rows: Sequence[Paired]) -> str:
    """The same as tables."""
    lines = []
    for name in dict.fromkeys(row.table for row in rows):
        part = [row for row in rows if row.table == name]
        lines += [
            f"### {name}",
            "",
            "| row | draws | old (95 % interval) | new (95 % interval) | points "
            "| only old, only new | p (differ) | p (worse) | |",
            "|---|---|---|---|---|---|---|---|---|",
            *(_line(row) for row in part),
            f"| together | {sum(r.draws for r in part)} | {sum(r.successes('old') for r in part)} "
            f"| {sum(r.successes('new') for r in part)} | {difference(part):+.2f} | | | | |",
            "",
        ]
    bad = [row.name for row in rows if row.to_json()["worse"]]
    lines.append(
        f"All rows together: {difference(rows):+.2f} points on {sum(r.draws for r in rows)} draws; "
        f"significantly worse ({100 * LEVEL:.0f} %, one-sided): {', '.join(bad) or 'none'}."
    )
    return "\n".join(lines) + "\n"


def _line(row: Paired) -> str:
    lost, won = len(row.only_old), len(row.only_new)
    p, one = mcnemar(lost, won), worse(lost, won)
    cells = []
    for side in ("old", "new"):
        wins = row.successes(side)
        low, high = (100 * bound for bound in wilson(wins, row.draws)) if row.draws else (0.0, 100.0)
        cells.append(f"{wins} ({low:.1f} to {high:.1f} %)")
    mark = "**worse**" if one < LEVEL else ""
    return (
        f"| {row.name} | {row.draws} | {' | '.join(cells)} | {difference([row]):+.1f} | {lost}, {won} "
        f"| {p:.3g} | {one:.3g} | {mark} |"
    )


def of_folders(old: Path, new: Path) -> list[Paired]:
    """Results of the same name in two folders.

    Raises:
        InputError: No name is in both, or two results of a name share no draw.
    """
    rows = []
    for path in sorted(new.glob("*.json")):
        sides = [_outcomes(folder / path.name) for folder in (old, new)]
        if all(sides):
            rows.append(Paired(path.stem.split("-")[0], path.stem, *sides))
    if not rows:
        raise InputError(f"no result file with outcomes has the same name in '{old}' and '{new}'")
    apart = [row.name for row in rows if not row.draws]
    if apart:
        raise InputError(f"the two results of {', '.join(apart)} are of other draws")
    return rows


def _outcomes(path: Path) -> dict[str, bool]:
    try:
        content: Any = json.loads(path.read_text(encoding="utf-8"))
        return {str(o["seed"]): bool(o["success"]) for o in content["outcomes"]}
    except (OSError, ValueError, KeyError, TypeError):
        return {}  # not there, or a result of another kind


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description="Two folders of results on the same draws, in pairs.")
    parser.add_argument("old", type=Path, help="folder of the older code's results")
    parser.add_argument("new", type=Path, help="folder of the new code's results")
    options = parser.parse_args(arguments)
    try:
        print(markdown(of_folders(options.old, options.new)))
    except BtTasksimError as error:
        print(f"paired: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
