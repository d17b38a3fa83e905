"""What a training shows of itself: its progress and its history."""

from __future__ import annotations

from dataclasses import dataclass

HISTORY = "history.json"
CLEARLY = 0.02
"""Share of held-apart draws by which an earlier policy must have been better than the last one."""


@dataclass(frozen=True)
class Progress:
    """Where a training stands, after each rollout.

    Attributes:
        train: Name of the Train node.
        steps: Decisions so far, and in all.
        success: Share of successes among the last episodes, exploration included.
        held_apart: Successes and draws of the last evaluation on held-apart draws; None before the first.
        stage: Name of the stage.
        rate: Decisions per second, evaluations left out.
        seconds_left: Estimate.
    """

    train: str
    steps: tuple[int, int]
    success: float
    held_apart: tuple[int, int] | None
    stage: str
    rate: float
    seconds_left: float
