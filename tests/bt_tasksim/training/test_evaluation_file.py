"""The file of an evaluation: nothing that had ended is lost, and only the same evaluation goes on from it."""

import dataclasses
import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time

import pytest

from bt_tasksim.cli.main import main
from bt_tasksim.concept_nodes.holding import NOT_HELD
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.identity import differences, identity, source_hash
from bt_tasksim.core.outcomes import CANNOT_START, DONE
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.training.evaluation_file import EvaluationFile, journal_of, read_kept
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, Evaluation

VERSIONS = {"bt-tasksim": "1", "source": "s"}


def made(seed):
    ends = [DONE(elapsed=1.1), CANNOT_START(NOT_HELD(object="cup", distance=0.08 + seed))]
    return EpisodeOutcome(
        seed, seed % 2 == 0, "SUCCESS", "", ends[seed % 2], 10, 0.1 / (seed + 1), math.nan, 0.0, 0.1
    )


def evaluation(n, **changes):
    outcomes = tuple(made(seed) for seed in range(n))
    about = {"subject": {"tree": "t"}, "versions": VERSIONS, "asked": 9, **changes}
    return Evaluation("s", "r", "e", "p", {}, outcomes, 2.0, **about)


def killed_after(path, n, **changes):
    """What a process leaves that is killed after some episodes."""
    keep = EvaluationFile(path)
    keep._next_whole = math.inf
    for k in range(n):
        keep.add(made(k), 0.5 * k, lambda k=k: evaluation(k + 1, **changes))
    return keep


def same(one, other):
    assert [o.to_data() for o in one] == [o.to_data() for o in other]


def test_what_had_ended_is_there_after_a_kill_and_half_a_line_is_none(tmp_path):
    path = tmp_path / "e.json"
    killed_after(path, 5)
    assert not path.exists()
    kept = read_kept(path, VERSIONS)
    same(kept.outcomes, evaluation(5).outcomes)
    assert kept.seconds == 2.0 and kept.subject == {"tree": "t"}
    whole = journal_of(path).read_bytes()
    for cut in (1, 20, 200):
        journal_of(path).write_bytes(whole[:-cut])
        same(read_kept(path, VERSIONS).outcomes, evaluation(4).outcomes)


def test_the_end_leaves_one_file_that_holds_all(tmp_path):
    path = tmp_path / "e.json"
    killed_after(path, 3).end(evaluation(4))
    assert [p.name for p in tmp_path.iterdir()] == ["e.json"]
    same(read_kept(path, VERSIONS).outcomes, evaluation(4).outcomes)


def test_what_an_earlier_one_left_stays_until_an_episode_has_ended(tmp_path):
    path = tmp_path / "e.json"
    killed_after(path, 5)
    before = journal_of(path).read_bytes()
    keep = EvaluationFile(path)
    assert journal_of(path).read_bytes() == before
    keep.add(made(0), 0.1, lambda: evaluation(1))
    same(read_kept(path, VERSIONS).outcomes, evaluation(1).outcomes)


def test_a_file_reached_by_another_name_is_the_same_one(tmp_path):
    (tmp_path / "folder").mkdir()
    path, link = tmp_path / "folder" / "e.json", tmp_path / "link.json"
    link.symlink_to(path)
    killed_after(link, 3)
    same(read_kept(path, VERSIONS).outcomes, evaluation(3).outcomes)
    EvaluationFile(link).end(evaluation(4))
    assert link.is_symlink() and [p.name for p in path.parent.iterdir()] == ["e.json"]


@pytest.mark.parametrize("fails", ["fsync", "write"])
def test_after_a_full_disk_the_journal_is_begun_anew(tmp_path, monkeypatch, fails):
    monkeypatch.setattr(EvaluationFile, "EVERY", 0.0)
    path = tmp_path / "e.json"
    keep = killed_after(path, 2)
    original = getattr(os, fails)

    def full(file, *data):
        if data:
            original(file, data[0][:7])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, fails, full)
    keep.add(made(2), 1.0, lambda: evaluation(3))
    monkeypatch.setattr(os, fails, original)
    keep.add(made(3), 1.0, lambda: evaluation(4))
    same(read_kept(path, VERSIONS).outcomes, evaluation(4).outcomes)


