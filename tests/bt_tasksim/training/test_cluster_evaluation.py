"""Evaluation on a Ray cluster: the same outcomes, whatever the actors, and whoever is killed."""

import contextlib
import dataclasses
import importlib.util
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import psutil
import pytest

from benchmarks import cluster as benchmark
from benchmarks.cluster import local_cluster, timeless
from bt_tasksim.cli.main import main
from bt_tasksim.core.errors import BtTasksimWarning, InputError
from bt_tasksim.core.identity import identity
from bt_tasksim.core.resources import HOME
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.training.evaluation_file import EvaluationFile, read_kept
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: pip install 'bt-tasksim[cluster]'"
)
JOB = Job("grasp_then_pick", options=EngineOptions(engines="sapien", noise="hard"), batch=1)
"""One episode after the other, so that somebody is in the middle of his share whenever he is killed."""
SEEDS = range(40, 56)
FEW = SEEDS[:8]
"""Enough where two actors have shares, one after the other."""


@pytest.fixture(scope="module")
def whole():
    return evaluate(dataclasses.replace(JOB, batch=None), SEEDS)


@pytest.fixture(scope="module")
def cluster():
    """A head with room for two actors; tests start more nodes, and end them."""
    with local_cluster(2) as found:
        yield found


def members(cluster, node=0):
    """Processes of actors on a node."""
    mine = set(cluster.nodes[node].processes())
    return [
        p for p in psutil.process_iter(["name"]) if p.pid in mine and p.info["name"].startswith("ray::Mem")
    ]


def told(job, seeds, progress, actors, cluster):
    """An evaluation, and whether it said that an actor was lost."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", BtTasksimWarning)
        found = evaluate(job, seeds, actors, progress=progress, cluster=cluster.address)
    return found, any(re.search("an actor on .* ended", str(warning.message)) for warning in said)


def test_one_and_two_actors_give_the_same_bits_also_after_one_was_killed(cluster, whole, tmp_path):
    alone = timeless(whole.outcomes[: len(FEW)])
    for _ in range(5):  # one that has not begun when others are at work is lost without a word
        killed, ended = [], []

        def kill_one(outcome, killed=killed, ended=ended):
            ended.append(outcome.seed)
            if len(ended) == 3:
                killed.append(members(cluster)[0].pid)
                os.kill(killed[0], signal.SIGKILL)

        two, lost = told(JOB, FEW, kill_one, 2, cluster)
        assert killed and sorted(ended) == list(FEW), "none twice"
        assert [o.seed for o in two.outcomes] == list(FEW)
        assert timeless(two.outcomes) == alone
        if lost:
            break
    assert lost, "none of the killed actors ever had a share"
    path = tmp_path / "e.json"
    evaluate(JOB, FEW[:3], keep=EvaluationFile(path))
    kept = read_kept(path, identity())
    one = evaluate(JOB, FEW, 1, cluster=cluster.address, kept=kept)
    assert timeless(one.outcomes) == alone and one.subject == whole.subject


def test_a_node_that_is_killed_is_made_up_for(cluster, whole):
    """An actor of that node may begin later than others end, so it is tried again."""
    for _ in range(5):
        cluster.start()
        ended = []

        def kill_node(outcome, ended=ended):
            ended.append(outcome.seed)
            if len(ended) == 6:
                cluster.nodes.pop().kill()

        found, lost = told(JOB, SEEDS, kill_node, 3, cluster)
        assert timeless(found.outcomes) == timeless(whole.outcomes) and sorted(ended) == list(SEEDS)
        if lost:
            return
    raise AssertionError("no actor of a killed node ever had a share")


def test_the_benchmark_kills_a_node_and_finds_all_whole_and_equal(cluster, monkeypatch, capsys):
    """``python -m benchmarks.cluster``, on this cluster instead of one of its own."""

    @contextlib.contextmanager
    def this_one(*processors):
        assert processors == (1, 1)
        cluster.start(1)
        yield cluster

    monkeypatch.setattr(benchmark, "local_cluster", this_one)
    try:
        assert benchmark.main(["--times", "1", "--episodes", "4", "--tree", "grasp_then_pick"]) == 0
    finally:
        cluster.nodes.pop().kill()
    assert capsys.readouterr().out.endswith("1 of 1 results whole and equal\n")


@pytest.mark.parametrize("there", ["another source", "an older version"])
def test_a_node_with_another_version_is_refused(cluster, tmp_path, there):
    shutil.copytree(HOME, tmp_path / "bt_tasksim", ignore=shutil.ignore_patterns("*.h5", "__pycache__"))
    core, said = tmp_path / "bt_tasksim" / "core", "has another version .*source"
    if there == "another source":
        with open(core / "units.py", "a") as file:
            file.write("# changed\n")
    else:
        (core / "identity.py").write_text("raise ModuleNotFoundError('there is none')\n")
        said = "has no bt-tasksim, or an older version .*there is none"
    node = cluster.start(2, {"PYTHONPATH": str(tmp_path)})
    try:
        with pytest.raises(InputError, match=f"the node .* of the cluster {said}") as caught:
            evaluate(JOB, range(100), 5, cluster=cluster.address)
        assert "\n" not in str(caught.value)
    finally:
        cluster.nodes.remove(node)
        node.kill()


def test_what_a_node_does_not_find_is_said_with_its_name(cluster, monkeypatch, tmp_path):
    """The actors' files may be others than ours: here a tree is gone until they look for it."""
    tree = tmp_path / "mine.py"
    tree.write_text(
        "import multiprocessing, sys\n"
        "assert 'ray' not in sys.modules\n"
        "from bt_tasksim.trees.scenarios.grasp_then_pick import build, scene\n"
    )
    with pytest.raises(InputError, match=r"on the node .* of the cluster: .*mine\.py', line 2: Assertion"):
        evaluate(Job(str(tree)), [1, 2], cluster=cluster.address)


