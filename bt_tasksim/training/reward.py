"""What an episode pays, and why."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from pydantic import Field

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import part
from bt_tasksim.core.typed_file import Number, Switch, check_record
from bt_tasksim.training.reward_parts import RewardPart, Transition

Penalty = Annotated[Number, Field(ge=-1e6, le=0.0)]
Term = Annotated[Number, Field(ge=-1e6, le=1e6)]


@dataclass(frozen=True)
class Reward:
    """What an episode pays.

    The sum over an episode lies near ``success`` or ``failure``; shaping only shows the way. The potential of
    a state is how much smaller its necessary cost is than the cost at the episode's first decision: so
    standing still pays nothing, and coming closer without ever being done pays less than nothing in the end.
    Source: A. Ng, D. Harada, S. Russell, "Policy invariance under reward transformations", ICML 1999.

    Attributes:
        success: The completion signal was right: what follows succeeded, judged by the hidden state too.
        failure: It was wrong, or the subtree failed by itself.
        violated: A limit was exceeded.
        timeout: The concept's own time was over.
        shaping: Weight of the potential.
        gamma: The learner's discount, for the potential too. With 0.99 a second of care would cost a fifth of
            what it may save.
        sufficient: What follows pays; else only shaping and limits do (an ablation).
        terms: Weights of further parts by their names; none by default.
    """

    success: Annotated[Number, Field(gt=0.0, le=1e6)] = 1.0
    failure: Penalty = -1.0
    violated: Penalty = -1.0
    timeout: Penalty = -1.0
    shaping: Annotated[Number, Field(ge=0.0, le=1e6)] = 0.3
    gamma: Annotated[Number, Field(gt=0.0, le=1.0)] = 0.999
    sufficient: Switch = True

    terms: Annotated[dict[str, Term], Field(max_length=32)] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_record(self, "reward")
        for name in self.terms:
            if name in PARTS:
                raise InputError(f"reward: '{name}' has a field of its own, and is no further term")
            part("reward part", name)

    @property
    def weights(self) -> dict[str, float]:
        """Weights of all parts by name."""
        return {**{name: getattr(self, name) for name in PARTS}, **self.terms}

    def pay(self, transition: Transition) -> dict[str, float]:
        """What a decision pays, by part."""
        out = {}
        for name, weight in self.weights.items():
            reward_part: RewardPart = part("reward part", name)()
            paid = reward_part.pay(transition)
            out[name] = weight * paid if paid else 0.0
        return out


PARTS = ("success", "failure", "violated", "timeout", "shaping")
"""Names of the parts that every reward has; an episode's ``info["reward"]`` begins with them."""
