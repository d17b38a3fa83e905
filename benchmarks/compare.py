"""An older code and this one, on the same draws: README's tables of successes, grasps and logs, in pairs.

    python -m benchmarks.compare --old ../old --block B0000              # hours; may be stopped and goes on
    python -m benchmarks.compare --old ../old --draws 3 --out runs/look  # a look, on development seeds

Each part of a row runs in a process of its own, with ``PYTHONPATH`` set to one checkout or the other,
through ``bt-tasksim evaluate`` and ``decompose_log``, which both codes have. Outcomes are appended to
``<out>/outcomes.jsonl`` as they come; the same command again goes on where it was. At the end
``compare.json`` and ``compare.md`` say of each row: successes with Wilson's intervals, draws that only one
code did, McNemar's exact p. And what the new code did in each complete row is written as its benchmark
writes it (so that `benchmarks.tables` shows it), with the pairs beside; of a block once and for ever.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks import grasp, paired, sealed, success
from benchmarks.compare_rows import GRASPS, LOGS, Chunk, Row, chunks, rows
from benchmarks.decomposition import EXPECTED
from bt_tasksim.core.errors import BtTasksimError, InputError, MachineError
from bt_tasksim.core.files import write_text
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, Evaluation
from bt_tasksim.trees.load import load_source

MEASURE = "compare"
SIDES = ("old", "new")
WORKER = Path(__file__).with_name("compare_worker.py")
LONGEST = 7200.0
"""Seconds after which a process is given up."""
HEAD = ("scenario", "robot", "engines", "perception", "policies")


@dataclass(frozen=True)
class Setting:
    """What is compared, the same through all continuations.

    Attributes:
        checkouts: Folders of the two codes.
        first: First seed.
        draws: Most draws of a row; None: those of a full measurement.
        block: The block, or None.
        out: Where outcomes and reports go.
        recorded: Folder of ManiSkill's recorded logs.
    """

    checkouts: dict[str, Path]
    first: int
    draws: int | None
    block: str | None
    out: Path
    recorded: Path

    def count(self, row: Row) -> int:
        """Draws of a row."""
        return row.draws if self.draws is None else min(self.draws, row.draws)

    def commits(self) -> dict[str, str]:
        """Commit of each checkout; with a plus where files differ from it."""
        return {side: _commit(self.checkouts[side]) for side in SIDES}


class Outcomes:
    """Everything measured so far, in a file to which lines are appended.

    Args:
        path: The file, JSON lines.
    """

    def __init__(self, path: Path) -> None:
        self.path, self._lock = path, threading.Lock()
        self.heads: dict[tuple[str, str], dict[str, Any]] = {}
        self.found: dict[tuple[str, str], dict[str, dict[str, Any]]] = {}
        for line in path.read_text(encoding="utf-8").splitlines() if path.is_file() else ():
            try:
                self._take(json.loads(line))
            except json.JSONDecodeError:
                continue  # the last line of a process that was killed while it wrote

    def add(self, row: str, side: str, head: dict[str, Any], outcomes: dict[str, dict[str, Any]]) -> None:
        """Keep what one process has measured."""
        line = {"row": row, "side": side, "head": head, "outcomes": outcomes}
        with self._lock:
            with open(self.path, "a", encoding="utf-8") as file:
                file.write(f"\n{json.dumps(line)}\n")
            self._take(line)

    def has(self, chunk: Chunk, side: str) -> bool:
        """All draws of this part are known."""
        return {str(seed) for seed in chunk.seeds} <= self.of(chunk.row, side).keys()

    def of(self, row: Row, side: str) -> dict[str, dict[str, Any]]:
        """A row's outcomes by draw."""
        return self.found.get((row.name, side), {})

    def pair(self, row: Row) -> paired.Paired:
        """A row as far as it is known."""
        old, new = (
            {draw: bool(outcome["success"]) for draw, outcome in self.of(row, side).items()} for side in SIDES
        )
        return paired.Paired(row.table, row.name, old, new)

    def _take(self, line: dict[str, Any]) -> None:
        key = (line["row"], line["side"])
        self.heads.setdefault(key, line["head"])
        self.found.setdefault(key, {}).update(line["outcomes"])


