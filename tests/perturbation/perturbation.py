"""Small changes to physics, by which a test run shows that no test stands on one chaotic draw.

Contacts make a run chaotic: another processor rounds differently, and a cup rolls the other way. The same
happens here on purpose: every target of a physics engine's drives is moved by a constant, and every world is
drawn with another seed. Neither changes what a test may rely on. ``pytest --nudge RAD --shift-seeds N``
installs this in pytest's own process, and `sitecustomize` beside this file in every process that it starts.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib.abc
import importlib.machinery
import os
import sys
from collections.abc import Callable, MutableMapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

HERE = str(Path(__file__).resolve().parent)
SEEDS = 2**64
"""Seeds are below."""
NUDGE, SHIFT = "TESTS_NUDGE_TARGETS", "TESTS_SHIFT_SEEDS"


def nudge_targets(radians: float) -> dict[str, Callable[[ModuleType], None]]:
    """What to do to the module of simulated worlds so that their drives' targets are off by a constant.

    All engines step there, those of one world, too.
    """

    def change(module: ModuleType) -> None:
        step = module.ThreadedBatch.step

        @functools.wraps(step)
        def nudged(self: Any, target: Any, *rest: Any, **options: Any) -> Any:
            moved = dataclasses.replace(target, position=target.position + radians)
            return step(self, moved, *rest, **options)

        module.ThreadedBatch.step = nudged

    return {"bt_tasksim.engines.physics.threaded": change}


def shift_seeds(shift: int) -> dict[str, Callable[[ModuleType], None]]:
    """What to do to the scene's module so that a seed draws the world of another; it keeps its own number."""

    def change(module: ModuleType) -> None:
        sample = module.Scene.sample

        @functools.wraps(sample)
        def shifted(self: Any, seed: int, *rest: Any, **options: Any) -> Any:
            whole = isinstance(seed, int) and 0 <= seed < SEEDS
            other = (seed + shift) % SEEDS if whole else seed  # what is refused stays so
            drawn = sample(self, other, *rest, **options)
            return dataclasses.replace(drawn, seed=int(seed))

        module.Scene.sample = shifted

    return {"bt_tasksim.scene.scene": change}


def install(radians: float, shift: int, environment: MutableMapping[str, str]) -> None:
    """Change the engines in this process, now or when they are imported, and in those that it will start.

    Once: a test runner's own worker finds it done already by `install_from`.
    """
    if any(type(finder).__name__ == _Importer.__name__ for finder in sys.meta_path):
        return
    changes = (nudge_targets(radians) if radians else {}) | (shift_seeds(shift) if shift else {})
    if not changes:
        return
    for name in [name for name in changes if name in sys.modules]:
        changes.pop(name)(sys.modules[name])
    sys.meta_path.insert(0, _Importer(changes))
    environment[NUDGE], environment[SHIFT] = repr(radians), str(shift)
    path = environment.get("PYTHONPATH", "").split(os.pathsep)
    if HERE not in path:
        environment["PYTHONPATH"] = os.pathsep.join([HERE, *filter(None, path)])


def install_from(environment: MutableMapping[str, str]) -> None:
    """Change the engines as the process that started this one did."""
    install(float(environment.get(NUDGE, "0")), int(environment.get(SHIFT, "0")), environment)


class _Importer(importlib.abc.MetaPathFinder):
    """Changes modules right after they were imported."""

    def __init__(self, changes: dict[str, Callable[[ModuleType], None]]) -> None:
        self.changes = changes

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name not in self.changes:
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        if spec is None or spec.loader is None:
            return None
        run, change = spec.loader.exec_module, self.changes[name]

        def run_and_change(module: ModuleType) -> None:
            run(module)
            change(module)

        spec.loader.exec_module = run_and_change  # type: ignore[method-assign]
        return spec
