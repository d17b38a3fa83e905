"""``bt-tasksim decompose``: tasks, graph, tree and picture; faulty logs."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest

from bt_tasksim.core.resources import asset

pytestmark = pytest.mark.physical

LOG = asset("demonstrations", "pick_and_place", "00.h5")


def test_decompose_writes_tasks_graph_tree_and_picture(call):
    code, out, _ = call("decompose", LOG, "--json", "d.json", "--xml", "d.xml", "--picture", "d.svg")
    assert code == 0 and out.strip().endswith("wrote d.json, d.xml, d.svg")
    content = json.loads(Path("d.json").read_text())
    assert {"tasks", "graph"} <= content.keys()
    assert [t["concept"] for t in content["tasks"]] == ["grasp", "pick", "bring", "place", "release"]
    for task in content["tasks"]:
        assert {"concept", "start", "end", "confidence", "parameters"} <= task.keys()
        assert task["start"] < task["end"] and 0 <= task["confidence"] <= 1
    code, _, _ = call("evaluate", "d.xml", "--episodes", 5, "--seed", 3, "--json", "e.json")
    assert code == 0 and json.loads(Path("e.json").read_text())["successes"] >= 3


def spoiled(change):
    shutil.copy(LOG, "log.h5")
    with h5py.File("log.h5", "r+") as file:
        demonstration = next(iter(file["demonstrations"].values()))
        change(demonstration)


def put(name, index, value):
    def change(demonstration):
        data = demonstration[name][()]
        data[index] = value
        del demonstration[name]
        demonstration[name] = data

    return change


def delete(name):
    def change(demonstration):
        del demonstration[name]

    return change


def first_object(change):
    def on(demonstration):
        name = next(iter(demonstration["objects"]))
        change(f"objects/{name}/pose")(demonstration)

    return on


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (put("hand/pose", (5, 0), np.nan), ("hand/pose", "5", "finite|not a number|NaN")),
        (put("time", 7, -1.0), ("time", "7", "back")),
        (put("hand/pose", (9, slice(3, 7)), 0.0), ("hand/pose", "9", "quaternion")),
        (first_object(lambda n: put(n, (3, 1), np.inf)), ("objects/", "3", "finite|not a number|inf")),
        (delete("hand/opening"), ("hand/opening", "missing")),
        (delete("objects"), ("object",)),
    ],
)
def test_faulty_logs_name_the_data_set_and_the_index(refused, change, words):
    spoiled(change)
    sentence = refused("decompose", "log.h5")
    assert "log.h5" in sentence
    for word in words:
        assert re.search(word, sentence, re.IGNORECASE), f"{word} in {sentence}"


def test_truncated_and_empty_logs(refused):
    Path("empty.h5").touch()
    assert refused("decompose", "empty.h5") == "'empty.h5' is empty; record or copy it again"
    content = Path(LOG).read_bytes()
    for share in (0.3, 0.9):
        Path("cut.h5").write_bytes(content[: int(share * len(content))])
        assert "'cut.h5' is cut off or damaged" in refused("decompose", "cut.h5")
    Path("text.h5").write_text("time,x,y\n" * 99)
    assert refused("decompose", "text.h5").startswith("'text.h5' is no log of a known kind")
    assert "'.' is a folder" in refused("decompose", ".")


def test_an_episode_that_is_not_there(refused):
    assert "9" in refused("decompose", LOG, "--episode", "9")


def test_what_was_not_understood_is_said(call):
    def opened(demonstration):
        opening = demonstration["hand/opening"]
        opening[...] = opening[...].max()

    spoiled(opened)
    code, out, _ = call("decompose", "log.h5")
    assert code == 0 and "no task was recognised in 'log.h5'" in out

    def away(demonstration):
        for name in demonstration["objects"]:
            demonstration[f"objects/{name}/pose"][:, 0] += 1.0

    spoiled(away)
    code, out, _ = call("decompose", "log.h5", "--json", "d.json")
    assert code == 0 and "held no object" in out, out
    assert "held no object" in json.dumps(json.loads(Path("d.json").read_text())["remarks"])


def test_pictures_are_svg_and_nothing_else(refused):
    assert ".svg" in refused("decompose", LOG, "--picture", "a.png")
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("bad", ["gone/d.xml", "folder", "d.json"])
def test_nothing_is_written_where_one_of_the_targets_cannot_be(refused, bad):
    Path("folder").mkdir()
    before = sorted(Path().rglob("*"))
    refused("decompose", LOG, "--json", "d.json", "--xml", bad, "--picture", "d.svg")
    refused("show", "pick_and_place", "--picture", "d.svg", "--xml", bad if bad != "d.json" else "d.svg")
    assert sorted(Path().rglob("*")) == before


def test_what_is_read_is_not_written_over(refused):
    shutil.copy(LOG, "log.h5")
    Path("t.py").write_text("TREE = 1")
    for words in (
        ("decompose", "log.h5", "--xml", "log.h5"),
        ("decompose", LOG, "log.h5", "--json", "../" + Path.cwd().name + "/log.h5"),
        ("show", "t.py", "--xml", "t.py"),
        ("evaluate", "t.py", "--json", "t.py"),
        ("evaluate", "pick_and_place", "--scene", "t.py", "--json", "t.py"),
    ):
        assert "which is read" in refused(*words)
    assert Path("log.h5").read_bytes() == Path(LOG).read_bytes() and Path("t.py").read_text() == "TREE = 1"


def test_nothing_is_written_where_there_is_no_tree(refused):
    spoiled(lambda demonstration: demonstration["hand/opening"].write_direct(np.full(
        demonstration["hand/opening"].shape, 0.08)))  # fmt: skip
    refused("decompose", "log.h5", "--json", "d.json", "--xml", "d.xml")
    assert not Path("d.json").exists()


def test_several_logs_are_merged_and_each_task_says_in_how_many_it_was_seen(call, refused):
    logs = [asset("demonstrations", "pick_and_place", f"{k:02d}.h5") for k in range(3)]
    code, out, _ = call("decompose", *logs, "--json", "d.json", "--xml", "d.xml")
    lines = out.splitlines()
    assert code == 0 and len(lines) == 6
    assert all(line.endswith("  3 of 3") for line in lines[:5]), out
    assert len(json.loads(Path("d.json").read_text())["demonstrations"]) == 3
    assert 'scene="pick_and_place"' in Path("d.xml").read_text()
    code, out, _ = call("decompose", logs[0], logs[1], asset("demonstrations", "pick_and_throw", "00.h5"))
    assert code == 0 and "2 of 3" in out
    assert not any(" of " in line for line in call("decompose", logs[0])[1].splitlines())
    assert str(logs[0]) in refused("decompose", logs[0], logs[0])


def test_motion_that_was_not_understood_is_said_beside_what_was(call):
    """A cup that is pushed on after it was set down; a hand that closed on nothing is not worth a line."""

    def pushed(demonstration):
        (name,) = demonstration["objects"]
        time, hand = demonstration["time"][()], demonstration["hand/pose"][()]
        cup, opening = demonstration[f"objects/{name}/pose"][()], demonstration["hand/opening"][()]
        height = cup[:, 2]
        top = int(np.argmax(height))
        lands = top + int(np.argmax(np.abs(height[top:] - np.median(height[-10:])) < 0.002))
        rows = np.concatenate([np.arange(lands), np.full(90, lands), np.arange(lands, len(time))])
        way = np.concatenate([np.zeros(lands), np.linspace(0, 0.2, 90), np.full(len(time) - lands, 0.2)])
        changed = {"hand/pose": hand, f"objects/{name}/pose": cup, "hand/opening": opening}
        for key, values in changed.items():
            del demonstration[key]
            moved = values[rows]
            if moved.ndim == 2:
                moved[:, 0] += way
            demonstration[key] = moved
        del demonstration["time"]
        demonstration["time"] = np.arange(len(rows)) * float(np.median(np.diff(time)))

    spoiled(pushed)
    code, out, _ = call("decompose", "log.h5", "--json", "d.json")
    lines = out.splitlines()
    assert code == 0 and len(lines) == 7, out
    assert lines[5].startswith("not understood: ") and "moved" in lines[5] and " m " in lines[5]
    (said,) = json.loads(Path("d.json").read_text())["remarks"].values()
    assert {remark["kind"] for remark in said} == {"motion", "empty hand"}
