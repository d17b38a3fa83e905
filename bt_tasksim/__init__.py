"""One behaviour tree, authored or taken from a demonstration, trained, simulated and run on a robot.

Names are imported when they are first used: ``import bt_tasksim`` loads no simulator and no learning library.
"""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

from bt_tasksim import _names

if TYPE_CHECKING:
    from bt_tasksim.concept.condition import Condition
    from bt_tasksim.concept.declared import ConditionOf
    from bt_tasksim.concept.limit import Limit
    from bt_tasksim.concept.model import ConceptModel
    from bt_tasksim.concept.parameters import (
        Direction,
        Flag,
        Metres,
        MetresPerSecond,
        Newtons,
        ObjectName,
        PlaceName,
        Points,
        Position,
        Radians,
        Ratio,
        Seconds,
        Text,
    )
    from bt_tasksim.concept.seen import Known, Seen
    from bt_tasksim.core import poses, units
    from bt_tasksim.core.errors import BtTasksimError, InputError, MachineError
    from bt_tasksim.core.outcomes import Form, Outcome, Possible, Statement, register_reason
    from bt_tasksim.core.poses import Array, array_namespace
    from bt_tasksim.core.registry import register
    from bt_tasksim.core.world import Command, Hidden, Observation
    from bt_tasksim.execution.batch_runner import BatchRunner
    from bt_tasksim.execution.pipelines import EngineOptions
    from bt_tasksim.execution.result import Result
    from bt_tasksim.execution.runner import Runner
    from bt_tasksim.execution.session import Session
    from bt_tasksim.planning import reference_motion
    from bt_tasksim.report.launch import run
    from bt_tasksim.robot.description import RobotDescription, load_robot
    from bt_tasksim.scene.scene import CurriculumStage, Lesson, Scene
    from bt_tasksim.scene.scene_file import load_scene
    from bt_tasksim.scene.specs import FixtureSpec as Fixture
    from bt_tasksim.scene.specs import Goal, HandStart, ObjectSpec, SpotSpec
    from bt_tasksim.training.config import TrainConfig
    from bt_tasksim.training.env import EpisodeEnv
    from bt_tasksim.training.launch import evaluate
    from bt_tasksim.training.ppo import train
    from bt_tasksim.training.sb3_vector_env import SB3VectorEnv
    from bt_tasksim.training.vector_env import EpisodeVectorEnv
    from bt_tasksim.trees.nodes.train import Train

_names.install()

_HOMES = {
    "bt_tasksim.concept.condition": ("Condition",),
    "bt_tasksim.concept.seen": ("Known", "Seen"),
    "bt_tasksim.concept.declared": ("ConditionOf",),
    "bt_tasksim.concept.limit": ("Limit",),
    "bt_tasksim.concept.model": ("ConceptModel",),
    "bt_tasksim.concept.parameters": (
        "Direction",
        "Flag",
        "Metres",
        "MetresPerSecond",
        "Newtons",
        "ObjectName",
        "PlaceName",
        "Points",
        "Position",
        "Radians",
        "Ratio",
        "Seconds",
        "Text",
    ),
    "bt_tasksim.core.poses": ("Array", "array_namespace"),
    "bt_tasksim.core.registry": ("register",),
    "bt_tasksim.core.world": ("Command", "Hidden", "Observation"),
    "bt_tasksim.execution.batch_runner": ("BatchRunner",),
    "bt_tasksim.execution.pipelines": ("EngineOptions",),
    "bt_tasksim.core.errors": ("BtTasksimError", "InputError", "MachineError"),
    "bt_tasksim.core.outcomes": ("Form", "Outcome", "Possible", "Statement", "register_reason"),
    "bt_tasksim.report.launch": ("run",),
    "bt_tasksim.execution.result": ("Result",),
    "bt_tasksim.execution.runner": ("Runner",),
    "bt_tasksim.execution.session": ("Session",),
    "bt_tasksim.robot": ("RobotDescription", "load_robot"),
    "bt_tasksim.scene": (
        "CurriculumStage",
        "Fixture",
        "Goal",
        "HandStart",
        "Lesson",
        "ObjectSpec",
        "Scene",
        "SpotSpec",
        "load_scene",
    ),
    "bt_tasksim.training.config": ("TrainConfig",),
    "bt_tasksim.trees.nodes.train": ("Train",),
    "bt_tasksim.training.env": ("EpisodeEnv",),
    "bt_tasksim.training.launch": ("evaluate",),
    "bt_tasksim.training.ppo": ("train",),
    "bt_tasksim.training.sb3_vector_env": ("SB3VectorEnv",),
    "bt_tasksim.training.vector_env": ("EpisodeVectorEnv",),
}
_MODULES = {
    "poses": "bt_tasksim.core.poses",
    "reference_motion": "bt_tasksim.planning.reference_motion",
    "units": "bt_tasksim.core.units",
}
_CALLED = {"Fixture": "FixtureSpec"}
"""Names that are longer where they are at home."""
_HOME = {name: home for home, names in _HOMES.items() for name in names} | _MODULES

__all__ = [
    "Array",
    "BatchRunner",
    "BtTasksimError",
    "Command",
    "ConceptModel",
    "Condition",
    "ConditionOf",
    "Direction",
    "EngineOptions",
    "EpisodeEnv",
    "EpisodeVectorEnv",
    "Fixture",
    "Flag",
    "Form",
    "Goal",
    "HandStart",
    "Hidden",
    "InputError",
    "Known",
    "CurriculumStage",
    "Lesson",
    "Limit",
    "MachineError",
    "Metres",
    "MetresPerSecond",
    "Newtons",
    "ObjectName",
    "ObjectSpec",
    "Observation",
    "Outcome",
    "PlaceName",
    "Points",
    "Position",
    "Possible",
    "Radians",
    "Ratio",
    "Result",
    "RobotDescription",
    "Runner",
    "SB3VectorEnv",
    "Scene",
    "Seconds",
    "Seen",
    "Session",
    "SpotSpec",
    "Statement",
    "Text",
    "Train",
    "TrainConfig",
    "array_namespace",
    "evaluate",
    "load_robot",
    "load_scene",
    "poses",
    "reference_motion",
    "register_reason",
    "register",
    "run",
    "train",
    "units",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        if "IPython" in sys.modules:  # a notebook: trees and graphs show themselves
            importlib.import_module("bt_tasksim.report.notebook").install()
        home = importlib.import_module(_HOME[name])
        return home if name in _MODULES else getattr(home, _CALLED.get(name, name))
    raise AttributeError(f"module 'bt_tasksim' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
