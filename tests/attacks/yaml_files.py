"""YAML files that people write: scenes, fixtures, robots, topics and gaps of a twin."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from bt_tasksim.core.resources import asset
from bt_tasksim.hardware.ros.setting import load_setting
from bt_tasksim.hardware.twin.gap import load_gap
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.scene_file import load_scene
from tests.attacks.mutations import Bait, Rng, damaged_bytes, damaged_data, odd_yaml, one_of

READERS: dict[str, Callable[[str], Any]] = {
    "scenes": lambda path: load_scene(path).sample(1),
    "fixtures": load_fixture,
    "robots": load_robot,
    "robots/ros": lambda path: load_setting(load_robot("panda"), path),
    "twin": load_gap,
}
"""Readers by the folder of bundled files that are damaged."""


def begin(folder: Path, bait: Bait) -> Callable[[Rng], Callable[[], object]]:
    """See `tests.attacks.__main__.KINDS`."""
    sound = [
        (read, path.read_text(encoding="utf-8"))
        for kind, read in READERS.items()
        for path in sorted(asset(*kind.split("/")).glob("*.yaml"))
    ]

    def make(rng: Rng) -> Callable[[], object]:
        read, text = one_of(rng, sound)
        path, kind = folder / f"case{int(rng.integers(10**9))}.yaml", rng.random()
        if kind < 0.1:
            path.write_text(odd_yaml(rng, bait), encoding="utf-8")
        elif kind < 0.3:
            path.write_bytes(damaged_bytes(text.encode(), rng))
        else:
            data = damaged_data(yaml.safe_load(text), rng, bait)
            path.write_text(yaml.safe_dump(data), encoding="utf-8", errors="replace")

        def case() -> None:
            try:
                read(str(path))
            finally:
                path.unlink()

        return case

    return make
