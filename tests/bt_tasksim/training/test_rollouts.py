"""Environments: the same whatever the number of workers, and one sentence where a worker goes wrong."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from toys import SCENE, Check, Even, Raise, Unprogrammed

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.policy.network import Network
from bt_tasksim.training.env import EpisodeEnv
from bt_tasksim.training.rollouts import RolloutTask, Workers, collect, judge_draw
from bt_tasksim.trees import sequence
from bt_tasksim.trees.nodes.train import Train

UP = Network(
    np.zeros(3), np.ones(3), [(np.array([[3.0, 0, 0], [-10.0, 0, 0]]), np.array([0.0, 1.0]))]
).arrays()
"""Brings the tool up and says so; noise apart."""


def make(tree=None):
    return EpisodeEnv(sequence("s", Even(), Train(Raise()), Check()) if tree is None else tree, SCENE)


def environment(number, decisions=40, network=UP, std=0.3, stage=None):
    return RolloutTask("environment", network, np.full(2, std, np.float32), (7, number), decisions, stage)


def as_bytes(found):
    return {k: v.tobytes() if isinstance(v, np.ndarray) else v for k, v in vars(found).items()}


def run(tasks, count, maker=make):
    pool = Workers(maker, count)
    try:
        return {number: as_bytes(result) for number, result in pool.each(tasks)}
    finally:
        pool.close()


@pytest.fixture
def maker(toy_engines):
    """Makes the environment, here and in workers, which are forked."""
    return make


def test_a_lane_is_whole_episodes_in_a_row(maker):
    found = collect(maker(), environment(0, decisions=60))
    assert found.features.shape == (60, 3) and found.actions.shape == (60, 2)
    assert found.features.dtype == found.actions.dtype == np.float32
    assert found.starts[0] and int(found.starts.sum()) in (len(found.ends), len(found.ends) + 1)
    lengths = [end[1] for end in found.ends]
    assert (
        np.flatnonzero(found.starts).tolist() == [0, *np.cumsum(lengths).tolist()][: int(found.starts.sum())]
    )
    first = lengths[0]
    assert found.ends[0][2] == pytest.approx(float(found.rewards[:first].sum()), abs=1e-5)
    assert len(lengths) > 3 and any(end[0] for end in found.ends) and found.redrawn > 0
    assert {end[3] for end in found.ends} <= {"success", "follower failed", "timeout"}
    # It was cut off in the middle of an episode, or ended with one.
    assert (found.cut_at.tolist() == [59]) == (sum(lengths) < 60)


def test_a_truncated_episode_is_marked(maker):
    def short():
        return EpisodeEnv(sequence("s", Train(Raise()), Check()), SCENE, longest=0.2)

    still = Network(np.zeros(3), np.ones(3), [(np.zeros((2, 3)), np.zeros(2))]).arrays()
    found = collect(short(), environment(0, decisions=12, network=still, std=0.0))
    assert found.cut_at.tolist() == [4, 9, 11] and found.cut.shape == (3, 3)
    assert [end[3] for end in found.ends] == ["failed", "failed"]
    assert found.starts.tolist() == [k in (0, 5, 10) for k in range(12)]


def test_lanes_are_the_same_whatever_the_workers_and_their_order(maker):
    tasks = [environment(k) for k in range(5)]
    here = {k: as_bytes(collect(maker(), task)) for k, task in enumerate(tasks)}
    assert run(tasks, 1) == run(tasks, 2) == here
    back = run(tasks[::-1], 2)
    assert [back[k] for k in range(5)] == [here[4 - k] for k in range(5)]
    assert len({row["features"] for row in here.values()}) == 5, "and no two are alike"


def test_held_apart_draws_are_judged_without_noise_and_apart(maker):
    env = maker()
    tasks = [RolloutTask("draw", UP, np.full(2, 9.0), (), 0, None, draw=k) for k in range(8)]
    found = [judge_draw(env, task) for task in tasks]
    assert [k for k, _, _ in found] == list(range(8))
    reached = [SCENE.sample(k, "validation").objects[0].pose[0] > 0.5 for k in range(8)]
    assert [won for _, won, _ in found] == reached and 0 < sum(reached) < 8
    assert all("was not reached" in why for _, won, why in found if not won)
    assert env.stream == "training"
    assert [judge_draw(env, task) for task in tasks[::-1]] == found[::-1]


def test_a_worker_that_finds_an_error_says_it(maker):
    with pytest.raises(InputError, match="leaf 'first' has no policy yet"):
        run([environment(0)], 1, lambda: make(sequence("s", Unprogrammed(name="first"), Train(Raise()))))
    with pytest.raises(InputError, match="has 0 stages, and none number 3"):
        run([environment(0, stage=3)], 1)


def test_a_worker_that_raises_is_one_error(maker):
    def broken():
        raise ZeroDivisionError("no such thing")

    with pytest.raises(MachineError, match=r"ZeroDivisionError\('no such thing'\)"):
        run([environment(0), environment(1)], 2, broken)


def test_a_worker_that_dies_is_one_error(maker):
    def deadly():
        os.kill(os.getpid(), signal.SIGKILL)

    with pytest.raises(MachineError, match=r"^a worker process ended; is there enough memory\?$"):
        run([environment(0), environment(1)], 2, deadly)


def test_workers_end_when_they_are_told(maker):
    pool = Workers(make, 2)
    dict(pool.each([environment(0), environment(1)]))
    pids = [process.pid for process in pool._processes]
    pool.close()
    assert not any(alive(pid) for pid in pids)


ORPHANS = """
import sys
sys.path.insert(0, {here!r})
import toys
from bt_tasksim.training.rollouts import Workers
pool = Workers(lambda: None, 3)
print(*(process.pid for process in pool._processes), flush=True)
import time
time.sleep(600)
"""


def alive(pid):
    stat = Path(f"/proc/{pid}/stat")
    try:
        return stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_workers_end_when_their_parent_is_killed():
    program = ORPHANS.format(here=str(Path(__file__).parent))
    parent = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    try:
        pids = [int(pid) for pid in parent.stdout.readline().split()]
        assert len(pids) == 3 and all(alive(pid) for pid in pids)
    finally:
        parent.kill()
        parent.wait()
        parent.stdout.close()
    until = time.monotonic() + 20.0
    while any(alive(pid) for pid in pids) and time.monotonic() < until:
        time.sleep(0.05)
    assert [pid for pid in pids if alive(pid)] == []
