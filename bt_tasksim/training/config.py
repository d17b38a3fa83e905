"""The settings of a training, typed and checked."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from pydantic import Field

from bt_tasksim.core.document import Document
from bt_tasksim.core.errors import FieldError, InputError
from bt_tasksim.core.plain import short
from bt_tasksim.core.renamed import renamed_fields
from bt_tasksim.core.typed_file import Model, Number, check_record, record_model, validate
from bt_tasksim.training.reward import Reward

LARGEST_ROLLOUT = 2**21
"""Decisions: they are kept in memory, some hundred numbers each."""


@renamed_fields(
    lanes="n_envs",
    lane_steps="n_steps",
    log_deviation="log_std",
    final_log_deviation="final_log_std",
    lesson_share="stage_share",
)
@dataclass(frozen=True)
class TrainConfig:
    """How a policy is learned with PPO.

    Source of what is not said otherwise: J. Schulman et al., "Proximal policy optimization algorithms", 2017,
    and the defaults of stable-baselines3.

    Attributes:
        steps: Decisions of the leaves under training, in all.
        seed: Everything random follows from it.
        n_envs: Environments in a rollout, side by side; results depend on it, and not on the workers.
        n_steps: Decisions of each environment in one rollout. 8 environments of 512 hold some 150 episodes:
            enough to judge a completion signal that pays once in each.
        epochs: Passes over a rollout.
        minibatch: Decisions in a gradient step.
        learning_rate: At the beginning.
        final_learning_rate: At the end; in between it falls linearly, so that the last policy is settled.
        gae_lambda: Of the generalised advantage estimation: a reward that comes once, 40 decisions later.
        clip: Largest relative change of a decision's probability.
        entropy: Weight of the entropy; none, since the std below only shrinks when that pays.
        hidden: Sizes of the hidden layers; 64 and 64 decide in 15 microseconds.
        log_std: Logarithm of the actions' standard deviation at the beginning: 0.22. The reference
            motion is nearly right already: wider exploration hides what small changes are worth, and teaches
            to keep away from what only exploring makes dangerous.
        final_log_std: Largest logarithm of the standard deviation at the end. The bound falls
            linearly in the second half: what is rewarded last is nearly what is done without exploration.
        terminate_bias: Bias of the completion signal at the beginning, whose threshold is
            `bt_tasksim.policy.policy.TERMINATE`: a first policy ends an episode at one decision in 100.
        stage_share: A stage ends after this share of the steps at the latest, whatever it came to: what it
            was to teach may be beyond a robot's reach, and the last stage is what counts.
        success_window: Episodes over which the success rate is taken that ends a stage.
        evaluate_every: Rollouts between two evaluations on held-apart draws; 0: only at the end.
        evaluation_draws: Held-apart draws of each, see `bt_tasksim.training.record.CLEARLY`.
        checkpoint_every: Rollouts between two checkpoints: what a killed training loses at most.
        reward: What an episode pays.
    """

    steps: Annotated[int, Field(ge=1, le=10**12)] = 1_000_000
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    n_envs: Annotated[int, Field(ge=1, le=4096)] = 8
    n_steps: Annotated[int, Field(ge=1, le=LARGEST_ROLLOUT)] = 512
    epochs: Annotated[int, Field(ge=1, le=1000)] = 10
    minibatch: Annotated[int, Field(ge=1, le=LARGEST_ROLLOUT)] = 512
    learning_rate: Annotated[Number, Field(gt=0.0, le=1.0)] = 4e-4
    final_learning_rate: Annotated[Number, Field(gt=0.0, le=1.0)] = 2e-5
    gae_lambda: Annotated[Number, Field(ge=0.0, le=1.0)] = 0.97
    clip: Annotated[Number, Field(gt=0.0, le=10.0)] = 0.2
    entropy: Annotated[Number, Field(ge=-10.0, le=10.0)] = 0.0
    hidden: Annotated[
        tuple[Annotated[int, Field(ge=1, le=1024)], ...], Field(strict=False, min_length=1, max_length=8)
    ] = (64, 64)
    log_std: Annotated[Number, Field(ge=-20.0, le=2.0)] = -1.5
    final_log_std: Annotated[Number, Field(ge=-20.0, le=2.0)] = -2.2
    terminate_bias: Annotated[Number, Field(ge=-50.0, le=50.0)] = 0.0
    stage_share: Annotated[Number, Field(gt=0.0, le=1.0)] = 0.25
    success_window: Annotated[int, Field(ge=1, le=10**6)] = 300
    evaluate_every: Annotated[int, Field(ge=0, le=10**9)] = 12
    evaluation_draws: Annotated[int, Field(ge=0, le=10**5)] = 200
    checkpoint_every: Annotated[int, Field(ge=1, le=10**9)] = 4
    reward: Reward = field(default_factory=Reward)

    def __post_init__(self) -> None:
        check_record(self, "training")
        if not isinstance(self.reward, Reward):
            raise InputError(f"training: 'reward' should be a Reward, found {short(self.reward)}")
        if not 2 <= self.rollout <= LARGEST_ROLLOUT:
            raise FieldError(
                f"training: a rollout of 'n_envs' times 'n_steps' should have 2 to {LARGEST_ROLLOUT} "
                f"decisions, found {self.rollout}",
                "n_steps",
            )

    @property
    def rollout(self) -> int:
        """Decisions of one rollout."""
        return self.n_envs * self.n_steps

    @property
    def rollouts(self) -> int:
        """How many rollouts there are, the last one included though it may go beyond ``steps``."""
        return math.ceil(self.steps / self.rollout)

    def to_dict(self) -> dict[str, Any]:
        """As plain data, for a card."""
        return dataclasses.asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> TrainConfig:
        """The settings that `to_dict` gave.

        Raises:
            InputError: A setting is unknown or no good.
        """
        return cls.from_model(validate(record_model(cls), Document("training", dict(data))))

    @classmethod
    def from_model(cls, model: Model) -> TrainConfig:
        """The settings that their model read from a file."""
        values = model.model_dump()
        return cls(**{**values, "reward": Reward(**values["reward"])})
