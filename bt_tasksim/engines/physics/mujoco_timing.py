"""How MuJoCo's worlds are stepped: how many steps a control period has, and how fine they are."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bt_tasksim.engines.physics.mujoco_contacts import FINE_STEP, TIMESTEP
from bt_tasksim.scene.configuration import ActorConfiguration


@dataclass(frozen=True)
class StepPlan:
    """How a control period is stepped.

    Attributes:
        period: Seconds.
        steps: Ordinary steps in it.
        sensed: The last steps, in which forces are felt.
        finer: Fine steps that an ordinary one becomes while something falls or is pushed.
    """

    period: float
    steps: int
    sensed: int
    finer: int

    @property
    def step(self) -> float:
        """Seconds of an ordinary step."""
        return self.period / self.steps

    @classmethod
    def of(cls, configuration: ActorConfiguration) -> StepPlan:
        """The plan for what was drawn."""
        period = 1.0 / configuration.control_frequency
        steps = math.ceil(period / TIMESTEP - 1e-9)
        share = configuration.control_frequency / configuration.physics_frequency
        return cls(
            period,
            steps,
            sensed=min(max(round(steps * share), 1), steps),
            finer=math.ceil(period / steps / FINE_STEP - 1e-9),
        )
