"""What is known of the worlds of a batch: names are columns, what is of unlike length is padded."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.columns import filled
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.fact_arrays import FactArrays, take_rows
from bt_tasksim.core.fact_making import rotations
from bt_tasksim.core.facts import WorldFacts, joined
from bt_tasksim.core.facts_table import FactsTable
from bt_tasksim.core.transfer import Index
from bt_tasksim.core.world import ObjectModel, Obstacle, PlaceModel, WorldModel
from tests.array_libraries import agree

KINDS = {
    "box": (2, False, ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)), (0.04, 0.07)),
    "cube": (4, True, ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), (0.05, 0.05, 0.05)),
    "cup": (0, False, ((1.0, 0.0, 0.0),), (0.06,)),
    "odd": (1, False, (), ()),
}


def thing(name, kind="box", size=0.1):
    symmetry, cubic, axes, widths = KINDS[kind]
    return ObjectModel(name, kind, (size, size / 2, size / 4), symmetry, axes, widths, cubic)


def place(name, at=0.0, kind="spot"):
    way = np.array([0.0, 0.0, 1.0])
    return PlaceModel(
        name, kind, poses.pose([0.4, at, 0.1]), (0.2, 0.3), (0.0, 0.01), 0.25, -way, way, "table", 0.02
    )


def world(objects=("cup",), places=("table",), walls=0, period=0.05, kinds=("cup",)):
    kinds = dict(zip(objects, kinds, strict=False))
    return WorldModel(
        tuple(thing(name, kinds.get(name, "box"), 0.1 + 0.01 * k) for k, name in enumerate(objects)),
        {name: place(name, 0.1 * k) for k, name in enumerate(places)},
        ("left", "right"),
        0.08,
        period,
        tuple(Obstacle(poses.pose([0.1 * k, 0, 0]), (0.1, 0.2, 0.3), "wall") for k in range(walls)),
    )


UNLIKE = [
    world(("cup", "box"), ("table", "shelf"), 2),
    world(("box",), ("table",), 0, kinds=("box",)),
    world(("cube", "cup", "odd"), ("bin", "table"), 5, kinds=("cube", "cup", "odd")),
    world((), (), 0),
]


def arrays(facts):
    """All arrays, by bundle and name."""
    return {
        f"{kind}.{f.name}": getattr(getattr(facts, kind), f.name)
        for kind in ("object_facts", "place_facts", "obstacle_facts")
        for f in dataclasses.fields(getattr(facts, kind))
    }


def same(first, second):
    """They say the same of as many worlds, objects and places, whatever they are padded to."""
    a, b = arrays(first), arrays(second)
    for name, values in a.items():
        other, padded = b[name], 1 if name.startswith("obstacle") else 2
        assert values.shape[:padded] == other.shape[:padded], name
        most = tuple(max(n, m) for n, m in zip(values.shape, other.shape, strict=True))[1:]
        nothing = PADDING.get(name.partition(".")[2], 0)
        np.testing.assert_array_equal(
            filled(values, most, nothing), filled(other, most, nothing), err_msg=name
        )
    return (first.columns, first.place_columns) == (second.columns, second.place_columns)


PADDING = {
    "rotations": (1.0, 0, 0, 0), "grasp_axes": (0.0, 1, 0), "grasp_widths": np.inf,
    "pose": (0.0, 0, 0, 1, 0, 0, 0),
}  # fmt: skip
"""What stands where there is nothing; else zeros."""


@pytest.mark.parametrize(
    "other",
    [
        lambda facts: facts.map(lambda values: values[:3]),
        lambda facts: facts.map(lambda values: values[:0]),
        lambda facts: dataclasses.replace(
            facts,
            object_facts=dataclasses.replace(
                facts.object_facts,
                rotations=facts.object_facts.rotations[:, :, :1],
                rotation_counts=facts.object_facts.rotation_counts[:, :, :1],
            ),
        ),
        lambda facts: dataclasses.replace(
            facts, obstacle_facts=facts.obstacle_facts.map(lambda values: values[:, :1])
        ),
    ],
    ids=["fewer worlds", "none", "lost rotations", "lost obstacles"],
)
def test_facts_that_lack_something_are_not_the_same(other):
    facts = WorldFacts.of(UNLIKE)
    with pytest.raises(AssertionError):
        same(facts, other(facts))


def test_every_array_has_a_row_for_each_world_and_a_column_for_each_name():
    facts = WorldFacts.of(UNLIKE)
    assert facts.worlds == 4 and list(facts.columns) == ["cup", "box", "cube", "odd"]
    assert list(facts.place_columns) == ["table", "shelf", "bin"]
    for name, values in arrays(facts).items():
        columns = {"object": 4, "place": 3, "obstacle": 5}[name.partition("_")[0]]
        assert values.shape[:2] == (4, columns), name
        assert values.dtype in (np.float64, np.bool_), name


def test_a_name_is_the_same_column_in_worlds_that_order_their_objects_otherwise():
    facts = WorldFacts.of([world(("cup", "box")), world(("box", "cup"), kinds=("box", "cup"))])
    cup, box = facts.object("cup"), facts.object("box")
    assert cup.extent[:, 0].tolist() == [0.1, 0.11] and box.extent[:, 0].tolist() == [0.11, 0.1]
    assert cup.revolved.all() and not box.revolved.any()
    assert facts.object_facts.extent.shape == (2, 2, 3)


def test_what_only_some_worlds_have_is_absent_in_the_others():
    facts = WorldFacts.of(UNLIKE)
    assert facts.object("cup").present.tolist() == [True, False, True, False]
    assert facts.object("box").present.tolist() == [True, True, False, False]
    assert facts.place("shelf").present.tolist() == [True, False, False, False]
    assert facts.obstacle_facts.present.sum(axis=1).tolist() == [2, 0, 5, 0]
    for values in arrays(facts).values():
        assert not np.isnan(values).any(), "numbers of what is absent mean nothing, and raise nothing"
    assert np.allclose(np.linalg.norm(facts.place_facts.pose[..., 3:], axis=-1), 1.0)
    assert np.allclose(np.linalg.norm(facts.obstacle_facts.pose[..., 3:], axis=-1), 1.0)


def test_symmetries_and_grasp_axes_are_padded_with_masks():
    facts = WorldFacts.of(UNLIKE)
    counts = {name: facts.object(name).rotation_counts.sum(axis=1).tolist() for name in facts.columns}
    assert counts == {"cup": [1, 1, 1, 1], "box": [2, 2, 1, 1], "cube": [1, 1, 24, 1], "odd": [1, 1, 1, 1]}
    identity = facts.object_facts.rotations[..., 0, :]
    assert np.array_equal(identity, np.broadcast_to([1.0, 0, 0, 0], identity.shape)), "the first one"
    assert facts.object("box").grasp_widths.tolist()[1] == [0.04, 0.07, np.inf]
    assert facts.object("odd").grasp_widths.tolist() == [[np.inf] * 3] * 4
    assert np.allclose(facts.object("cube").rotations[2], rotations(thing("x", "cube")))


@pytest.mark.parametrize("kind", KINDS)
def test_rotations_bring_an_object_onto_itself_each_another_one(kind):
    model = thing("x", kind)
    turns = rotations(model)
    assert len(turns) == (24 if model.cubic else max(model.symmetry, 1))
    between = poses.angle_between(turns[:, None], turns[None])
    assert (between + 9.0 * np.eye(len(turns)) > 0.1).all()
    box = np.abs(poses.to_matrix(turns))
    assert np.allclose(box.sum(axis=-1), 1.0) and np.allclose(box.max(axis=-1), 1.0)


def test_a_world_that_is_taken_from_a_batch_is_what_it_is_alone():
    facts = WorldFacts.of(UNLIKE)
    for k, model in enumerate(UNLIKE):
        alone = WorldFacts.of([model], list(facts.columns), list(facts.place_columns))
        assert same(alone, facts.map(lambda values, k=k: values[[k]]))


def test_a_batch_is_its_worlds_joined():
    facts = WorldFacts.of(UNLIKE)
    names, places = list(facts.columns), list(facts.place_columns)
    one_by_one = joined([WorldFacts.of([model], names, places) for model in UNLIKE])
    assert same(facts, one_by_one)
    shapes = {name: values.shape for name, values in arrays(facts).items()}
    assert shapes == {name: values.shape for name, values in arrays(one_by_one).items()}
    assert one_by_one.object("box").grasp_widths.tolist() == facts.object("box").grasp_widths.tolist()


def test_standing_height_and_rim_say_what_they_say():
    facts = WorldFacts.of(UNLIKE)
    assert facts.object("cube").standing_height[2] == 0.05, "a cube may stand on any face"
    assert facts.object("box").standing_height[1] == 0.1 / 8
    in_bin = WorldFacts.of([dataclasses.replace(world(), places={"bin": place("bin", kind="bin")})])
    assert in_bin.place("bin").rim.tolist() == [0.25] and facts.place("table").rim.tolist() == [0.0] * 4


def test_a_place_of_each_world_by_its_column():
    facts = WorldFacts.of(UNLIKE[:3])
    found = facts.place_at(np.array([1, 0, 2]))
    assert found.present.tolist() == [True, True, True]
    assert found.pose[:, 1].tolist() == [0.1, 0.0, 0.0]


def test_names_that_no_world_has_are_refused_with_the_nearest():
    facts = WorldFacts.of(UNLIKE)
    with pytest.raises(InputError, match="no object 'cap' in the scene; did you mean 'cup'"):
        facts.object("cap")
    with pytest.raises(InputError, match="no place 'shelv' in the scene; did you mean 'shelf'"):
        facts.place("shelv")


OTHERS = [
    world(period=0.1),
    dataclasses.replace(world(), opening=0.1),
    dataclasses.replace(world(), tips=("thumb", "index")),
]


@pytest.mark.parametrize("other", OTHERS)
def test_worlds_of_other_robots_or_control_rates_are_no_batch(other):
    with pytest.raises(InputError, match="one robot and one control rate"):
        WorldFacts.of([world(), other])
    with pytest.raises(InputError, match="one robot and one control rate"):
        joined([WorldFacts.of([world()]), WorldFacts.of([other])])
    table = FactsTable(2)
    table.replace(np.array([0, 1]), [world(), other])
    with pytest.raises(InputError, match="one robot and one control rate"):
        _ = table.facts


def test_no_worlds_are_no_batch():
    with pytest.raises(InputError, match="at least one world"):
        WorldFacts.of([])


# ---- worlds that begin anew -------------------------------------------------------------------------------


def test_before_any_world_has_begun_nothing_is_known():
    assert FactsTable(3).facts is None


def test_worlds_that_never_began_have_the_facts_of_one_that_did():
    table = FactsTable(3)
    table.replace(np.array([1]), [world(("box",))])
    assert same(table.facts, WorldFacts.of([world(("box",))] * 3))


def test_rows_that_begin_anew_are_as_if_all_had_begun_so():
    table = FactsTable(4)
    table.replace(np.arange(4), UNLIKE)
    assert same(table.facts, WorldFacts.of(UNLIKE))
    table.replace(np.array([0, 2]), [UNLIKE[2], UNLIKE[1]])
    after = [UNLIKE[2], UNLIKE[1], UNLIKE[1], UNLIKE[3]]
    assert same(table.facts, WorldFacts.of(after))
    assert "shelf" not in table.facts.place_columns, "nobody has it any more"
    table.replace(np.array([3]), [world(("cup", "box"), ("shelf",), 1)])
    assert same(table.facts, WorldFacts.of([*after[:3], world(("cup", "box"), ("shelf",), 1)]))


def test_rows_are_taken_in_any_order_and_not_from_before():
    table, rows = FactsTable(4), np.array([3, 1])
    table.replace(np.arange(4), UNLIKE)
    assert same(table.taken(Index(rows)), WorldFacts.of([UNLIKE[3], UNLIKE[1]], *_names(table.facts)))
    assert table.taken(Index(rows)) is table.taken(Index(rows.copy()))
    table.replace(np.array([1]), [UNLIKE[0]])
    assert same(table.taken(Index(rows)), WorldFacts.of([UNLIKE[3], UNLIKE[0]], *_names(table.facts)))


def _names(facts):
    return list(facts.columns), list(facts.place_columns)


def test_many_choices_of_rows_are_not_kept_for_ever():
    table = FactsTable(10)
    table.replace(np.arange(10), [world()] * 10)
    for k in range(1, 1 << 10):
        rows = np.flatnonzero([k >> bit & 1 for bit in range(10)])
        assert table.taken(Index(rows)).worlds == len(rows)
    assert len(table._taken) < 100


# ---- taking rows ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("inner", [(), (3,), (2, 4)])
def test_of_each_row_the_entry_that_is_asked_for(inner):
    values = np.arange(5 * 6 * int(np.prod(inner, initial=1)), dtype=float).reshape(5, 6, *inner)
    index = np.array([0, 5, 2, 2, 1])
    expected = np.stack([values[k, i] for k, i in enumerate(index)])
    assert np.array_equal(agree(take_rows, values, index), expected)


def asked(facts, index):
    cup, table, there = facts.object("cup"), facts.place("table"), facts.place_at(index)
    assert isinstance(cup, FactArrays) and facts.worlds == index.shape[0]
    boxes = facts.obstacle_facts
    return cup.standing_height, table.rim, there.rim, cup, table, there, boxes


def test_facts_are_the_same_in_every_library_and_on_every_device():
    agree(asked, WorldFacts.of(UNLIKE), np.array([0, 2, 1, 1]))


def test_unlike_worlds_say_the_same_in_any_company(rows_alike):
    facts = WorldFacts.of([UNLIKE[k % 4] for k in range(65)])
    index = np.arange(65) % len(facts.place_columns)
    rows_alike(lambda rows: asked(facts.map(lambda values: values[rows]), index[rows]), 65)


def test_each_world_knows_what_it_was_made_of_however_its_rows_came_about():
    facts = WorldFacts.of(UNLIKE)
    rows = np.array([2, 0])
    some = facts.map(lambda values: values[rows])
    assert [some.model_of(k) for k in range(2)] == [UNLIKE[2], UNLIKE[0]]
    both = joined([some, facts])
    assert [both.model_of(k) for k in range(6)] == [UNLIKE[2], UNLIKE[0], *UNLIKE]
    other = WorldFacts.of([UNLIKE[3]], *_names(facts))
    changed = facts.replaced(np.array([1]), other)
    assert [changed.model_of(k) for k in range(4)] == [UNLIKE[0], UNLIKE[3], UNLIKE[2], UNLIKE[3]]
    assert len(changed.models) == changed.worlds, "worlds that have ended are not kept"
