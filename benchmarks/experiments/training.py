"""Trainings that an experiment needs, run by run: what is finished is skipped, what was cut off goes on."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.core.files import write_text
from bt_tasksim.scene.scene import Scene
from bt_tasksim.training.config import TrainConfig

POLICIES = Path(__file__).resolve().parents[1] / "policies"
"""Policies of experiments; those that are used elsewhere are in ``assets/policies``."""
KEPT = ("steps", "episodes", "success", "return", "length", "ends", "stage", "held_apart", "seconds")
"""What is kept of each rollout."""


def learn(
    build: Callable[[], Behaviour],
    scene: Scene,
    out: Path,
    config: TrainConfig,
    workers: int,
    name: str,
    keep: bool = True,
) -> list[dict[str, Any]]:
    """Train one policy, unless that is done.

    Args:
        build: Builds the tree.
        scene: Its scene, with stages.
        out: The policy's folder.
        config: The settings.
        workers: Worker processes.
        name: Name of the tree in the card.
        keep: Keep checkpoint and events in ``<out>.training``; else its history alone, as ``<out>.json``.

    Returns:
        Its history.
    """
    from bt_tasksim.policy.files import CHECKPOINT, training_folder
    from bt_tasksim.training.ppo import train
    from bt_tasksim.training.record import HISTORY

    beside, short = training_folder(out), out.with_name(f"{out.name}.json")
    if finished(out):
        print(f"{out.name} is there already", flush=True)
    else:
        out.parent.mkdir(parents=True, exist_ok=True)
        resume = (beside / CHECKPOINT).is_file()
        train(build(), scene, out=out, config=config, workers=workers, resume=resume, report=_said, name=name)
        write_text(short, compact(history(beside / HISTORY)))
        if not keep:
            shutil.rmtree(beside)
    return history(short)


def finished(out: Path) -> bool:
    """A training has ended and its policy and history are there."""
    return (out / "card.json").is_file() and out.with_name(f"{out.name}.json").is_file()


def history(path: Path) -> list[dict[str, Any]]:
    """What a training wrote about each rollout."""
    rows: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
    return [{key: row[key] for key in KEPT if key in row} for row in rows]


def compact(rows: list[dict[str, Any]]) -> str:
    """A history as JSON, one line a rollout."""
    short = [{k: round(v, 4) if isinstance(v, float) else v for k, v in row.items()} for row in rows]
    return "[\n" + ",\n".join(json.dumps(row) for row in short) + "\n]\n"


_last = {"time": 0.0}


def _said(progress: Any) -> None:
    now, (done, total) = time.monotonic(), progress.steps
    if now - _last["time"] > 20.0 or done >= total:
        _last["time"] = now
        held = "" if progress.held_apart is None else " held apart {} of {}".format(*progress.held_apart)
        print(
            f"{done} of {total}: {100 * progress.success:.0f} %{held}, {progress.stage}, "
            f"{progress.rate:.0f}/s, {progress.seconds_left:.0f} s left",
            flush=True,
        )
