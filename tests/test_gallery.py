"""docs/gallery.md: its pictures are small, and made of runs that succeed."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from bt_tasksim.core.errors import MachineError
from bt_tasksim.trees.load import scenarios
from tools import strips


def test_a_strip_is_made(tmp_path):
    try:
        strips.main(["press_button", "--frames", "2", "--out", str(tmp_path)])
    except MachineError as error:
        pytest.skip(f"no pictures on this machine: {error}")
    (made,) = tmp_path.iterdir()
    picture = cv2.imread(str(made))
    assert picture.shape == (strips.SIZE[1], 2 * strips.SIZE[0], 3)
    first, last = np.split(picture.astype(int), 2, axis=1)
    assert picture.std() > 20 and np.abs(first - last).mean() > 2, "the hand has come"


def test_moments_are_where_something_moves():
    still, way = np.tile([0.0, 0, 0, 1, 0, 0, 0], (40, 1)), np.linspace(0.0, 0.4, 21)
    thing = still.copy()
    thing[10:31, 0], thing[31:, 0] = way, way[-1]
    states = [SimpleNamespace(tool_pose=t, objects=o[None]) for t, o in zip(still, thing, strict=True)]
    found = strips.moments(states)
    assert found[0] == 0 and found == sorted(found)
    assert np.diff(thing[found, 0]) == pytest.approx(np.full(strips.FRAMES - 1, 0.1), abs=0.021)


def test_the_page_shows_the_pictures_that_are_there():
    shown = {picture.stem: picture.stat().st_size for picture in strips.PICTURES.glob("*.jpg")}
    assert set(shown) <= set(scenarios()) and max(shown.values()) < 60_000
    assert f"{strips.BEGIN}\n\n{strips.page()}{strips.END}" in strips.PAGE.read_text(encoding="utf-8")
