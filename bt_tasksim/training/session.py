"""What ``bt-tasksim train`` does around `bt_tasksim.training.ppo.train`: settings, progress, how to go on."""

from __future__ import annotations

import dataclasses
import json
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bt_tasksim.errors import InputError, MachineError, nearest
from bt_tasksim.files import check_folder
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.reward import Reward

if TYPE_CHECKING:
    from bt_tasksim.training.ppo import Progress

EVERY = 5
"""Rollouts between two lines where there is no terminal."""


@dataclass(frozen=True)
class Request:
    """What the command line asks for.

    Attributes:
        tree: Name or file of the tree.
        scene: Name or file of the scene, or None for the tree's own.
        robot: Name or file of the robot, or None for the scene's own.
        nodes: A Python file with concepts and conditions of one's own, for an XML tree.
        out: The policy's folder, or None for `default_out`.
        steps: Decisions, or None for the settings' own.
        seed: Seed, or None for the settings' own.
        workers: Worker processes, or None for one for each core.
        settings: File of settings, or None.
        resume: Go on from the checkpoint.
        backward: Fine-tune from the last Train node to the first afterwards.
    """

    tree: str
    scene: str | None = None
    robot: str | None = None
    nodes: str | None = None
    out: Path | None = None
    steps: int | None = None
    seed: int | None = None
    workers: int | None = None
    settings: Path | None = None
    resume: bool = False
    backward: bool = False

    def words(self) -> list[str]:
        """The command line that asks for this and goes on from the checkpoint."""
        out = ["bt-tasksim", "train", self.tree]
        for name in ("scene", "robot", "nodes", "out", "steps", "seed", "workers", "settings"):
            value = getattr(self, name)
            if value is not None:
                out += [f"--{name}", str(value)]
        return [*out, *(["--backward"] if self.backward else []), "--resume"]


def run(request: Request) -> str:
    """Train, and say where the policy is and how it is used.

    Raises:
        InputError: Anything that was asked for is no good; then nothing was written.
        MachineError: The libraries for training are missing, or a worker ended.
        KeyboardInterrupt: Ended by the user; says how to go on.
    """
    from trees.load import load_source

    config = load_settings(request.settings)
    changes = {name: getattr(request, name) for name in ("steps", "seed")}
    config = dataclasses.replace(config, **{k: v for k, v in changes.items() if v is not None})
    source = load_source(request.tree, request.robot, request.scene, request.nodes)
    out = request.out or default_out(source.name, source.scene.robot)
    ppo, find_train = _ppo()
    tree = source.build()
    find_train(tree)
    places = ppo.policy_folders(tree, out)
    fresh = _check(places.values(), request.resume)
    try:
        with shown() as report:
            ppo.train(
                tree,
                source.scene,
                out=out,
                config=config,
                workers=request.workers,
                resume=request.resume,
                backward=request.backward,
                report=report,
                name=source.name,
            )
    except KeyboardInterrupt:
        kept = any((ppo.training_folder(folder) / ppo.CHECKPOINT).is_file() for folder in places.values())
        _forget(fresh)
        go_on = f"go on with: {shlex.join(request.words())}"
        raise KeyboardInterrupt(
            go_on if kept else "there was no checkpoint yet, so nothing is kept"
        ) from None
    except BaseException:
        _forget(fresh)
        raise
    return summary(request.tree, places)


def default_out(tree: str, robot: str) -> Path:
    """Where a policy goes that is given no place."""
    return Path("runs") / f"train-{tree}-{Path(robot).stem}"


def summary(tree: str, places: Mapping[Any, Path]) -> str:
    """One line for each policy: how good it is, where it is, and how it is used."""
    from bt_tasksim.policy_files import load_card

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
    from bt_tasksim.training import ppo

    for suffix in ("-backward", ""):
        file = ppo.training_folder(folder, suffix) / ppo.HISTORY
        if file.is_file():
            rows = [row.get("held_apart") for row in json.loads(file.read_text(encoding="utf-8"))]
            held = [row for row in rows if row]
            if held:
                best = max(held, key=_share)
                kept = held[-1] if _share(held[-1]) >= _share(best) - ppo.CLEARLY else best
                return f", {kept['successes']} of {kept['draws']} held-apart draws"
    return ""


def _share(held: Mapping[str, Any]) -> float:
    return float(held["successes"] / held["draws"])


def _ppo() -> tuple[Any, Any]:
    try:
        import gymnasium  # noqa: F401
        import stable_baselines3  # noqa: F401

        from bt_tasksim.training import ppo
        from bt_tasksim.training.episode import find_train
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
    from bt_tasksim.policy_files import FILES
    from bt_tasksim.training import ppo

    fresh = []
    for k, folder in enumerate(folders):
        check_folder(folder, FILES)
        beside = ppo.training_folder(folder)
        if resume and k == 0 and not (beside / ppo.CHECKPOINT).is_file():
            raise InputError(f"there is no checkpoint in '{beside}' to go on from: train without --resume")
        if not beside.exists():
            fresh.append(beside)
    return fresh


