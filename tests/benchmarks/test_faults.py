"""The table of faults: what cannot be measured is said, what is measured is kept, and a late hold fails."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from benchmarks import faults
from benchmarks.faults import Bench, Seen, attempt
from bt_tasksim.core.errors import MachineError

GOOD = Seen(0.1, 0.2, 0.01, 0.0, "stale", "said", [], True)


def table(monkeypatch: Any, tmp_path: Path, outcomes: dict[str, Any]) -> tuple[int, dict[str, Any]]:
    """Exit status and file of a table of such outcomes, each one that is raised or seen."""

    @contextlib.contextmanager
    def bench_of(domain: int, ros: str) -> Iterator[None]:
        yield None

    def measure(bench: Any, fault: str, seed: int) -> Seen:
        outcome = outcomes[fault]
        if isinstance(outcome, BaseException):
            raise outcome
        return Seen(**{**asdict(GOOD), **outcome})

    monkeypatch.setattr(faults, "bench_of", bench_of)
    monkeypatch.setattr(faults, "measure", measure)
    file = tmp_path / "faults.json"
    words = ["--times", "2", "--json", str(file), "--faults", *outcomes]
    try:
        status = faults.main(words)
    except KeyboardInterrupt:
        status = -1
    return status, json.loads(file.read_text())


def test_everything_held_in_time(monkeypatch: Any, tmp_path: Path, capsys: Any) -> None:
    outcomes = {"a": {}, "b": {"held": 0.25, "far": math.nan}, "c": {"left_out": 0.3}}
    status, found = table(monkeypatch, tmp_path, outcomes)
    assert status == 0 and len(found["b"]) == 2
    lines = capsys.readouterr().out.splitlines()[2:]
    assert "0.010 rad" in lines[0] and "not known" in lines[1] and "2 of 2 | 2 |" in lines[2]


@pytest.mark.parametrize("bad", [{"held": 0.26}, {"held": math.inf}, {"again": False}, {"running": ["leaf"]}])
def test_what_is_not_in_order_is_a_failure(monkeypatch: Any, tmp_path: Path, bad: dict[str, Any]) -> None:
    assert table(monkeypatch, tmp_path, {"a": {}, "b": bad, "c": {}})[0] == 1


def test_what_cannot_be_measured_is_said_and_the_rest_is_kept(
    monkeypatch: Any, tmp_path: Path, capsys: Any
) -> None:
    outcomes: dict[str, Any] = {"a": MachineError("no bridge"), "b": {}, "c": KeyboardInterrupt()}
    status, found = table(monkeypatch, tmp_path, outcomes)
    assert status == -1 and list(found) == ["a", "b"]  # written after each fault
    assert found["a"][0]["held"] == math.inf and not found["a"][0]["again"]
    assert "not measured: MachineError: no bridge" in capsys.readouterr().out


class Evaluation:
    """Says the same again and again."""

    def __init__(self, **note: Any) -> None:
        self._told = {
            "fault": {
                "held": None,
                "still": None,
                "far": 0.3,
                "fastest": 0.0,
                "hardest": 0.0,
                "why": "",
                **note,
            },
            "left_out": 0.2,
        }
        self._told["position"] = [0.0] * 7

    def tell(self) -> dict[str, Any]:
        return self._told


def test_an_arm_that_never_stands() -> None:
    bench = object.__new__(Bench)
    bench.evaluation = Evaluation(held=0.1)  # type: ignore[assignment]
    told = bench.at_rest(0.1)
    seen = faults._after(bench, "said", [], lambda: True, told)
    assert seen.held == 0.1 and math.isinf(seen.still) and seen.far == 0.3 and seen.left_out == 0.2
    bench.evaluation = Evaluation()  # type: ignore[assignment]
    assert math.isinf(faults._after(bench, "said", [], lambda: True, bench.at_rest(0.1)).held)


def test_a_twin_that_does_not_answer_is_ended(monkeypatch: Any) -> None:
    closed = []

    class Twin:
        evaluation_port = 1
        secret = "of the twin that is not there"

        def __init__(self, *_: Any, **__: Any) -> None: ...

        def close(self) -> None:
            closed.append(True)

    monkeypatch.setattr(faults, "Twin", Twin)
    with pytest.raises(MachineError, match="no twin answers"):
        Bench()
    assert closed


def test_no_run_to_break() -> None:
    class Gone:
        def restart(self) -> None:
            raise MachineError("the twin is not ready")

    assert "the twin is not ready" in attempt(Gone(), "SIGINT", 0).said  # type: ignore[arg-type]
