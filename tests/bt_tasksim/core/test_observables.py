"""Every field of an observation says what it is, and how far simulation and reality differ in it."""

from __future__ import annotations

import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.observables import FIELDS, observable, observables


def test_the_fields_of_an_observation_are_the_observables_of_the_package():
    assert list(observables())[: len(FIELDS)] == list(FIELDS)


@pytest.mark.parametrize("name", FIELDS)
def test_each_has_a_shape_a_unit_a_gap_and_a_reason(name):
    found = observable(name)
    assert found.name == name and found.__doc__
    assert found.shape.startswith("(...") and isinstance(found.unit, str)
    assert found.gap in ("small", "large") and len(found.why) > 5 and found.error


def test_those_with_a_large_gap_are_sizes_of_forces_and_velocities():
    large = [name for name, found in observables().items() if found.gap == "large"]
    assert large == ["arm_velocity", "hand_effort", "contact_force", "wrench"]


def test_an_unknown_one_is_refused_with_the_nearest():
    with pytest.raises(InputError, match="'contacts'"):
        observable("contact")