def replaced(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


DAMAGE = {
    "a digit": lambda text: replaced(text, "1.08", "1.07"),
    "a success": lambda text: replaced(text, '"success": false', '"success": true'),
    "a seed": lambda text: replaced(text, '"seed": 1', '"seed": 7'),
    "not JSON": lambda text: text[: len(text) // 2] + "}{" + text[len(text) // 2 :],
    "bytes": lambda text: "\0\xff\n" + text,
    "nothing": lambda text: "",
    "a list": lambda text: "[1]\n",
    "other kinds": lambda text: '{"outcomes": 3, "subject": {}, "versions": 7}\n',
}


@pytest.mark.parametrize("damage", DAMAGE)
@pytest.mark.parametrize("ended", [False, True])
def test_a_damaged_file_is_one_sentence(tmp_path, damage, ended):
    path = tmp_path / "e.json"
    keep = killed_after(path, 4)
    if ended:
        keep.end(evaluation(4))
    of = path if ended else journal_of(path)
    of.write_text(DAMAGE[damage](of.read_text()))
    with pytest.raises(
        InputError, match=r"e\.json.*(damaged|not JSON|not text|UTF-8|braces|not say)"
    ) as caught:
        read_kept(path, VERSIONS)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("tail", ['{"check": "0', "half\n", "\0" * 4096, "\0\n\0\n", "last line again"])
def test_a_torn_end_costs_only_what_is_torn(tmp_path, tail):
    path = tmp_path / "e.json"
    killed_after(path, 4)
    text = journal_of(path).read_text()
    journal_of(path).write_text(text + (f"{text.splitlines()[-1]}\n" if tail == "last line again" else tail))
    kept = read_kept(path, VERSIONS)
    same(kept.outcomes, evaluation(4).outcomes)
    assert kept.lost and kept.seconds == 1.5 and "4 episodes" in kept.line and "torn" in kept.line
    journal_of(path).write_text(text)
    assert not read_kept(path, VERSIONS).lost


def test_damage_in_the_middle_is_told_by_its_lines_and_costs_no_others(tmp_path):
    path = tmp_path / "e'.json"
    killed_after(path, 6)
    lines = journal_of(path).read_text().splitlines(keepends=True)
    lines[2], lines[4] = lines[2].replace("1.08", "1.07"), lines[4][:40] + "\n"
    journal_of(path).write_text("".join(lines))
    with pytest.raises(InputError, match="damaged in line 3, 5, and 4 episodes in it are whole") as caught:
        read_kept(path, VERSIONS)
    advice = re.search(r"\((sed .*)\) and", str(caught.value))[1]
    subprocess.run(shlex.split(advice), check=True)
    assert [o.seed for o in read_kept(path, VERSIONS).outcomes] == [0, 2, 4, 5]


@pytest.mark.parametrize("kind", ["file", "empty", "link", "folder"])
def test_what_is_not_ours_is_never_touched(tmp_path, kind, capsys):
    path, foreign = tmp_path / "e.json", tmp_path / "e.json.episodes"
    if kind == "folder":
        foreign.mkdir()
    elif kind == "link":
        (tmp_path / "mine").write_text("mine")
        foreign.symlink_to(tmp_path / "mine")
    else:
        foreign.write_text("mine" * (kind == "file"))
    words = ["evaluate", "pick_and_throw", "--episodes", "1", "--json", str(path)]
    for more in ([], ["--resume"]):
        assert main([*words, *more]) == 2
        said = capsys.readouterr().err
        assert "e.json.episodes" in said and said.count("\n") == 1
    with pytest.raises(InputError):
        EvaluationFile(path)
    assert os.path.lexists(foreign) and not path.exists()
    assert kind == "folder" or foreign.read_text() == "mine" * (kind != "empty")


def test_what_comes_to_the_journals_name_later_stays(tmp_path):
    path = tmp_path / "e.json"
    keep = EvaluationFile(path)
    journal_of(path).write_text("mine")
    keep.add(made(0), 0.1, lambda: evaluation(1))
    keep.end(evaluation(1))
    assert journal_of(path).read_text() == "mine"
    assert json.loads(path.read_text())["episodes"] == 1


def test_another_version_is_refused_with_what_differs(tmp_path):
    path = tmp_path / "e.json"
    killed_after(path, 2)
    with pytest.raises(InputError, match=r"another version.*bt-tasksim 1, here 2"):
        read_kept(path, {**VERSIONS, "bt-tasksim": "2"})
    assert differences({"a": "1"}, {"a": "1"}) == ""
    assert "numpy none, here 2" in differences({}, {"numpy": "2"})
    assert identity()["source"] == source_hash() and len(source_hash()) == 16


def test_files_of_earlier_versions_are_refused(tmp_path):
    path = tmp_path / "e.json"
    content = evaluation(2).to_json()
    path.write_text(
        json.dumps({k: v for k, v in content.items() if k not in ("subject", "versions", "sha256")})
    )
    with pytest.raises(InputError, match="does not say what was evaluated"):
        read_kept(path, VERSIONS)


def test_there_is_nothing_to_go_on_from(tmp_path, capsys):
    with pytest.raises(InputError, match=r"no evaluation in .*without --resume"):
        read_kept(tmp_path / "e.json", VERSIONS)
    assert main(["evaluate", "pick_and_throw", "--resume"]) == 2
    assert "name it" in capsys.readouterr().err


# ---- with episodes ----------------------------------------------------------------------------------------

JOB = Job("pick_and_throw", options=EngineOptions(noise="none"))


@pytest.fixture(scope="module")
def whole():
    return evaluate(JOB, range(6))


def timeless(outcomes):
    return [dataclasses.replace(o, wall_time=0.0).to_data() for o in outcomes]


def begun(path, n):
    """An evaluation of which only the first episodes ended."""
    evaluate(JOB, range(n), keep=EvaluationFile(path))
    return read_kept(path, identity())


@pytest.mark.parametrize("workers", [None, 2])
def test_it_goes_on_and_is_as_if_it_had_never_stopped(tmp_path, whole, workers):
    path, seen = tmp_path / "e.json", []
    kept = begun(path, 3)
    found = evaluate(
        JOB, range(6), workers, kept=kept, keep=EvaluationFile(path), progress=lambda o: seen.append(o.seed)
    )
    assert timeless(found.outcomes) == timeless(whole.outcomes) and found.complete
    assert [o.to_data() for o in found.outcomes[:3]] == [o.to_data() for o in kept.outcomes], "not run again"
    assert seen[:3] == [0, 1, 2] and sorted(seen) == [*range(6)] and found.seconds > kept.seconds
    again = evaluate(JOB, range(6), kept=read_kept(path, identity()))
    assert again.outcomes == found.outcomes or timeless(again.outcomes) == timeless(found.outcomes)


def test_only_the_same_evaluation_goes_on(tmp_path, policy):
    path = tmp_path / "e.json"
    kept = begun(path, 2)
    other = tmp_path / "other.py"
    other.write_text("from bt_tasksim.trees.scenarios.pick_and_throw import build, scene\n")
    for job, named in {
        dataclasses.replace(JOB, tree="shelf_to_shelf"): "tree and another scene",
        dataclasses.replace(JOB, tree=str(other)): "file other.py",
        dataclasses.replace(JOB, robot="xarm7_ability"): "robot",
        dataclasses.replace(JOB, options=EngineOptions(noise="hard")): "choice of engines",
        dataclasses.replace(JOB, options=EngineOptions(engines="mujoco", noise="none")): "choice of engines",
        dataclasses.replace(JOB, policies=(("grasp", str(policy("mine"))),)): "choice of policies",
    }.items():
        with pytest.raises(InputError, match=f"another {named}"):
            evaluate(job, range(2), kept=kept)
    with pytest.raises(InputError, match="another stream of draws"):
        evaluate(JOB, range(2), kept=kept, stream="training")
    with pytest.raises(InputError, match="1 episodes that are not asked for, such as seed 0"):
        evaluate(JOB, range(1, 9), kept=kept)


def test_a_killed_command_goes_on(tmp_path, whole, capsys):
    words = ["evaluate", "pick_and_throw", "--noise", "none", "--episodes", "6", "--json", "e.json"]
    command = [sys.executable, "-m", "bt_tasksim.cli", *words, "--batch", "1"]  # one after the other
    first = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL)
    journal, until = tmp_path / "e.json.episodes", time.monotonic() + 60.0
    while not (journal.exists() and journal.read_bytes().count(b"\n") >= 3):
        assert first.poll() is None and time.monotonic() < until
        time.sleep(0.005)
    first.send_signal(signal.SIGKILL)
    first.wait()
    kept = read_kept(tmp_path / "e.json", identity())
    assert 2 <= len(kept.outcomes) < 6
    before = journal.read_bytes()
    assert main([*words[:-1], str(tmp_path / "e.json")]) == 2, "anew would lose them"
    assert journal.read_bytes() == before and "go on with --resume" in capsys.readouterr().err
    assert main([*words[:-1], str(tmp_path / "e.json"), "--resume"]) == 0
    content = json.loads((tmp_path / "e.json").read_text())
    ended = [EpisodeOutcome.from_data(data) for data in content["outcomes"]]
    assert timeless(ended) == timeless(whole.outcomes) and content["complete"]
    by_seed = {outcome.seed: outcome for outcome in ended}
    same([by_seed[outcome.seed] for outcome in kept.outcomes], kept.outcomes)  # none was played again
    assert sorted(p.name for p in tmp_path.iterdir()) == ["e.json"]
