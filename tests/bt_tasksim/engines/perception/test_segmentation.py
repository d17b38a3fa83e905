"""Pixels go to the object whose colour they have, in light and in shade, and never to a fixture."""

import numpy as np
import pytest
from raycast import CAMERA, TABLE, box, image

from bt_tasksim.core import poses
from bt_tasksim.core.world import Obstacle
from bt_tasksim.engines.perception.segmentation import NEUTRAL, classify, find_segments, outside
from bt_tasksim.scene.shapes import KINDS

SHELF = [(0.72, 0.53, 0.34), (0.62, 0.44, 0.27)]
OTHERS = np.array([NEUTRAL, TABLE, *SHELF])
COLOURS = KINDS["box"].colours
TABLE_BOX = Obstacle(np.array([0.4, 0, -0.025, 1, 0, 0, 0]), (1.4, 1.6, 0.05), "table")


def swatches(colours, brightness):
    linear = np.array(colours) ** 2.2 * brightness
    return np.round(255 * linear ** (1 / 2.2)).astype(np.uint8)[None]


@pytest.mark.parametrize("brightness", [0.15, 0.5, 1.0])
def test_shading_does_not_change_whose_a_pixel_is(brightness):
    masks = classify(swatches(COLOURS, brightness), COLOURS, OTHERS)
    assert np.array_equal(np.stack(masks, -1)[0], np.eye(len(COLOURS), dtype=bool))


def test_fixtures_robots_and_black_belong_to_no_object():
    others = [*OTHERS, (0.5, 0.5, 0.52), (0.1, 0.1, 0.1), (0, 0, 0)]
    assert not np.any(classify(swatches(others, 0.8), COLOURS, OTHERS))


def test_an_object_of_a_fixtures_colour_keeps_its_pixels():
    masks = classify(swatches([SHELF[0]], 0.7), [SHELF[0]], OTHERS)
    assert masks[0].all()


def test_objects_of_one_colour_share_their_pixels():
    first, second = classify(swatches(COLOURS[:1], 1.0), [COLOURS[0]] * 2, OTHERS)
    assert first.all()
    assert second.all()


def test_outside_measures_from_a_turned_box():
    turned = Obstacle(poses.pose([1, 0, 0], poses.yaw(np.pi / 4)), (0.2, 0.2, 0.2), "f")
    corner = np.sqrt(2) * 0.1
    points = np.array([[1 + corner + 0.004, 0, 0], [1 + corner + 0.02, 0, 0], [1, 0, 0]])
    assert outside(points, [turned], 0.01).tolist() == [False, True, False]


def test_a_segment_is_what_the_object_shows_without_its_foot():
    depth = box(poses.pose([0.5, 0, 0.05], poses.yaw(0.4)), (0.07, 0.05, 0.1))
    seen, which = image([(depth, COLOURS[0])])
    mask = classify(seen.colour, [COLOURS[0]], OTHERS)[0]
    assert np.array_equal(mask, which == 1)
    (segment,) = find_segments(CAMERA, seen.depth, mask, [TABLE_BOX], size=0.13)
    assert not np.any(segment.mask & (which != 1))
    assert segment.pixels > 0.9 * np.sum(which == 1)
    assert segment.points[:, 2].min() > 0.005
    assert segment.points[:, 2].max() == pytest.approx(0.1, abs=1e-3)


def test_what_a_finger_parts_is_one_segment_and_a_far_thing_another():
    pose = poses.pose([0.5, 0, 0.05])
    finger = box(poses.pose([0.5, 0.05, 0.09]), (0.012, 0.01, 0.2))
    far = box(poses.pose([0.5, -0.4, 0.03]), (0.04, 0.04, 0.06))
    seen, which = image(
        [(box(pose, (0.07, 0.05, 0.1)), COLOURS[0]), (finger, (0.2, 0.2, 0.2)), (far, COLOURS[0])]
    )
    mask = classify(seen.colour, [COLOURS[0]], OTHERS)[0]
    segments = find_segments(CAMERA, seen.depth, mask, [TABLE_BOX], size=0.13)
    assert len(segments) == 2
    assert not np.any(segments[0].mask & (which == 3))
    assert segments[0].pixels > 0.9 * np.sum(which == 1)


def test_nothing_of_the_colour_is_no_segment():
    seen, _ = image([])
    mask = classify(seen.colour, [COLOURS[0]], OTHERS)[0]
    assert find_segments(CAMERA, seen.depth, mask, [TABLE_BOX], size=0.1) == []
