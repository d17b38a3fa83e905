"""How large the world of a robot is: where it reaches, what furniture stands there, how large things are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bt_tasksim.core.errors import InputError, nearest

SMALL = Path(__file__).parent / "fixtures"
"""Furniture for small arms."""
Range = tuple[float, float]
Sizes = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class Stand:
    """A fixture and where it may stand.

    Attributes:
        fixture: Name of a bundled fixture, or path of a data file.
        distance: From the robot's base to its origin, metres.
        bearing: Half width of the range of directions in which it stands, radians.
        turned: Half width of the range by which it turns away from facing the robot, radians.
        bins: Names of its containers that things fall into.
        trays: Names of its containers that things stand in.
        boards: Names of its boards, each with the half sizes ``(2,)`` in metres that an arm reaches.
    """

    fixture: str
    distance: Range
    bearing: float
    turned: float
    bins: tuple[str, ...] = ()
    trays: tuple[str, ...] = ()
    boards: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Setting:
    """The world of one robot; lengths in metres, robot base frame.

    Attributes:
        ahead: Direction in which it looks, radians from x.
        forward: Range of what is within reach, along that direction.
        aside: Half width of it, across.
        farthest: From the base.
        deep: Range of the depth of the rectangle in which things begin.
        wide: Range of its width.
        base: Radius about the base that furniture keeps clear of.
        stands: Furniture by arrangement.
        sizes: Full sizes by kind; kinds that are missing have their own.
        mesh_scale: Factor of the meshes' size.
        mass: Range, kg.
    """

    ahead: float
    forward: Range
    aside: float
    farthest: float
    deep: Range
    wide: Range
    base: float
    stands: Mapping[str, tuple[Stand, ...]]
    sizes: Mapping[str, Sizes] = field(default_factory=dict)
    mesh_scale: float = 1.0
    mass: Range = (0.05, 0.25)


TRAY = Stand("tray", (0.42, 0.58), 1.1, 3.1, trays=("tray",))
BIN = Stand("trash_bin", (0.45, 0.62), 1.1, 3.1, bins=("trash_bin",))
BOARDS = {"lower_board": (0.02, 0.20), "upper_board": (0.02, 0.20)}
SHELF = Stand("shelf", (0.62, 0.70), 0.9, 0.55, boards=BOARDS)
LARGE = {"nothing": (), "tray": (TRAY,), "bin": (BIN,), "shelf": (SHELF,), "shelf and bin": (SHELF, BIN)}

_SMALL_TRAY = Stand(str(SMALL / "small_tray.yaml"), (0.17, 0.24), 0.9, 3.1, trays=("small_tray",))
_SMALL_BIN = Stand(str(SMALL / "small_bin.yaml"), (0.16, 0.23), 0.9, 3.1, bins=("small_bin",))
_SMALL_STEP = Stand(
    str(SMALL / "small_step.yaml"), (0.20, 0.26), 0.8, 0.3, boards={"small_step": (0.015, 0.06)}
)
_LITTLE = {
    "nothing": (),
    "tray": (_SMALL_TRAY,),
    "bin": (_SMALL_BIN,),
    "step": (_SMALL_STEP,),
    "step and bin": (_SMALL_STEP, _SMALL_BIN),
}
_LITTLE_SIZES: Mapping[str, Sizes] = {
    "box": ((0.024, 0.020, 0.03), (0.045, 0.034, 0.06)),
    "cube": ((0.022, 0.022, 0.022), (0.034, 0.034, 0.034)),
    "cylinder": ((0.022, 0.022, 0.03), (0.038, 0.038, 0.06)),
    "cup": ((0.034, 0.034, 0.04), (0.046, 0.046, 0.06)),
    "diamond": ((0.034, 0.026, 0.03), (0.05, 0.038, 0.06)),
    "oval": ((0.028, 0.022, 0.03), (0.045, 0.034, 0.06)),
    "superellipsoid": ((0.024, 0.024, 0.03), (0.04, 0.036, 0.05)),
}

SETTINGS: Mapping[str, Setting] = {
    "panda": Setting(0.0, (0.30, 0.65), 0.36, 0.70, (0.20, 0.32), (0.30, 0.60), 0.18, LARGE),
    "xarm7_ability": Setting(0.0, (0.35, 0.60), 0.30, 0.64, (0.18, 0.25), (0.30, 0.55), 0.18, LARGE),
    "so100": Setting(
        -1.5707963, (0.12, 0.29), 0.16, 0.29, (0.08, 0.14), (0.16, 0.28), 0.07, _LITTLE, _LITTLE_SIZES,
        mesh_scale=0.5, mass=(0.01, 0.05),
    ),
}  # fmt: skip
"""By robot."""


def setting(robot: str) -> Setting:
    """The world of a robot.

    Raises:
        InputError: There is none for this robot.
    """
    if robot not in SETTINGS:
        raise InputError(f"there is no setting for the robot '{robot}'{nearest(robot, SETTINGS)}")
    return SETTINGS[robot]
