"""Settings of trainings, in YAML and JSON."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import yaml

from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.session import load_settings
from tests.attacks.mutations import Bait, Rng, damaged_bytes, damaged_data, odd_yaml


def begin(folder: Path, bait: Bait) -> Callable[[Rng], Callable[[], object]]:
    """See `tests.attacks.__main__.KINDS`."""
    sound = json.loads(json.dumps(TrainConfig().to_dict()))

    def make(rng: Rng) -> Callable[[], object]:
        kind = rng.random()
        path = folder / ("settings.json" if rng.random() < 0.5 else "settings.yaml")
        if kind < 0.15:
            path.write_text(odd_yaml(rng, bait), encoding="utf-8")
        elif kind < 0.3:
            path.write_bytes(damaged_bytes(yaml.safe_dump(sound).encode(), rng))
        else:
            data = damaged_data(sound, rng, bait)
            text = json.dumps(data) if path.suffix == ".json" else yaml.safe_dump(data)
            path.write_text(text, encoding="utf-8", errors="replace")
        return lambda: load_settings(path)

    return make
