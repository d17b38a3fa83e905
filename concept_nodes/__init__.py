"""Concepts and conditions: the leaves of trees, one file a concept."""

from __future__ import annotations

from bt_tasksim.concept import ConceptModel, Condition
from concept_nodes.bring import Bring
from concept_nodes.conditions import AtPose, Holding, TimePassed, Upright
from concept_nodes.grasp import Grasp
from concept_nodes.pick import Pick
from concept_nodes.place import Place
from concept_nodes.release import Release
from concept_nodes.wait import Wait

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
    """All concepts and conditions by name, as trees in XML name them."""
    leaves: list[type[ConceptModel] | type[Condition]] = [
        Grasp, Pick, Bring, Place, Release, Wait, Holding, AtPose, Upright, TimePassed,
    ]  # fmt: skip
    return {leaf.__name__: leaf for leaf in leaves}
