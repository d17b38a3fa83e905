"""Sealed seeds: blocks of test draws, each opened once, by a commit that says beforehand what is claimed.

    python -m benchmarks.sealed                                    # which blocks are open, which comes next
    python -m benchmarks.sealed open --claim TEXT --metric TEXT --bar TEXT --measure success grasp ...
    git commit benchmarks/ledger.toml
    python -m benchmarks.success --block B0000                     # refused without that commit

A block is a range of 10,000 seeds; blocks never overlap, and begin above every seed that anything has ever
been run on. A block that is not in the ledger (``benchmarks/ledger.toml``) is sealed. Opening the next one
writes the claim, the metric, the bar it has to pass and the measurements it allows into the ledger. A
measurement then asks `block_seeds` for its seeds, which refuses

- a block that is sealed, or whose entry is not in the last commit word for word;
- a measurement that the entry does not name;
- a measurement whose result exists, or once existed in any commit: it is history, and never scored again.

Development uses seeds from `DEVELOPMENT` on, of which no claim may be made.
"""

from __future__ import annotations

import argparse
import datetime
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from bt_tasksim.core.errors import BtTasksimError, InputError
from bt_tasksim.core.files import write_text

ROOT = Path(__file__).resolve().parents[1]
LEDGER = "benchmarks/ledger.toml"
RESULTS = "benchmarks/results"
FIRST = 1_000_000
"""The first seed of the first block. Seeds below were run while things were built: 0 to 99,999 by every
benchmark, 700,000 to 900,999 by tests and tables of the decomposition."""
SIZE = 10_000
DEVELOPMENT = 20_000
"""Where seeds begin that anybody may look at."""
OUT = Path("runs/benchmarks")
"""Where results on them go."""


@dataclass(frozen=True)
class Block:
    """What the ledger says of an opened block.

    Attributes:
        id: ``B`` and four digits.
        opened: Date, ``YYYY-MM-DD``.
        claim: What is claimed, written down before anything is measured.
        metric: What is measured, and how it is compared.
        bar: What the metric has to reach for the claim to stand.
        command: The command that measures it.
        measures: Names of the results it allows, or of the benchmarks that write several (``success`` allows
            ``success/shelf_to_shelf-panda``).
    """

    id: str
    opened: str
    claim: str
    metric: str
    bar: str
    command: str
    measures: tuple[str, ...]

    @property
    def seeds(self) -> range:
        """All its seeds."""
        return seeds_of(self.id)

    def allows(self, measure: str) -> bool:
        """The block was opened for this measurement."""
        return measure in self.measures or measure.partition("/")[0] in self.measures


def seeds_of(block: str) -> range:
    """The seeds that an id stands for, opened or not.

    Raises:
        InputError: This is no id.
    """
    if not re.fullmatch(r"B\d{4}", block):
        raise InputError(f"'{block}' is no block: write B and four digits, such as B0000")
    first = FIRST + SIZE * int(block[1:])
    return range(first, first + SIZE)


def read_ledger(text: str) -> dict[str, Block]:
    """The opened blocks, by id.

    Args:
        text: The ledger, TOML: one table a block.

    Raises:
        InputError: It is no good; says which block and why.
    """
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{LEDGER}: {error}") from error
    blocks = {}
    for name, table in tables.items():
        seeds_of(name)
        if not isinstance(table, dict) or set(table) != set(_KEYS):
            raise InputError(f"{LEDGER}: block {name} needs {', '.join(_KEYS)}, and nothing else")
        table = dict(table, measures=tuple(table["measures"]))
        blocks[name] = Block(name, **table)
    return blocks


_KEYS = ("opened", "claim", "metric", "bar", "command", "measures")


def written(block: Block) -> str:
    """A block as a table of the ledger."""
    lines = [f"[{block.id}]"]
    for key in _KEYS:
        value = getattr(block, key)
        value = list(value) if isinstance(value, tuple) else value
        lines.append(f"{key} = {json.dumps(value, ensure_ascii=False)}")  # TOML writes these as JSON does
    return "\n".join(lines) + "\n"


