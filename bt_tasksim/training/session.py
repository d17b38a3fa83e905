"""What ``bt-tasksim train`` does around `bt_tasksim.training.ppo.train`: settings, summary, how to go on."""

from __future__ import annotations

import dataclasses
import json
import os
import shlex
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bt_tasksim.core.document import located, read_document
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.files import check_folder
from bt_tasksim.core.interrupts import terminable
from bt_tasksim.core.locks import LockedError
from bt_tasksim.core.plugins import loaded
from bt_tasksim.core.typed_file import record_model, validate
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.policy.files import CHECKPOINT, training_folder
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.named_tree import NamedTree
from bt_tasksim.training.on_cluster import check_cluster
from bt_tasksim.training.record import CLEARLY, HISTORY, Progress


@dataclass(frozen=True)
class Request:
    """What the command line asks for.

    Attributes:
        tree: Name or file of the tree.
        scene: Name or file of the scene, or None for the tree's own.
        robot: Name or file of the robot, or None for the scene's own.
        engines: Name of the physics engine, or None for the usual one.
        out: The policy's folder, or None for `default_out`.
        steps: Decisions, or None for the settings' own.
        seed: Seed, or None for the settings' own.
        workers: Worker processes or actors, or None for as many as `bt_tasksim.training.ppo.train` takes.
        cluster: Address of a Ray cluster, or None for this machine's processes.
        settings: File of settings, or None.
        resume: Go on from the checkpoint.
        backward: Fine-tune from the last Train node to the first afterwards.
    """

    tree: str
    scene: str | None = None
    robot: str | None = None
    engines: str | None = None
    out: Path | None = None
    steps: int | None = None
    seed: int | None = None
    workers: int | None = None
    cluster: str | None = None
    settings: Path | None = None
    resume: bool = False
    backward: bool = False

    def words(self) -> list[str]:
        """The command line that asks for this and goes on from the checkpoint."""
        out = ["bt-tasksim", "train", self.tree]
        for plugin in loaded():
            out += ["--plugin", plugin]
        for name in ("scene", "robot", "engines", "out", "steps", "seed", "workers", "cluster", "settings"):
            value = getattr(self, name)
            if value is not None:
                out += [f"--{name}", str(value)]
        return [*out, *(["--backward"] if self.backward else []), "--resume"]


def run(request: Request, report: Callable[[Progress], None]) -> str:
    """Train, and say where the policy is and how it is used.

    Args:
        request: What to train.
        report: Called after every rollout.

    Raises:
        InputError: Anything that was asked for is no good; then nothing was written.
        MachineError: The libraries for training are missing, a worker ended, or the cluster does not answer.
        KeyboardInterrupt: Ended by the user, SIGTERM or SIGHUP; says how to go on.
    """
    config = load_settings(request.settings)
    changes = {name: getattr(request, name) for name in ("steps", "seed")}
    config = dataclasses.replace(config, **{k: v for k, v in changes.items() if v is not None})
    options = EngineOptions(noise="original")
    if request.engines is not None:
        options = dataclasses.replace(options, engines=request.engines)
    if request.cluster is not None:
        check_cluster(request.cluster, options)
    named = NamedTree(request.tree, request.scene, request.robot)
    source = named.load(options)
    out = request.out or default_out(source.name, source.scene.robot)
    ppo, find_train = _ppo()
    tree = source.build()
    find_train(tree)
    places = ppo.policy_folders(tree, out)
    fresh = _check(places.values(), request.resume)
    try:
        with terminable():
            ppo.train(
                tree,
                source.scene,
                out=out,
                config=config,
                options=options,
                workers=request.workers,
                resume=request.resume,
                backward=request.backward,
                report=report,
                name=source.name,
                cluster=request.cluster,
                source=named,
                build=source.build,
            )
    except KeyboardInterrupt as stop:
        kept = any((training_folder(folder) / CHECKPOINT).is_file() for folder in places.values())
        _forget(fresh)
        go_on = f"go on with: {shlex.join(request.words())}"
        raise type(stop)(go_on if kept else "there was no checkpoint yet, so nothing is kept") from None
    except LockedError:
        raise  # what is there is the other one's
    except BaseException:
        _forget(fresh)
        raise
    return summary(request.tree, places)


