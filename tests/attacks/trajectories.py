"""ManiSkill's trajectory files: ``trajectory.h5`` and ``trajectory.json``."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from bt_tasksim.demos_decomp.decompose import decompose_log
from bt_tasksim.demos_decomp.readers import open_log
from tests.attacks.mutations import Bait, Rng, damaged_bytes, damaged_data, damaged_hdf5

ABOUT = {
    "env_info": {"env_id": "PickCube-v1", "env_kwargs": {"control_freq": 20, "obs_mode": "state"}},
    "episodes": [{"episode_id": 0, "episode_seed": 7, "success": True}, {"episode_id": 1}],
    "source_desc": "a planner's",
}


def trajectory() -> bytes:
    """Two trajectories of a cube that is lifted, as ManiSkill writes them."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for number in range(2):
            count, states = 60, file.create_group(f"traj_{number}/env_states")
            robot = np.zeros((count, 31))
            robot[:, 0], robot[:, 3] = -0.615, 1.0
            robot[:, 13:20] = [0.0, 0.4, 0.0, -2.0, 0.0, 2.4, 0.8]
            robot[:, 20:22] = np.linspace(0.04, 0.02, count)[:, None]
            robot[:, 14] += np.linspace(0.0, -0.3, count)
            cube = np.zeros((count, 13))
            cube[:, 2], cube[:, 3] = 0.02 + np.maximum(np.linspace(-0.1, 0.1, count), 0.0), 1.0
            states["articulations/panda"], states["actors/cube"] = robot, cube
            states["actors/goal_site"] = cube
            file[f"traj_{number}/actions"] = np.zeros((count - 1, 8))
    return buffer.getvalue()


def begin(folder: Path, bait: Bait) -> Callable[[Rng], Callable[[], object]]:
    """See `tests.attacks.__main__.KINDS`."""
    sound, about = trajectory(), json.dumps(ABOUT)

    def make(rng: Rng) -> Callable[[], object]:
        path, kind = folder / "trajectory.h5", rng.random()
        path.write_bytes(
            sound
            if kind < 0.3
            else damaged_bytes(sound, rng)
            if kind < 0.5
            else damaged_hdf5(sound, rng, bait)
        )
        text = about
        if kind < 0.25:
            text = json.dumps(damaged_data(ABOUT, rng, bait))
        elif kind < 0.3:
            text = damaged_bytes(about.encode(), rng).decode("latin-1")
        path.with_suffix(".json").write_text(text, encoding="utf-8", errors="replace")
        return lambda: decompose_log(open_log(path))

    return make
