"""The experiments: tables and pictures from results, what is resumed, and the variants that are compared."""

import functools
import pickle
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.experiments import ablations, follower, judged, learning, pages, robot, sequences, shapes
from benchmarks.experiments.__main__ import main
from benchmarks.experiments.common import EXPERIMENTS, Request, share
from bt_tasksim.concept_nodes import Pick
from bt_tasksim.policy.policy import Action
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.trees.nodes.train import follower_of, train_nodes
from bt_tasksim.trees.scenarios import grasp_then_pick

COUNTS = {
    "draws": 10, "successes": 9, "interval": [0.6, 0.98], "done": 9, "done_right": 9,
    "done_interval": [0.7, 1.0], "ends": {"violated": 1}, "failed_seeds": [50003],
}  # fmt: skip
ROWS = [
    {
        "steps": 4096 * (k + 1), "episodes": 100, "success": k / 10, "return": 0.0, "length": 20.0,
        "ends": {"success": 10 * k, "violated": 100 - 10 * k}, "stage": "near" if k < 4 else "far",
        "seconds": 60.0 * k, **({"held_apart": {"successes": 10 * k, "draws": 100}} if k % 2 else {}),
    }
    for k in range(8)
]  # fmt: skip
BOTH = {"learned", "programmed"}
SHAPES = {
    "robot": "panda",
    "policy": "grasp-panda@0123",
    "kinds": {w: {"box": COUNTS, "all": {**COUNTS, "graspable": COUNTS}} for w in BOTH},
    "failures": {w: {"dropped": 1} for w in BOTH},
    "completion": {w: {"done": 9, "right": 9, "interval": [0.7, 1.0]} for w in BOTH},
    "draws": [[50000 + k, "box", 40.0 + k, 60.0 + k, int(k != 3), 1] for k in range(10)],
}
SEQUENCE = {
    "tree": "shelf_to_shelf", "perception": "camera", "who": "learned", "policy": "p", **COUNTS,
    "failures": {"dropped": 1}, "first": {"success": 50000, "dropped": 50003}, "why": {},
}  # fmt: skip
RESULTS = {
    "A": {"runs": [{"name": "grasp-panda", "robot": "panda", "rows": ROWS, "programmed": COUNTS}]},
    "B": SHAPES,
    "C": {"robots": {"panda": SHAPES, "xarm7_ability": {**SHAPES, "robot": "xarm7_ability"}}},
    "D": {"rows": [SEQUENCE, {**SEQUENCE, "who": "programmed", "perception": "pose, noise original"}]},
    "E": {
        "squeeze": 12.0,
        "cells": [
            {
                "who": who,
                "policy": "p",
                "follower": f,
                **COUNTS,
                "force": [4.0, 5.0, 9.0] if f == "gentle" else [],
            }
            for who in ("a", "b")
            for f in follower.FOLLOWERS
        ],
    },
    "F": {
        "hold": 1.2,
        "runs": [
            {"variant": v, "seed": s, "original": COUNTS, "hard": COUNTS, "curve": ablations.slim(ROWS)}
            for v, s in (("programmed", 0), ("full", 0), ("full", 1), ("fixed time", 0), ("shaping alone", 0))
        ],
    },
}
MODULES = {"A": learning, "B": shapes, "C": robot, "D": sequences, "E": follower, "F": ablations}


@pytest.mark.parametrize("letter", EXPERIMENTS)
def test_tables_and_pictures_are_made_from_results(letter, tmp_path):
    module = MODULES[letter]
    table = module.table(RESULTS[letter])
    for block in table.split("\n\n"):
        widths = {line.count("|") for line in block.split("\n")}
        assert len(widths) == 1, block
    assert "9 of 10, 90.0 % (60.0 to 98.0)" in table
    module.draw(RESULTS[letter], tmp_path)
    files = list(tmp_path.iterdir())
    assert files and all(f.name.startswith(f"{letter}-") and 500 < f.stat().st_size < 200_000 for f in files)


