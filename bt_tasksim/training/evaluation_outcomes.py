"""The outcomes of an evaluation: one episode in short, all of them together, and how they are written."""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from bt_tasksim.core.markup import html_pairs
from bt_tasksim.core.outcomes import NO_DRAW, Outcome, outcome_from_data, recorded_outcome

CONFIDENCE = 0.95


ERRORS = ("position_error", "angle_error", "penetration")
"""Fields of an outcome that may be unknown."""
UNJUDGED = ("no_goal", "not_judged", "done")
"""Reasons of successes that nobody judged; ``done`` is that of files of version 0.1."""


@dataclass(frozen=True)
class EpisodeOutcome:
    """One episode, in short.

    Attributes:
        seed: Its seed.
        success: The tree ended SUCCESS and the physics state agrees.
        status: The tree's status.
        leaf: Name of the leaf that failed or was stopped; empty where none did.
        outcome: How it ended.
        control_steps: Control periods.
        position_error: Metres, NaN where no goal says so.
        angle_error: Radians, likewise.
        penetration: Deepest overlap of two bodies, metres.
        wall_time: Seconds it took.
        judged: The physics state was asked whether all goals are reached; else a success is the tree's own
            word.
        placements: What became of each goal, in plain data, see `bt_tasksim.scene.goal_verdict.GoalVerdict`.
    """

    seed: int
    success: bool
    status: str
    leaf: str
    outcome: Outcome
    control_steps: int
    position_error: float
    angle_error: float
    penetration: float
    wall_time: float
    judged: bool = True
    placements: tuple[Mapping[str, Any], ...] = ()

    @property
    def reason(self) -> str:
        """Registered name of the reason for failure; empty on success."""
        return "" if self.success else self.outcome.cause.reason.name

    @property
    def why(self) -> str:
        """One sentence."""
        return f"{self.leaf}: {self.outcome.sentence}" if self.leaf else self.outcome.sentence

    def to_data(self) -> dict[str, Any]:
        """As plain data, for files: ``reason`` is the name, ``outcome`` has the numbers, None is unknown."""
        fields = {name: _known(value) for name, value in vars(self).items() if name != "outcome"}
        fields["placements"] = list(self.placements)
        return {**fields, "reason": self.reason, "why": self.why, "outcome": self.outcome.to_data()}

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> EpisodeOutcome:
        """What `to_data` wrote, or an older version, which knew no more than a reason and a sentence."""
        fields = {key: value for key, value in data.items() if key not in ("reason", "why", "outcome")}
        fields |= {name: math.nan for name in ERRORS if fields.get(name) is None}
        fields["placements"] = tuple(data.get("placements", ()))
        if "outcome" in data:
            outcome = outcome_from_data(data["outcome"])
        else:
            outcome = recorded_outcome(data["reason"] or "done", data["why"])
        if "judged" not in data:
            fields["judged"] = not (data["success"] and outcome.cause.reason.name in UNJUDGED)
        return cls(**{"leaf": "", **fields}, outcome=outcome)


def _known(value: Any) -> Any:
    """A value, or None for the NaN that JSON has no word for."""
    return None if isinstance(value, float) and math.isnan(value) else value


