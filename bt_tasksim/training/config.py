"""The settings of a training, typed and checked."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from bt_tasksim.errors import InputError, nearest
from bt_tasksim.training.reward import Reward


@dataclass(frozen=True)
class TrainConfig:
    """How a policy is learned with PPO.

    Source of what is not said otherwise: J. Schulman et al., "Proximal policy optimization algorithms", 2017,
    and the defaults of stable-baselines3.

    Attributes:
        steps: Decisions of the leaves under training, in all.
        seed: Everything random follows from it.
        lanes: Parallel strands of episodes in a rollout; results depend on it, and not on the workers.
        lane_steps: Decisions of a lane in one rollout. 8 lanes of 512 hold some 150 episodes: enough to judge
            a completion signal that pays once in each.
        epochs: Passes over a rollout.
        minibatch: Decisions in a gradient step.
        learning_rate: At the beginning.
        final_learning_rate: At the end; in between it falls linearly, so that the last policy is settled.
        gae_lambda: Of the generalised advantage estimation: a reward that comes once, 40 decisions later.
        clip: Largest relative change of a decision's probability.
        entropy: Weight of the entropy; none, since the deviation below only shrinks when that pays.
        hidden: Sizes of the hidden layers; 64 and 64 decide in 15 microseconds.
        log_deviation: Logarithm of the actions' standard deviation at the beginning: 0.22. The reference
            motion is nearly right already: wider exploration hides what small changes are worth, and teaches
            to keep away from what only exploring makes dangerous.
        final_log_deviation: Largest logarithm of the standard deviation at the end. The bound falls
            linearly in the second half: what is rewarded last is nearly what is done without exploration.
        terminate_bias: Bias of the completion signal at the beginning, of which `bt_tasksim.policy.TERMINATE`
            is the threshold: a first policy ends an episode at one decision in 100.
        lesson_share: A lesson ends after this share of the steps at the latest, whatever it came to: what it
            was to teach may be beyond a robot's reach, and the last lesson is what counts.
        success_window: Episodes over which the success rate is taken that ends a lesson.
        evaluate_every: Rollouts between two evaluations on held-apart draws; 0: only at the end.
        evaluation_draws: Held-apart draws of each, see `bt_tasksim.training.ppo.CLEARLY`.
        checkpoint_every: Rollouts between two checkpoints: what a killed training loses at most.
        reward: What an episode pays.
    """

    steps: int = 1_000_000
    seed: int = 0
    lanes: int = 8
    lane_steps: int = 512
    epochs: int = 10
    minibatch: int = 512
    learning_rate: float = 4e-4
    final_learning_rate: float = 2e-5
    gae_lambda: float = 0.97
    clip: float = 0.2
    entropy: float = 0.0
    hidden: tuple[int, ...] = (64, 64)
    log_deviation: float = -1.5
    final_log_deviation: float = -2.2
    terminate_bias: float = 0.0
    lesson_share: float = 0.25
    success_window: int = 300
    evaluate_every: int = 12
    evaluation_draws: int = 200
    checkpoint_every: int = 4
    reward: Reward = field(default_factory=Reward)

    def __post_init__(self) -> None:
        for name in (
            "steps",
            "lanes",
            "lane_steps",
            "epochs",
            "minibatch",
            "success_window",
            "checkpoint_every",
        ):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise InputError(f"training: '{name}' should be a positive whole number, found {value!r}")
        for name in ("seed", "evaluate_every", "evaluation_draws"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise InputError(
                    f"training: '{name}' should be zero or a positive whole number, found {value!r}"
                )
        for name in ("learning_rate", "final_learning_rate", "clip"):
            value = getattr(self, name)
            if not math.isfinite(value) or value <= 0.0:
                raise InputError(f"training: '{name}' should be positive, found {value!r}")
        if not 0.0 <= self.gae_lambda <= 1.0:
            raise InputError(f"training: 'gae_lambda' should be between 0 and 1, found {self.gae_lambda!r}")
        if not 0.0 < self.lesson_share <= 1.0:
            raise InputError(
                f"training: 'lesson_share' should be above 0 and at most 1, found {self.lesson_share!r}"
            )
        for name in ("entropy", "log_deviation", "final_log_deviation", "terminate_bias"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise InputError(f"training: '{name}' should be a finite number, found {value!r}")
        if not isinstance(self.reward, Reward):
            raise InputError(f"training: 'reward' should be a Reward, found {self.reward!r}")
        if not self.hidden or any(n < 1 for n in self.hidden):
            raise InputError(f"training: 'hidden' should hold sizes of layers, found {self.hidden!r}")
        if self.lanes * self.lane_steps < 2:
            raise InputError("training: a rollout needs two decisions at least")

    @property
    def rollout(self) -> int:
        """Decisions of one rollout."""
        return self.lanes * self.lane_steps

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
        known = {f.name for f in dataclasses.fields(cls)}
        for name in data:
            if name not in known:
                raise InputError(f"training: unknown setting '{name}'{nearest(name, known)}")
        values = dict(data)
        try:
            if isinstance(values.get("reward"), Mapping):
                values["reward"] = Reward(**values["reward"])
            if "hidden" in values:
                values["hidden"] = tuple(values["hidden"])
            return cls(**values)
        except TypeError as error:
            raise InputError(f"training: {error}") from error
