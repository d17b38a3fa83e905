"""One behaviour tree, authored or taken from a demonstration, trained, simulated and run on a robot.

Names are imported when they are first used: ``import bt_tasksim`` loads no simulator and no learning library.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bt_tasksim.concept import ConceptModel, Condition
    from bt_tasksim.engines.registry import EngineOptions
    from bt_tasksim.errors import BtTasksimError, InputError, MachineError
    from bt_tasksim.launch import run
    from bt_tasksim.runner import Result, Runner
    from bt_tasksim.scene import Goal, HandStart, Lesson, ObjectSpec, Scene, SpotSpec
    from bt_tasksim.training.config import TrainConfig
    from bt_tasksim.training.decorator import Train
    from bt_tasksim.training.episode import EpisodeEnv
    from bt_tasksim.training.ppo import train

_HOMES = {
    "bt_tasksim.concept": ("ConceptModel", "Condition"),
    "bt_tasksim.engines.registry": ("EngineOptions",),
    "bt_tasksim.errors": ("BtTasksimError", "InputError", "MachineError"),
    "bt_tasksim.launch": ("run",),
    "bt_tasksim.runner": ("Result", "Runner"),
    "bt_tasksim.scene": ("Goal", "HandStart", "Lesson", "ObjectSpec", "Scene", "SpotSpec"),
    "bt_tasksim.training.config": ("TrainConfig",),
    "bt_tasksim.training.decorator": ("Train",),
    "bt_tasksim.training.episode": ("EpisodeEnv",),
    "bt_tasksim.training.ppo": ("train",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "BtTasksimError",
    "ConceptModel",
    "Condition",
    "EngineOptions",
    "EpisodeEnv",
    "Goal",
    "HandStart",
    "InputError",
    "Lesson",
    "MachineError",
    "ObjectSpec",
    "Result",
    "Runner",
    "Scene",
    "SpotSpec",
    "Train",
    "TrainConfig",
    "run",
    "train",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(_HOME[name]), name)
    raise AttributeError(f"module 'bt_tasksim' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
