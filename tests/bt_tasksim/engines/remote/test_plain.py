"""Plain data and back: the same value again, and everything else refused with where it is."""

import dataclasses
import json
import math

import msgpack
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bt_tasksim.core.errors import InputError
from bt_tasksim.engines.images import CameraModel
from bt_tasksim.engines.remote.plain import LARGEST, LONGEST_LIST, from_plain, shown, to_plain
from bt_tasksim.scene.configuration import ActorConfiguration, Disturbance
from bt_tasksim.scene.specs import Goal
from bt_tasksim.trees.load import load_source, scenarios


def again(kind, value):
    return from_plain(kind, msgpack.unpackb(msgpack.packb(to_plain(value))), "it")


@pytest.mark.parametrize("scenario", sorted(scenarios()))
@pytest.mark.parametrize("seed", [0, 7, 123456])
def test_drawn_worlds_are_the_same_bit_for_bit(scenario, seed):
    world = load_source(scenario).scene.sample(seed)
    assert again(ActorConfiguration, world).to_json() == world.to_json()


@given(
    st.builds(
        Disturbance,
        object=st.text("abc_", max_size=9),
        delay=st.floats(-LARGEST, LARGEST),
        force=st.tuples(*[st.floats(-LARGEST, LARGEST)] * 3),
    )
)
def test_every_number_survives(value):
    back = again(Disturbance, value)
    assert back == value and [math.copysign(1, x) for x in back.force] == [
        math.copysign(1, x) for x in value.force
    ]


LEAVES = st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.binary()


def _nested(inner):
    return st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4)


@given(st.recursive(LEAVES, _nested))
@example(1 << 64)
@example(-(1 << 63) - 1)
@example((1 << 64) - 1)
def test_whatever_comes_is_a_value_or_an_input_error(data):
    for kind in (str, bool, int, float, tuple[float, ...], dict[str, str], Goal | None, CameraModel):
        try:
            value = from_plain(kind, data, "it")
        except InputError as error:
            assert str(error).startswith("it") and len(str(error)) < 300 and str(error).isprintable()
        else:
            assert value is None or again(kind, value) == value


def test_a_sentence_says_where_and_what():
    world = to_plain(load_source("pick_and_place").scene.sample(0))

    def refused(change):
        data = json.loads(json.dumps(world))
        change(data)
        with pytest.raises(InputError) as error:
            from_plain(ActorConfiguration, data, "world")
        return str(error.value)

    def nan(data):
        data["objects"][0]["mass"] = math.nan

    assert refused(nan) == "world: objects[0]: mass should be a number within +-1e+09, found NaN"
    assert "objects[0] should be a ObjectActor" in refused(lambda d: d["objects"][0].pop("mass"))
    assert "missing: 'extra'" in refused(lambda d: d.update(extra=1))
    assert "places[0]: pose should be numbers of shape (7,)" in refused(
        lambda d: d["places"][0].update(pose=[1])
    )
    assert "seed should be a whole number within 64 bits" in refused(lambda d: d.update(seed=1.5))
    assert "seed should be a whole number within 64 bits" in refused(lambda d: d.update(seed=True))
    assert "noise should be printable text" in refused(lambda d: d.update(noise="a\x1b[2J"))
    assert "joint_position should be a list of at most" in refused(
        lambda d: d.update(joint_position=[0.0] * (LONGEST_LIST + 1))
    )
    assert "goals[0]: position_tolerance" in refused(lambda d: d["goals"][0].update(position_tolerance=1e300))


def test_what_is_no_data_is_not_sent():
    with pytest.raises(InputError, match="a function cannot be sent"):
        to_plain({"call": shown})
    with pytest.raises(InputError, match="a bytes cannot be sent"):
        to_plain([b"x"])


def test_every_field_of_a_drawn_world_is_covered():
    """A new field of a type that is not known here must fail here, not on the road."""
    world = load_source("pick_and_place_recovering").scene.sample(1)
    assert world.disturbance is not None
    assert to_plain(world).keys() == {f.name for f in dataclasses.fields(world)}
    again(ActorConfiguration, world)
