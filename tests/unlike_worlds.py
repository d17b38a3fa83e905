"""Worlds that hold unlike objects, or the same ones in another order: what a source of worlds may draw."""

import dataclasses

from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec

SPECS = {
    "target": ObjectSpec(kinds=("box", "diamond"), on="table", centre=(0.0, -0.14), area=(0.08, 0.10)),
    "box": ObjectSpec(kinds=("box",), on="table", centre=(0.2, 0.02), area=(0.04, 0.04)),
    "tall": ObjectSpec(kinds=("cylinder",), on="table", centre=(-0.16, 0.02), area=(0.03, 0.03)),
}
SPOTS = [SpotSpec("goal", on="table", centre=(0.0, 0.16), area=(0.08, 0.08), yaw=0.5)]


def holding(*names, fixtures=()):
    """A scene with these objects, in this order."""
    goal = Goal("target", "goal") if "target" in names else None
    return Scene(objects={n: SPECS[n] for n in names}, fixtures=fixtures, spots=SPOTS, goal=goal)


@dataclasses.dataclass(frozen=True)
class Mixed(Scene):
    """One scene after the other by their seeds; of every other one the places are in another order."""

    scenes: tuple[Scene, ...] = ()

    def sample(self, seed, stream="evaluation", stage=None):
        drawn = self.scenes[seed % len(self.scenes)].sample(seed, stream, stage)
        return dataclasses.replace(drawn, places=drawn.places[:: -1 if seed % 2 else 1])


def mixed(*scenes):
    """A source of worlds that are drawn from these scenes in turn."""
    names = {name for scene in scenes for name in scene.objects}
    return Mixed(objects={name: SPECS[name] for name in sorted(names)}, spots=SPOTS, scenes=scenes)