def default_out(tree: str, robot: str) -> Path:
    """Where a policy goes that is given no place."""
    return Path("runs") / f"train-{tree}-{Path(robot).stem}"


def summary(tree: str, places: Mapping[Any, Path]) -> str:
    """One line for each policy: how good it is, where it is, and how it is used."""
    from bt_tasksim.policy.files import load_card

    lines = []
    for folder in places.values():
        card = load_card(folder)
        lines.append(
            f"{card.concept} for {card.robot}: {card.steps} decisions in {_duration(card.wall_seconds)}"
            f"{_best(folder)}; policy: {folder}; "
            f"use it: bt-tasksim run {tree} --policy {card.concept}={folder}"
        )
    return "\n".join(lines)


def _best(folder: Path) -> str:
    """The last evaluation, or an earlier one whose policy was clearly better and is kept."""
    for suffix in ("-backward", ""):
        file = training_folder(folder, suffix) / HISTORY
        if file.is_file():
            rows = [row.get("held_apart") for row in json.loads(file.read_text(encoding="utf-8"))]
            held = [row for row in rows if row]
            if held:
                best = max(held, key=_share)
                kept = held[-1] if _share(held[-1]) >= _share(best) - CLEARLY else best
                return f", {kept['successes']} of {kept['draws']} held-apart draws"
    return ""


def _share(held: Mapping[str, Any]) -> float:
    return float(held["successes"] / held["draws"])


def _ppo() -> tuple[Any, Any]:
    try:
        import gymnasium  # noqa: F401
        import stable_baselines3  # noqa: F401

        from bt_tasksim.training import ppo
        from bt_tasksim.training.learning_leaves import find_train
    except ImportError as error:
        raise MachineError(
            f"training cannot start: {error}; install what it needs: pip install 'bt-tasksim[train]'"
        ) from error
    return ppo, find_train


def _check(folders: Any, resume: bool) -> list[Path]:
    """Check that the policies can be written before anything is learned.

    Returns:
        The folders beside them that do not exist yet.

    Raises:
        InputError: A folder holds something else, or there is nothing to go on from.
    """
    from bt_tasksim.policy.files import FILES

    fresh = []
    for k, folder in enumerate(folders):
        check_folder(folder, FILES)
        beside = training_folder(folder)
        if os.path.lexists(beside) and not beside.is_dir():
            raise InputError(f"'{beside}', which is for the checkpoint, is a file: choose another --out")
        if resume and k == 0 and not (beside / CHECKPOINT).is_file():
            raise InputError(f"there is no checkpoint in '{beside}' to go on from: train without --resume")
        if not beside.exists():
            fresh.append(beside)
    return fresh


def _forget(folders: list[Path]) -> None:
    """Remove folders of trainings that ended before they kept anything."""
    for folder in folders:
        if folder.is_dir() and not (folder / CHECKPOINT).is_file():
            shutil.rmtree(folder, ignore_errors=True)


# ---- settings ---------------------------------------------------------------------------------------------


def load_settings(path: Path | None) -> TrainConfig:
    """The settings in a JSON or YAML file; the defaults where there is none.

    Raises:
        InputError: The file is missing or no mapping, or a setting is unknown or no good.
    """
    if path is None:
        return TrainConfig()
    document = read_document(path, "settings")
    if document.value is None:
        return TrainConfig()
    with located(document):
        return TrainConfig.from_model(validate(record_model(TrainConfig), document))


# ---- progress ---------------------------------------------------------------------------------------------


def describe(progress: Progress) -> str:
    """Success, stage, speed and time left in one line."""
    parts = [f"{100 * progress.success:.0f} % success"]
    if progress.held_apart is not None:
        right, of = progress.held_apart
        parts.append(f"held apart {right} of {of}")
    if progress.stage:
        parts.append(f"stage '{progress.stage}'")
    parts += [f"{progress.rate:.0f} decisions/s", f"{_duration(progress.seconds_left)} left"]
    return ", ".join(parts)


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60:02d} min"
