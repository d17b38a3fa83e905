"""The type of a concept's memory stands in its head."""

import typing

import pytest

from bt_tasksim.concept.functions import ConceptFunctions
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release, Wait


def memory_in_head(concept):
    for owner in concept.__mro__:
        for base in vars(owner).get("__orig_bases__", ()):
            if typing.get_origin(base) is ConceptModel:
                said = typing.get_args(base)[0]
                return getattr(said, "__default__", said)  # of a family of concepts: the usual one
    return None


@pytest.mark.parametrize("concept", [Grasp, Pick, Bring, Place, Release, Wait])
def test_begin_gives_what_the_head_says(concept):
    said = memory_in_head(concept)
    assert said is not None
    if concept.begin is not ConceptFunctions.begin:
        assert typing.get_type_hints(concept.begin)["return"] is said


def test_a_concept_without_one_is_a_concept_all_the_same():
    class Hum(ConceptModel):
        """Does nothing.

        Args:
        """

        def command(self, action, seen, memory):
            raise NotImplementedError

        def done(self, seen, memory):
            raise NotImplementedError

    assert Hum.value().begin(None) is None and Hum.parameters() == {}