def test_the_same_numbers_make_the_same_picture(tmp_path):
    for name in ("one", "two"):
        shapes.draw(SHAPES, tmp_path / name)
    for file in (tmp_path / "one").iterdir():
        assert file.read_bytes() == (tmp_path / "two" / file.name).read_bytes()


def test_a_page_says_what_is_not_measured_yet():
    assert pages.page("B", {}) == "Not measured yet: `python -m benchmarks.experiments B`."
    assert pages.page("B", {"experiment-B": SHAPES}).startswith(shapes.table(SHAPES))


def test_counts_of_draws():
    draws = [
        judged.Draw(1, True, True, "success", "", 20, 5.0),
        judged.Draw(2, False, True, "follower failed", "", 20, 0.0),
        judged.Draw(3, False, False, "violated", "", 10, 0.0),
    ]
    found = judged.counts(draws)
    assert (found["successes"], found["done"], found["done_right"]) == (1, 2, 1)
    assert found["ends"] == {"follower failed": 1, "violated": 1} and found["failed_seeds"] == [2, 3]
    assert judged.interval(0, 0) == [0.0, 1.0]
    assert share({"draws": 0, "successes": 0, "interval": [0, 1]}).startswith("0 of 0")


def test_the_fixed_time_replaces_the_completion_signal():
    leaf = ablations.FixedTimeGrasp("target", hold=0.5)
    memory = SimpleNamespace(closing=np.array([-1.0, 0.4, 0.6]))
    found = leaf.amended(Action(np.zeros((3, 6)), np.array([True, True, False])), memory)
    assert found.terminate.tolist() == [False, False, True] and found.motion.shape == (3, 6)


def test_the_fixed_time_ends_a_grasp_in_training_too():
    """Whatever the learner says: neither its first signal ends it, nor does its silence go on for ever."""
    env = EpisodeEnv(ablations.tree("fixed time", 0.3), grasp_then_pick.scene(), stage=0)
    ended = []
    for seed in range(4):
        env.reset(seed=seed)
        for _ in range(3):
            assert not any(env.step(np.append(np.zeros(6), 1.0))[2:4]), "it has not closed yet"
        decisions, info = 3, {}
        while "status" not in info:
            info, decisions = env.step(np.zeros(7))[4], decisions + 1
        assert 10 < decisions < 300
        ended.append(info["status"] == "SUCCESS")
    env.close()
    assert sum(ended) >= 2, "careful as it is, it comes too late in some draws"


def test_variants_differ_in_one_thing():
    full, fixed, alone = (ablations.config(v, 1, 4096) for v in ablations.VARIANTS)
    assert full == fixed and full.reward.sufficient and not alone.reward.sufficient
    assert [type(train_nodes(ablations.tree(v))[0].decorated.model).__name__ for v in ablations.VARIANTS] == [
        "Grasp", "FixedTimeGrasp", "Grasp",
    ]  # fmt: skip
    assert len({out for _, _, out in ablations.runs(Request())}) == 9


@pytest.mark.parametrize("name", follower.FOLLOWERS)
def test_both_picks_judge_the_same_grasp(name):
    tree = follower.tree(name, 0.7)
    (train,) = train_nodes(tree)
    judge = follower_of(train)[0]
    assert isinstance(judge.model, Pick) and (judge.model.squeeze is None) == (name == "fast")
    own = follower.FOLLOWERS[name].build().children[0].decorated
    assert (train.decorated.model.grip, own.model.grip) == (0.7, 1.0)
    case = judged.Case(functools.partial(follower.tree, name, 0.7), follower.FOLLOWERS[name].scene())
    assert pickle.loads(pickle.dumps(case)).scene == case.scene


def test_what_trains_nothing_says_so(capsys):
    with pytest.raises(SystemExit):
        main(["B", "--train"])
    assert "trains nothing" in capsys.readouterr().err
