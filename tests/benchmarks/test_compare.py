"""Two codes on the same draws: what is counted, that it goes on where it was, and a real short comparison."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks import compare, sealed
from benchmarks.compare import Outcomes, Setting
from benchmarks.compare_rows import GRASPS, LOGS, SUCCESSES, Row, chunks, rows
from benchmarks.paired import Paired, difference, main, markdown, mcnemar, report, worse
from bt_tasksim.core.errors import MachineError


def pair(only_old: int, only_new: int, both: int = 20, neither: int = 3, name: str = "row") -> Paired:
    old = [True] * only_old + [False] * only_new + [True] * both + [False] * neither
    new = [False] * only_old + [True] * only_new + [True] * both + [False] * neither
    return Paired("table", name, dict(enumerate_as_text(old)), dict(enumerate_as_text(new)))


def enumerate_as_text(values: list[bool]) -> list[tuple[str, bool]]:
    return [(str(k), value) for k, value in enumerate(values)]


def test_mcnemars_test_is_the_binomial_of_draws_that_only_one_of_them_did():
    assert mcnemar(0, 0) == worse(0, 0) == 1.0
    assert mcnemar(8, 0) == pytest.approx(2 * 0.5**8) and worse(8, 0) == pytest.approx(0.5**8)
    assert worse(0, 8) == pytest.approx(1.0) and mcnemar(5, 5) == pytest.approx(1.0)


def test_a_row_is_worse_where_chance_would_hardly_do_it():
    assert pair(7, 0).to_json()["worse"] and not pair(6, 0).to_json()["worse"]
    assert not pair(0, 9).to_json()["worse"]
    found = pair(4, 1).to_json()
    assert (found["old"], found["new"], found["draws"]) == (24, 21, 28)
    assert found["failed_in_new_alone"] == ["0", "1", "2", "3"] and found["failed_in_old_alone"] == ["4"]


def test_only_draws_count_that_both_have_run():
    lame = Paired("t", "r", {"1": True, "2": True, "3": True}, {"2": False, "3": True, "4": True})
    assert lame.draws == 2 and lame.successes("old") == 2 and lame.successes("new") == 1


def test_tables_and_all_together():
    parts = [pair(7, 0, name="bad"), pair(0, 2, name="good")]
    found = report(parts)
    assert found["worse_rows"] == ["bad"] and found["together"]["draws"] == 30 + 25
    assert difference(parts) == pytest.approx(100 * -5 / 55)
    text = markdown(parts)
    assert text.count("**worse**") == 1 and "-9.09 points on 55 draws" in text


def test_the_rows_are_those_of_the_readme():
    every = rows()
    assert len({row.name for row in every}) == len(every)
    count = {table: sum(row.table == table for row in every) for table in (SUCCESSES, GRASPS, LOGS)}
    assert count == {SUCCESSES: 11, GRASPS: 12, LOGS: 5 + 12}
    assert {row.draws for row in every if row.table == SUCCESSES} == {300, 50}


@pytest.mark.parametrize("draws", [3, 10, 25, 300])
def test_a_rows_draws_are_each_in_one_part(draws: int):
    logs = [Path(f"{k}.h5") for k in range(10)]
    for row in rows():
        parts = list(chunks(row, 20_000, min(draws, row.draws), logs))
        seeds = [seed for part in parts for seed in part.seeds]
        first = 0 if row.table == LOGS and not row.factor else 20_000
        assert seeds == list(range(first, first + min(draws, row.draws)))
        assert all((part.log is not None) == row.from_logs for part in parts)
    if draws == 300:
        (row,) = (r for r in rows() if r.name == "shelf_to_shelf-panda-fromlogs")
        assert [len(part.seeds) for part in chunks(row, 0, draws, logs)] == [30] * 10


ROW = Row(SUCCESSES, "pick_and_place-panda", 4, "pick_and_place", chunk=2)


def setting(tmp_path: Path, draws: int | None = None) -> Setting:
    here = {"old": sealed.ROOT, "new": sealed.ROOT}
    return Setting(here, 20_000, draws, None, tmp_path, tmp_path / "none")


def fake(success: bool = True) -> Any:
    def measure(setting: Setting, chunk: Any, side: str) -> Any:
        outcome = {
            "success": success, "status": "SUCCESS", "reason": "", "why": "", "control_steps": 3,
            "position_error": 0.0, "angle_error": 0.0, "penetration": 0.0, "wall_time": 0.1,
        }  # fmt: skip
        head = {"scenario": "pick_and_place", "robot": "panda", "engines": "e", "perception": "p"}
        return {**head, "policies": {}}, {str(seed): {"seed": seed, **outcome} for seed in chunk.seeds}

    return measure


def test_what_is_measured_is_kept_and_a_second_call_goes_on(tmp_path: Path, monkeypatch: Any):
    asked: list[tuple[int, str]] = []

    def first(setting: Setting, chunk: Any, side: str) -> Any:
        asked.append((chunk.seeds.start, side))
        if (chunk.seeds.start, side) == (20_002, "new"):
            raise MachineError("power cut")
        return fake()(setting, chunk, side)

    monkeypatch.setattr(compare, "measure", first)
    failed = compare.compare(setting(tmp_path), [ROW], 1)
    assert failed == ["power cut"] and len(asked) == 4
    compare.write_results(setting(tmp_path), [ROW])
    assert not (tmp_path / "rows").exists()
    with open(tmp_path / "outcomes.jsonl", "a") as file:
        file.write('{"row": "pick_and')  # killed while it wrote
    asked.clear()
    monkeypatch.setattr(
        compare, "measure", lambda *a: (asked.append((a[1].seeds.start, a[2])), fake()(*a))[1]
    )
    assert compare.compare(setting(tmp_path), [ROW], 1) == [] and asked == [(20_002, "new")]
    compare.write_results(setting(tmp_path), [ROW])
    kept = json.loads((tmp_path / "rows" / f"{ROW.name}.json").read_text())
    assert kept["successes"] == 4 and kept["paired"]["old"] == 4 and kept["first_seed"] == 20_000
    assert Outcomes(tmp_path / "outcomes.jsonl").pair(ROW).draws == 4


def test_a_comparison_does_not_go_on_with_another_setting(tmp_path: Path):
    compare._same_as_before(setting(tmp_path, 3))
    compare._same_as_before(setting(tmp_path, 3))
    with pytest.raises(compare.InputError, match="draws"):
        compare._same_as_before(setting(tmp_path, 4))


def test_a_code_compared_with_itself_is_the_same_on_every_draw(tmp_path: Path, capsys: Any):
    names = ["shelf_to_shelf-panda-fromlogs", "logs-pick_and_place-fresh-2", "grasp-panda-hard-untrained"]
    words = ["--old", str(sealed.ROOT), "--draws", "1", "--jobs", "1", "--out", str(tmp_path / "out")]
    assert compare.main([*words, "--only", *names]) == 0, capsys.readouterr().err
    found = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert [row["row"] for row in found["rows"]] == names
    for row in found["rows"]:
        assert row["draws"] == 1 and row["only_old"] == row["only_new"] == 0
    assert found["rows"][0]["old"] == found["rows"][1]["old"] == 1
    assert (tmp_path / "out" / "rows" / "grasp-panda-hard-untrained.json").is_file()


def test_a_checkout_that_changes_ends_it_at_once(tmp_path: Path, monkeypatch: Any):
    commits = iter(["a", "a", "b", "c", "d", "e"])
    monkeypatch.setattr(compare, "_commit", lambda checkout: next(commits))
    monkeypatch.setattr(compare, "measure", fake())
    with pytest.raises(compare.InputError, match="changed"):
        compare.compare(setting(tmp_path), [ROW], 1)
    assert not (tmp_path / "outcomes.jsonl").exists()


def test_results_of_two_folders_are_paired_by_seed(tmp_path, capsys):
    outcomes = {"old": {1: True, 2: True, 3: False}, "new": {2: False, 3: True, 4: True}}
    for side, seeds in outcomes.items():
        (tmp_path / side).mkdir()
        rows = [{"seed": seed, "success": success} for seed, success in seeds.items()]
        (tmp_path / side / "gap-x-twin.json").write_text(json.dumps({"outcomes": rows}))
        (tmp_path / side / "speed.json").write_text("[1]")
    assert main([str(tmp_path / "old"), str(tmp_path / "new")]) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("| gap-x-twin"))
    assert [cell.strip() for cell in line.split("|")][2:7] == [
        "2", "1 (9.5 to 90.5 %)", "1 (9.5 to 90.5 %)", "+0.0", "1, 1"
    ]  # fmt: skip


@pytest.mark.parametrize("seeds", [[], [9]])
def test_results_that_share_no_draw_are_no_pair(seeds, tmp_path, capsys):
    for side, own in (("old", [1]), ("new", seeds)):
        (tmp_path / side).mkdir()
        rows = [{"seed": seed, "success": True} for seed in own]
        (tmp_path / side / "gap-x-twin.json").write_text(json.dumps({"outcomes": rows}))
    assert main([str(tmp_path / "old"), str(tmp_path / "new")]) == 2
    assert ("gap-x-twin" in capsys.readouterr().err) == bool(seeds)
