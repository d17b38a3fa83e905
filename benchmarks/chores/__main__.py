"""Random chores over all concepts, trees made in the obvious way, and what becomes of them.

    python -m benchmarks.chores --episodes 20                        # development seeds
    python -m benchmarks.chores --block B0012 --episodes 100 --engines mujoco
    python -m benchmarks.chores --only 900012 --kinds pour carry     # one of them again

Each draw is a task of its own (`benchmarks.chores.draw`). Draws that fail are given to an oracle, which has
exact poses, other orders of the chores and trees that recover, each in a world drawn with the same seed.
But it has the very concepts that are measured: what none of them can do it calls impossible, too. So
successes are said of all draws first, then of those that it achieves, and what it calls impossible is listed
with the reasons of its own tries, to be looked at.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from benchmarks import sealed
from benchmarks.chores.chore import KINDS
from benchmarks.chores.draw import Task, task
from bt_tasksim import EngineOptions, Runner
from bt_tasksim.core.errors import BtTasksimError, BtTasksimWarning, InputError
from bt_tasksim.core.identity import identity
from bt_tasksim.scene.configuration import check_seed
from bt_tasksim.training.evaluation import episode
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, wilson

FIRST = 900_000
"""The first seed without a block."""
ORACLES = 6
"""Tries of the oracle."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure."""
    parser = argparse.ArgumentParser(prog="benchmarks.chores", description=__doc__.partition("\n")[0])
    sealed.add_arguments(parser, FIRST)
    parser.add_argument("--robot", default="panda")
    parser.add_argument("--episodes", type=int, default=20, metavar="N", help="draws, default 20")
    parser.add_argument(
        "--only", type=int, nargs="+", metavar="SEED", help="these seeds, and nothing is kept"
    )
    parser.add_argument("--kinds", nargs="*", default=[], metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--tree", default="obvious", choices=("obvious", "recovering"))
    parser.add_argument("--engines", default="sapien")
    parser.add_argument("--noise", default="fine")
    parser.add_argument("--oracle", type=int, default=ORACLES, metavar="N", help="tries for a failed draw")
    asked = parser.parse_args(arguments)
    warnings.simplefilter("ignore", BtTasksimWarning)
    usual = {"tree": "obvious", "engines": "sapien", "noise": "fine"}
    name = "-".join(["chores", asked.robot, *(v for k, v in vars(asked).items() if usual.get(k, v) != v)])
    try:
        for seed in asked.only or ():
            check_seed(seed)
        if asked.episodes < 1:
            raise InputError(f"'--episodes' should be at least 1, found {asked.episodes}")
        if asked.kinds and asked.block:
            raise InputError("a block is measured with all kinds of chores: leave out --kinds")
        if asked.only:
            sealed.check_looked_at(asked.only, f"chores/{name}")
            _said(list(_played(asked.only, asked)), name)
            return 0
        seeds = sealed.choose(asked.block, asked.seed, f"chores/{name}", asked.episodes)
        draws = list(_played(seeds, asked))
        content = {"benchmark": "chores", "robot": asked.robot, "engines": asked.engines}
        content |= {name: vars(asked)[name] for name in ("tree", "noise", "oracle", "kinds")}
        content |= {"versions": identity(), **summary(draws), "draws": draws}
        sealed.keep(asked.block, f"chores/{name}", content)
        _said(draws, name)
    except BtTasksimError as error:
        print(f"chores: {error}", file=sys.stderr)
        return 2
    return 0


def _played(seeds: Sequence[int], asked: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """What becomes of each draw."""
    good = 0
    for number, seed in enumerate(seeds, 1):
        drawn = task(seed, asked.robot, asked.kinds)
        found = _one(drawn, asked.engines, asked.noise, asked.tree)
        draw = {"seed": int(seed), "words": drawn.words, "kinds": [chore.kind for chore in drawn.chores]}
        draw |= {"success": found.success, "leaf": found.leaf, "why": found.outcome.sentence}
        draw["reason"] = "" if found.success else found.outcome.cause.reason.name
        if not found.success and asked.oracle > 0:
            draw["possible"], draw["oracle"] = _possible(drawn, asked)
        good += found.success
        print(f"{'ok  ' if found.success else 'FAIL'} {seed} {good}/{number}  {drawn.words}", flush=True)
        if not found.success:
            print(f"       {found.leaf}: {draw['reason']}: {draw['why']}", flush=True)
            if "possible" in draw:
                said = "possible" if draw["possible"] else f"IMPOSSIBLE: {'; '.join(draw['oracle'])}"
                print(f"       oracle: {said}", flush=True)
        yield draw


def _one(
    drawn: Task, engines: str, noise: str, kind: str, order: Sequence[int] | None = None
) -> EpisodeOutcome:
    with Runner(drawn.tree(kind, order), drawn.scene, EngineOptions(engines=engines, noise=noise)) as runner:
        return episode(runner, drawn.seed)


def _possible(drawn: Task, asked: argparse.Namespace) -> tuple[bool, list[str]]:
    """Whether the oracle achieves it, and why its tries before that failed: leaves and reasons."""
    orders = itertools.permutations(range(len(drawn.chores)))
    tries = itertools.islice(itertools.product(orders, ("obvious", "recovering")), asked.oracle)
    failed: list[str] = []
    for order, kind in tries:
        found = _one(drawn, asked.engines, "none", kind, order)
        if found.success:
            return True, failed
        failed.append(f"{found.leaf}: {found.outcome.cause.reason.name}")
    return False, failed


def summary(draws: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Successes of all draws and of what the oracle achieves, and failures by leaf and reason."""
    possible = [draw for draw in draws if draw["success"] or draw.get("possible", True)]
    successes = sum(draw["success"] for draw in draws)
    impossible = Counter(
        " or ".join(dict.fromkeys(draw["oracle"])) for draw in draws if not draw.get("possible", True)
    )
    failed = Counter(f"{d['leaf']}: {d['reason']}" for d in draws if not d["success"])
    by_kind = Counter(kind for draw in draws for kind in draw["kinds"])
    missed = Counter(kind for draw in draws if not draw["success"] for kind in draw["kinds"])
    return {
        "episodes": len(draws),
        "possible": len(possible),
        "successes": successes,
        "confidence_interval_of_all": _interval(successes, len(draws)),
        "confidence_interval": _interval(successes, len(possible)),
        "failures": dict(failed.most_common()),
        "impossible": dict(impossible.most_common()),
        "kinds": {name: {"draws": n, "in_failed": missed[name]} for name, n in sorted(by_kind.items())},
    }


def _interval(successes: int, count: int) -> list[float]:
    """The 95 % interval of a share."""
    return [round(share, 4) for share in wilson(successes, count)] if count else [0.0, 1.0]


def _said(draws: Sequence[dict[str, Any]], name: str) -> None:
    found = summary(draws)
    of_all, of_possible = (
        "{:.1f} to {:.1f} %".format(*(100 * share for share in found[interval]))
        for interval in ("confidence_interval_of_all", "confidence_interval")
    )
    print(f"{name}: {found['successes']} of {found['episodes']} draws ({of_all})")
    print(f"  of those that the oracle achieves {found['successes']} of {found['possible']} ({of_possible})")
    for reason, count in found["failures"].items():
        print(f"  {count} x {reason}")
    for reason, count in found["impossible"].items():
        print(f"  {count} x called impossible by the oracle: {reason}")


if __name__ == "__main__":
    sys.exit(main())
