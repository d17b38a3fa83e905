"""Tests of Push: run them with pytest."""

from __future__ import annotations

from pathlib import Path

from bt_tasksim import EpisodeEnv, Runner
from bt_tasksim.checking.command import check

from train_push import build, scene


def test_the_concept_is_sound():
    report = check(Path(__file__).with_name("push.py"))
    assert not report.errors, "\n".join(report.lines())


def test_the_reference_motion_runs_to_its_end():
    result = Runner(build(), scene()).run(seed=1)
    assert result.status.name == "SUCCESS", result.why


def test_a_completion_signal_pays_when_it_is_right():
    env = EpisodeEnv(build(), scene(), lesson=1)
    outcomes = set()
    for seed in range(6):
        features, _ = env.reset(seed=seed)
        assert features.shape == env.observation_space.shape
        _, reward, terminated, _, info = env.step([0.0, 1.0])
        assert terminated and (reward > 0.0) == info["is_success"]
        outcomes.add(info["is_success"])
    assert False in outcomes, "said at once, it should not be right everywhere"
