import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.core.errors import FieldError, InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.scene import ObjectSpec, Scene
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.grips import GivenGrip
from bt_tasksim.scene.sampling import draw_heading
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.scene.specs import Goal, HandStart, SpotSpec

ACROSS = {"point": (0, 0, 0), "closing": (0, 1, 0)}
MESH = Path(__file__).parents[3] / "assets" / "objects" / "bracket.obj"


def box(**fields):
    return ObjectSpec(**{"kinds": "box", "on": "table", **fields})


@pytest.mark.parametrize(
    ("said", "same"),
    [
        ({"mass": 0.1}, {"mass": (0.1, 0.1)}),
        ({"friction": [0.5, 0.6]}, {"friction": (0.5, 0.6)}),
        ({"size": (0.06, 0.06, 0.1)}, {"size": ((0.06, 0.06, 0.1), (0.06, 0.06, 0.1))}),
        ({"size": np.full((2, 3), 0.05)}, {"size": ((0.05,) * 3, (0.05,) * 3)}),
        ({"area": np.array([0.1, 0.2])}, {"area": (0.1, 0.2)}),
        ({"exponents": 0.5}, {"exponents": (0.5, 0.5)}),
        ({"exponents": [[0.1, 0.2], [0.3, 0.4]]}, {"exponents": ((0.1, 0.2), (0.3, 0.4))}),
        ({"colour": "red"}, {"colour": (0.86, 0.16, 0.15)}),
        ({"yaw": np.float32(1.0), "symmetry": np.int64(2)}, {"yaw": 1.0, "symmetry": 2}),
        ({"yaw": np.array([0.5, 0.5])}, {"yaw": (0.5, 0.5)}),
    ],
)
def test_python_takes_what_files_take(said, same):
    assert box(**said) == box(**same)
    drawn = Scene(objects={"a": box(**said)}).sample(0)
    assert ActorConfiguration.from_json(drawn.to_json()).objects == drawn.objects


def test_a_grasp_as_files_have_it():
    (found,) = box(size=(0.04, 0.05, 0.06), grasps=[ACROSS]).grasps
    assert isinstance(found, GivenGrip) and found.width == pytest.approx(0.05)
    given = {**ACROSS, "width": 0.04}
    assert box(grasps=[given]) == box(grasps=(GivenGrip(**given),))


@pytest.mark.parametrize(
    "fields",
    [
        {"kinds": 5},
        {"kinds": (1,)},
        {"on": 5},
        {"on": (1,)},
        {"area": (1, 2, 3)},
        {"area": 0.1},
        {"area": (-0.1, 0.1)},
        {"centre": (0.1, math.nan)},
        {"centre": None},
        {"yaw": math.inf},
        {"yaw": "x"},
        {"size": (math.nan, math.nan)},
        {"size": ((0.1, 0.1, 0.1), (0.05, 0.1, 0.1))},
        {"size": 5},
        {"mass": (0, 0)},
        {"mass": (-1, -1)},
        {"mass": (2, 1)},
        {"mass": True},
        {"mass": 10**400},
        {"friction": (-1, -1)},
        {"exponents": (2, 1)},
        {"exponents": ((0.1, 0.2), (0.4, 0.3))},
        {"mesh": str(MESH)},
        {"kinds": "mesh"},
        {"split": 5},
        {"size_error": math.nan},
        {"distance": "a"},
        {"gap": -1},
        {"movable": 5},
        {"file": 5},
        {"colour": "reddish"},
        {"colour": (math.nan, 0, 0)},
        {"colour": (255, 0, 0)},
        {"grasps": [5]},
        {"grasps": [{"point": (0, 0, 0)}]},
        {"grasps": [ACROSS]},  # and no single size to measure the width from
        {"symmetry": -3},
        {"symmetry": 1.5},
        {"category": None},
    ],
    ids=str,
)
def test_what_no_object_can_be_is_refused_where_it_is_said(fields):
    with pytest.raises(FieldError) as error:
        box(**fields)
    assert str(error.value).count("\n") == 0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SpotSpec("m", "table", (0, math.nan), (0, 0)), "spot 'm': 'centre\\[1\\]'"),
        (lambda: SpotSpec("m", "table", (0, 0), (0, 0), extent=(0, 1)), "'extent\\[0\\]' should be positive"),
        (lambda: SpotSpec("m", 5, (0, 0), -1), "'area' should be 2 numbers"),
        (lambda: HandStart("cup", height=(0.3, 0.2)), "'height' should be the lower one first"),
        (lambda: HandStart("cup", aside="x"), "'aside' should be a number"),
    ],
)
def test_other_specs_that_cannot_be(make, words):
    with pytest.raises(FieldError, match=words):
        make()


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"robot": None}, "'robot' should be"),
        ({"name": 5}, "'name' should be"),
        ({"objects": 5}, "'objects' should be"),
        ({"objects": {"cup": ["on", "table"]}}, "object 'cup': .* should read"),
        ({"objects": {"cup": None}}, "object 'cup': .* should read"),
        ({"spots": [("m", "table")]}, "'spots' should be"),
        ({"spots": 5}, "'spots' should be"),
        ({"fixtures": [5]}, "'fixtures' should be"),
        ({"fixtures": None}, "'fixtures' should be"),
        ({"fixtures": "tray"}, "'fixtures' should be"),
        ({"disturbed": 5}, "'disturbed' should be"),
        ({"stages": [5]}, "'stages' should be"),
    ],
)
def test_what_a_scene_is_made_of(fields, words):
    with pytest.raises(FieldError, match=words):
        Scene(**fields)


