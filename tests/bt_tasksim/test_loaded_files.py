"""Bundled files have the values that they had before there were models; odd ones are refused in order.

``data/loaded_files.json`` was recorded from the hand-written loaders of version 0.1. The SO-100's jaw is
stronger since.
"""

from __future__ import annotations

import dataclasses
import json
import math
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.hardware.ros.setting import load_setting
from bt_tasksim.hardware.twin.gap import load_gap
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.session import load_settings

RECORDED = json.loads((Path(__file__).parent / "data" / "loaded_files.json").read_text())


def plain(value):
    """Dataclasses and arrays as JSON; of paths the name alone."""
    if isinstance(value, Path):
        return value.name
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if dataclasses.is_dataclass(value):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)
    if isinstance(value, str) and value.endswith(".obj"):
        return Path(value).name
    return value


LOADERS = {
    "robots": load_robot,
    "fixtures": load_fixture,
    "scenes": lambda name: load_scene(asset("scenes", f"{name}.yaml")),
    "twin": lambda name: load_gap(),
    "robots/ros": lambda name: load_setting(load_robot(name)),
}


@pytest.mark.parametrize("name", RECORDED)
def test_a_bundled_file_has_the_values_of_before(name):
    if name == "settings":
        found = plain(TrainConfig())
    else:
        folder, _, stem = name.rpartition("/")
        stem, _, seed = stem.partition("#")
        found = LOADERS[folder](stem)
        found = plain(found.sample(int(seed)) if seed else found)
    assert_covers(found, RECORDED[name])


def assert_covers(found, recorded):
    """Everything that was recorded is found; there may be more now."""
    if isinstance(recorded, dict):
        for key, value in recorded.items():
            if key == "goal":  # one, where there are several now
                found = {**found, "goal": next(iter(found["goals"]), None)}
            assert_covers(found[key], "on" if (key, value) == ("relation", "stands") else value)
    elif isinstance(recorded, list):
        assert len(found) == len(recorded)
        for one, other in zip(found, recorded, strict=True):
            assert_covers(one, other)
    else:
        assert found == recorded


# ---- odd files --------------------------------------------------------------------------------------------

SETTINGS = "steps: 500\nhidden: [32, 32]\nlearning_rate: 1e-3\nreward: {success: 2, gamma: 0.9}\n"
SOURCES = {
    "robot": (asset("robots", "panda.yaml").read_text(), lambda file: load_robot(str(file))),
    "fixture": (asset("fixtures", "shelf.yaml").read_text(), lambda file: load_fixture(str(file))),
    "scene": (asset("scenes", "bottle_on_table.yaml").read_text(), load_scene),
    "settings": (SETTINGS, load_settings),
    "gap": (asset("twin", "gap.yaml").read_text(), lambda file: load_gap(str(file))),
    "ros": (
        asset("robots", "ros", "panda.yaml").read_text(),
        lambda file: load_setting(load_robot("panda"), str(file)),
    ),
}
ODD = st.sampled_from(
    ["", "0", "-1", "1e300", ".nan", ".inf", "-.inf", "true", "~", "[]", "{}", "[[[]]]", "'x'", "9" * 400,
     "*a", "&a [*a]", "!!binary x", "\x1b", "a/b", "../x", "[1, 2]", "{a: 1}", ": :", "\t", "- -", "1:30",
     "0o17", "é"]
)  # fmt: skip


@st.composite
def mutated(draw, text):
    """The text with some of its lines, or of the values in them, taken for others."""
    lines = text.splitlines()
    for _ in range(draw(st.integers(1, 3))):
        i = draw(st.integers(0, len(lines) - 1))
        match draw(st.integers(0, 5)):
            case 0:
                lines[i] = lines[draw(st.integers(0, len(lines) - 1))]
            case 1:
                key, colon, _ = lines[i].partition(":")
                lines[i] = f"{key}{colon} {draw(ODD)}"
            case 2:
                words = lines[i].split(" ")
                words[draw(st.integers(0, len(words) - 1))] = draw(ODD)
                lines[i] = " ".join(words)
            case 3:
                lines[i] = "  " * draw(st.integers(0, 3)) + lines[i].strip()
            case 4:
                k = draw(st.integers(0, len(lines[i])))
                lines[i] = lines[i][:k] + draw(st.characters()) + lines[i][k + 1 :]
            case 5:
                lines[i] = draw(st.text(max_size=20))
    return "\n".join(lines)


@pytest.mark.parametrize("kind", SOURCES)
def test_an_odd_file_is_taken_or_refused_in_one_sentence(kind, tmp_path):
    text, load = SOURCES[kind]

    @settings(max_examples=120, deadline=None, suppress_health_check=list(HealthCheck))
    @given(mutated(text))
    def try_one(changed):
        file = tmp_path / f"{kind}.yaml"
        file.write_bytes(changed.encode("utf-8", "surrogatepass"))
        begin = time.monotonic()
        try:
            load(file)
        except InputError as error:
            assert "\n" not in str(error) and str(file) in str(error)
        assert time.monotonic() - begin < 10.0

    try_one()
