"""A reward part from outside: jerky motion costs."""

import numpy as np

from bt_tasksim.core.registry import register
from bt_tasksim.training.reward_parts import RewardPart, Transition


@register("reward part", "smoothness")
class Smoothness(RewardPart):
    """The square of the change of an action from one decision to the next, negative."""

    def pay(self, transition: Transition) -> float:
        if transition.last_motion is None:
            return 0.0
        change = np.asarray(transition.motion) - np.asarray(transition.last_motion)
        return -float(np.mean(change**2))