def block_seeds(block: str, measure: str, count: int, root: Path = ROOT) -> range:
    """The first seeds of an opened block, for one measurement that was not made yet.

    Args:
        block: Its id.
        measure: Name of the measurement, such as ``success/shelf_to_shelf-panda``: that of its result.
        count: How many seeds.
        root: The repository.

    Raises:
        InputError: The block is sealed, its entry is not committed or was changed since, it was opened for
            something else, or the measurement was made before.
    """
    seeds = seeds_of(block)
    if count > len(seeds):
        raise InputError(f"block {block} has {len(seeds)} seeds, {count} were asked for")
    entry = read_ledger(_text(root / LEDGER)).get(block)
    if entry is None:
        raise InputError(
            f"block {block} is sealed: open it with 'python -m benchmarks.sealed open', and commit {LEDGER}"
        )
    if read_ledger(_committed(root)).get(block) != entry:
        raise InputError(f"the entry of block {block} is not committed as it stands: commit {LEDGER} first")
    if not entry.allows(measure):
        raise InputError(f"block {block} was opened for {', '.join(entry.measures)}, not for '{measure}'")
    if scored(block, measure, root):
        raise InputError(f"'{measure}' was scored on block {block}: it is history; open the next block")
    return seeds[:count]


def result_file(block: str, measure: str, root: Path = ROOT) -> Path:
    """Where a measurement on a block is written: once."""
    return root / RESULTS / block / f"{measure.rpartition('/')[2]}.json"


def scored(block: str, measure: str, root: Path = ROOT) -> bool:
    """The result is there, or was in any commit that led to this one."""
    path = result_file(block, measure, root)
    if path.exists():
        return True
    return bool(_git(root, "log", "-1", "--format=%H", "--", str(path.relative_to(root))).strip())


def write_result(block: str, measure: str, content: Mapping[str, object], root: Path = ROOT) -> Path:
    """Write what was measured on a block; it cannot be written twice.

    Raises:
        InputError: It is there already.
    """
    path = result_file(block, measure, root)
    if scored(block, measure, root):
        raise InputError(f"'{path.relative_to(root)}' is history: it is never written again")
    path.parent.mkdir(parents=True, exist_ok=True)
    commit = _git(root, "rev-parse", "HEAD").strip()
    write_text(path, json.dumps({"block": block, "commit": commit, **content}, indent=1) + "\n")
    return path


def keep(block: str | None, measure: str, content: Mapping[str, object], out: Path = OUT) -> Path:
    """Write a result: of a block beside all others, once; of other seeds into a folder to look at.

    Raises:
        InputError: See `write_result`.
    """
    if block is not None:
        return write_result(block, measure, content)
    path = out / f"{measure.rpartition('/')[2]}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, json.dumps(content, indent=1) + "\n")
    return path


def next_block(blocks: Mapping[str, Block]) -> str:
    """The first id after the last one that was opened."""
    return f"B{1 + max((int(name[1:]) for name in blocks), default=-1):04d}"


def open_block(
    claim: str, metric: str, bar: str, command: str, measures: Sequence[str], root: Path = ROOT
) -> Block:
    """Write the next block's entry into the ledger; a commit of it opens the block.

    Raises:
        InputError: A text is empty.
    """
    texts = {"claim": claim, "metric": metric, "bar": bar, "command": command}
    for name, text in texts.items():
        if not text.strip():
            raise InputError(f"a block is opened for a claim: say its {name}")
    if not measures:
        raise InputError("a block is opened for measurements: name at least one")
    old = _text(root / LEDGER)
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    block = Block(next_block(read_ledger(old)), today, **texts, measures=tuple(measures))
    write_text(root / LEDGER, f"{old.rstrip()}\n\n{written(block)}".lstrip())
    return block


