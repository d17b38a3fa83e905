"""Contact states and the tasks that break, keep or make them.

A surface that touches an object with unit normal ``n`` (pointing into the object) admits the
infinitesimal motions ``t`` with ``n . t >= 0``. Several contacts admit the polyhedral cone
``C = {t : n_i . t >= 0}``, which is described by three dimensions:

* ``m``, maintaining: of the lineality space of ``C``, the motions along which every contact is kept;
* ``d``, detaching: ``dim C - m``, the motions by which a contact opens and which cannot be undone;
* ``c``, constraining: ``3 - dim C``, the motions that contacts on both sides forbid.

All ten triples with ``m + d + c = 3`` occur. Grouped by ``c`` and by whether ``d`` is zero they give seven
classes. Rotations about a point ``o`` obey the same cone with the normals ``(p_i - o) x n_i``. What turns
about an axis alone, as in bearings, is free to (PR), stopped one way (OP) or both ways (FT).

After Kuhn and Tucker's theory of linear inequalities as used by Ikeuchi and Suehiro, "Toward an assembly
plan from observation", IEEE Trans. Robotics and Automation 10(3), 1994. The dimensions are computed in
`bt_tasksim.concept_nodes.contact_cones`; which tasks there are is `bt_tasksim.concept_nodes.contact_tasks`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bt_tasksim.concept.contact import ContactState as ContactState
from bt_tasksim.concept.contact import Freedom
from bt_tasksim.concept_nodes.contact_cones import (
    EXACT,
    MEASURED,
    Booleans,
    Floats,
    Integers,
    cone_dimensions,
    numbers,
    unit_normals,
    vectors,
)
from bt_tasksim.core.errors import InputError
from bt_tasksim.engines.body_contacts import BodyContacts

STATES: tuple[ContactState, ...] = tuple(ContactState)
"""The classes in the order of their numbers in arrays."""
THROUGH = 1e-9
"""Metres from a centre within which a normal that is known exactly passes through it."""
LEVER = 1e-3
"""The same of a physics engine's contacts, whose points are off by some tenths of a millimetre."""


class Dimensions(NamedTuple):
    """Maintaining, detaching and constraining dimensions of a cone of feasible motions; their sum is 3."""

    m: int
    d: int
    c: int


_CLASS_OF = {
    (0, False): ContactState.NC,
    (0, True): ContactState.PC,
    (1, False): ContactState.TR,
    (1, True): ContactState.OT,
    (2, False): ContactState.PR,
    (2, True): ContactState.OP,
    (3, False): ContactState.FT,
}


def translation_normals(normals: ArrayLike) -> NDArray[np.float64]:
    """Normals of the cone of feasible translations: the contact normals themselves.

    Args:
        normals: (n, 3) contact normals that point into the object; their length is of no account.

    Returns:
        (n, 3) unit normals.

    Raises:
        InputError: The shape is wrong, or a normal is zero or not finite.
    """
    array = numbers("contact normals", normals, "give an array of shape (n, 3)")
    if array.size == 0:
        return np.zeros((0, 3))
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"contact normals have shape {array.shape}; give an array of shape (n, 3)")
    unit: NDArray[np.float64] = unit_normals(array[None], np.ones((1, len(array)), dtype=bool))[0]
    return unit


def rotation_normals(
    normals: ArrayLike, points: ArrayLike, centre: ArrayLike, lever: float = THROUGH
) -> NDArray[np.float64]:
    """Normals of the cone of feasible rotations about a point: ``(p_i - o) x n_i``.

    Args:
        normals: (n, 3) contact normals that point into the object.
        points: (n, 3) contact points in metres.
        centre: (3,) point ``o`` in metres, about which the object may turn.
        lever: Metres from the centre within which a normal passes through it.

    Returns:
        (k, 3) unit normals with k <= n: a contact whose normal passes through the centre does not restrict
        rotation about it and is left out.

    Raises:
        InputError: A shape is wrong, or a normal is zero or not finite.
    """
    unit = translation_normals(normals)
    about = vectors("the centre", centre, (3,))
    at = vectors("contact points", points, (-1, 3))
    _check_lever(lever)
    if len(at) != len(unit):
        raise InputError(f"{len(unit)} contact normals but {len(at)} contact points; give one point each")
    moments = np.cross(at - about, unit)
    arms = np.linalg.norm(moments, axis=1)
    keep = arms > lever
    return np.asarray(moments[keep] / arms[keep][:, None], dtype=np.float64)


def _check_lever(lever: float) -> None:
    if not 0.0 <= lever < math.inf:
        raise InputError(f"the lever of a rotation is {lever} m; give a finite one that is not negative")


def dimensions(normals: ArrayLike, tolerance: float = EXACT) -> Dimensions:
    """Dimensions (m, d, c) of the cone ``{t : n_i . t >= 0}``.

    Args:
        normals: (n, 3) normals from :func:`translation_normals` or :func:`rotation_normals`.
        tolerance: Radians up to which directions count as equal. Measured normals need twice the angle by
            which they are uncertain.

    Returns:
        The three dimensions.

    Raises:
        InputError: The shape is wrong, or a normal is zero or not finite.
    """
    unit = translation_normals(normals)
    found = cone_dimensions(unit[None], np.ones((1, len(unit)), dtype=bool), tolerance)
    return Dimensions(*found[0].tolist())


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
    if any(each != int(each) for each in triple) or min(m, d, c) < 0 or m + d + c != 3:
        raise InputError(f"no contact state has (m, d, c) = ({m}, {d}, {c}): the three must add up to 3")
    return _CLASS_OF[c, d > 0]


