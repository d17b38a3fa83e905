"""Fixtures of a drawn world: those that are made by numbers, and where each stands.

That is where its file or the scene says, or within an area of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bt_tasksim.core.errors import FieldError, NoDrawError
from bt_tasksim.scene.fixture_overlap import overlap
from bt_tasksim.scene.fixtures import Fixture, is_made, load_fixture
from bt_tasksim.scene.outlines import TOUCHING
from bt_tasksim.scene.specs import FixtureSpec

TRIES = 50
"""Draws of where a fixture stands, after which there is none."""


def draw_fixtures(specs: Sequence[str | FixtureSpec], rng: np.random.Generator) -> tuple[Fixture, ...]:
    """Fixtures as they are made and where they stand in one world, none in another.

    Args:
        specs: What the scene says of them.
        rng: Random numbers.

    Raises:
        NoDrawError: None of 50 draws of one was free, or its numbers do not fit together.
        InputError: There is no such fixture.
    """
    drawn: list[Fixture] = []
    still = [load_fixture(spec) for spec in specs if not _is_drawn(spec)]
    for spec in specs:
        if not _is_drawn(spec):
            drawn.append(load_fixture(spec))
            continue
        others = [*still, *(fixture for fixture in drawn if fixture not in still)]
        for _ in range(TRIES):
            try:
                found = load_fixture(_placed(spec, rng), rng)
            except FieldError as error:  # these numbers do not fit together
                raise NoDrawError(str(error)) from error
            if all(overlap(found, other) <= TOUCHING for other in others):
                drawn.append(found)
                break
        else:
            raise NoDrawError(
                f"fixture '{found.name}' finds no room among the others in any of {TRIES} draws: draw it "
                f"from another area"
            )
    return tuple(drawn)


def _is_drawn(spec: str | FixtureSpec) -> bool:
    """What it is, or where it stands, differs from world to world."""
    return is_made(spec) or (
        isinstance(spec, FixtureSpec) and (any(spec.area) or isinstance(spec.yaw, tuple))
    )


def _placed(spec: str | FixtureSpec, rng: np.random.Generator) -> str | FixtureSpec:
    """The same fixture at one place."""
    if not isinstance(spec, FixtureSpec) or not (any(spec.area) or isinstance(spec.yaw, tuple)):
        return spec
    nominal = load_fixture(spec).pose
    x, y = (float(v + rng.uniform(-1, 1) * half) for v, half in zip(nominal, spec.area, strict=False))
    yaw = spec.yaw
    if isinstance(yaw, tuple):
        yaw = float(yaw[0] + rng.uniform() * (yaw[1] - yaw[0]))
    return replace(spec, at=(x, y, nominal[2]), yaw=yaw, area=(0.0, 0.0))
