"""How sure a recognition is: measured margins, turned into a probability, and what the person said.

Every decision compares one measured number with a limit. Its probability is that of the number falling on
the same side again if the sensor noise and the slack of the model were drawn anew: ``F((value - limit) /
spread)``, where F is Student's distribution with 3 degrees of freedom, because trackers err with heavy
tails. The confidence of a task is the product over the decisions it rests on.
Narration multiplies the odds of a decision, so that it settles what the motion leaves open and never
outweighs what the motion shows plainly.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from bt_tasksim.demos_decomp.concepts import concepts
from bt_tasksim.demos_decomp.log import Utterance

NAMED = 4.0
"""Odds in favour of a concept that was named while it happened."""

EARSHOT = 0.8
"""Seconds by which people name what they do too early or too late."""


@dataclass(frozen=True)
class Check:
    """One measured number against one limit.

    Attributes:
        what: The claim, in words.
        value: The measured number.
        limit: The number it is compared with.
        spread: Standard deviation of the number: sensor noise and slack of the model.
        below: The claim is that the value is below the limit, not above it.
        odds: Odds that do not come from the motion, such as from narration; 1 for none.
    """

    what: str
    value: float
    limit: float
    spread: float
    below: bool = False
    odds: float = 1.0

    @property
    def probability(self) -> float:
        """Probability in (0, 1) that the claim holds."""
        margin = (self.value - self.limit) / self.spread
        margin = -margin if self.below else margin
        holds, fails = _student(margin), _student(-margin)
        return holds * self.odds / max(holds * self.odds + fails, 1e-300)

    def opposite(self) -> Check:
        """The claim that this claim is wrong."""
        return replace(self, below=not self.below, odds=1 / self.odds)

    def __bool__(self) -> bool:
        return bool(self.probability > 0.5)

    def __str__(self) -> str:
        sign = "<" if self.below else ">"
        return f"{self.what}: {self.value:.3g} {sign} {self.limit:.3g} ({self.probability:.2f})"


def _student(t: float) -> float:
    """Cumulative distribution of Student's t with 3 degrees of freedom, exact also far out in the tail."""
    x = t / math.sqrt(3)
    if x < -20:
        return 2 / (3 * math.pi * abs(x) ** 3)
    return 0.5 + (x / (1 + x * x) + math.atan(x)) / math.pi


def confidence(checks: Iterable[Check]) -> float:
    """Probability that all checks would come out again as they did."""
    return math.prod(check.probability for check in checks)


def spoken_odds(narration: Iterable[Utterance], concept: str, start: float, end: float) -> float:
    """Odds that narration gives to a concept in a span of time.

    Args:
        narration: What was said, and when.
        concept: Name of the concept.
        start: First second of the span.
        end: Last second of the span.

    Returns:
        `NAMED` if the concept was named within `EARSHOT` of the span, else 1: silence says nothing.
    """
    for utterance in narration:
        if start - EARSHOT <= utterance.time <= end + EARSHOT and concept in spoken_concepts(utterance.text):
            return NAMED
    return 1.0


def spoken_concepts(text: str) -> set[str]:
    """Concepts that an English sentence names."""
    said = text.casefold()
    return {
        name
        for name, concept in concepts().items()
        if concept.presentation.spoken and re.search(concept.presentation.spoken, said)
    }
