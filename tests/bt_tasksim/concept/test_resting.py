"""What stands is put onto what it stands on, whatever it is seen to be wrong by; what leans is left alone."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.concept.resting import at_rest
from bt_tasksim.core import poses
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec

SCENE = Scene(
    "panda",
    fixtures=["table", "shelf", "tray"],
    objects={
        "box": ObjectSpec("box", on="table", centre=(-0.05, -0.15), area=(0.02, 0.02)),
        "cube": ObjectSpec("cube", on="table", centre=(-0.05, 0.0), area=(0.02, 0.02)),
        "top": "cylinder on box",
        "cup": "cup on lower_board",
    },
)


def world_of(seed):
    drawn = SCENE.sample(seed)
    return drawn.world_model(["left", "right"], 0.08), np.array([actor.pose for actor in drawn.objects])


@given(st.integers(0, 50), st.integers(0, 2**32 - 1))
def test_heights_and_tilts_that_are_seen_wrong_are_put_right(seed, errors):
    world, true = world_of(seed)
    rng = np.random.default_rng(errors)
    off = rng.uniform(-1.0, 1.0, true.shape)
    seen = true.copy()
    seen[:, :3] += off[:, :3] * [0.004, 0.004, 0.02]
    turned = poses.from_rotation_vector(off[:, 3:6] * 0.06)
    seen[:, 3:] = poses.quat_multiply(turned, true[:, 3:])
    found = at_rest(world, seen)
    assert np.allclose(found[:, 2], true[:, 2], atol=1e-6)
    assert np.array_equal(found[:, :2], seen[:, :2])
    for k, model in enumerate(world.objects):
        if not model.cubic:
            assert poses.tilt(found[k, 3:]) < 1e-6
        assert poses.angle_between(found[k, 3:], seen[k, 3:]) <= poses.tilt(seen[k, 3:]) + 1e-6
    assert np.allclose(at_rest(world, found), found, atol=1e-9), "and once more changes nothing"


def test_what_no_fixture_carries_carries_nothing():
    """A goal in the air, a centimetre above where a cube stands on the table, is not what it stands on."""
    world, seen = world_of(2)
    air = dataclasses.replace(
        world.places["table"], name="goal", fixture="", pose=seen[1] + np.eye(7)[2] * -0.01
    )
    floating = dataclasses.replace(world, places={**world.places, "goal": air})
    assert np.array_equal(at_rest(floating, seen), at_rest(world, seen))


def test_a_cube_may_lie_on_any_face():
    world, seen = world_of(3)
    tipped = poses.from_rotation_vector(np.array([np.pi / 2 + 0.05, 0.0, 0.0]))
    seen[1, 3:] = poses.quat_multiply(seen[1, 3:], tipped)
    axes = poses.to_matrix(at_rest(world, seen)[1, 3:])
    assert np.max(np.abs(axes[2])) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "change",
    [
        lambda pose: np.concatenate([pose[:3], poses.from_rotation_vector(np.array([0.3, 0.0, 0.0]))]),
        lambda pose: pose + np.array([0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0.0]),
        lambda pose: pose + np.array([-3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        lambda pose: np.full(7, np.nan),
    ],
    ids=["leans", "is held", "is nowhere", "was not seen"],
)
def test_what_does_not_stand_is_left_as_it_is_seen(change):
    world, seen = world_of(1)
    seen[2] = change(seen[2])
    assert np.array_equal(at_rest(world, seen)[2], seen[2], equal_nan=True)


@pytest.mark.parametrize("height", [-0.012, -0.004, 0.004, 0.012])
def test_a_part_of_furniture_is_left_on_its_joint_whatever_it_is_just_above(height):
    """A button that seems to stand a little above or within its console, and a cube that stands on it."""
    scene = Scene(
        "panda",
        fixtures=["button"],
        objects={"cube": ObjectSpec("cube", on="table", centre=(-0.1, 0.3), area=(0.02, 0.02))},
    )
    drawn = scene.sample(3)
    world, seen = (
        drawn.world_model(["left", "right"], 0.08),
        np.array([actor.pose for actor in drawn.objects]),
    )
    button, cube = world.object_index("button"), world.object_index("cube")
    seen[button, 2] += height
    top = seen[button, 2] + world.object("button").extent[2] / 2
    seen[cube, :3] = [*seen[button, :2], top + world.object("cube").extent[2] / 2 + 0.003]
    found = at_rest(world, seen)
    assert np.array_equal(found[button], seen[button])
    assert found[cube, 2] == pytest.approx(top + world.object("cube").extent[2] / 2, abs=1e-6)


def test_furniture_carries_beside_its_places_too_where_there_is_room():
    """The table's top is larger than its named region; the rim of a tray is no place to stand."""
    world, true = world_of(3)
    box, tray = world.object_index("box"), world.places["tray"]
    seen = true.copy()
    seen[box, :3] = [-0.1, 0.2, true[box, 2] + 0.004]
    place = world.places["table"]
    assert seen[box, 0] < place.pose[0] - place.extent[0] / 2, "it is beside the place"
    assert at_rest(world, seen)[box, 2] == pytest.approx(true[box, 2], abs=1e-6)
    walls = [b for b in world.obstacles if b.fixture == tray.fixture and min(b.size[:2]) < 0.02]
    half = walls[0].size[2] / 2 + world.object("box").extent[2] / 2
    seen[box, :3] = walls[0].pose[:3] + np.eye(3)[2] * (half + 0.004)
    assert at_rest(world, seen)[box, 2] == seen[box, 2]
