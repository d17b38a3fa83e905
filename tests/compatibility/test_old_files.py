"""Files of earlier versions load with today's code and mean what they meant.

Samples are never changed. Where a file needs a conversion, the test calls the one command that converts it.
"""

from __future__ import annotations

import dataclasses
import json
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bt_tasksim.cli.main import main
from bt_tasksim.core.renamed import former_names
from bt_tasksim.demos_decomp import decompose_log, open_log
from bt_tasksim.engines.remote.keys import load_key
from bt_tasksim.execution.replay import replay
from bt_tasksim.hardware.ros.setting import load_setting
from bt_tasksim.hardware.twin.gap import load_gap
from bt_tasksim.policy import library
from bt_tasksim.policy.files import load_policy
from bt_tasksim.robot import load_robot
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.scene.specs import ObjectSpec
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.training.session import load_settings
from bt_tasksim.trees import save_tree
from bt_tasksim.trees.load import load_source

OLD = Path(__file__).parent / "samples" / "v0.1"
EXPECTED = json.loads((OLD / "expected.json").read_text(encoding="utf-8"))
SETTINGS = ("policy", "timeout", "tolerance", "uncertainty")
PORTS = ("attempts", "times", "seconds", "success_count", "failure_count", "memory")
RENAMED = {"stands": "on"}
"""Goal relations that have another name today."""
OBJECT = ("name", "kind", "size", "exponents", "mass", "friction", "pose", "known_size", "on")


@pytest.fixture
def files(tmp_path: Path, monkeypatch: Any) -> Path:
    """A copy of the samples to work in, its Python files converted."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    folder = tmp_path / "old"
    shutil.copytree(OLD, folder)
    python = sorted(str(p) for p in folder.rglob("*.py"))
    assert main(["convert", *python]) == 0
    monkeypatch.setitem(sys.modules, "push", None)
    del sys.modules["push"]  # a module of this name of another folder
    return folder


def plain(value: Any) -> Any:
    """A value as JSON has it."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, bytes):
        return value.decode()
    if isinstance(value, Path):
        return value.name
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, dict) or hasattr(value, "items"):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    return value


FORMER = {"Fallback": "Selector"}
"""Classes of nodes that were made when there was only a base class of theirs."""


def node(tree: Any) -> dict[str, Any]:
    """A tree's nodes, names and arguments."""
    kind = type(tree).__name__
    found = {"type": FORMER.get(kind, kind), "name": tree.name}
    model = getattr(tree, "model", None)
    if model is not None:
        found["values"] = plain(model.values)
        both = {name: getattr(tree, name, getattr(model, name, None)) for name in SETTINGS}
        found |= {
            name: plain(value) for name, value in both.items() if hasattr(model, name) or name in vars(tree)
        }
    else:
        found |= {name: plain(getattr(tree, name)) for name in PORTS if name in vars(tree)}
    return found | {"children": [node(child) for child in tree.children]}


FIELDS = {
    name: present
    for kind in (ActorConfiguration, Box, ObjectSpec, Scene, TrainConfig)
    for name, present in former_names(kind).items()
}
"""Present names of fields by what they were called when the samples were made."""


def assert_same(now: Any, before: Any, where: str = "") -> None:
    """Everything that was is there, with the same values; there may be more today."""
    if isinstance(before, dict):
        assert isinstance(now, dict), where
        for former, value in before.items():
            key = former if former in now else FIELDS.get(former, former)
            assert key in now, f"{where}: '{key}' is gone"
            assert_same(now[key], value, f"{where}.{key}")
    elif isinstance(before, list):
        assert isinstance(now, list) and len(now) == len(before), where
        for k, (a, b) in enumerate(zip(now, before, strict=True)):
            assert_same(a, b, f"{where}[{k}]")
    elif isinstance(before, float) and isinstance(now, float | int):
        assert now == pytest.approx(before, abs=1e-9, nan_ok=True), where
    else:
        assert now == before, where


@pytest.mark.parametrize("name", EXPECTED["trees"])
def test_a_tree_is_the_same_tree_and_is_saved_and_loaded_as_such(files: Path, name: str):
    path = files / ("concepts" if name in ("wipe.py", "train_push.py") else "trees") / name
    tree = load_source(str(path)).build()
    before = EXPECTED["trees"][name]
    assert_same(node(tree), without_memory_of_leaves(before), name)
    if name.endswith(".xml"):
        save_tree(tree, files / "again.xml", scene="shelf_to_shelf")
        again = load_source(str(files / "again.xml"), scene=scene_of(path)).build()
        assert node(again) == node(tree)


def scene_of(path: Path) -> str:
    return path.stem if path.stem.startswith(("grasp_", "pick_")) else "shelf_to_shelf"


def without_memory_of_leaves(before: dict[str, Any]) -> dict[str, Any]:
    """What the expected file says of a tree; a leaf's memory is no argument."""
    out = {k: v for k, v in before.items() if k != "memory" or "values" not in before}
    return out | {"children": [without_memory_of_leaves(child) for child in before.get("children", [])]}