def translation_state(normals: ArrayLike, tolerance: float = EXACT) -> ContactState:
    """Class of the contact state for translation; arguments as in :func:`dimensions`."""
    return contact_state(dimensions(normals, tolerance))


def rotation_state(
    normals: ArrayLike,
    points: ArrayLike,
    centre: ArrayLike,
    tolerance: float = EXACT,
    lever: float = THROUGH,
) -> ContactState:
    """Class of the contact state for rotation about a point; arguments as in :func:`rotation_normals`."""
    return contact_state(dimensions(rotation_normals(normals, points, centre, lever), tolerance))


def contact_states(normals: Floats, there: Booleans, tolerance: float = MEASURED) -> Integers:
    """Classes of many sets of contacts for translation.

    Args:
        normals: Normals ``(S, most, 3)`` that point into the object; their length is of no account.
        there: Booleans ``(S, most)``: there is one (`bt_tasksim.concept_nodes.contact_cones.padded`).
        tolerance: Radians up to which directions count as equal.

    Returns:
        Numbers ``(S,)`` of the classes in `STATES`.

    Raises:
        InputError: A shape is wrong, or a normal is zero or not finite.
    """
    return _classes(cone_dimensions(normals, there, tolerance))


def rotation_states(
    normals: Floats,
    there: Booleans,
    points: Floats,
    centres: Floats,
    axes: Floats | None = None,
    tolerance: float = MEASURED,
    lever: float = LEVER,
) -> Integers:
    """Classes of many sets of contacts for rotation, each about a point, or about an axis alone.

    Args:
        normals: Normals ``(S, most, 3)`` that point into the object.
        there: Booleans ``(S, most)``: there is one.
        points: Contact points ``(S, most, 3)``, metres.
        centres: Points ``(S, 3)`` about which the objects may turn.
        axes: Directions ``(S, 3)`` of bearings, about which alone they may.
        tolerance: Radians up to which directions count as equal.
        lever: Metres from the centre within which a normal passes through it and restricts no rotation.

    Returns:
        Numbers ``(S,)`` of the classes in `STATES`.

    Raises:
        InputError: A shape is wrong, or a normal or an axis is zero or not finite.
    """
    if points.shape != normals.shape or centres.shape != (len(normals), 3):
        raise InputError(
            f"{normals.shape} contact normals, {points.shape} points and {centres.shape} centres do not fit: "
            "give a point for each normal, and a centre for each set"
        )
    _check_lever(lever)
    if not (np.isfinite(centres).all() and np.isfinite(points[there]).all()):
        raise InputError("contact points and the centres of rotations have to be finite numbers")
    moments = np.cross(points - centres[:, None], unit_normals(normals, there))
    arms = np.linalg.norm(moments, axis=2)
    there = there & (arms > lever)
    if axes is None:
        return _classes(cone_dimensions(moments, there, tolerance))
    axis = unit_normals(axes[:, None], np.ones((len(axes), 1), dtype=bool))
    about = np.einsum("snk,sjk->sn", moments, axis)
    there = there & (np.abs(about) > lever)
    held = [(there & (sense * about > 0.0)).any(axis=1) for sense in (1.0, -1.0)]
    blocked = held[0].astype(np.int64) + held[1]
    turning = (ContactState.PR, ContactState.OP, ContactState.FT)
    numbers: Integers = np.array([STATES.index(state) for state in turning])[blocked]
    return numbers


def state_of(
    name: str,
    contacts: BodyContacts,
    motion: Freedom = "translation",
    *,
    centre: ArrayLike | None = None,
    axis: ArrayLike | None = None,
    hand: bool = False,
    tolerance: float = MEASURED,
) -> ContactState:
    """Class of the contact state in which an object is, by the contacts of a physics engine.

    Args:
        name: The object; or anything else that touches things, by the name that the engine gives.
        contacts: What `PhysicsEngine.contact_points` says.
        motion: The class for translation, or for rotation.
        centre: Point ``(3,)`` in metres about which it may turn; rotation alone.
        axis: Direction ``(3,)`` of an axis through that point, about which alone it may turn.
        hand: What the robot touches it with counts, too; else the environment alone does.
        tolerance: Radians up to which directions count as equal.

    Raises:
        InputError: A rotation without a centre, or a translation with one; or a bad number.
    """
    if (motion == "rotation") != (centre is not None) or (axis is not None and centre is None):
        raise InputError(
            "a contact state for rotation needs the centre of that rotation, and one for translation none"
        )
    normals, points = contacts.on(name, hand)
    there = np.ones((1, len(normals)), dtype=bool)
    if centre is None:
        return STATES[int(contact_states(normals[None], there, tolerance)[0])]
    centres = np.asarray(centre, dtype=np.float64).reshape(1, 3)
    axes = None if axis is None else np.asarray(axis, dtype=np.float64).reshape(1, 3)
    return STATES[int(rotation_states(normals[None], there, points[None], centres, axes, tolerance)[0])]


def _classes(found: Integers) -> Integers:
    """Numbers ``(S,)`` in `STATES` of dimensions ``(S, 3)``."""
    table = np.zeros((4, 2), dtype=np.int64)
    for (c, opens), state in _CLASS_OF.items():
        table[c, int(opens)] = STATES.index(state)
    numbers: Integers = table[found[:, 2], (found[:, 1] > 0).astype(np.int64)]
    return numbers