@dataclass(frozen=True, repr=False)
class Evaluation:
    """The outcomes of an evaluation and what they were measured with."""

    scenario: str
    robot: str
    engines: str
    perception: str
    policies: dict[str, str]
    outcomes: tuple[EpisodeOutcome, ...]
    seconds: float
    asked: int | None = None
    """Episodes that were asked for; None for as many as there are outcomes."""
    subject: Mapping[str, str] = field(default_factory=dict)
    """What was evaluated, as hashes by name, see `bt_tasksim.training.subject`; empty where nobody asks."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Of the program, see `bt_tasksim.core.identity`."""

    @property
    def complete(self) -> bool:
        """Every episode that was asked for has ended."""
        return self.asked is None or len(self.outcomes) >= self.asked

    @property
    def successes(self) -> int:
        """Count of successful episodes."""
        return sum(o.success for o in self.outcomes)

    @property
    def undrawn(self) -> list[int]:
        """Seeds with which no world could be drawn; they count as episodes without success."""
        return [o.seed for o in self.outcomes if o.reason == NO_DRAW.name]

    @property
    def judged(self) -> bool:
        """Every episode was judged by the physics state; else successes are the tree's own word."""
        return all(outcome.judged for outcome in self.outcomes)

    def failure_lines(self) -> list[str]:
        """A line for each leaf and reason, the most frequent first, with a seed to look at."""
        groups: dict[tuple[str, str], list[EpisodeOutcome]] = {}
        for episode in self.outcomes:
            if not episode.success:
                groups.setdefault((episode.leaf, episode.reason), []).append(episode)
        return [
            f"{len(group):4d} x {f'{leaf}: ' if leaf else ''}{reason}, such as seed {group[0].seed}: "
            f"{group[0].outcome.sentence}"
            for (leaf, reason), group in sorted(groups.items(), key=lambda item: -len(item[1]))
        ]

    def to_json(self) -> dict[str, Any]:
        """The fields of ``evaluate --json``."""
        n = len(self.outcomes)
        failures = Counter(o.reason for o in self.outcomes if not o.success)
        episodes = [o.to_data() for o in self.outcomes]
        return {
            "scenario": self.scenario,
            "robot": self.robot,
            "engines": self.engines,
            "perception": self.perception,
            "policies": self.policies,
            "episodes": n,
            "successes": self.successes,
            "complete": self.complete,
            "judged": self.judged,
            "success_rate": self.successes / n if n else None,
            "confidence_interval": list(wilson(self.successes, n)) if n else None,
            "failures": dict(failures.most_common()),
            "failed_leaves": dict(Counter(o.leaf for o in self.outcomes if o.leaf).most_common()),
            "failed_seeds": [o.seed for o in self.outcomes if not o.success],
            "undrawn_seeds": self.undrawn,
            "seconds": round(self.seconds, 3),
            "control_steps": sum(o.control_steps for o in self.outcomes),
            "subject": dict(self.subject),
            "versions": dict(self.versions),
            "sha256": outcomes_hash(episodes),
            "outcomes": episodes,
        }

    def lines(self) -> list[str]:
        """What people read: counts, and the reasons of failures, each with a seed to look at."""
        n, who = len(self.outcomes), f"{self.scenario} on {self.robot} ({self.engines}, {self.perception})"
        if not n:
            return [f"{who}: no episode ended"]
        low, high = wilson(self.successes, n)
        steps = sum(o.control_steps for o in self.outcomes)
        lines = [
            f"{who}: {self.successes} of {n} ({100 * self.successes / n:.1f} %, "
            f"95 % interval {100 * low:.1f} to {100 * high:.1f}), "
            f"{steps / max(self.seconds, 1e-9):.0f} control steps/s"
        ]
        if not self.judged:
            lines.append("  (the scene has no goal: success is the tree's own word, nothing was judged)")
        if undrawn := self.undrawn:
            lines.append(
                f"  ({len(undrawn)} of {n} seeds could not be drawn and count as not successful: "
                f"{listed(undrawn)})"
            )
        return [*lines, *(f"  {line}" for line in self.failure_lines())]

    def __str__(self) -> str:
        """As the command line prints it."""
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        return f"<Evaluation of {self.scenario} on {self.robot}: {self.successes} of {len(self.outcomes)}>"

    def _repr_html_(self) -> str:
        """A small table, for notebooks."""
        head, *rest = self.lines()
        return html_pairs({"": head} | {str(number): line.strip() for number, line in enumerate(rest, 1)})


def listed(seeds: Sequence[int], most: int = 10) -> str:
    """Seeds as people read them, the first of many."""
    more = f" and {len(seeds) - most} more" if len(seeds) > most else ""
    return f"seed{'' if len(seeds) == 1 else 's'} {', '.join(map(str, seeds[:most]))}{more}"


def outcomes_hash(episodes: Sequence[Any]) -> str:
    """SHA-256 of episodes in plain data, by which a file says that they are what was written."""
    return hashlib.sha256(json.dumps(episodes).encode()).hexdigest()


def wilson(successes: int, n: int) -> tuple[float, float]:
    """Wilson's confidence interval (95 %) of a success rate.

    Source: E. B. Wilson, "Probable inference, the law of succession, and statistical inference", J. American
    Statistical Association 22, 1927; computed by SciPy.
    """
    from scipy.stats import binomtest

    interval = binomtest(successes, n).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)
