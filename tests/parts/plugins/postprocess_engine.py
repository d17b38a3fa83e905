"""A post-process engine from outside: object poses arrive some ticks late; what the hand feels does not."""

from dataclasses import replace

from bt_tasksim.core.registry import register
from bt_tasksim.engines.perception.noise import noise_model
from bt_tasksim.engines.perception.state import StatePostProcess

TICKS = 4


@register("engine/postprocess", "late")
class LatePerception(StatePostProcess):
    @classmethod
    def create(cls, robot, setup):
        return cls(robot, noise_model(setup.noise))

    @classmethod
    def label(cls, setup):
        return f"{TICKS} ticks late, noise {setup.noise}"

    def reset(self, configuration, model):
        super().reset(configuration, model)
        self.queue = []

    def observe(self, state, images):
        now = super().observe(state, images)
        self.queue = [*self.queue, now.objects][-(TICKS + 1) :]
        return replace(now, objects=self.queue[0])
