"""Sealed seeds: opened by a commit, for what was claimed, and scored once."""

from __future__ import annotations

import itertools
import subprocess
from pathlib import Path
from typing import Any

import pytest

from benchmarks import sealed
from benchmarks.sealed import LEDGER, block_seeds, open_block, write_result
from bt_tasksim.core.errors import InputError

CLAIM = {"claim": "grasp «x» is better", "metric": "successes, paired", "bar": "p < 0.01", "command": "c"}


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """An empty git repository."""
    git(tmp_path, "init", "-q")
    git(tmp_path, "config", "user.email", "a@b")
    git(tmp_path, "config", "user.name", "a")
    (tmp_path / "benchmarks").mkdir()
    return tmp_path


def git(root: Path, *words: str) -> None:
    subprocess.run(["git", "-C", str(root), *words], check=True, capture_output=True)


def commit(root: Path) -> None:
    git(root, "add", ".")
    git(root, "commit", "-qm", "x")


def opened(root: Path, *measures: str) -> str:
    block = open_block(**CLAIM, measures=measures, root=root)
    commit(root)
    return block.id


def test_blocks_never_overlap_and_begin_above_all_that_was_ever_run():
    blocks = [sealed.seeds_of(f"B{k:04d}") for k in (0, 1, 2, 9999)]
    assert blocks[0].start == 1_000_000
    for a, b in itertools.combinations(blocks, 2):
        assert a.stop <= b.start
    for name in ("B1", "b0001", "B00001", "0001", "B000x"):
        with pytest.raises(InputError):
            sealed.seeds_of(name)


def test_a_block_is_sealed_until_its_claim_is_committed(repository: Path):
    with pytest.raises(InputError, match="sealed"):
        block_seeds("B0000", "grasp", 10, repository)
    block = open_block(**CLAIM, measures=["grasp"], root=repository)
    assert block.id == "B0000" and block.claim == CLAIM["claim"]
    with pytest.raises(InputError, match="not committed"):
        block_seeds("B0000", "grasp", 10, repository)
    commit(repository)
    assert block_seeds("B0000", "grasp/a", 10, repository) == range(1_000_000, 1_000_010)
    with pytest.raises(InputError, match="sealed"):
        block_seeds("B0001", "grasp", 10, repository)


def test_an_entry_that_was_changed_after_its_commit_opens_nothing(repository: Path):
    opened(repository, "grasp")
    ledger = repository / LEDGER
    ledger.write_text(ledger.read_text().replace("p < 0.01", "p < 0.5"))
    with pytest.raises(InputError, match="not committed"):
        block_seeds("B0000", "grasp", 10, repository)


def test_a_block_serves_what_it_was_opened_for_and_no_more_seeds_than_it_has(repository: Path):
    opened(repository, "grasp", "success/row")
    for measure in ("grasp", "grasp/any", "success/row"):
        assert len(block_seeds("B0000", measure, sealed.SIZE, repository)) == sealed.SIZE
    for measure in ("success", "success/other", "gap"):
        with pytest.raises(InputError, match="opened for"):
            block_seeds("B0000", measure, 1, repository)
    with pytest.raises(InputError, match="has 10000 seeds"):
        block_seeds("B0000", "grasp", sealed.SIZE + 1, repository)


def test_what_was_scored_is_history_also_when_its_file_is_gone(repository: Path):
    block = opened(repository, "grasp")
    path = write_result(block, "grasp/a", {"successes": 3}, repository)
    with pytest.raises(InputError, match="history"):
        block_seeds(block, "grasp/a", 10, repository)
    assert block_seeds(block, "grasp/b", 10, repository)
    commit(repository)
    path.unlink()
    commit(repository)
    with pytest.raises(InputError, match="history"):
        block_seeds(block, "grasp/a", 10, repository)
    with pytest.raises(InputError, match="history"):
        write_result(block, "grasp/a", {}, repository)


def test_blocks_are_opened_one_after_the_other_and_a_claim_needs_all_its_parts(repository: Path):
    assert [opened(repository, "a"), opened(repository, "b", "c")] == ["B0000", "B0001"]
    found = sealed.read_ledger((repository / LEDGER).read_text())
    assert found["B0001"].measures == ("b", "c") and found["B0000"].bar == CLAIM["bar"]
    for part in CLAIM:
        with pytest.raises(InputError, match=part):
            open_block(**{**CLAIM, part: " "}, measures=["a"], root=repository)
    with pytest.raises(InputError):
        open_block(**CLAIM, measures=[], root=repository)


@pytest.mark.parametrize("text", ["[B0000", "[B0]\n", '[B0000]\nclaim = "x"\n', "B0000 = 3\n"])
def test_a_ledger_that_is_no_good_is_one_sentence(text: str):
    with pytest.raises(InputError):
        sealed.read_ledger(text)


def test_no_checkout_no_scores(tmp_path: Path):
    (tmp_path / "benchmarks").mkdir()
    open_block(**CLAIM, measures=["grasp"], root=tmp_path)
    with pytest.raises(InputError):
        block_seeds("B0000", "grasp", 1, tmp_path)


def test_without_a_block_no_sealed_seed_is_run():
    assert sealed.choose(None, 20_000, "grasp/a", 100) == range(20_000, 20_100)
    for first in (sealed.FIRST - 1, sealed.FIRST, sealed.FIRST + 9_999 * sealed.SIZE):
        with pytest.raises(InputError, match="sealed"):
            sealed.choose(None, first, "no such measurement", 2)


@pytest.mark.parametrize("name", ["success", "grasp", "oracle", "gap", "faults", "decomposition"])
def test_every_benchmark_refuses_a_block_that_is_not_open(name: str, monkeypatch: Any, capsys: Any):
    import importlib

    module = importlib.import_module(f"benchmarks.{name}")
    monkeypatch.setattr("sys.argv", [name, "--block", "B9999"])
    status = module.main() if name == "decomposition" else module.main(["--block", "B9999"])
    assert status == 2 and "B9999 is sealed" in capsys.readouterr().err


def test_single_draws_of_a_sealed_block_are_not_looked_at(capsys: Any):
    from benchmarks.any_tree.__main__ import main

    last = str(sealed.FIRST + 9_999 * sealed.SIZE)
    assert main(["--only", "900009", last]) == 2
    assert f"seeds from {last} on are sealed" in capsys.readouterr().err


def test_the_ledger_of_this_repository_is_sound():
    for name, block in sealed.read_ledger((sealed.ROOT / LEDGER).read_text()).items():
        assert block.seeds == sealed.seeds_of(name) and block.measures