def test_engines_that_serve_one_client_are_refused():
    for engines in ("remote:127.0.0.1:5555", "ros:127.0.0.1:9090"):
        with pytest.raises(InputError, match="one client at a time: leave --cluster away"):
            evaluate(Job("grasp_then_pick", options=EngineOptions(engines=engines)), [1], cluster="local")


def test_a_wrong_address_is_refused_by_the_command(capsys):
    assert main(["evaluate", "grasp_then_pick", "--cluster", "ray://10.0.0.1"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_a_command_that_is_ended_loses_nothing_and_leaves_nothing(tmp_path, whole, number, code):
    episodes = 24 if number == signal.SIGKILL else 2000  # more than it can do before it is told to end
    words = [
        "evaluate",
        "grasp_then_pick",
        "--noise",
        "hard",
        "--seed",
        "40",
        "--episodes",
        str(episodes),
        "--json",
    ]
    slow = ["--cluster", "local", "--workers", "1", "--batch", "1"]  # one episode after the other
    command = [sys.executable, "-m", "bt_tasksim.cli", *words, "e.json", *slow]
    first = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    journal, until = tmp_path / "e.json.episodes", time.monotonic() + 300.0
    with first:
        while not (journal.exists() and journal.read_bytes().count(b"\n") >= 3):
            if first.poll() is not None or time.monotonic() > until:
                first.kill()
                raise AssertionError(first.communicate()[1])
            time.sleep(0.005)
        begun = psutil.Process(first.pid).children(recursive=True)
        first.send_signal(number)
        _, said = first.communicate()
    assert first.returncode == code and said.count("\n") == (number != signal.SIGKILL), said
    _, left = psutil.wait_procs(begun, timeout=30.0)
    assert [p for p in left if p.status() != psutil.STATUS_ZOMBIE] == []
    path = str(tmp_path / "e.json")
    assert 2 <= len(read_kept(path, identity()).outcomes) < episodes
    if number != signal.SIGKILL:
        return
    assert main([*words, path, "--resume"]) == 0
    content = json.loads(Path(path).read_text())
    found = timeless(EpisodeOutcome.from_data(o) for o in content["outcomes"])
    assert len(found) == episodes and found[: len(SEEDS)] == timeless(whole.outcomes)
