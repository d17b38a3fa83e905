"""Where a place or the top of an object is, and how an object stands there: for a batch of worlds."""

from __future__ import annotations

from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes.surface import top_frame, upright
from bt_tasksim.core import poses
from bt_tasksim.core.fact_arrays import ObjectFacts, take_rows
from bt_tasksim.core.poses import Array, array_namespace


def destination(seen: Seen, name: str) -> tuple[Array, Array]:
    """Frames ``(N, 7)`` of a place or of the top of an object, and their rims' heights ``(N,)`` in metres."""
    if name in seen.world.place_columns:
        place = seen.place(name)
        return place.pose, place.rim
    frame = top_frame(seen.object(name), seen.model(name).standing_height)
    return frame, array_namespace(frame).zeros_like(frame[:, 0])


def standing_pose(
    frame: Array, now: Array, model: ObjectFacts, height: Array | float = 0.0, towards: Array | None = None
) -> Array:
    """Poses ``(N, 7)`` of an object that stands above a frame, turned as its symmetry allows.

    Args:
        frame: Poses ``(N, 7)`` of the place.
        now: Present poses ``(N, 7)`` of the object.
        model: The object.
        height: Free height below it, metres, one for all or ``(N,)``.
        towards: Rotations ``(N, 4)`` of the object that are preferred; by default the present ones.
    """
    towards = now[:, 3:] if towards is None else towards
    xp = array_namespace(now)
    centre = model.standing_height + height
    nothing = xp.zeros_like(centre)
    position = poses.transform(frame, xp.stack([nothing, nothing, centre], axis=-1))
    nearest = _nearest_rotation(frame[:, 3:], model, towards)
    best = xp.where(model.revolved[:, None], upright(frame, now), nearest)
    return xp.concat([position, best], axis=-1)


def _nearest_rotation(frame: Array, model: ObjectFacts, towards: Array) -> Array:
    """Of the rotations ``(N, 4)`` in which an object looks the same, the one that is the shortest turn away.

    Of equal ones it is the first.
    """
    xp = array_namespace(towards)
    ways = poses.quat_multiply(frame[:, None, :], model.rotations)
    # Alike as rotations where q and -q are: the larger |q . r|, the shorter the turn.
    nearness = abs(poses.dot(ways, towards[:, None, :]))
    counts = xp.where(model.rotation_counts, xp.round(nearness * 1e9), -xp.ones_like(nearness))
    return take_rows(ways, xp.argmax(counts, axis=1))
