"""Depth images of a box or a cylinder over a table, computed ray by ray: no rendering engine is needed."""

import dataclasses

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.engines.cameras import CAMERAS, unproject
from bt_tasksim.engines.images import Image

CAMERA = dataclasses.replace(CAMERAS["scene"], size=(480, 360)).model("scene")
TABLE = (0.80, 0.72, 0.60)


def cloud(camera, depth):
    """Points ``(height, width, 3)``, base frame, of a depth image ``(height, width)``."""
    rows, columns = np.mgrid[0 : camera.height, 0 : camera.width]
    return unproject(camera, rows, columns, depth)


def rays():
    """Directions ``(height, width, 3)`` that reach depth 1, base frame."""
    ones = np.ones((CAMERA.height, CAMERA.width))
    return cloud(CAMERA, ones) - CAMERA.pose[:3]


def box(pose, size):
    """Depth ``(height, width)`` of a box, infinite beside it."""
    q = poses.quat_conjugate(pose[3:])
    origin, direction = poses.rotate(q, CAMERA.pose[:3] - pose[:3]), poses.rotate(q, rays())
    half = np.array(size) / 2
    with np.errstate(divide="ignore"):
        a, b = (-half - origin) / direction, (half - origin) / direction
    near, far = np.max(np.minimum(a, b), -1), np.min(np.maximum(a, b), -1)
    return np.where((near < far) & (near > 0), near, np.inf)


def cylinder(pose, radius, height):
    """Depth ``(height, width)`` of a solid cylinder about its z axis."""
    q = poses.quat_conjugate(pose[3:])
    o, d = poses.rotate(q, CAMERA.pose[:3] - pose[:3]), poses.rotate(q, rays())
    a = d[..., 0] ** 2 + d[..., 1] ** 2
    b = o[0] * d[..., 0] + o[1] * d[..., 1]
    c = o[0] ** 2 + o[1] ** 2 - radius**2
    root = np.sqrt(np.maximum(b * b - a * c, 0))
    slab = np.sort(np.stack([(-height / 2 - o[2]) / d[..., 2], (height / 2 - o[2]) / d[..., 2]]), axis=0)
    near, far = np.maximum((-b - root) / a, slab[0]), np.minimum((-b + root) / a, slab[1])
    return np.where((b * b > a * c) & (near < far), near, np.inf)


def table():
    """Depth of the plane z = 0."""
    with np.errstate(divide="ignore"):
        t = -CAMERA.pose[2] / rays()[..., 2]
    return np.where(t > 0, t, 10.0)


def image(things):
    """An RGB-D image of ``(depth, colour)`` pairs over the table, and the index of what each pixel shows.

    Colours are darkened to the right, as a light from the left would.
    """
    depths = np.stack([table(), *(d for d, _ in things)])
    which = np.argmin(depths, axis=0)
    depth = np.min(depths, axis=0)
    colours = np.array([TABLE, *(c for _, c in things)])
    shade = np.linspace(1.0, 0.5, CAMERA.width)[None, :, None]
    pixels = np.round(255 * (colours[which] ** 2.2 * shade) ** (1 / 2.2)).astype(np.uint8)
    return Image(CAMERA, pixels, depth.astype(np.float32)), which
