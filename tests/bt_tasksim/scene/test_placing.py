"""Fixtures that stand elsewhere in each world."""

from __future__ import annotations

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, NoDrawError
from bt_tasksim.scene.placing import draw_fixtures
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.scene.specs import FixtureSpec


def of_chest(seed, **said):
    scene = Scene(fixtures=[FixtureSpec("chest", **said)], objects={"cup": "inside drawer"})
    world = scene.sample(seed)
    (chest,) = (fixture for fixture in world.fixtures if fixture.name == "chest")
    return world, np.array(chest.pose)


def test_it_stands_within_its_area_and_headings():
    found = np.array([of_chest(k, at=(0.6, 0.1), area=(0.05, 0.02), yaw=(-0.3, 0.1))[1] for k in range(12)])
    assert np.all(abs(found[:, :2] - [0.6, 0.1]) <= [0.05, 0.02])
    assert np.ptp(found[:, 0]) > 0.02 and np.ptp(found[:, 1]) > 0.01
    turned = poses.rotation_vector(found[:, 3:])[:, 2]
    assert np.all((turned >= -0.3) & (turned <= 0.1)) and np.ptp(turned) > 0.1


def test_its_parts_and_what_is_in_them_go_along():
    world, chest = of_chest(3, area=(0.05, 0.05), yaw=(-0.4, 0.4))
    drawer = next(actor for actor in world.objects if actor.name == "drawer")
    cup = next(actor for actor in world.objects if actor.name == "cup")
    local = poses.multiply(poses.inverse(chest), np.array(drawer.pose))
    assert local[3:] == pytest.approx([1, 0, 0, 0]) and local[0] == pytest.approx(0.1125)
    inside = poses.transform(poses.inverse(np.array(drawer.pose)), np.array(cup.pose[:3]))
    assert np.all(abs(inside[:2]) < np.array(drawer.size[:2]) / 2)


def test_the_same_seed_gives_the_same_place():
    assert np.array_equal(of_chest(5, area=(0.05, 0.05))[1], of_chest(5, area=(0.05, 0.05))[1])


def test_none_stands_in_another():
    scene = Scene(
        fixtures=[
            FixtureSpec("stand", at=(0.5, 0.35), area=(0.03, 0.03)),
            FixtureSpec("chest", at=(0.6, -0.05), area=(0.05, 0.2)),
        ]
    )
    for seed in range(8):
        scene.sample(seed)


def test_where_there_is_no_room_it_says_so():
    # The middle of the area is free, and nearly all of the rest is in the other chest.
    crowded = [FixtureSpec("chest", at=(0.6, 0.0)), FixtureSpec("stand", at=(0.76, 0.0), area=(0.02, 0.3))]
    with pytest.raises(InputError, match="in one another"):
        Scene(fixtures=crowded)
    seen = Scene(fixtures=[FixtureSpec("stand", at=(0.76, 0.3), area=(0.02, 0.02)), crowded[0]])
    moved = FixtureSpec("chest", at=(0.6, 0.0), area=(0.0, 0.0), yaw=(0.0, 0.0))
    with pytest.raises(NoDrawError, match="no room"):
        draw_fixtures([*seen.fixtures, moved], np.random.default_rng(0))


@pytest.mark.parametrize("said", [{"area": (0.1,)}, {"yaw": (1.0, 0.0)}, {"area": (-0.1, 0.1)}])
def test_odd_ranges_are_refused(said):
    with pytest.raises(InputError):
        FixtureSpec("chest", **said)


def test_a_scene_file_says_it(tmp_path):
    file = tmp_path / "kitchen.yaml"
    file.write_text(
        "fixtures: [{fixture: chest, at: [0.6, 0.0], area: [0.02, 0.03], yaw: [-0.1, 0.1]}]\n"
        "objects: {cup: on table}\n"
    )
    (_, chest) = load_scene(file).fixtures
    assert chest.area == (0.02, 0.03) and chest.yaw == (-0.1, 0.1)
