"""A look: the best of several sightings, one segment for each object, and what stands on what is seen."""

from types import SimpleNamespace

import numpy as np
import pytest
from raycast import box, image

from bt_tasksim.core import poses
from bt_tasksim.engines.perception.camera_errors import PERFECT
from bt_tasksim.engines.perception.looking import Capture, Looker, Sighting, shared_out
from bt_tasksim.engines.perception.registration import Fit
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec

SMALL, LARGE = (0.05, 0.03, 0.06), (0.09, 0.08, 0.06)
NOTHING = np.full((2, 7), np.nan)


def sighting(camera, pixels, cost, rows=slice(0, 10)):
    mask = np.zeros((40, 40), bool)
    mask[rows] = True
    return Sighting(Fit(np.zeros(7), 0.0, cost), camera, SimpleNamespace(mask=mask, pixels=pixels))


@pytest.mark.parametrize(
    ("left", "right", "best"),
    [((400, 0.1), (50, 0.05), "left"), ((400, 0.4), (50, 0.1), "right"), ((60, 0.1), (50, 0.1), "left")],
)
def test_of_those_that_fit_well_the_one_with_most_pixels_counts(left, right, best):
    seen = [(0, sighting("left", *left)), (0, sighting("right", *right))]
    assert shared_out(seen)[0].camera == best
    assert shared_out(seen[::-1])[0].camera == best


def test_objects_of_one_colour_do_not_have_the_same_pixels():
    same, other = slice(0, 10), slice(20, 30)
    seen = [
        (0, sighting("left", 400, 0.12, same)),
        (1, sighting("left", 400, 0.10, same)),
        (0, sighting("left", 400, 0.15, other)),
    ]
    found = shared_out(seen)
    assert found[1].fit.cost == 0.10 and found[0].fit.cost == 0.15


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
