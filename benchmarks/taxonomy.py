"""How fast contacts are classified, and how often rightly: ``python -m benchmarks.taxonomy``.

Random sets of contacts, as a physics engine gives them: several points for each pair of faces, each with a
normal of its own that is off by up to half of the tolerance. What is right is found by linear programming
with the normals as they were before that. Sets that are nearer to another class than `BORDER` are left out
and counted: there another class is right, too.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from bt_tasksim.concept_nodes.contact_cones import MEASURED, padded
from bt_tasksim.concept_nodes.taxonomy import STATES, contact_state, contact_states

Floats = NDArray[np.float64]
LEAST_PER_SECOND, MOST = 10_000, 1_000_000
BORDER = 0.08
"""Sine of the angle, and share, within which a set is near a border between two classes."""
MOST_FACES, MOST_POINTS = 6, 4


class BruteForce(NamedTuple):
    """What linear programming says of a set of contacts.

    Attributes:
        dimensions: Maintaining, detaching and constraining dimensions.
        border: How far the set is from one of another class: the least of all that decides.
    """

    dimensions: tuple[int, int, int]
    border: float


def brute_force(normals: Floats) -> BruteForce:
    """The dimensions of a cone by linear programming.

    A contact that some feasible motion opens is opened by that one which opens as many as can be opened;
    those that it keeps closed are the constraining ones. Motions may be of any length, so that "open by one"
    asks nothing more than "open".

    Args:
        normals: Exact unit normals ``(n, 3)``.
    """
    n = len(normals)
    if n == 0:
        return BruteForce((3, 0, 0), 1.0)
    values = np.linalg.svd(normals, compute_uv=False)
    rank = int((values > 1e-9).sum())
    border = float(values[:rank].min()) / np.sqrt(n)
    opened = linprog(  # of t (3 numbers) and of how far each is opened, from 0 to 1
        np.concatenate([np.zeros(3), -np.ones(n)]),
        A_ub=np.concatenate([-normals, np.eye(n)], axis=1),
        b_ub=np.zeros(n),
        bounds=[(None, None)] * 3 + [(0.0, 1.0)] * n,
    ).x[3:]
    closed = opened < 0.5
    if not closed.all():
        widest = linprog(
            [0.0, 0.0, 0.0, -1.0],
            A_ub=np.concatenate([-normals, np.where(closed, 0.0, 1.0)[:, None]], axis=1),
            b_ub=np.zeros(n),
            bounds=[(-1.0, 1.0)] * 3 + [(0.0, 1.0)],
        ).x[3]
        border = min(border, float(widest))
    _, values, axes = np.linalg.svd(normals[closed].reshape(-1, 3))
    c = int((values > 1e-9).sum())
    if c:
        around = _sphere() if c == 3 else _circle(axes[:c])
        border = min(border, -float((around @ normals[closed].T).min(axis=1).max()))
    return BruteForce((3 - rank, rank - c, c), border)


def _circle(axes: Floats, count: int = 720) -> Floats:
    """Directions ``(k, 3)`` all around in the span of one or two axes."""
    if len(axes) == 1:
        return np.concatenate([axes, -axes])
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes


def _sphere(count: int = 4000) -> Floats:
    """Directions ``(count, 3)`` all over a sphere, evenly (Fibonacci's lattice)."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, np.pi * (1.0 + 5.0**0.5) * k
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


def random_faces(rng: np.random.Generator) -> Floats:
    """Exact normals ``(n, 3)`` of up to `MOST_FACES` faces: along axes, opposite, in a plane, or anyhow."""
    grid = np.array([row for row in np.ndindex(3, 3, 3) if row != (1, 1, 1)], dtype=float) - 1.0
    faces: list[Floats] = []
    for _ in range(int(rng.integers(0, MOST_FACES + 1))):
        how = int(rng.integers(0, 5))
        if how == 0:
            faces.append(rng.normal(size=3))
        elif how == 1 and faces:
            faces.append(-faces[int(rng.integers(len(faces)))])
        elif how == 2 and len(faces) > 1:
            first, second = rng.choice(len(faces), 2, replace=False)
            mixed = rng.uniform(-1.0, 1.0) * faces[first] + rng.uniform(-1.0, 1.0) * faces[second]
            faces.append(mixed if np.linalg.norm(mixed) > 1e-3 else faces[first])
        else:
            faces.append(grid[int(rng.integers(len(grid)))])
    exact = np.array([face / np.linalg.norm(face) for face in faces]).reshape(-1, 3)
    return Rotation.random(rng=rng).apply(exact) if len(exact) else exact


def measured(exact: Floats, rng: np.random.Generator, uncertainty: float) -> Floats:
    """Normals ``(k, 3)`` as a physics engine gives them: of each face several, each off by an angle."""
    if not len(exact):
        return exact
    each = np.repeat(exact, rng.integers(1, MOST_POINTS + 1, len(exact)), axis=0)
    axis = np.cross(each, rng.normal(size=each.shape))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    off = Rotation.from_rotvec(axis * rng.uniform(0.0, uncertainty, (len(each), 1))).apply(each)
    shuffled: Floats = rng.permutation(off)
    return shuffled


def rate(sets: Sequence[Floats]) -> float:
    """Sets that are classified in a second."""
    normals, there = padded(sets)
    contact_states(normals[:10], there[:10], MEASURED)
    began = time.perf_counter()
    contact_states(normals, there, MEASURED)
    return len(sets) / (time.perf_counter() - began)


def main(arguments: list[str] | None = None) -> int:
    """Measure, and say it."""
    parser = argparse.ArgumentParser(description="Classification of contact sets.")
    parser.add_argument("--sets", type=int, default=10_000, help="how many random ones")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    if options.seed < 0 or not 1 <= options.sets <= MOST:
        parser.error(f"--seed should not be negative, and --sets lie between 1 and {MOST}")
    rng = np.random.default_rng(options.seed)
    exact = [random_faces(rng) for _ in range(options.sets)]
    given = [measured(each, rng, MEASURED / 2) for each in exact]
    per_second = rate(given)
    found = contact_states(*padded(given), MEASURED)
    agree = near = 0
    wrong: list[str] = []
    for each, state in zip(exact, found.tolist(), strict=True):
        right = brute_force(each)
        if right.border < BORDER:
            near += 1
            continue
        expected = contact_states(*padded([each]))[0]
        agree += int(state == _class(right))
        if state != _class(right):
            wrong.append(f"{STATES[state].name} for {right}, exact {STATES[expected].name}")
    judged = options.sets - near
    print(f"{per_second:.0f} sets a second on one core (at least {LEAST_PER_SECOND})")
    print(f"{agree} of {judged} as brute force has it; {near} of {options.sets} are near a border")
    print(*wrong[:20], sep="\n")
    return int(agree < judged)


def _class(found: BruteForce) -> int:
    return STATES.index(contact_state(found.dimensions))


if __name__ == "__main__":
    raise SystemExit(main())