def measure(setting: Setting, chunk: Chunk, side: str) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Run one part with one code.

    Returns:
        What it was measured with, and outcomes by draw.

    Raises:
        MachineError: The process failed; says how.
    """
    row = chunk.row
    if row.table == LOGS:
        return {}, _recognised(setting, chunk, side)
    tree, folder = row.scenario, setting.out / side
    folder.mkdir(parents=True, exist_ok=True)
    if chunk.log is not None:
        tree = str(folder / f"{row.scenario}-{chunk.log.stem}.xml")
        _run(setting, side, _cli("decompose", str(chunk.log), "--xml", tree))
    said = folder / f"{row.name}-{chunk.seeds.start}.json"
    words = [*row.arguments, "--seed", str(chunk.seeds.start), "--episodes", str(len(chunk.seeds))]
    if chunk.log is not None:
        words += ["--scene", row.scenario]
    if row.table == GRASPS:
        words += ["--policy", f"grasp={_policy(setting, row)}"]
    _run(setting, side, _cli("evaluate", tree, *words, "--json", str(said)))
    content = json.loads(said.read_text(encoding="utf-8"))
    said.unlink()
    head = {key: content[key] for key in HEAD} | {"scenario": row.scenario}
    return head, {str(outcome["seed"]): outcome for outcome in content["outcomes"]}


def _policy(setting: Setting, row: Row) -> str:
    if row.who == "programmed":
        return "programmed"
    return f"grasp-{row.robot}" if row.who == "learned" else str(_untrained_folder(setting, row.robot))


def _untrained_folder(setting: Setting, robot: str) -> Path:
    return setting.out / "untrained" / robot / "grasp-untrained"


def _recognised(setting: Setting, chunk: Chunk, side: str) -> dict[str, dict[str, Any]]:
    row = chunk.row
    files: list[tuple[str, str, int | None]] = []
    for seed in chunk.seeds:
        if row.factor:
            files.append((str(seed), str(_fresh_folder(setting, row) / f"{seed}.h5"), None))
        elif row.scenario.endswith("-v1"):
            files.append((str(seed), str(setting.recorded / row.scenario / "trajectory.h5"), seed))
        else:
            log = setting.checkouts[side] / "assets" / "demonstrations" / row.scenario / f"{seed:02d}.h5"
            files.append((str(seed), str(log), None))
    found = json.loads(_run(setting, side, [sys.executable, str(WORKER), "tasks"], json.dumps(files)))
    right = list(EXPECTED[row.scenario])
    return {label: {"success": tasks == right, "tasks": tasks} for label, tasks in found.items()}


def _fresh_folder(setting: Setting, row: Row) -> Path:
    return setting.out / "logs" / f"{row.scenario}-{row.factor}"


def prepare(setting: Setting, chosen: Sequence[Row]) -> None:
    """Make what both codes are given: the untrained grasp and the fresh logs, both by the old code."""
    for robot in sorted({row.robot for row in chosen if row.who == "untrained"}):
        if not (_untrained_folder(setting, robot) / "card.json").is_file():
            folder = _untrained_folder(setting, robot)
            folder.parent.mkdir(parents=True, exist_ok=True)
            _run(setting, "old", [sys.executable, str(WORKER), "untrained", robot, str(folder)])
    for row in (row for row in chosen if row.factor):
        words = [str(_fresh_folder(setting, row)), row.scenario, str(setting.first), str(setting.count(row))]
        _run(setting, "old", [sys.executable, str(WORKER), "logs", *words, str(row.factor)])


def _cli(*words: str) -> list[str]:
    return [sys.executable, "-m", "bt_tasksim.cli", *words]


def _run(setting: Setting, side: str, words: Sequence[str], given: str = "") -> str:
    """What a command prints that runs with one of the codes."""
    checkout = str(setting.checkouts[side])
    environment = {**os.environ, "PYTHONPATH": checkout, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            words, cwd=checkout, env=environment, input=given, capture_output=True, text=True, timeout=LONGEST
        )
    except subprocess.TimeoutExpired as error:
        raise MachineError(f"{side} code: no end after {LONGEST:.0f} s: {' '.join(words[1:])}") from error
    if done.returncode != 0:
        last = (done.stderr.strip() or done.stdout.strip() or "nothing").splitlines()[-1]
        raise MachineError(f"{side} code: exit {done.returncode} of {' '.join(words[1:])}: {last}")
    return done.stdout


def _commit(checkout: Path) -> str:
    words = ["git", "-C", str(checkout)]
    try:
        head = subprocess.run([*words, "rev-parse", "HEAD"], capture_output=True, text=True, check=True)
        changed = subprocess.run(
            [*words, "status", "--porcelain", "--untracked-files=no"],
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(f"'{checkout}' is no git checkout") from error
    return head.stdout.strip() + ("+" if changed.stdout.strip() else "")


def compare(setting: Setting, chosen: Sequence[Row], jobs: int) -> list[str]:
    """Measure what is missing.

    Returns:
        One sentence for each part that could not be measured.

    Raises:
        InputError: A checkout has changed meanwhile.
    """
    outcomes = Outcomes(setting.out / "outcomes.jsonl")
    if setting.block is not None:
        chosen = [row for row in chosen if not sealed.scored(setting.block, f"{MEASURE}/{row.name}")]
    prepare(setting, chosen)
    logs = {row.scenario: _shipped(setting, row.scenario) for row in chosen if row.from_logs}
    todo = [
        (chunk, side)
        for row in chosen
        for chunk in chunks(row, setting.first, setting.count(row), logs.get(row.scenario, ()))
        for side in SIDES
        if not outcomes.has(chunk, side)
    ]
    failed: list[str] = []
    begun, commits = time.monotonic(), setting.commits()

    def one(chunk: Chunk, side: str) -> None:
        if setting.commits() != commits:
            raise InputError("a checkout has changed since this began: take ones that nobody works in")
        head, found = measure(setting, chunk, side)
        outcomes.add(chunk.row.name, side, head, found)

    with ThreadPoolExecutor(jobs) as pool:
        running = {pool.submit(one, chunk, side): (chunk, side) for chunk, side in todo}
        try:
            for count, done in enumerate(as_completed(running), 1):
                chunk, side = running[done]
                try:
                    done.result()
                except MachineError as error:
                    failed.append(str(error))
                    print(error, file=sys.stderr, flush=True)
                spent = time.monotonic() - begun
                left = spent / count * (len(todo) - count)
                print(
                    f"{count} of {len(todo)}: {chunk.row.name} {chunk.seeds.start}.. {side}, "
                    f"{spent / 60:.1f} min, about {left / 60:.0f} left",
                    flush=True,
                )
        except (KeyboardInterrupt, InputError):
            pool.shutdown(cancel_futures=True)
            raise
    return failed


def _shipped(setting: Setting, scenario: str) -> tuple[Path, ...]:
    """A scenario's shipped logs; both codes are given the old one's."""
    return tuple(sorted((setting.checkouts["old"] / "assets" / "demonstrations" / scenario).glob("*.h5")))


def write_results(setting: Setting, chosen: Sequence[Row]) -> None:
    """Write the rows that are complete, each as its own benchmark writes it; of a block only once."""
    outcomes = Outcomes(setting.out / "outcomes.jsonl")
    for row in chosen:
        measure = f"{MEASURE}/{row.name}"
        if any(len(outcomes.of(row, side)) < setting.count(row) for side in SIDES):
            continue
        if setting.block is None or not sealed.scored(setting.block, measure):
            content = _content(setting, outcomes, row)
            sealed.keep(setting.block, measure, content, setting.out / "rows")


def _content(setting: Setting, outcomes: Outcomes, row: Row) -> dict[str, Any]:
    pair = outcomes.pair(row)
    both = {"commits": setting.commits(), "paired": pair.to_json()}
    new = outcomes.of(row, "new")
    if row.table == LOGS:
        return {**both, "right": pair.successes("new"), "logs": pair.draws, "tasks": new}
    found = _evaluation(outcomes.heads[row.name, "new"], [new[draw] for draw in sorted(new, key=int)])
    if row.table == GRASPS:
        scene = load_source(row.scenario, row.robot).scene
        kinds = {int(draw): scene.sample(int(draw)).objects[0].kind for draw in new}
        return {**grasp.summary(found, kinds, {}), **both}
    return {**success.content(found, setting.first), **both}


def _evaluation(head: dict[str, Any], outcomes: Sequence[dict[str, Any]]) -> Evaluation:
    seconds = sum(outcome["wall_time"] for outcome in outcomes)
    episodes = tuple(EpisodeOutcome.from_data(outcome) for outcome in outcomes)
    return Evaluation(**head, outcomes=episodes, seconds=seconds)


def write_report(setting: Setting, chosen: Sequence[Row]) -> str:
    """``compare.json`` and ``compare.md`` of what is known; the latter is returned."""
    outcomes = Outcomes(setting.out / "outcomes.jsonl")
    pairs = [pair for row in chosen if (pair := outcomes.pair(row)).draws]
    text = paired.markdown(pairs)
    content = {"commits": setting.commits(), "first_seed": setting.first, **paired.report(pairs)}
    write_text(setting.out / "compare.json", json.dumps(content, indent=1) + "\n")
    write_text(setting.out / "compare.md", text)
    return text


def _same_as_before(setting: Setting) -> None:
    """Note the setting, or see that it is what a run that goes on began with.

    Raises:
        InputError: It is another one, or a checkout has changes that are in no commit.
    """
    now = {**asdict(setting), "commits": setting.commits()}
    now = json.loads(json.dumps(now, default=str))
    path = setting.out / "setting.json"
    if setting.block is not None and any(c.endswith("+") for c in now["commits"].values()):
        raise InputError("a block is measured with committed code alone: commit, or take a clean checkout")
    if path.is_file():
        before = json.loads(path.read_text(encoding="utf-8"))
        changed = sorted(key for key in now if now[key] != before.get(key))
        if changed:
            raise InputError(f"'{setting.out}' was begun with other {', '.join(changed)}: take another --out")
    write_text(path, json.dumps(now, indent=1) + "\n")


def _setting(options: argparse.Namespace, chosen: Sequence[Row]) -> Setting:
    first, out = options.seed, options.out or Path("runs") / f"compare-{options.block or 'development'}"
    if options.block is not None:
        first = sealed.seeds_of(options.block).start
    for row in chosen:
        if options.block is None:
            sealed.choose(None, first, row.name, row.draws)
        elif not sealed.scored(options.block, f"{MEASURE}/{row.name}"):
            sealed.block_seeds(options.block, f"{MEASURE}/{row.name}", row.draws)
    out.mkdir(parents=True, exist_ok=True)
    checkouts = {"old": options.old.resolve(), "new": options.new.resolve()}
    setting = Setting(
        checkouts, first, options.draws, options.block, out.resolve(), options.recorded.resolve()
    )
    for side in SIDES:
        if not (checkouts[side] / "bt_tasksim" / "__init__.py").is_file():
            raise InputError(f"there is no bt_tasksim in '{checkouts[side]}': give a checkout")
        where = json.loads(_run(setting, side, [sys.executable, str(WORKER), "where"]))
        if Path(where) != checkouts[side]:
            raise InputError(f"with '{checkouts[side]}' Python takes bt_tasksim from '{where}'")
    if options.block is not None and options.draws is not None:
        raise InputError("a block is measured in full: leave out --draws")
    return setting


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, go on, report."""
    every = {row.name: row for row in rows()}
    parser = argparse.ArgumentParser(description="An older code and this one on the same draws.")
    parser.add_argument("--old", type=Path, required=True, metavar="DIR", help="checkout of the older code")
    parser.add_argument("--new", type=Path, default=sealed.ROOT, metavar="DIR", help="default: this one")
    sealed.add_arguments(parser)
    parser.add_argument("--draws", type=int, metavar="N", help="most draws of a row; default: all")
    parser.add_argument("--only", nargs="+", metavar="ROW", default=list(every), help=", ".join(every))
    parser.add_argument("--out", type=Path, metavar="DIR", help="default runs/compare-<block>")
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time, default 2")
    parser.add_argument("--nice", type=int, default=0, metavar="N", help="be nicer to others by this much")
    parser.add_argument(
        "--recorded",
        type=Path,
        metavar="DIR",
        default=sealed.ROOT.parent / "shared" / "demonstrations" / "maniskill",
        help="ManiSkill's recorded logs; without them their rows are left out",
    )
    options = parser.parse_args(arguments)
    try:
        unknown = set(options.only) - set(every)
        if unknown:
            raise InputError(f"there is no row {', '.join(sorted(unknown))}; there are {', '.join(every)}")
        there = options.recorded.is_dir()
        chosen = [every[n] for n in options.only if there or not every[n].scenario.endswith("-v1")]
        os.nice(options.nice)
        setting = _setting(options, chosen)
        _same_as_before(setting)
        failed = compare(setting, chosen, options.jobs)
        print(write_report(setting, chosen), flush=True)
        write_results(setting, chosen)
    except BtTasksimError as error:
        print(f"compare: {error}", file=sys.stderr)
        return 2
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
