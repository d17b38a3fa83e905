"""A rendering engine from outside: the table from above as a map, one colour an object, 5 mm a pixel."""

import numpy as np

from bt_tasksim.core.registry import register
from bt_tasksim.engines.base import RenderingEngine
from bt_tasksim.engines.images import CameraModel, Image

CORNER, PIXEL = np.array([0.0, -0.8]), 0.005  # metres


@register("engine/rendering", "map")
class MapRendering(RenderingEngine):
    def __init__(self, robot):
        self.rows, self.columns = 240, 320

    def reset(self, configuration):
        self.actors = configuration.objects

    def render(self, state, camera, *, depth=False, size=None):
        colour = np.full((self.rows, self.columns, 3), 255, np.uint8)
        for actor, pose in zip(self.actors, state.objects, strict=True):
            self.paint(colour, pose[:2], max(actor.size[:2]) / 2, actor.colour)
        self.paint(colour, state.tool_pose[:2], 0.01, (0.0, 0.0, 0.0))
        pose = np.array([*CORNER, 1.0, 1.0, 0.0, 0.0, 0.0])
        model = CameraModel(camera, self.columns, self.rows, np.diag([1 / PIXEL, 1 / PIXEL, 1.0]), pose)
        return Image(model, colour, None)

    def paint(self, picture, centre, radius, colour):
        row, column = ((centre - CORNER) / PIXEL).astype(int)
        r = int(radius / PIXEL)
        picture[max(row - r, 0) : row + r + 1, max(column - r, 0) : column + r + 1] = 255 * np.array(colour)
