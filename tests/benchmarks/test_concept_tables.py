"""Tables of the concepts' scenarios say what results hold, and that others are not there yet."""

from __future__ import annotations

from benchmarks import concept_tables
from bt_tasksim.trees.load import scenarios


def result(successes, episodes=100, undrawn=(), force=30.0, **reasons):
    """As `benchmarks.concepts` writes it."""
    felt = {"median": 1.0, "largest": 99.0, "of": episodes}
    return {
        "successes": successes,
        "episodes": episodes,
        "undrawn_seeds": list(undrawn),
        "reasons": {f"{leaf}: why": count for leaf, count in reasons.items()},
        "force": {**felt, "usual": force, "limit": 60.0, "within": 98},
        "jerk": {**felt, "usual": 12.0, "limit": 40.0, "within": 100},
        "overlap": {**felt, "usual": 0.0011, "limit": 0.002, "within": 97},
    }


def test_without_results_nothing_is_claimed():
    rows = concept_tables.concepts({}).splitlines()[2:]
    assert len(rows) == len(scenarios()) and all("not measured yet" in row for row in rows)
    assert concept_tables.failures({}) == "None." and concept_tables.gentleness({}) == "Not measured yet."


def test_successes_are_those_of_the_draws_in_which_a_run_could_begin():
    found = {
        "concept-push-panda-sapien": result(97),
        "concept-push-xarm7_ability-sapien": result(80, undrawn=range(10)),
    }
    row = next(line for line in concept_tables.concepts(found).splitlines() if "`push`" in line)
    assert "| 97 of 100 (92 to 99 %) | not measured yet | 80 of 90 (81 to 94 %) |" in row


def test_every_failure_is_listed_with_its_leaf_but_for_worlds_that_were_not_drawn():
    found = {
        "concept-push-panda-sapien": {**result(96, push=3), "reasons": {"push: late": 3, ": no_draw": 1}}
    }
    assert concept_tables.failures(found).splitlines()[2:] == [
        "| `push` | Panda, SAPIEN | 3 | push: late 3 |"
    ]


def test_chores_are_counted_of_all_draws_and_of_those_that_are_possible():
    one = {"episodes": 100, "successes": 90, "possible": 96, "failures": {"grasp cup: no_way": 6}}
    first, second = concept_tables.chores({"chores-panda": one}).splitlines()[2:]
    assert first == "| Panda, SAPIEN | 100 | 90 | 90 of 96 (87 to 97 %) | grasp cup: no_way 6 |"
    assert "not measured yet" in second


def test_gentleness_is_that_of_the_engine_in_which_it_was_worse():
    found = {
        "concept-push-panda-sapien": result(97, force=20.0),
        "concept-push-panda-mujoco": result(97, force=41.0),
    }
    (row,) = concept_tables.gentleness(found).splitlines()[2:]
    assert row.startswith("| `push` | 41.0 of 60 | 12.0 of 40 | 1.1 of 2 | ")
    found["concept-push-panda-mujoco"]["gentle"] = 93
    found["concept-push-panda-sapien"]["gentle"] = 95
    assert concept_tables.gentleness(found).endswith("| 93 of 100 |")


def test_of_each_limit_alone_it_follows_how_many_runs_kept_all_at_least():
    row = result(97, force=20.0)
    for what, within in (("force", 99), ("jerk", 93), ("overlap", 100)):
        row[what] |= {"within": within, "of": 100}
    assert concept_tables.gentleness({"concept-push-panda-sapien": row}).endswith("| 92 of 100 at least |")