@pytest.mark.parametrize("approach", [(0, 1, 0), (0, -2, 0.1)])
def test_a_hand_does_not_come_along_the_way_in_which_it_closes(approach, tmp_path):
    with pytest.raises(InputError, match="parallel"):
        GivenGrip((0, 0, 0), (0, 1, 0), 0.05, approach)
    (tmp_path / "s.yaml").write_text(
        "objects:\n  box:\n    on: table\n    grasps:\n"
        f"      - {{point: [0, 0, 0], closing: [0, 1, 0], width: 0.05, approach: {list(approach)}}}\n"
    )
    with pytest.raises(InputError, match=r"line 5.*parallel"):
        load_scene(tmp_path / "s.yaml")


def test_a_colour_that_is_none_is_said_to_be_none(tmp_path):
    (tmp_path / "s.yaml").write_text("objects:\n  box: {on: table, colour: [.nan, 0, 0]}\n")
    with pytest.raises(
        InputError, match=r"'objects.box.colour' should be the name of a colour, or 3 numbers"
    ):
        load_scene(tmp_path / "s.yaml")


def test_a_bundled_mesh_is_found_by_its_name_and_ones_own_first(tmp_path, monkeypatch):
    bundled = asset("objects", "bottle.obj")
    monkeypatch.chdir(tmp_path)
    assert ObjectSpec(on="table", mesh="bottle.obj").mesh == str(bundled)
    (tmp_path / "bottle.obj").write_text(bundled.read_text())
    assert (
        Path(ObjectSpec(on="table", mesh="bottle.obj").mesh).resolve() == (tmp_path / "bottle.obj").resolve()
    )
    with pytest.raises(FieldError, match="mesh file"):
        ObjectSpec(on="table", mesh="bottles.obj")


def test_a_mesh_alone_says_that_it_is_one():
    spec = ObjectSpec(on="table", mesh=str(asset("objects", "mug.obj")))
    assert spec.kinds == ("mesh",)


def test_no_object_is_called_as_the_robots_tool_is():
    with pytest.raises(FieldError, match="an object is called 'tool', which is the robot's own"):
        Scene(objects={"tool": "cup on table"})


@given(st.floats(-3.0, 3.0), st.floats(0.0, 1.0), st.integers(0, 2**31))
def test_headings_are_within_their_range_and_one_number_is_half_its_width(low, width, seed):
    spot = SpotSpec("a", "table", (0.0, 0.0), yaw=(low, low + width))
    drawn = draw_heading(spot.yaw, np.random.default_rng(seed))
    assert low - 1e-9 <= drawn <= low + width + 1e-9
    about = draw_heading(width, np.random.default_rng(seed))
    assert about == pytest.approx(draw_heading((-width, width), np.random.default_rng(seed)))
    assert drawn - low == pytest.approx((about + width) / 2, abs=1e-9)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: box(at=(0, 0)), "an object has no 'at'; it is 'centre'"),
        (lambda: box(sise=1), "an object has no 'sise'; did you mean 'size'"),
        (lambda: SpotSpec("a", "table", (0, 0), heading=1), "a spot has no 'heading'; it is 'yaw'"),
        (lambda: SpotSpec("a", "table", (0, 0), yaw=(1.0, 0.5)), "'yaw' should be the lowest heading first"),
        (lambda: SpotSpec("a", "table", (0, 0), yaw=(1, 2, 3)), "'yaw' should be 2 numbers"),
        (lambda: box(distance=0.2), "'distance' is for an object that starts 'beside' another one"),
        (lambda: Goal("a", "b", angle_tolerance=10.0), "'angle_tolerance'"),
        (lambda: Goal("a", "b", heigth=1), "a goal has no 'heigth'; did you mean 'height'"),
    ],
)
def test_arguments_that_there_are_not_are_named_with_the_right_one(made, words):
    with pytest.raises(FieldError, match=words):
        made()
