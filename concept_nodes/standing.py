"""The poses in which an object may stand somewhere, up to its symmetry: all of them, in one world."""

from __future__ import annotations

import numpy as np

from bt_tasksim.concept_nodes.surface import top_frame
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.fact_making import rotations
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel

HEADINGS = 12
"""Headings that are tried where any will do."""
TIPPED = (0.07, 0.14)
"""Radians by which something may lean that is put down where it cannot stand upright at once: what has turned
in a hand of fingers that swing. It stands up when it is let go. Less than `place.LEANING`."""

ASIDE = 0.01
"""Metres beside where something should stand at which it is put down where it cannot be put there itself:
half of what `AtPose` tolerates; the rest is for errors of estimates and of the hand."""
TURNED = 0.1
"""Radians by which it is turned there then: the same of an angle."""
FARTHER = 0.014
"""The same once it is held: a grasp is chosen for `ASIDE`, and what is held moves some millimetres in the
hand as this closes."""


def standing_options(view: WorldView, target: str, reference: str, hover: float = 0.0) -> Array:
    """Poses ``(k, 7)`` of an object that stands over a place that is no container, or on another object.

    Args:
        view: The world.
        target: The object.
        reference: The place, or the other object.
        hover: Free height below it, metres.
    """
    model = view.model(target)
    frame, _ = reference_frame(view, reference)
    turns = headings() if model.symmetry == 0 and not model.cubic else rotations(model)
    position = poses.transform(frame, np.array([0.0, 0.0, standing_height(model) + hover]))
    turned = poses.quat_multiply(frame[None, 3:], turns)
    return np.concatenate([np.tile(position, (len(turned), 1)), turned], axis=-1)


def aside_options(view: WorldView, reference: str, options: Array, held: bool = False) -> Array:
    """Poses ``(m, 7)`` beside some ``(k, 7)`` over a place: nearer to the arm, farther, across, turned.

    Over another object, whose top may be small, it is only turned, and by any angle. None is in a container,
    nor beyond the place itself.

    Args:
        view: The world.
        reference: The place, or the other object.
        options: The poses.
        held: They are for what is in the hand; else for the choice of a grasp.
    """
    place = view.world.places.get(reference)
    if not len(options) or (place is not None and place.container):
        return np.zeros((0, 7))
    if place is None:
        turns = 2.0 * np.pi * np.arange(1, HEADINGS) / HEADINGS
        return _unlike(np.concatenate([_turned(options[:1], turn) for turn in turns]), options)
    frame = np.asarray(place.pose)
    towards = frame[:2] / max(float(np.linalg.norm(frame[:2])), 1e-9)
    ways = np.array([-towards, towards, (-towards[1], towards[0]), (towards[1], -towards[0])])
    moved = [_moved(options, ASIDE * way) for way in ways]
    moved += [_turned(options, angle) for angle in (TURNED, -TURNED)]
    moved += [_moved(options, FARTHER * way) for way in ways] if held else []
    every = np.concatenate(moved)
    there = abs(poses.localise(frame, every[:, :3])[:, :2] - np.asarray(place.centre))
    found: Array = every[(there <= np.asarray(place.extent) / 2).all(axis=-1)]
    return found


def _unlike(found: Array, options: Array) -> Array:
    """Those of some poses ``(k, 7)`` that are turned from all of others ``(m, 7)``."""
    angles = poses.angle_between(found[:, None, 3:], options[None, :, 3:])
    return found[angles.min(axis=1) > TURNED]


def _moved(options: Array, by: Array) -> Array:
    """The same poses ``(k, 7)`` moved over the ground by ``(2,)`` metres."""
    found: Array = options + np.array([*by, 0.0, 0.0, 0.0, 0.0, 0.0])
    return found


def _turned(options: Array, angle: float) -> Array:
    """The same poses ``(k, 7)`` turned about the upward axis, radians."""
    turned = poses.quat_multiply(poses.yaw(angle)[None], options[:, 3:])
    return np.concatenate([options[:, :3], turned], axis=-1)


def supports_of(view: WorldView, reference: str) -> frozenset[str]:
    """Names of what an object touches that stands on a place or on another object."""
    return frozenset([view.world.thing_of(reference)])


def standing_height(model: ObjectModel) -> float:
    """Height of an object's centre above what it stands on, metres."""
    return max(model.extent) / 2 if model.cubic else model.extent[2] / 2


def reference_frame(view: WorldView, name: str) -> tuple[Array, float]:
    """Frame ``(7,)`` of a place or of the top of an object, and its rim's height, metres."""
    place = view.world.places.get(name)
    if place is not None:
        return np.asarray(place.pose), place.rim
    height = np.array([standing_height(view.model(name))])
    return top_frame(view.objects[name][None], height)[0], 0.0


def headings(count: int = HEADINGS) -> Array:
    """Rotations ``(count, 4)`` about the upward axis, all around."""
    return np.array([poses.yaw(2 * np.pi * k / count) for k in range(count)])


def nearest_first(options: Array, rotation: Array) -> Array:
    """The same poses ``(k, 7)``, those first that are turned least from a rotation ``(4,)``."""
    angles = poses.angle_between(options[:, 3:], rotation[None])
    found: Array = options[np.argsort(angles, kind="stable")]
    return found


def tipped(options: Array, grip: Array) -> Array:
    """The same poses ``(4 k, 7)`` of an object, leaning by `TIPPED`, the least first.

    They lean about the tool's x axis: in the plane across it fingers swing, and turn what they close on.

    Args:
        options: Poses ``(k, 7)``.
        grip: The tool's pose ``(7,)`` in the object.
    """
    axes = poses.to_matrix(poses.multiply(options, grip[None])[:, 3:])[:, :, 0]
    leans = [angle for least in TIPPED for angle in (least, -least)]
    turns = [np.concatenate([[np.cos(a / 2)], np.sin(a / 2) * axis]) for a in leans for axis in axes]
    rotations = poses.quat_multiply(np.array(turns), np.tile(options[:, 3:], (len(leans), 1)))
    return np.concatenate([np.tile(options[:, :3], (len(leans), 1)), rotations], axis=-1)
