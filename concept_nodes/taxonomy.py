"""Contact states and the tasks that break, keep or make them.

A surface that touches an object with unit normal ``n`` (pointing into the object) admits the
infinitesimal motions ``t`` with ``n . t >= 0``. Several contacts admit the polyhedral cone
``C = {t : n_i . t >= 0}``, which is described by three dimensions:

* ``m``, maintaining: of the lineality space of ``C``, the motions along which every contact is kept;
* ``d``, detaching: ``dim C - m``, the motions by which a contact opens and which cannot be undone;
* ``c``, constraining: ``3 - dim C``, the motions that contacts on both sides forbid.

All ten triples with ``m + d + c = 3`` occur. Grouped by ``c`` and by whether ``d`` is zero they give seven
classes. Rotations about a point ``o`` obey the same cone with the normals ``(p_i - o) x n_i``.

After Kuhn and Tucker's theory of linear inequalities as used by Ikeuchi and Suehiro, "Toward an assembly
plan from observation", IEEE Trans. Robotics and Automation 10(3), 1994.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bt_tasksim.concept.contact import Change as Change
from bt_tasksim.concept.contact import ContactChange, Freedom
from bt_tasksim.concept.contact import ContactState as ContactState
from bt_tasksim.core.errors import InputError, nearest


class Dimensions(NamedTuple):
    """Maintaining, detaching and constraining dimensions of a cone of feasible motions; their sum is 3."""

    m: int
    d: int
    c: int


@dataclass(frozen=True)
class ContactTask:
    """A task as a change of contact state.

    Attributes:
        name: Name of the concept.
        motion: Whether the contact state is that of translation or of rotation.
        before: Class of contact state before the task.
        after: Class of contact state after the task.
    """

    name: str
    motion: Freedom
    before: ContactState
    after: ContactState

    @property
    def change(self) -> Change:
        """Whether the task breaks, keeps or makes the contact state."""
        return ContactChange(self.before, self.after, self.motion).change


_CLASS_OF = {
    (0, False): ContactState.NC,
    (0, True): ContactState.PC,
    (1, False): ContactState.TR,
    (1, True): ContactState.OT,
    (2, False): ContactState.PR,
    (2, True): ContactState.OP,
    (3, False): ContactState.FT,
}

TASKS: tuple[ContactTask, ...] = (
    ContactTask("pick", "translation", ContactState.PC, ContactState.NC),
    ContactTask("bring", "translation", ContactState.NC, ContactState.NC),
    ContactTask("place", "translation", ContactState.NC, ContactState.PC),
    ContactTask("unblock", "translation", ContactState.OT, ContactState.TR),
    ContactTask("slide", "translation", ContactState.TR, ContactState.TR),
    ContactTask("block", "translation", ContactState.TR, ContactState.OT),
    ContactTask("open_drawer", "translation", ContactState.OP, ContactState.PR),
    ContactTask("adjust_drawer", "translation", ContactState.PR, ContactState.PR),
    ContactTask("close_drawer", "translation", ContactState.PR, ContactState.OP),
    ContactTask("hold", "translation", ContactState.FT, ContactState.FT),
    ContactTask("open_door", "rotation", ContactState.OP, ContactState.PR),
    ContactTask("adjust_door", "rotation", ContactState.PR, ContactState.PR),
    ContactTask("close_door", "rotation", ContactState.PR, ContactState.OP),
)
"""The tasks of the taxonomy, each with its time reverse (a task that keeps a state is its own)."""


def translation_normals(normals: ArrayLike) -> NDArray[np.float64]:
    """Normals of the cone of feasible translations: the contact normals themselves.

    Args:
        normals: (n, 3) contact normals that point into the object; their length is of no account.

    Returns:
        (n, 3) unit normals.

    Raises:
        InputError: The shape is wrong, or a normal is zero or not finite.
    """
    array = np.asarray(normals, dtype=np.float64)
    if array.size == 0:
        return np.zeros((0, 3))
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"contact normals have shape {array.shape}; give an array of shape (n, 3)")
    lengths = np.linalg.norm(array, axis=1)
    bad = np.flatnonzero(~np.isfinite(lengths) | (lengths < 1e-9))
    if bad.size:
        raise InputError(f"contact normal {bad[0]} is zero or not finite; give a direction")
    unit: NDArray[np.float64] = array / lengths[:, None]
    return unit


def rotation_normals(normals: ArrayLike, points: ArrayLike, centre: ArrayLike) -> NDArray[np.float64]:
    """Normals of the cone of feasible rotations about a point: ``(p_i - o) x n_i``.

    Args:
        normals: (n, 3) contact normals that point into the object.
        points: (n, 3) contact points in metres.
        centre: (3,) point ``o`` in metres, about which the object may turn.

    Returns:
        (k, 3) unit normals with k <= n: a contact whose normal passes through the centre (closer than a
        nanometre) does not restrict rotation about it and is left out.

    Raises:
        InputError: A shape is wrong, or a normal is zero or not finite.
    """
    unit = translation_normals(normals)
    at = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    if len(at) != len(unit):
        raise InputError(f"{len(unit)} contact normals but {len(at)} contact points; give one point each")
    moments = np.cross(at - np.asarray(centre, dtype=np.float64), unit)
    arms = np.linalg.norm(moments, axis=1)
    keep = arms > 1e-9
    return np.asarray(moments[keep] / arms[keep][:, None], dtype=np.float64)


def dimensions(normals: ArrayLike, tolerance: float = 1e-6) -> Dimensions:
    """Dimensions (m, d, c) of the cone ``{t : n_i . t >= 0}``.

    The cone is generated by its lineality space and its extreme rays, each of which is at right angles to
    two independent vectors out of the normals and a basis of the lineality space.

    Args:
        normals: (n, 3) normals from :func:`translation_normals` or :func:`rotation_normals`.
        tolerance: Sine of the angle below which directions count as equal. Measured normals need the
            angle by which they are uncertain.

    Returns:
        The three dimensions.

    Raises:
        InputError: The shape is wrong, or a normal is zero or not finite.
    """
    unit = translation_normals(normals)
    if not len(unit):
        return Dimensions(3, 0, 0)
    rank = _rank(unit, tolerance)
    lineality = np.linalg.svd(unit)[2][rank:]
    rows = np.vstack([unit, lineality])
    first, second = np.triu_indices(len(rows), k=1)
    rays = np.cross(rows[first], rows[second])
    lengths = np.linalg.norm(rays, axis=1)
    rays = rays[lengths > 2 * tolerance] / lengths[lengths > 2 * tolerance, None]
    rays = np.vstack([rays, -rays])
    feasible = rays[(rays @ unit.T >= -tolerance).all(axis=1)]
    spanned = _rank(np.vstack([feasible, lineality]), tolerance)
    m = 3 - rank
    return Dimensions(m, spanned - m, 3 - spanned)


def contact_state(triple: tuple[int, int, int]) -> ContactState:
    """Class of a triple (m, d, c).

    Args:
        triple: Dimensions from :func:`dimensions`.

    Returns:
        The class.

    Raises:
        InputError: The numbers are negative or their sum is not 3, so that no cone has them.
    """
    m, d, c = triple
    if min(m, d, c) < 0 or m + d + c != 3:
        raise InputError(f"no contact state has (m, d, c) = ({m}, {d}, {c}): the three must add up to 3")
    return _CLASS_OF[c, d > 0]


def translation_state(normals: ArrayLike, tolerance: float = 1e-6) -> ContactState:
    """Class of the contact state for translation; arguments as in :func:`dimensions`."""
    return contact_state(dimensions(translation_normals(normals), tolerance))


def rotation_state(
    normals: ArrayLike, points: ArrayLike, centre: ArrayLike, tolerance: float = 1e-6
) -> ContactState:
    """Class of the contact state for rotation about a point; arguments as in :func:`rotation_normals`."""
    return contact_state(dimensions(rotation_normals(normals, points, centre), tolerance))


def tasks_between(
    before: ContactState, after: ContactState, motion: Freedom = "translation"
) -> tuple[ContactTask, ...]:
    """Tasks that lead from one contact state to another.

    Args:
        before: Class before the task.
        after: Class after the task.
        motion: Which kind of motion the classes speak of.

    Returns:
        The tasks, none where the taxonomy has no single task for the change.
    """
    return tuple(t for t in TASKS if (t.motion, t.before, t.after) == (motion, before, after))


def task(name: str) -> ContactTask:
    """The task of this name.

    Raises:
        InputError: The taxonomy has no such task.
    """
    for candidate in TASKS:
        if candidate.name == name:
            return candidate
    raise InputError(f"the taxonomy has no task '{name}'{nearest(name, [t.name for t in TASKS])}")


def time_reverse(forward: ContactTask) -> ContactTask:
    """The task that one sees when another one is watched backwards: pick and place, open and close."""
    (backward,) = tasks_between(forward.after, forward.before, forward.motion)
    return backward


def _rank(vectors: NDArray[np.float64], tolerance: float) -> int:
    return int(np.linalg.matrix_rank(vectors, tol=2 * tolerance)) if len(vectors) else 0
