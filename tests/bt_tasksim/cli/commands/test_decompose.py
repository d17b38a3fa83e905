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
