"""The rows that `benchmarks.compare` measures with both codes: README's successes, grasps and logs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.decomposition import EXPECTED
from benchmarks.grasp import NOISES, WHO
from benchmarks.success import ROWS as SUCCESS_ROWS
from benchmarks.success import Row as SuccessRow

SUCCESSES, GRASPS, LOGS = "successes", "grasps", "logs"
CHUNK = 100
"""Episodes of one process: what is lost when it is interrupted."""
CAMERA_CHUNK = 10
LOG_DRAWS = 100
FACTORS = (1, 2, 3, 4)
"""How many times a recording's errors the fresh synthetic logs have."""
SHIPPED = 10
"""Shipped logs of a scenario, and recorded ones of a ManiSkill task."""


@dataclass(frozen=True)
class Row:
    """A row of a table.

    Attributes:
        table: `SUCCESSES`, `GRASPS` or `LOGS`.
        name: Its name, that of its results file.
        draws: Draws of a full measurement.
        scenario: The tree's scenario, or what a log shows.
        arguments: Options of ``bt-tasksim evaluate``.
        who: Of a grasp, ``learned``, ``untrained`` or ``programmed``.
        robot: Name of the robot.
        from_logs: The tree is made from the scenario's shipped logs, by either code itself.
        factor: Of logs, see `FACTORS`; 0: the shipped or recorded ones.
        chunk: Episodes of one process.
    """

    table: str
    name: str
    draws: int
    scenario: str
    arguments: tuple[str, ...] = ()
    who: str = ""
    robot: str = "panda"
    from_logs: bool = False
    factor: int = 0
    chunk: int = CHUNK


def rows() -> tuple[Row, ...]:
    """All rows, those that take longest last."""
    quick = [_success(row) for row in SUCCESS_ROWS if row.perception == "state"]
    slow = [_success(row) for row in SUCCESS_ROWS if row.perception != "state"]
    grasps = [
        _grasp(robot, noise, who) for robot in ("panda", "xarm7_ability") for noise in NOISES for who in WHO
    ]
    return (*quick, *_logs(), *grasps, *slow)


def _success(row: SuccessRow) -> Row:
    camera = row.perception == "camera"
    return Row(
        SUCCESSES,
        row.name,
        row.episodes,
        row.scenario,
        ("--robot", row.robot, "--perception", row.perception),
        robot=row.robot,
        from_logs=row.from_logs,
        chunk=CAMERA_CHUNK if camera else CHUNK,
    )


def _grasp(robot: str, noise: str, who: str) -> Row:
    name = f"grasp-{robot}-{noise}-{who}"
    return Row(
        GRASPS, name, 1000, "grasp_then_pick", ("--robot", robot, "--noise", noise), who=who, robot=robot
    )


def _logs() -> Iterator[Row]:
    for scenario in EXPECTED:
        yield Row(LOGS, f"logs-{scenario}", SHIPPED, scenario)
    for scenario in EXPECTED:
        if not scenario.endswith("-v1"):
            for factor in FACTORS:
                yield Row(LOGS, f"logs-{scenario}-fresh-{factor}", LOG_DRAWS, scenario, factor=factor)


@dataclass(frozen=True)
class Chunk:
    """What one process measures: consecutive draws of a row.

    Attributes:
        row: The row.
        seeds: Its draws; of shipped logs, their numbers.
        log: The log from which the tree is made, where it is.
    """

    row: Row
    seeds: range
    log: Path | None = None


def chunks(row: Row, first: int, draws: int, logs: Sequence[Path]) -> Iterator[Chunk]:
    """A row's draws, cut so that each part is one command.

    Args:
        row: The row.
        first: First seed.
        draws: How many.
        logs: The scenario's shipped logs.
    """
    if row.table == LOGS and row.factor == 0:
        yield Chunk(row, range(min(draws, row.draws)))
        return
    if not row.from_logs:
        for begin in range(first, first + draws, row.chunk):
            yield Chunk(row, range(begin, min(begin + row.chunk, first + draws)))
        return
    for k, log in enumerate(logs):
        begin, end = (-(-draws * number // len(logs)) for number in (k, k + 1))
        if end > begin:
            yield Chunk(row, range(first + begin, first + end), log)
