"""MuJoCo writes warnings to the terminal and to MUJOCO_LOG.TXT where the user stands, unless told not to."""

from __future__ import annotations

from typing import Any


def write_none(mujoco: Any) -> None:
    """Have MuJoCo write no warnings, unless somebody else hears them already.

    Args:
        mujoco: The module.
    """
    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(_ignored)


def _ignored(warning: str) -> None:
    """What matters is looked for in numbers: MuJoCo counts warnings of a world in its data."""
