"""A look: the best of several sightings, and what stands on what is seen."""

from types import SimpleNamespace

import numpy as np
import pytest
from raycast import CAMERA, box, cloud, image

from bt_tasksim.core import poses
from bt_tasksim.engines.perception.camera_errors import PERFECT
from bt_tasksim.engines.perception.looking import Capture, Looker, Sighting, best_of
from bt_tasksim.engines.perception.registration import DepthView, Fit
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec

SMALL, LARGE = (0.05, 0.03, 0.06), (0.09, 0.08, 0.06)
NOTHING = np.full((2, 7), np.nan)


def sighting(camera, pixels, cost, rows=slice(0, 10), doubt=0.1):
    mask = np.zeros((40, 40), bool)
    mask[rows] = True
    return Sighting(Fit(np.zeros(7), 0.0, cost), camera, SimpleNamespace(mask=mask, pixels=pixels), doubt)


def test_the_sighting_that_explains_all_pictures_best_counts():
    seen = [(0, sighting("left", 400, 0.1, doubt=0.2)), (0, sighting("right", 50, 0.12, doubt=0.15))]
    assert best_of(seen)[0].camera == "right"
    assert best_of(seen[::-1])[0].camera == "right"


def test_what_one_camera_sees_counts_against_what_fits_in_the_others_picture():
    spec = {"it": ObjectSpec(("box",), on="table", size=(SMALL, SMALL), area=(0, 0))}
    world = Scene("panda", objects=spec).sample(2)
    actor = world.objects[0]
    looker = Looker(world, world.world_model(["left", "right"], 0.08), PERFECT, ["scene"])
    right = np.array(actor.pose)
    wrong = poses.multiply(right, poses.pose([0.0, 0.0, 0.0], poses.yaw(np.pi / 2)))
    seen, which = image([(box(right, actor.size), actor.colour)])
    whole = DepthView(CAMERA, seen.depth, cloud(CAMERA, seen.depth)[which == 1])
    part = DepthView(CAMERA, seen.depth, whole.points[: len(whole.points) // 10])
    right_doubt, wrong_doubt = (
        looker._doubt(0, Fit(pose, 0.001, 0.0), part, [[whole]]) for pose in (right, wrong)
    )
    assert right_doubt < 0.1 < wrong_doubt - 0.05
    assert looker._doubt(0, Fit(wrong, 0.001, 0.0), part, []) == pytest.approx(0.1)


def test_what_stands_on_something_is_found_upright_at_the_first_look():
    spec = {
        "low": ObjectSpec(("box",), on="table", size=(LARGE, LARGE), area=(0, 0)),
        "high": ObjectSpec(("box",), on="low", size=(SMALL, SMALL)),
    }
    world = Scene("panda", objects=spec).sample(2)
    things = [(box(np.array(actor.pose), actor.size), actor.colour) for actor in world.objects]
    looker = Looker(world, world.world_model(["left", "right"], 0.08), PERFECT, ["scene"])
    capture = Capture({"scene": image(things)[0]}, NOTHING, ((False, False),) * 2)
    found = looker.look(capture).sightings
    for k, actor in enumerate(world.objects):
        pose = found[k].fit.pose
        assert np.linalg.norm(pose[:3] - np.array(actor.pose[:3])) < 0.003
        assert poses.z_axis(pose[3:])[2] > 0.999
