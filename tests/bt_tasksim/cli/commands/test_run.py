"""``bt-tasksim run`` and ``replay``: what they write, and what they say of bad trees and names."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytestmark = pytest.mark.physical


def test_run_writes_its_folder_and_replay_finds_the_same(call, until):
    out, err = until(0, "run", "pick_and_throw", "--out", "here")
    assert err == "" and out.startswith("SUCCESS: cup is in trash_bin")
    assert out.strip().endswith("results: here/report.html") and len(out.strip().splitlines()) == 1
    assert {"result.json", "run.h5", "tree.svg", "report.html"} <= {p.name for p in Path("here").iterdir()}
    code, out, _ = call("replay", "here")
    assert (code == 0 and "identical" in out) or "same" in out


def test_run_and_evaluate_take_the_policy_of_the_command_line(call, until, policy):
    folder = policy("mine")
    words = ("--policy", f"grasp={folder}")
    until(0, "run", "pick_and_place", *words, "--out", "here")
    named = json.loads(Path("here/result.json").read_text())["policies"]
    assert named["grasp target"].startswith("mine@") and named["place target"] == "programmed"
    assert call("replay", "here")[0] == 2, "a log names no file to load"
    code, out, _ = call("replay", "here", "--policy", f"grasp={folder}")
    assert code == 0 and out.startswith("identical")
    code, out, _ = call("evaluate", "pick_and_place", *words, "--episodes", 1, "--json", "e.json")
    assert code == 0 and json.loads(Path("e.json").read_text())["policies"] == named


def test_a_goal_out_of_reach_is_a_failed_run_with_the_leaf_and_the_place(until, tree_file):
    name = tree_file('sequence("far", Grasp("cup"), Pick("cup"), Bring("cup", position=(3.0, 0.0, 0.4)))')
    out, err = until(1, "run", name, "--out", "far", said="bring cup")
    assert err == ""
    assert out.startswith("FAILURE: bring cup: ")
    assert "the arm does not reach (3." in out
    assert json.loads(Path("far/result.json").read_text())["reason"] == "no_way"
    assert json.loads(Path("far/result.json").read_text())["success"] is False


def test_a_failed_run_says_which_leaf_and_why(call, tree_file):
    name = tree_file('sequence("soon", Grasp("cup", timeout=0.5))')
    code, out, _ = call("run", name, "--out", "soon")
    assert code == 1
    assert out.startswith("FAILURE: grasp cup: ") and out.count("grasp cup") == 1
    content = json.loads(Path("soon/result.json").read_text())
    assert (content["reason"], content["leaf"]) == ("timed_out", "grasp cup")
    assert content["outcome"]["numbers"] == {"limit": 0.5}
    assert content["outcome"]["detail"]["units"]["distance"] == "m"


def test_a_run_behind_the_limits_in_real_time_says_how_well_it_kept_time(call, until):
    out, _ = until(0, "run", "grasp_then_pick", "--safety", "--real-time", "--out", "here")
    assert "20 Hz: " in out and "periods skipped" in out
    about = json.loads(Path("here/result.json").read_text())
    assert about["options"]["safety"] and about["options"]["real_time"]
    assert about["timing"]["summary"] in out and about["timing"]["ticks"] > 20
    assert "control rate" in Path("here/report.html").read_text()
    assert call("replay", "here")[0] == 0


def test_a_leaf_that_raises_is_one_sentence_with_its_name(call, tree_file):
    tree_file(
        'Broken("cup", name="culprit")',
        "\nclass Broken(Grasp):\n    def begin(self, seen):\n        return {}['key']\n",
    )
    code, _, err = call("run", "tree.py", "--out", "here")
    assert code == 1 and err == "bt-tasksim: leaf 'culprit' raised KeyError in tree.py:14: 'key'\n"
    assert not Path("here").exists()


def test_a_run_whose_tree_xml_cannot_hold_is_replayed_with_it(call, refused, tree_file):
    from bt_tasksim.demos_decomp.log_file import read_log
    from bt_tasksim.execution.run_log import read_text

    more = """
from py_trees.behaviours import Success

class Thing(Success):
    pass
"""
    tree_file('sequence("mixed", Thing("mine"), Grasp("cup", timeout=0.5))', more)
    assert call("run", "tree.py", "--seed", 3, "--out", "here")[0] == 1
    assert read_text(read_log("here/run.h5").demonstrations[0].extra["run/tree"]) == ""
    assert "--tree" in refused("replay", "here"), "and nothing is looked for where the log says it ran"
    code, out, _ = call("replay", "here", "--tree", "tree.py")
    assert code == 0 and out.startswith("identical"), out
    assert "another tree" in refused("replay", "here", "--tree", "pick_and_place")
    assert "pick_and_place" in refused("replay", "here", "--tree", "pick_and_plaice")
    assert "gone.py" in refused("replay", "here", "--tree", "gone.py")


@pytest.mark.parametrize("kind", ["scenario", "xml"])
def test_a_run_is_replayed_with_any_kind_of_tree(call, kind):
    assert call("show", "pick_and_throw", "--xml", "tree.xml")[0] == 0
    tree = "pick_and_throw" if kind == "scenario" else "tree.xml"
    assert call("run", tree, "--seed", 3, "--out", "here")[0] in (0, 1)
    code, out, _ = call("replay", "here", "--tree", tree)
    assert code == 0 and out.startswith("identical"), out


def test_laws_of_batches_are_refused_for_a_single_run(call):
    code, _, err = call("run", "pick_and_place", "--laws", "torch")
    assert code == 2 and "evaluate" in err and not Path("runs").exists()


@pytest.mark.parametrize("more", [(), ("--video",)])
def test_a_run_is_as_long_as_is_asked_for(call, until, more):
    out, _ = until(1, "run", "pick_and_place", "--longest", "1.5", "--out", "short", *more)
    assert "1.5 s" in out
    result = json.loads(Path("short/result.json").read_text())
    assert result["reason"] == "time_over" and result["control_steps"] == 30
    assert call("replay", "short")[0] == 0


def test_a_draw_that_starts_in_the_robot_is_bad_input_and_nothing_is_written(call):
    Path("inside.py").write_text(
        "from bt_tasksim import ObjectSpec, Scene\n"
        "from bt_tasksim.concept_nodes import Grasp\n"
        "from bt_tasksim.trees import sequence\n\n"
        'near = ObjectSpec("box", on="table", centre=(-0.55, 0.0), area=(0.0, 0.0))\n'
        'def scene(): return Scene(objects={"near": near})\n'
        'def build(): return sequence("take", Grasp("near"))\n'
    )
    code, out, err = call("run", "inside.py", "--out", "here")
    assert (code, out) == (2, "") and "'near' starts" in err and "check" in err
    assert not Path("here").exists()
