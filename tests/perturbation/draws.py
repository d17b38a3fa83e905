"""Several draws in place of one: what a test may ask of a tree that runs in physics.

No tree succeeds in every world that can be drawn, and contacts are chaotic: on another processor another
draw fails. So a test asks for a share of some draws. The programmed trees fail in less than 2 % of theirs
(docs/evaluation.md: 1 to 4 of 300; of 60 more seeds of each whole task in SAPIEN
none, and none of `pick_and_throw` from a log under nudges of the drive targets). Three or more failures in
five draws then have a chance of less than ``10 * 0.02**3 = 8e-5``, and a tree that is broken fails in
nearly all. One success in three draws, where a test only needs a run to look at, is missed with a chance of
``0.02**3 = 8e-6``; but a concept that fails in half of its draws passes that, so two of three are asked for
where a run takes few seconds (``3 * 0.02**2 = 1e-3``). Where 6 % fail (the programmed grasp of all shapes in
`grasp_then_pick`; some grasps in MuJoCo), two of five are asked for: ``5 * 0.06**4 = 6e-5``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol, TypeVar


class Judged(Protocol):
    """What a run ended with, such as `bt_tasksim.execution.runner.Result`."""

    success: bool
    reason: str
    why: str


R = TypeVar("R", bound=Judged)


def successes(
    run: Callable[[int], R], seeds: Iterable[int], n: int = 3, wanted: Callable[[R], bool] | None = None
) -> list[R]:
    """The first successes among some draws; as soon as there are enough, no more are run.

    Args:
        run: Runs one seed.
        seeds: Five of them, by default.
        n: How many have to succeed.
        wanted: What counts as success, instead of ``success``.

    Raises:
        AssertionError: Too few; with the reason of each failure.
    """
    found: list[R] = []
    failed: list[str] = []
    for seed in seeds:
        result = run(seed)
        if result.success if wanted is None else wanted(result):
            found.append(result)
            if len(found) == n:
                return found
        else:
            failed.append(f"seed {seed}: {result.reason}: {result.why}")
    raise AssertionError(f"{len(found)} successes, {n} expected; " + "; ".join(failed))


def good_seed(run: Callable[[int], Judged], seeds: Iterable[int]) -> int:
    """The first of some seeds, three by default, with which the run succeeds."""
    tried: list[int] = []

    def noted(seed: int) -> Judged:
        tried.append(seed)
        return run(seed)

    successes(noted, seeds, n=1)
    return tried[-1]
