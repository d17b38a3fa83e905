"""Tables of any tree say what results hold, and that others are not there yet."""

import pytest

from benchmarks import any_tree_tables
from benchmarks.any_tree.five import FIVE
from benchmarks.any_tree.report import summary
from bt_tasksim.training.evaluation_outcomes import wilson

FAILED = {"concept": "pick", "leaf": "pick cup", "reason": "goal_lost", "status": "FAILURE"}


def result(good, bad, impossible=0):
    """Results of draws, as the benchmark writes them."""
    draws = [{"seed": k, "success": True, "reason": ""} for k in range(good)]
    draws += [{**FAILED, "seed": 100 + k, "success": False} for k in range(bad)]
    for k in range(impossible):
        gone = {"oracle": {"possible": False, "reason": "no grasp", "exhausted": k != 1}}
        draws.append({**FAILED, **gone, "seed": 200 + k, "success": False})
    return {**summary(draws), "draws": draws}


@pytest.mark.parametrize("name", any_tree_tables.TABLES)
def test_without_results_every_row_says_so(name):
    rows = any_tree_tables.TABLES[name]({}).splitlines()[2:]
    assert all("not measured yet" in row for row in rows)


def test_rates_are_those_of_what_is_possible():
    first = {**result(18, 2, 4), "block": "B0099"}
    found = {"any_tree-so100": first, "any_tree-panda-2_colours": result(3, 0)}
    lines = any_tree_tables.any_tree(found).splitlines()
    line = next(line for line in lines if "SO-100" in line)
    assert "| B0099 | 24 | 18 | 4 | 1 | 0 | 90.00 %" in line and "| 95 % | 0 | 0 |" in line
    assert any("`panda-2_colours` |  | 3 | 3 | 0 | 0 | 0 |" in each for each in lines), (
        "whatever else there is"
    )
    failures = any_tree_tables.any_tree_failures(found)
    assert "| SO-100 | pick | goal_lost | 2 | 100, 101 |" in failures


def test_what_is_refused_by_name_does_not_count():
    draws = result(18, 2)["draws"]
    for k in range(3):
        draws.append(
            {"seed": 300 + k, "success": False, "reason": "not_told_apart", "concept": "", "leaf": ""}
        )
    draws[-1]["oracle"] = {"possible": False, "reason": "no grasp"}
    found = {"any_tree-panda-camera-1_colours": {**summary(draws), "draws": draws}}
    lines = any_tree_tables.any_tree(found).splitlines()
    assert any("one colour |  | 23 | 18 | 1 | 1 | 2 | 90.00 %" in line for line in lines)


def test_a_newer_block_with_fewer_draws_does_not_replace_an_older_one():
    old, new = {**result(95, 5), "block": "B0001"}, {**result(40, 0), "block": "B0002"}
    name = "any_tree-panda-camera"
    found = {name: new, f"B0001/{name}": old, f"B0002/{name}": new}
    line = next(line for line in any_tree_tables.any_tree(found).splitlines() if "camera" in line)
    assert "| B0001 | 100 | 95 |" in line


def test_pairs_are_of_the_draws_that_both_had():
    usual, other = result(10, 2), result(4, 0)
    other["draws"][3]["success"] = False
    lines = any_tree_tables.any_tree_pairs({"any_tree-panda": usual, "any_tree-panda-mujoco": other})
    assert "| Panda, MuJoCo |  | 4 | 4 | 3 | 1 | 0 | 1 |" in lines
    block = {**other, "block": "B0098"}
    found = {"any_tree-panda": result(0, 12), "B0098/any_tree-panda": usual, "any_tree-panda-mujoco": block}
    lines = any_tree_tables.any_tree_pairs(found)
    assert "| Panda, MuJoCo | B0098 | 4 | 4 | 3 | 1 | 0 | 1 |" in lines, (
        "of its own block, not of a later one"
    )
    for draw in other["draws"]:
        draw["seed"] += 10_000
    lines = any_tree_tables.any_tree_pairs({"any_tree-panda": usual, "any_tree-panda-mujoco": other})
    assert "MuJoCo | | not measured yet" in lines, "no draw in common"


def test_all_of_the_five_trees_have_a_row():
    assert list(any_tree_tables.FIVE) == list(FIVE)
    found = {
        "successes": 97, "episodes": 100, "confidence_interval": wilson(97, 100), "failures": {"no_way": 3}
    }  # fmt: skip
    line = any_tree_tables.five({"five-tower-panda": found}).splitlines()[-1]
    assert "97 of 100" in line and "3 x no_way" in line
