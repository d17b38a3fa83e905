"""Concepts and conditions: the leaves of trees, one file a concept."""

from __future__ import annotations

from bt_tasksim._names import one_module
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept_nodes.bring import Bring
from bt_tasksim.concept_nodes.conditions import AtPose, Holding, TimePassed, Upright
from bt_tasksim.concept_nodes.grasp import Grasp
from bt_tasksim.concept_nodes.pick import Pick
from bt_tasksim.concept_nodes.place import Place
from bt_tasksim.concept_nodes.release import Release
from bt_tasksim.concept_nodes.wait import Wait
from bt_tasksim.core.registry import parts

one_module(__name__)

__all__ = [
    "AtPose",
    "Bring",
    "Grasp",
    "Holding",
    "Pick",
    "Place",
    "Release",
    "TimePassed",
    "Upright",
    "Wait",
    "catalogue",
]


def catalogue() -> dict[str, type[ConceptModel] | type[Condition]]:
    """All concepts and conditions by name, as trees in XML name them; those of plugins, too."""
    return parts("concept")
