"""How an episode of training ends: one activation of what stands under a `Train` node."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from bt_tasksim.core.outcomes import LIMIT_VIOLATED, TIME_OVER, TIMED_OUT, Outcome, register_reason
from bt_tasksim.training.judge import SignalOutcome
from bt_tasksim.training.reward_parts import End

BEGAN_ANEW = register_reason("began_anew", "'{train}' began anew before what follows ended")
TREE_ENDED = register_reason("tree_ended", "the tree ended before what follows did")
FOLLOWER_LATE = register_reason("follower_late", "what follows did not end in time")


@dataclass(frozen=True)
class Ending:
    """How an episode ended.

    Attributes:
        end: What is paid for it.
        outcome: Why; None where nobody says.
        truncated: It was cut off from outside, or an error spoiled it; else it is terminated.
        kept: Its last state counts as one from which things could have gone on, so its potential stays.
        judged: What became of the completion signal; None without one.
        status: Status of the subtree.
        seconds: Simulated time since the world was drawn.
    """

    end: End
    outcome: Outcome | None
    truncated: bool
    kept: bool
    judged: SignalOutcome | None
    status: str
    seconds: float

    @property
    def is_success(self) -> bool:
        """The completion signal was right, and nothing spoiled the episode."""
        return self.judged is not None and self.judged.success and not self.judged.discarded

    @property
    def discarded(self) -> bool:
        """An error spoiled the episode."""
        return self.judged is not None and self.judged.discarded

    @property
    def counted_as(self) -> str:
        """A word to count by.

        It is ``success``, ``discarded``, ``violated``, ``timeout``, ``follower failed`` or ``failed``.
        """
        if self.is_success:
            return "success"
        if self.discarded:
            return "discarded"
        if self.end in ("violated", "timeout"):
            return self.end
        return "follower failed" if self.status == "SUCCESS" else "failed"

    def info(self, paid: dict[str, float]) -> dict[str, Any]:
        """What gymnasium's ``info`` says of an episode's last step.

        Args:
            paid: What it paid, by part.
        """
        return {
            "reward": paid,
            "is_success": self.is_success,
            "status": self.status,
            "follower": "" if self.judged is None else self.judged.status,
            "reason": "" if self.outcome is None else self.outcome.cause.reason.name,
            "why": "" if self.outcome is None else self.outcome.sentence,
            "discarded": self.discarded,
            "seconds": self.seconds,
        }


def ending_of(
    cut: Outcome | None,
    judged: SignalOutcome | None,
    outcome: Outcome | None,
    said: Outcome | None,
    sufficient: bool,
    status: str,
    seconds: float,
) -> Ending:
    """How an episode ended.

    Args:
        cut: What broke it off; None: nothing did.
        judged: What became of the completion signal; None without one.
        outcome: How the leaf ended that decided last; None where it runs, or says nothing.
        said: What the node says that made the subtree fail.
        sufficient: What follows pays.
        status: Status of the subtree.
        seconds: Simulated time since the world was drawn.
    """
    end: End = "cut"
    truncated = False
    if cut is not None:
        outcome, truncated = cut, cut.is_a(TIME_OVER)
    elif judged is not None:
        outcome, truncated = judged.outcome, judged.discarded
        if not judged.discarded and sufficient:
            end = "success" if judged.success else "failure"
    elif outcome is not None and outcome.is_a(LIMIT_VIOLATED):
        end = "violated"
    elif outcome is not None and outcome.is_a(TIMED_OUT):
        end = "timeout"
    else:
        outcome, end = said or outcome, "failure"
    kept = truncated or (judged is not None and (judged.success or not sufficient))
    return Ending(end, outcome, truncated, kept, judged, status, seconds)
