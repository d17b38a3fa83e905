"""Inverse kinematics and observations of many worlds: microseconds of a control step and world.

The tools go on straight lines from the rest posture to poses around it, each world to its own, and the hands
close on the way; objects are those of three unlike scenes. The processor's time is divided by the worlds.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Observation, WorldState
from bt_tasksim.engines.kinematics.batch import BatchKinematics
from bt_tasksim.engines.perception.noise import noise_model
from bt_tasksim.engines.perception.state import BatchState
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene

WORLDS = (1, 64, 256)
BARS_US = {"solve": {1: 300.0, 64: 12.0, 256: 6.0}, "observe": {256: 6.0}}
BEFORE_US = {"solve": 34.0, "observe": 12.0, "visual": 54.0}
"""What one world alone took with the code before batches, by Pinocchio and plain floats, on this machine."""
STEPS = 40
SCENES = (
    Scene(objects={"cup": "on table", "box": "on table"}),
    Scene(objects={"box": "on table"}),
    Scene(objects={"superellipsoid": "on table", "diamond": "on table", "cylinder": "on table"}),
)


def options(parser: argparse.ArgumentParser) -> None:
    """What the section takes: nothing of its own."""


def measure(options: argparse.Namespace) -> dict[str, Any]:
    """Microseconds of solving, observing, and of the visual features where somebody looks at them."""
    repeats = 3 if options.quick else 11
    print("\nkinematics and observations, us of a control step and world")
    print(f"{'worlds':>8}{'solve':>9}{'observe':>9}{'visual':>9}")
    print(f"{'before':>8}" + "".join(f"{value:9.1f}" for value in BEFORE_US.values()))
    out: dict[str, Any] = {"before": BEFORE_US}
    for worlds in (options.worlds,) if options.worlds else WORLDS:
        found = out[str(worlds)] = {"solve": _solving(worlds, repeats), **_observing(worlds, repeats)}
        print(f"{worlds:8}" + "".join(f"{found[name]:9.2f}" for name in BEFORE_US), flush=True)
    print(f"bars: {BARS_US}")
    return out


def _solving(worlds: int, repeats: int) -> float:
    robot, rng = load_robot("panda"), np.random.default_rng(0)
    kinematics = BatchKinematics.of(robot, worlds)
    joints = np.tile(np.concatenate([robot.rest, robot.hand_open]), (worlds, 1))
    begin = kinematics.tool_pose(joints)
    goal = begin.copy()
    goal[:, :3] += rng.uniform(-0.1, 0.1, (worlds, 3))
    turn = poses.from_rotation_vector(rng.uniform(-0.3, 0.3, (worlds, 3)))
    goal[:, 3:] = poses.quat_multiply(turn, goal[:, 3:])
    tools = [poses.interpolate(begin, goal, np.full(worlds, i / STEPS)) for i in range(STEPS + 1)]
    hands = [np.full((worlds, 1), i / STEPS) for i in range(STEPS + 1)]

    def track() -> None:
        for tool, hand in zip(tools[1:], hands[1:], strict=True):
            kinematics.track(tool, hand, joints)

    def anew() -> None:
        kinematics.restart(np.arange(worlds), np.full(worlds, 20.0))
        kinematics.track(tools[0], hands[0], joints)

    return _median(track, anew, repeats) / STEPS / worlds


def _observing(worlds: int, repeats: int) -> dict[str, float]:
    robot, rng = load_robot("panda"), np.random.default_rng(0)
    drawn = [SCENES[i % len(SCENES)].sample(i) for i in range(worlds)]
    objects = np.full((worlds, max(len(w.objects) for w in drawn), 7), np.nan)
    for i, world in enumerate(drawn):
        objects[i, : len(world.objects)] = [actor.pose for actor in world.objects]
    batch = BatchState(robot, worlds, noise_model("fine"))
    batch.reset(range(worlds), drawn)
    states = [_state(robot.joints, objects, step, rng) for step in range(STEPS)]
    seen: list[Observation] = []

    def observe() -> None:
        seen[:] = [batch.observe(state) for state in states]

    def look() -> None:
        for observation in seen:
            _ = observation.contact_points, observation.motion

    observing = _median(observe, lambda: None, repeats)
    return {
        "observe": observing / STEPS / worlds,
        "visual": _median(look, observe, repeats) / STEPS / worlds,
    }


def _state(joints: tuple[str, ...], objects: Array, step: int, rng: np.random.Generator) -> WorldState:
    worlds, n = len(objects), len(joints)
    tool = np.tile(poses.pose([0.0, 0.0, 0.0]), (worlds, 1))
    tool[:, :3] = objects[:, 0, :3] + rng.normal(scale=0.03, size=(worlds, 3))
    return WorldState(
        time=np.full(worlds, 0.05 * step),
        joint_position=rng.uniform(0.0, 0.04, (worlds, n)),
        joint_velocity=rng.normal(size=(worlds, n)),
        joint_effort=rng.normal(size=(worlds, n)),
        tip_force=rng.normal(size=(worlds, 2, 3)),
        wrench=rng.normal(size=(worlds, 6)),
        tool_pose=tool,
        tips=tool[:, None, :3] + rng.normal(scale=0.02, size=(worlds, 2, 3)),
        objects=objects,
    )


def _median(work: Callable[[], None], before: Callable[[], None], repeats: int) -> float:
    """Microseconds of the processor, the median of some times, the first one left out."""
    taken = []
    for _ in range(repeats + 1):
        before()
        began = time.process_time()
        work()
        taken.append(1e6 * (time.process_time() - began))
    return statistics.median(taken[1:])
