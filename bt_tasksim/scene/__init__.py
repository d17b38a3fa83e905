"""What is in the world: objects, furniture, places, their seeded sampling, and when a run was a success.

The names that people import are handed on when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from bt_tasksim.core.lazy import handed_on

if TYPE_CHECKING:
    from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
    from bt_tasksim.scene.fixtures import Fixture, load_fixture
    from bt_tasksim.scene.scene import CurriculumStage, Lesson, Scene
    from bt_tasksim.scene.scene_file import load_scene
    from bt_tasksim.scene.specs import FixtureSpec, Goal, HandStart, ObjectSpec, SpotSpec

__getattr__, __dir__ = handed_on(
    __name__,
    {
        "specs": ("FixtureSpec", "Goal", "HandStart", "ObjectSpec", "SpotSpec"),
        "configuration": ("ActorConfiguration", "ObjectActor"),
        "fixtures": ("Fixture", "load_fixture"),
        "scene": ("CurriculumStage", "Lesson", "Scene"),
        "scene_file": ("load_scene",),
    },
)

__all__ = [
    "ActorConfiguration",
    "Fixture",
    "FixtureSpec",
    "Goal",
    "HandStart",
    "CurriculumStage",
    "Lesson",
    "ObjectActor",
    "ObjectSpec",
    "Scene",
    "SpotSpec",
    "load_fixture",
    "load_scene",
]