def _forget(folders: list[Path]) -> None:
    """Remove folders of trainings that ended before they kept anything."""
    from bt_tasksim.training import ppo

    for folder in folders:
        if folder.is_dir() and not (folder / ppo.CHECKPOINT).is_file():
            shutil.rmtree(folder, ignore_errors=True)


# ---- settings ---------------------------------------------------------------------------------------------


def load_settings(path: Path | None) -> TrainConfig:
    """The settings in a JSON or YAML file; the defaults where there is none.

    Raises:
        InputError: The file is missing or no mapping, or a setting is unknown or no good.
    """
    if path is None:
        return TrainConfig()
    import yaml

    try:
        text = path.read_text(encoding="utf-8")
        content = json.loads(text) if path.suffix == ".json" else yaml.safe_load(text)
    except OSError as error:
        raise InputError(f"settings '{path}' cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError, yaml.YAMLError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"settings '{path}' are not {_language(path)}: {said}") from error
    content = {} if content is None else content
    if not isinstance(content, dict):
        raise InputError(f"settings '{path}' should be a mapping of names to values, found {content!r}")
    try:
        _check_values(content, TrainConfig(), "")
        return TrainConfig.from_dict(content)
    except InputError as error:
        raise InputError(f"settings '{path}': {str(error).removeprefix('training: ')}") from error


def _language(path: Path) -> str:
    return "JSON" if path.suffix == ".json" else "YAML"


def _check_values(content: Mapping[Any, Any], defaults: TrainConfig | Reward, within: str) -> None:
    """Check names and types against the defaults'."""
    known = {f.name: getattr(defaults, f.name) for f in dataclasses.fields(defaults)}
    for name, value in content.items():
        if name not in known:
            raise InputError(f"unknown setting '{within}{name}'{nearest(str(name), known)}")
        default = known[name]
        if isinstance(default, Reward):
            if not isinstance(value, dict):
                raise InputError(f"'{name}' should be a mapping, found {value!r}")
            _check_values(value, default, f"{name}.")
        elif not _like(value, default):
            raise InputError(f"'{within}{name}' should be {_kind(default)}, found {value!r}")


def _like(value: Any, default: Any) -> bool:
    if isinstance(default, bool) or isinstance(value, bool):
        return isinstance(default, bool) and isinstance(value, bool)
    if isinstance(default, tuple):
        return isinstance(value, list) and all(type(v) is int for v in value)
    if isinstance(default, int):
        return isinstance(value, int)
    return isinstance(value, int | float)


def _kind(default: Any) -> str:
    if isinstance(default, bool):
        return "true or false"
    if isinstance(default, tuple):
        return "a list of whole numbers"
    return "a whole number" if isinstance(default, int) else "a number"


# ---- progress ---------------------------------------------------------------------------------------------


@contextmanager
def shown() -> Iterator[Callable[[Progress], None]]:
    """A progress bar on a terminal; elsewhere a line every few rollouts."""
    if not sys.stderr.isatty():
        yield _Lines()
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn
    from rich.progress import Progress as Bar

    columns = [TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %")]
    with Bar(
        *columns, TextColumn("{task.fields[said]}"), console=Console(stderr=True), transient=True
    ) as bar:
        task = bar.add_task("training", total=None, said="the first rollout")

        def show(progress: Progress) -> None:
            done, total = progress.steps
            bar.update(task, description=progress.train, completed=done, total=total, said=describe(progress))

        yield show


class _Lines:
    """Writes a line for some of the rollouts."""

    def __init__(self) -> None:
        self.count = 0
        self.held: tuple[int, int] | None = None

    def __call__(self, progress: Progress) -> None:
        done, total = progress.steps
        self.count += 1
        if self.count == 1 or self.count % EVERY == 0 or done >= total or progress.held_apart != self.held:
            self.held = progress.held_apart
            sys.stderr.write(f"{progress.train}: {done} of {total}, {describe(progress)}\n")
            sys.stderr.flush()
        if done >= total:
            self.count = 0


def describe(progress: Progress) -> str:
    """Success, lesson, pace and time left in one line."""
    parts = [f"{100 * progress.success:.0f} % success"]
    if progress.held_apart is not None:
        right, of = progress.held_apart
        parts.append(f"held apart {right} of {of}")
    if progress.lesson:
        parts.append(f"lesson '{progress.lesson}'")
    parts += [f"{progress.rate:.0f} decisions/s", f"{_duration(progress.seconds_left)} left"]
    return ", ".join(parts)


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60:02d} min"
