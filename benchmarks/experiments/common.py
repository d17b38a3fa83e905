"""What all experiments share: what is asked for, shares as text, and how results are written."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.success import RESULTS
from bt_tasksim.core.files import write_text
from bt_tasksim.core.resources import asset

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "images" / "experiments"
FIRST_SEED = 50_000
"""Seeds from here on were measured after many changes (``docs/evaluation.md``): when the experiments are made
anew, they take a block of `benchmarks.sealed`."""
EXPERIMENTS = {
    "A": "learning",
    "B": "shapes",
    "C": "robot",
    "D": "sequences",
    "E": "follower",
    "F": "ablations",
}
"""Module of each."""


@dataclass(frozen=True)
class Request:
    """What the command line asks for.

    Attributes:
        policy: The learned policy; None: the shipped one.
        workers: Worker processes.
        draws: Draws of each measurement; None: the experiment's own.
        steps: Decisions of each training; None: the experiment's own.
        policies: Folder of the experiments' own policies; None: ``benchmarks/policies``.
        results: Folder of results.
        pictures: Folder of pictures.
    """

    policy: str | None = None
    workers: int = 2
    draws: int | None = None
    steps: int | None = None
    policies: Path | None = None
    results: Path = RESULTS
    pictures: Path = PICTURES

    def seeds(self, draws: int) -> range:
        """Seeds of the draws."""
        return range(FIRST_SEED, FIRST_SEED + (self.draws or draws))


def policy_of(request: Request, robot: str) -> Path:
    """The folder of the learned grasp for a robot: what was asked for, or the shipped one."""
    return Path(request.policy) if request.policy else asset("policies", f"grasp-{robot}")


def share(found: Mapping[str, Any]) -> str:
    """``963 of 1000, 96.3 % (94.9 to 97.3)``."""
    n, wins = found["draws"], found["successes"]
    low, high = found["interval"]
    return f"{wins} of {n}, {100 * wins / max(n, 1):.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def write(request: Request, letter: str, found: Mapping[str, Any]) -> Path:
    """Write an experiment's results."""
    request.results.mkdir(parents=True, exist_ok=True)
    path = request.results / f"experiment-{letter}.json"
    write_text(path, json.dumps(found, indent=1) + "\n")
    return path


def read(letter: str, folder: Path = RESULTS) -> dict[str, Any] | None:
    """An experiment's results, or None where there are none yet."""
    path = folder / f"experiment-{letter}.json"
    found: dict[str, Any] | None = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    return found
