"""Objects that start on, in and beside objects, and close to one another: no draw overlaps anything."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.any_tree.meshes import write
from bt_tasksim.core import poses
from bt_tasksim.core.errors import FieldError, InputError
from bt_tasksim.scene.outlines import distance, holds, overlapping, rectangle, whole_outline
from bt_tasksim.scene.overlap import check_configuration
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import FixtureSpec, ObjectSpec
from bt_tasksim.scene.starts import parts_of

CUBE = ((0.05,) * 3,) * 2
SMALL = ((0.03,) * 3,) * 2
BOWL = ((0.12, 0.12, 0.08),) * 2


def cube(y, **more):
    fields = {"area": (0, 0), "centre": (0.0, y), "size": CUBE, "yaw": 0.0, **more}
    return ObjectSpec(("cube",), on="table", **fields)


def drawn(scene, seed):
    world = scene.sample(seed)
    check_configuration(world)
    return {actor.name: actor for actor in world.objects}


@pytest.mark.parametrize("millimetres", [30, 6])
def test_two_cubes_close_together_are_drawn(millimetres):
    scene = Scene(objects={"a": cube(0.0), "b": cube(0.05 + millimetres / 1000)})
    world = drawn(scene, 0)
    assert distance(*(whole_outline(parts_of(world[n])) for n in "ab")) == pytest.approx(millimetres / 1000)


def test_the_gap_is_kept_and_may_be_chosen():
    close = {"a": cube(0.0), "b": cube(0.053)}
    with pytest.raises(InputError, match="'b' finds no free spot on 'table' beside the others"):
        Scene(objects=close).sample(0)
    drawn(Scene(objects={"a": cube(0.0), "b": cube(0.053, gap=0.002)}), 0)


CLUTTER = Scene(
    objects={
        f"thing {i}": ObjectSpec(("box", "cube", "cylinder", "diamond"), on="table", area=(0.13, 0.18))
        for i in range(9)
    }
)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_clutter_is_drawn_with_gaps_between_all(seed):
    world = list(drawn(CLUTTER, seed).values())
    outlines = [whole_outline(parts_of(actor)) for actor in world]
    gaps = [distance(a, b) for i, a in enumerate(outlines) for b in outlines[:i]]
    assert min(gaps) >= 0.005


MIXED = Scene(
    fixtures=["tray"],
    objects={
        "top": ObjectSpec(("cube",), on="blue", size=SMALL),  # drawn after blue, and still the first
        "pea": ObjectSpec(("cube",), inside="bowl", size=SMALL),
        "near": ObjectSpec(("box", "oval"), beside="blue"),
        "blue": cube(0.0),
        "bowl": ObjectSpec(("cup",), inside="tray", size=BOWL),
        "left": ObjectSpec(("cylinder",), inside="tray", size=((0.05, 0.05, 0.06),) * 2),
    },
)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6))
def test_things_on_in_and_beside_things(seed):
    world = drawn(MIXED, seed)
    assert list(world) == list(MIXED.objects)
    at = {name: np.array(actor.pose[:3]) for name, actor in world.items()}
    assert at["top"][2] == pytest.approx(0.05 + 0.015)
    assert np.all(np.abs(at["top"][:2] - at["blue"][:2]) < 0.025)
    assert at["pea"][2] == pytest.approx(0.008 + 0.005 + 0.015)  # on the bottom of the bowl in the tray
    assert np.hypot(*(at["pea"] - at["bowl"])[:2]) < 0.06
    near, blue = (whole_outline(parts_of(world[n])) for n in ("near", "blue"))
    assert 0.005 <= distance(near, blue) <= 0.10
    assert at["near"][2] == pytest.approx(world["near"].model().extent[2] / 2)
    tray = next(place for place in MIXED.sample(seed).places if place.name == "tray")
    room = rectangle(tray.pose, tray.centre, tray.extent)
    assert all(holds(room, whole_outline(parts_of(world[n])), 0.0049) for n in ("bowl", "left"))
    assert {n: (a.on, a.base) for n, a in world.items()} == {
        "top": ("table", "blue"), "pea": ("tray", "bowl"), "near": ("table", ""),
        "blue": ("table", ""), "bowl": ("tray", ""), "left": ("tray", ""),
    }  # fmt: skip


def test_short_forms():
    scene = Scene(
        fixtures=["tray"],
        objects={
            "cup": "inside tray",
            "b": "box beside cup",
            "carton on": "cube on table",
            "c": " cube  on b ",
        },
    )
    starts = {name: (spec.kinds, *spec.start) for name, spec in scene.objects.items()}
    assert starts == {
        "cup": (("cup",), "inside", "tray"), "b": (("box",), "beside", "cup"),
        "carton on": (("cube",), "on", "table"), "c": (("cube",), "on", "b"),
    }  # fmt: skip


def test_nothing_is_drawn_into_furniture():
    scene = Scene(fixtures=[FixtureSpec("trash_bin", at=(0.5, 0.0))], objects={"cup": "on table"})
    for seed in range(5):
        with pytest.raises(InputError, match=r"'cup' and fixture 'trash_bin' overlap by|no free spot"):
            scene.sample(seed)
    beside = ObjectSpec(("cup",), on="table", area=(0.2, 0.2))
    free = dataclasses.replace(scene, objects={"cup": beside})
    for seed in range(20):
        drawn(free, seed)


def test_a_board_is_nothing_to_fall_off():
    """What is beside an object at the edge of a board stands on the board, too."""
    edge = ObjectSpec(("cube",), on="lower_board", centre=(0.0, 0.25), area=(0, 0), size=CUBE)
    scene = Scene(fixtures=["shelf"], objects={"a": edge, "b": ObjectSpec(("cube",), beside="a")})
    for seed in range(20):
        world = drawn(scene, seed)
        board = next(p for p in scene.sample(seed).places if p.name == "lower_board")
        local = poses.transform(poses.inverse(board.pose), np.array(world["b"].pose[:3]))
        assert abs(local[1]) < 0.3 and local[2] == pytest.approx(world["b"].size[2] / 2)


@pytest.mark.parametrize(
    ("objects", "words"),
    [
        ({"a": "cube on b", "b": "cube on a"}, "in a circle: 'a' starts on 'b', 'b' starts on 'a'"),
        ({"a": "cube on a"}, "in a circle: 'a' starts on 'a'"),
        ({"a": "cube on bed"}, "'bed', which is not a place of the scene, nor an object of it"),
        ({"a": "cube beside table"}, "beside 'table', which is not an object of the scene"),
        ({"table": "cube on table"}, "an object and a place are both called 'table'"),
    ],
)
def test_scenes_that_cannot_be(objects, words):
    with pytest.raises(FieldError, match=words):
        Scene(objects=objects)


@pytest.mark.parametrize("starts", [{}, {"on": "table", "beside": "b"}])
def test_an_object_starts_in_one_way(starts):
    with pytest.raises(FieldError, match="'on', 'inside' or 'beside' one thing"):
        ObjectSpec(("cube",), **starts)


def test_what_is_too_large_for_a_cup_does_not_start_in_it():
    scene = Scene(objects={"cup": "on table", "b": ObjectSpec(("cube",), inside="cup", size=CUBE)})
    with pytest.raises(InputError, match="'b' finds no free spot in 'cup'"):
        scene.sample(0)


def test_a_wide_gap_is_kept_too():
    objects = {name: ObjectSpec(("cube",), on="table", area=(0.15, 0.3), gap=0.1) for name in ("a", "b")}
    scene = Scene(objects=objects)
    for seed in range(20):
        a, b = (parts_of(actor) for actor in scene.sample(seed).objects)
        assert not overlapping(a, b, 0.1 - 1e-6)


def test_what_has_no_hollow_has_nothing_in_it():
    scene = Scene(objects={"a": cube(0.0), "b": ObjectSpec(("cube",), inside="a", size=SMALL)})
    with pytest.raises(InputError, match="nothing can start in 'a': it has no hollow"):
        scene.sample(0)


def test_what_starts_in_a_mug_is_never_beside_its_handle(tmp_path):
    mug = str(write(tmp_path, 3)["mug"])
    spec = ObjectSpec(("mesh",), on="table", mesh=mug, yaw=3.0)
    scene = Scene(objects={"mug": spec, "pea": ObjectSpec(("cube",), inside="mug", size=((0.012,) * 3,) * 2)})
    for seed in range(20):
        world = drawn(scene, seed)
        (x, y, z), at = world["mug"].size, np.array(world["mug"].pose)
        local = poses.localise(at, np.array(world["pea"].pose[:3]))
        assert np.hypot(local[0] + (x - y) / 2, local[1]) < y / 2 - 0.006
        assert -z / 2 + 0.006 <= local[2] - 0.006 < -z / 2 + 0.02
