"""Demonstrations for tests: small scripted ones, and the folder of recorded ones where it is present."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.demos_decomp.log import Demonstration, Surface, Track
from bt_tasksim.demos_decomp.synthetic_motion import minimum_jerk

ROOT = Path(__file__).resolve().parents[2]
DOWN = poses.frame_from_axes(np.array([0.0, 0, -1]), np.array([0.0, 1, 0]))
UPRIGHT = np.array([1.0, 0, 0, 0])
TABLE = Surface(np.array([0.5, 0, 0, *UPRIGHT]), np.array([0.9, 1.2]), "table")
BIN = Surface(np.array([0.45, -0.38, 0.01, *UPRIGHT]), np.array([0.2, 0.2]), "bin", "trash_bin", height=0.21)
SIZE = np.array([0.05, 0.05, 0.10])


@pytest.fixture(scope="session")
def recorded():
    """Folder of recorded demonstrations; the test is skipped where it is absent."""
    folder = ROOT.parent / "shared" / "demonstrations"
    if not folder.is_dir():
        pytest.skip("the recorded demonstrations (../shared/demonstrations) are not on this machine")
    return folder


@pytest.fixture(scope="session")
def act():
    """Builds a demonstration from key frames."""
    return acted


def acted(frames, objects, places=None, floors=None, rate=30.0, noise=0.0, seed=0, narration=()):
    """A demonstration from key frames.

    Args:
        frames: (seconds, hand position, opening, name of the held object or None); minimum jerk in between.
            What is held from one frame to the next moves with the hand.
        objects: Start position of the centre, by name; every object is a standing box of `SIZE`.
        places: By name; a table by default.
        floors: Height of the centre on which an object comes to rest when it is let go, by name.
        rate: Samples per second.
        noise: Standard deviation of object and hand positions, metres.
        seed: Of the noise.
        narration: What was said.
    """
    time = np.arange(frames[0][0], frames[-1][0] + 1e-9, 1 / rate)
    hand = np.zeros((len(time), 3))
    opening = np.zeros(len(time))
    tracks = {name: np.tile(np.asarray(at, float), (len(time), 1)) for name, at in objects.items()}
    now = {name: np.asarray(at, float) for name, at in objects.items()}
    for (t0, p0, o0, held), (t1, p1, o1, _) in pairwise(frames):
        span = (time >= t0 - 1e-9) & (time <= t1 + 1e-9)
        share = minimum_jerk((time[span] - t0) / (t1 - t0))[:, None]
        hand[span] = np.asarray(p0) + share * (np.asarray(p1) - np.asarray(p0, float))
        opening[span] = o0 + share[:, 0] * (o1 - o0)
        after = time >= t0 - 1e-9
        for name in tracks:
            if name == held:
                tracks[name][span] = now[name] + hand[span] - np.asarray(p0)
                now[name] = now[name] + np.asarray(p1, float) - np.asarray(p0)
                tracks[name][time > t1] = now[name]
            elif floors and name in floors and now[name][2] > floors[name]:
                fall = 0.5 * 9.81 * (time[after] - t0) ** 2
                tracks[name][after, 2] = np.maximum(now[name][2] - fall, floors[name])
                now[name][2] = floors[name]
    rng = np.random.default_rng(seed)

    def posed(positions, rotation):
        return np.concatenate(
            [positions + rng.normal(0, 1, positions.shape) * noise, np.tile(rotation, (len(time), 1))], axis=1
        )

    return Demonstration(
        name="000",
        time=time,
        hand_pose=posed(hand, DOWN),
        hand_opening=opening,
        objects={name: Track(posed(track, UPRIGHT), "box", SIZE) for name, track in tracks.items()},
        places={"table": TABLE} if places is None else places,
        narration=tuple(narration),
    )


def carry(name, start, end, t, opening=0.09, closed=0.05):
    """Key frames of grasp, pick, bring, place and release from one position to another; lasts 6 s."""
    (x0, y0, z0), (x1, y1, z1) = start, end
    return [
        (t, (x0, y0, z0 + 0.2), opening, None),
        (t + 1, start, opening, None),
        (t + 1.4, start, closed, name),
        (t + 2.2, (x0, y0, z0 + 0.12), closed, name),
        (t + 3.4, (x1, y1, z1 + 0.12), closed, name),
        (t + 4.2, end, closed, name),
        (t + 4.4, end, closed, None),
        (t + 4.8, end, opening, None),
        (t + 5.6, (x1, y1, z1 + 0.2), opening, None),
    ]


@pytest.fixture(scope="session")
def carried():
    """Key frames of a whole transport."""
    return carry


@pytest.fixture(scope="session")
def trash_bin():
    """Places with a bin beside the table's middle."""
    return {"table": TABLE, "trash_bin": BIN}