def choose(block: str | None, first: int, measure: str, count: int) -> range:
    """A benchmark's seeds: of a block, or from any other seed on.

    Args:
        block: The block's id, or None.
        first: First seed without a block.
        measure: See `block_seeds`.
        count: How many seeds.

    Raises:
        InputError: See `block_seeds`; or the seeds are of a block on which this was not measured yet.
    """
    if block is not None:
        return block_seeds(block, measure, count)
    seeds = range(first, first + count)
    check_looked_at(seeds, measure)
    return seeds


def check_looked_at(seeds: Iterable[int], measure: str) -> None:
    """Check that seeds may be run to look at them: they are of no block, or the block was measured.

    Raises:
        InputError: A seed is of a block on which this was not measured yet.
    """
    for number in sorted({(seed - FIRST) // SIZE for seed in seeds if seed >= FIRST}):
        if not scored(f"B{number:04d}", measure):  # history may be repeated, and is then no result
            raise InputError(
                f"seeds from {FIRST + SIZE * number} on are sealed, as '{measure}' was not measured on them: "
                f"take --block, or seeds below {FIRST}"
            )


def add_arguments(parser: argparse.ArgumentParser, first: int = DEVELOPMENT) -> None:
    """The options of a benchmark that say on which draws it runs.

    Args:
        parser: Where to add them.
        first: First seed where no block is named.
    """
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--block", metavar="ID", help=f"an opened block; its results go to {RESULTS}/ID, once")
    which.add_argument(
        "--seed", type=int, default=first, metavar="S", help=f"else the first seed, default {first}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """List the blocks, or open the next one."""
    parser = argparse.ArgumentParser(description="Blocks of sealed test seeds.")
    commands = parser.add_subparsers(dest="action")
    opening = commands.add_parser("open", help="write the next block's entry into the ledger")
    for name, text in (
        ("claim", "what is claimed"),
        ("metric", "what is measured, and how it is compared"),
        ("bar", "what it has to reach"),
        ("command", "the command that measures it"),
    ):
        opening.add_argument(f"--{name}", required=True, metavar="TEXT", help=text)
    opening.add_argument("--measure", nargs="+", required=True, metavar="NAME", help="results it allows")
    options = parser.parse_args(arguments)
    try:
        if options.action == "open":
            block = open_block(options.claim, options.metric, options.bar, options.command, options.measure)
            print(f"{written(block)}\ncommit {LEDGER}: that opens block {block.id}")
        else:
            print(_listing(read_ledger(_text(ROOT / LEDGER))))
    except BtTasksimError as error:
        print(f"sealed: {error}", file=sys.stderr)
        return 2
    return 0


def _listing(blocks: Mapping[str, Block]) -> str:
    lines = []
    for block in blocks.values():
        there = sorted(p.stem for p in (ROOT / RESULTS / block.id).glob("*.json"))
        said = asdict(block)
        lines.append(
            f"{block.id}  seeds {block.seeds.start} to {block.seeds.stop - 1}, opened {block.opened}"
        )
        lines += [f"    {key}: {said[key]}" for key in ("claim", "metric", "bar", "command")]
        lines.append(f"    scored: {', '.join(there) or 'nothing yet'}")
    return "\n".join([*lines, f"{next_block(blocks)} is the next one"])


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def _committed(root: Path) -> str:
    """The ledger of the last commit; empty where there is none."""
    try:
        return _git(root, "show", f"HEAD:{LEDGER}")
    except InputError:
        return ""


def _git(root: Path, *words: str) -> str:
    """What git prints.

    Raises:
        InputError: There is no git, or this is no checkout.
    """
    try:
        done = subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(f"sealed seeds are scored in a git checkout only, and '{root}' is none") from error
    return done.stdout


if __name__ == "__main__":
    sys.exit(main())
