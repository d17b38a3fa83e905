"""``bt-tasksim train``: what it writes and says, and one sentence for whatever goes wrong."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from bt_tasksim.cli.main import main
from bt_tasksim.core.errors import InputError
from bt_tasksim.policy.files import load_card
from bt_tasksim.training import session as command
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.record import Progress

TINY = {
    "steps": 128, "n_envs": 2, "n_steps": 32, "epochs": 1, "minibatch": 32, "evaluate_every": 1,
    "evaluation_draws": 2, "checkpoint_every": 1,
}  # fmt: skip
TWO = """
from bt_tasksim import Train
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.trees import fallback
from bt_tasksim.trees.scenarios.grasp_then_pick import scene

def build():
    return fallback("twice", *(Train(Grasp("target", name=name, timeout=2.0)) for name in ("first", "again")))
"""
NEVER = """
from bt_tasksim import Train
from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.trees import sequence
from bt_tasksim.trees.scenarios.grasp_then_pick import scene

def build():
    return sequence("never", Pick("target"), Train(Grasp("target")))
"""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def tiny(tmp_path):
    """Writes settings of a training of a second: ``tiny(**changes)``."""

    def write(**changes) -> Path:
        path = tmp_path / "tiny.json"
        path.write_text(json.dumps(TINY | changes))
        return path

    return write


@pytest.fixture
def call(capsys):
    def run(*words):
        capsys.readouterr()
        try:
            code = main(["train", *map(str, words)])
        except SystemExit as end:
            code = end.code
        return code, *capsys.readouterr()

    return run


def there(folder):
    """All that is in a folder, but for what Python compiles."""
    return [path for path in sorted(folder.rglob("*")) if "__pycache__" not in path.parts]


@pytest.fixture
def refused(call, tmp_path):
    """Exit code 2, one sentence, and no new file."""

    def run(*words) -> str:
        before = there(tmp_path)
        code, out, err = call(*words)
        assert code == 2, err
        assert out == "" and err.startswith("bt-tasksim: ") and err.count("\n") == 1
        assert there(tmp_path) == before
        return err

    return run


def test_a_training_leaves_a_policy_and_says_how_to_use_it(call, tiny):
    code, out, err = call("grasp_then_pick", "--settings", tiny(), "--workers", 2, "--seed", 3)
    assert code == 0, err
    folder = Path("runs/train-grasp_then_pick-panda")
    assert f"--policy grasp={folder}" in out and "of 2 held-apart draws" in out and out.count("\n") == 1
    card = load_card(folder)
    assert (card.concept, card.robot, card.steps, card.seeds) == ("grasp", "panda", 128, (3,))
    assert card.wall_seconds > 0.0 and card.tree == "grasp_then_pick"
    lines = err.splitlines()
    assert "64 of 128" in lines[0] and "128 of 128" in lines[-1]
    assert "held apart" in lines[-1] and "decisions/s" in lines[-1] and "left" in lines[-1]
    assert {p.name for p in folder.parent.iterdir()} == {folder.name, f"{folder.name}.training"}


def test_a_training_goes_on_where_it_was(call, tiny):
    asked = ("grasp_then_pick", "--settings", tiny(), "--workers", 1, "--out", "p")
    assert call(*asked)[0] == 0
    code, out, _ = call(*asked, "--steps", 192, "--resume")
    assert code == 0 and "192 decisions" in out
    assert [row["steps"] for row in json.loads(Path("p.training/history.json").read_text())] == [64, 128, 192]


def test_a_second_training_does_not_overwrite_the_first(call, refused, tiny):
    asked = ("grasp_then_pick", "--settings", tiny(), "--workers", 1, "--out", "p")
    assert call(*asked)[0] == 0
    assert "--resume" in refused(*asked)
    other = tiny(learning_rate=1e-3)
    assert "other settings" in refused("grasp_then_pick", "--settings", other, "--out", "p", "--resume")


def test_the_second_node_begins_when_a_resumed_training_gets_there(call, tiny):
    Path("two.py").write_text(TWO)
    asked = ("two.py", "--settings", tiny(evaluation_draws=0), "--workers", 2, "--out", "both")
    code, out, err = call(*asked)
    assert code == 0, err
    assert out.count("\n") == 2 and "both/train-first" in out and "both/train-again" in out
    for file in Path("both/train-again.training").iterdir():
        file.unlink()
    code, out, err = call(*asked, "--resume")
    assert code == 0, err
    assert "train again: 64 of 128" in err


def test_settings_in_yaml():
    Path("s.yaml").write_text(
        "steps: 500\nhidden: [32]\nreward: {success: 2, gamma: 0.9, sufficient: yes}\nclip: 1e-1\n"
    )
    found = command.load_settings(Path("s.yaml"))
    assert (found.steps, found.hidden, found.reward.success, found.reward.gamma) == (500, (32,), 2, 0.9)
    assert command.load_settings(None) == TrainConfig()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("stepps: 5", "did you mean 'steps'"),
        ("reward: {sucess: 1}", "did you mean 'success'"),
        ("reward: 3", "'reward' should be a mapping"),
        ("steps: many", "'steps' should be a whole number"),
        ("steps: 0", "'steps' should be at least 1"),
        ("steps: true", "'steps' should be a whole number"),
        ("hidden: [64.5]", "'hidden[0]' should be a whole number"),
        ("learning_rate: fast", "'learning_rate' should be a number"),
        ("reward: {sufficient: 1}", "'reward.sufficient' should be true or false"),
        ("- 1", "should be a mapping"),
        ("a: [", "not YAML"),
        ("steps: 5\nsteps: 6", "line 2: 'steps' stands there twice"),
        ("epochs: " + "1" + "0" * 30, "'epochs' should be at most 1000"),
        ("1: 2", "unknown field '1'"),
    ],
)
def test_settings_that_are_no_good(text, said):
    Path("s.yaml").write_text(text)
    with pytest.raises(InputError, match=r"^settings 's.yaml'") as error:
        command.load_settings(Path("s.yaml"))
    assert said in str(error.value) and "\n" not in str(error.value)


def test_bad_input_is_one_sentence_and_leaves_nothing(refused, tiny):
    assert "no Train(...) node" in refused("pick_and_place")
    assert "no scenario 'grasp_than_pick'" in refused("grasp_than_pick")
    assert "unknown robot 'pnda'" in refused("grasp_then_pick", "--robot", "pnda")
    assert "cannot be read" in refused("grasp_then_pick", "--settings", "missing.yaml")
    assert "no checkpoint" in refused("grasp_then_pick", "--resume")
    Path("full").mkdir()
    Path("full/letter.txt").write_text("keep me")
    assert "it holds other things, such as 'letter.txt'" in refused("grasp_then_pick", "--out", "full")
    assert "is a file" in refused("grasp_then_pick", "--out", "full/letter.txt/policy")
    Path("p.training").write_text("mine")
    assert "'p.training', which is for the checkpoint, is a file" in refused("grasp_then_pick", "--out", "p")


def test_a_tree_whose_node_is_never_reached(refused, tiny):
    Path("never.py").write_text(NEVER)
    said = refused("never.py", "--settings", tiny(), "--workers", 1, "--out", "p")
    assert "'train grasp target' was not reached" in said


def test_words_of_a_request_that_goes_on():
    asked = command.Request(
        "t.xml", robot="panda", out=Path("my policy"), steps=5, cluster="local", backward=True
    )
    assert asked.words() == [
        "bt-tasksim", "train", "t.xml", "--robot", "panda", "--out", "my policy", "--steps", "5",
        "--cluster", "local", "--backward", "--resume",
    ]  # fmt: skip


def test_progress_in_words():
    progress = Progress("train grasp", (10, 20), 0.5, (3, 4), "all shapes", 900.0, 7500.0)
    said = command.describe(progress)
    assert said == "50 % success, held apart 3 of 4, stage 'all shapes', 900 decisions/s, 2 h 05 min left"


@pytest.mark.parametrize(
    ("kept", "number", "code", "said"),
    [(True, signal.SIGINT, 130, "interrupted"), (False, signal.SIGTERM, 143, "terminated")],
    ids=["interrupt", "terminate"],
)
def test_an_interrupt_says_how_to_go_on(tiny, tmp_path, kept, number, code, said):
    settings = tiny(steps=1_000_000, evaluate_every=0, checkpoint_every=1 if kept else 100_000)
    words = ["train", "grasp_then_pick", "--out", "p", "--workers", "2", "--settings", settings.name]
    process = subprocess.Popen(
        [sys.executable, "-m", "bt_tasksim.cli", *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    assert process.stderr is not None
    assert " of 1000000, " in process.stderr.readline()
    time.sleep(0.3)
    os.killpg(process.pid, number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == code and "Traceback" not in err
    last = err.splitlines()[-1]
    if kept:
        assert last == f"{said}; go on with: bt-tasksim {' '.join(words)} --resume"
    else:
        assert last == f"{said}; there was no checkpoint yet, so nothing is kept"
    assert {p.name for p in tmp_path.iterdir()} == {"tiny.json", *(["p.training"] if kept else [])}
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


def test_the_page_about_training_has_every_setting_with_its_default():
    page = (Path(__file__).parents[3] / "docs" / "training.md").read_text(encoding="utf-8")
    page = page.split("## What was measured")[0]
    rows = dict(re.findall(r"^\| `([\w.]+)` \| ([^|`]+) \|", page, re.M))
    defaults = {k: v for k, v in TrainConfig().to_dict().items() if k != "reward"}
    defaults |= {f"reward.{k}": v for k, v in TrainConfig().to_dict()["reward"].items()}
    assert rows.keys() == defaults.keys()
    for name, said in rows.items():
        value = defaults[name]
        expected = list(value) if isinstance(value, tuple) else value
        assert json.loads(said) == expected, name