@pytest.mark.parametrize("name", EXPECTED["scenes"])
def test_a_scene_draws_the_same_worlds(files: Path, name: str):
    path = files / ("scenes" if "/" not in name else "") / name
    scene = load_scene(path) if name.endswith(".yaml") else load_source(str(path)).scene
    for seed, before in EXPECTED["scenes"][name].items():
        now = json.loads(scene.sample(int(seed)).to_json())
        assert now["robot"] == before["robot"] and len(now["objects"]) == len(before["objects"])
        for a, b in zip(now["objects"], before["objects"], strict=True):
            assert_same({k: a[k] for k in OBJECT}, {k: b[k] for k in OBJECT}, f"{name}, seed {seed}")
        assert_same(now["places"], before["places"], f"{name}, places")
        goal = before["goal"]
        if goal is not None:
            goal = goal | {"relation": RENAMED.get(goal["relation"], goal["relation"])}
        assert_same(next(iter(now["goals"]), None), goal, f"{name}, goal")
        for key in ("disturbance", "noise", "physics_frequency", "control_frequency"):
            assert_same(now[key], before[key], f"{name}, {key}")


def test_furniture_robot_topics_and_gap_have_the_same_numbers(files: Path):
    assert_same(plain(load_fixture(str(files / "scenes" / "stool.yaml"))), EXPECTED["fixture"])
    robot = plain(load_robot(str(files / "robots" / "my_panda.yaml")))
    before = {k: v for k, v in EXPECTED["robot"].items() if k not in ("source", "urdf", "cameras")}
    assert_same(robot, before, "robot")
    cell = load_setting(load_robot("panda"), str(files / "robots" / "my_cell.yaml"))
    assert_same(plain(cell), EXPECTED["ros"], "topics")
    assert_same(plain(load_gap(str(files / "robots" / "my_gap.yaml"))), EXPECTED["gap"], "gap")


@pytest.mark.parametrize("name", EXPECTED["settings"])
def test_settings_of_a_training_are_the_same(files: Path, name: str):
    assert_same(plain(load_settings(files / "settings" / name).to_dict()), EXPECTED["settings"][name], name)


def test_a_log_shows_the_same_tasks(files: Path):
    found = decompose_log(open_log(files / "logs" / "demonstration.h5"))
    assert_same([plain(task.to_json()) for task in found.tasks], EXPECTED["log"])
    tasks = json.loads((files / "logs" / "demonstration.json").read_text())["tasks"]
    assert_same([plain(task.to_json()) for task in found.tasks], tasks)


@pytest.mark.parametrize("name", EXPECTED["runs"])
def test_a_run_is_replayed_and_judged_the_same(files: Path, name: str):
    before = json.loads((files / "runs" / name / "result.json").read_text())
    found = replay(files / "runs" / name)
    assert found.result.success == before["success"] and found.result.status.name == before["status"]


@pytest.mark.parametrize("name", EXPECTED["runs"])
def test_a_run_is_decomposed_like_any_log(files: Path, name: str, capsys: Any):
    assert main(["decompose", str(files / "runs" / name)]) == 0
    concepts = {line.split()[4] for line in capsys.readouterr().out.splitlines() if " s " in line}
    assert concepts == ({"grasp", "pick", "bring", "place", "release"} if name == "success" else set())


@pytest.mark.parametrize("name", ["evaluation", "evaluation_failed"])
def test_an_evaluation_has_what_it_had(files: Path, name: str):
    before = json.loads((files / f"{name}.json").read_text())
    tree = "pick_and_place" if name == "evaluation" else "too_short"
    seed = before["outcomes"][0]["seed"]
    now = evaluate(Job(str(files / "trees" / f"{tree}.xml")), [seed]).to_json()
    assert set(before) <= set(now) and set(before["outcomes"][0]) <= set(now["outcomes"][0])
    for key in ("scenario", "robot", "engines", "perception"):
        assert now[key] == before[key]


def test_a_policy_does_the_same(files: Path):
    network, card = load_policy(files / "policies" / "grasp-tiny")
    before = EXPECTED["policy"]
    action = network(np.array(before["input"]))
    assert action == pytest.approx(before["action"], abs=1e-6)
    assert (card.concept, card.robot, card.steps) == ("grasp", "panda", before["card"]["steps"])
    job = Job("grasp_then_pick", policies=(("grasp", str(files / "policies" / "grasp-tiny")),))
    assert "grasp-tiny" in evaluate(job, [0]).policies["grasp target"]


def test_a_training_goes_on_from_its_checkpoint(files: Path):
    pytest.importorskip("torch")
    out = files / "grasp-more"
    shutil.copytree(files / "policies" / "grasp-tiny", out)
    shutil.copytree(files / "policies" / "grasp-tiny-training", f"{out}.training")
    words = [
        "--settings",
        str(files / "settings" / "tiny.json"),
        "--steps",
        "384",
        "--workers",
        "1",
        "--resume",
    ]
    assert main(["train", str(files / "trees" / "grasp_then_pick.xml"), "--out", str(out), *words]) == 0
    assert load_policy(out)[1].steps == 384


def test_pins_are_read(files: Path, monkeypatch: Any):
    real = library.asset
    pins = files / "policies" / "pins.json"
    monkeypatch.setattr(library, "asset", lambda *parts: pins if parts[-1] == "pins.json" else real(*parts))
    assert library.read_pins() == {"grasp": {"panda": "grasp-panda"}}


def test_keys_are_read(files: Path):
    for side, name in (("server", "cell.key"), ("client", "cell.client.key")):
        path = files / "keys" / name
        path.chmod(0o600)
        assert plain(load_key(path, side)) == EXPECTED["keys"][side]


def test_a_concept_of_ones_own_runs_after_its_conversion(files: Path, capsys: Any):
    assert main(["check", str(files / "concepts" / "push.py")]) == 0, capsys.readouterr().out
