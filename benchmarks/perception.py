"""How well objects are seen: ``python benchmarks/perception.py [--draws 50] [--robot panda]``.

Prints, over seeded draws, the error of the first look at each kind of object on the table and on the shelf,
standing and lying, and of the first look in each scenario with the arm in its rest posture: along each axis
of the robot base frame in millimetres (median of the magnitude), in length and in rotation (median, 90 % and
largest; up to the object's symmetry), and the time of a look, without the rendering.
"""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import math
import time

import cv2
import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel, WorldState
from bt_tasksim.engines.cameras import project
from bt_tasksim.engines.images import CameraModel
from bt_tasksim.engines.perception.camera_errors import PERFECT, CameraErrors
from bt_tasksim.engines.perception.opencv import CameraPostProcess
from bt_tasksim.engines.perception.segmentation import NEUTRAL, classify, find_segments
from bt_tasksim.engines.rendering.sapien import SapienRendering
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec

KINDS = ("box", "cube", "cylinder", "oval", "diamond", "cup", "superellipsoid")
SCENARIOS = ("pick_and_place", "shelf_to_shelf", "pick_and_throw", "pick_and_place_recovering")


def resting_state(world: ActorConfiguration) -> WorldState:
    """The state at the begin of an episode: the arm in its rest posture, the hand open."""
    robot = load_robot(world.robot)
    joints = np.concatenate([robot.rest, robot.hand_open])
    n, tips = len(joints), len(robot.tips)
    objects = np.array([actor.pose for actor in world.objects])
    return WorldState(
        time=np.float64(0.0),
        joint_position=joints,
        joint_velocity=np.zeros(n),
        joint_effort=np.zeros(n),
        tip_force=np.zeros((tips, 3)),
        wrench=np.zeros(6),
        tool_pose=np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]),
        tips=np.zeros((tips, 3)),
        objects=objects,
        velocities=np.zeros((len(objects), 6)),
    )


def rotation_error(found: Array, true: Array, model: ObjectModel, lying: bool) -> float:
    """Degrees between two rotations ``(4,)`` up to what can be told apart by shape."""
    between = poses.quat_multiply(poses.quat_conjugate(true), found)
    if model.symmetry == 0:
        up = float(poses.rotate(between, np.array([0.0, 0.0, 1.0]))[2])
        same_ends = lying and model.kind == "cylinder"
        return math.degrees(math.acos(min(1.0, abs(up) if same_ends else up)))
    turns = 4 if model.cubic else model.symmetry
    same = [poses.yaw(2 * math.pi * k / turns) for k in range(turns)]
    if model.cubic:
        quarter = [[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [2, 0, 0]]
        tips = [poses.from_rotation_vector(np.array(v) * math.pi / 2) for v in quarter]
        same = [poses.quat_multiply(t, s) for t in tips for s in same]
    elif lying:
        # A half turn about x: for a diamond, whose frame is turned, about its long diagonal.
        half = model.grasp_axes[1] if model.kind == "diamond" else None
        turn = math.atan2(half[1], half[0]) - math.pi / 2 if half else 0.0
        axis = np.array([math.cos(turn / 2), math.sin(turn / 2), 0.0])
        across = np.array([-axis[1], axis[0], 0.0])
        same += [np.array([0.0, *a]) for a in (axis, across)]
    return min(math.degrees(float(poses.angle_between(between, s))) for s in same)


class Measurement:
    """Looks once at each world and compares with the truth."""

    def __init__(self, robot: str, errors: CameraErrors) -> None:
        self.rendering = SapienRendering()
        self.post = CameraPostProcess(load_robot(robot), errors)
        self.robot = load_robot(robot)
        self.worst: list[tuple[float, str]] = []

    def look(self, world: ActorConfiguration) -> tuple[Array | None, float]:
        """The estimate ``(7,)`` of the first object, or None, and the seconds that it took."""
        model = world.world_model([tip.name for tip in self.robot.tips], self.robot.opening)
        self.rendering.reset(world)
        # What perception is given holds no poses.
        blind = tuple(dataclasses.replace(o, pose=(math.nan,) * 7) for o in world.objects)
        self.post.reset(dataclasses.replace(world, objects=blind), model)
        state = resting_state(world)
        images = {name: self.rendering.render(state, name, depth=True) for name in self.post.cameras(True)}
        state = dataclasses.replace(state, objects=None, velocities=None)
        started = time.perf_counter()
        pose = self.post.observe(state, images).objects[0]
        took = time.perf_counter() - started
        return (pose if np.isfinite(pose[0]) else None), took

    def row(self, label: str, worlds: list[ActorConfiguration], lying: bool = False) -> None:
        """Measure and print one line."""
        offsets, lengths, angles, times, unseen = [], [], [], [], 0
        for world in worlds:
            pose, took = self.look(world)
            times.append(1000 * took)
            if pose is None:
                unseen += 1
                continue
            true = np.array(world.objects[0].pose)
            offsets.append(1000 * (pose[:3] - true[:3]))
            lengths.append(float(np.linalg.norm(offsets[-1])))
            angles.append(rotation_error(pose[3:], true[3:], world.objects[0].model(), lying))
        x, y, z = np.median(np.abs(offsets), axis=0)
        print(
            f"{label:<34}{x:5.1f}{y:5.1f}{z:5.1f}   {_spread(lengths)}   {_spread(angles)}   "
            f"{unseen:4d} of {len(worlds):<4d}{np.median(times):6.0f} ms",
            flush=True,
        )


def tipped(world: ActorConfiguration, rng: np.random.Generator) -> ActorConfiguration:
    """The world with its first object lying on its side."""
    actor = world.objects[0]
    side = np.array([math.pi / 2, 0.0, 0.0]) if rng.integers(2) else np.array([0.0, math.pi / 2, 0.0])
    rotation = poses.quat_multiply(poses.yaw(rng.uniform(-3, 3)), poses.from_rotation_vector(side))
    turned = poses.transform(poses.pose([0, 0, 0], rotation), actor.shape().visual.vertices)
    pose = poses.pose([*actor.pose[:2], -float(np.min(turned[:, 2]))], rotation)
    return dataclasses.replace(world, objects=(dataclasses.replace(actor, pose=tuple(pose.tolist())),))


def picture(measure: Measurement, path: str) -> None:
    """Write a picture: what was segmented (bright) and where the fitted shape's outline is (white)."""
    scenes = [
        importlib.import_module(f"bt_tasksim.trees.scenarios.{name}").scene(measure.robot.name)
        for name in SCENARIOS
    ]
    worlds = [scene.sample(seed) for scene, seed in zip(scenes, (1, 2, 3, 3), strict=True)]
    worlds[3] = tipped(
        Scene(measure.robot.name, objects={"cup": "cup on table"}).sample(4), np.random.default_rng(1)
    )
    panels = []
    for world in worlds:
        pose, _ = measure.look(world)
        seen, actor = (
            measure.rendering.render(resting_state(world), measure.post.camera, depth=True),
            world.objects[0],
        )
        others = np.array([NEUTRAL, *sorted({b.colour for f in world.fixtures for b in f.boxes})])
        mask = classify(seen.colour, [actor.colour], others)[0]
        model = world.world_model([], 0.0)
        size = math.hypot(*model.objects[0].extent)
        segments = find_segments(seen.camera, seen.depth, mask, model.obstacles, size=size)
        shown = seen.colour.astype(float)
        if segments:
            shown[~segments[0].mask] = 0.55 * shown[~segments[0].mask] + 0.45 * 255 * 0.6
        half_width, half_height = 75, 56
        middle = np.argwhere(segments[0].mask).mean(axis=0) if segments else np.array([240.0, 320.0])
        row = int(np.clip(middle[0] - half_height, 0, seen.camera.height - 2 * half_height))
        column = int(np.clip(middle[1] - half_width, 0, seen.camera.width - 2 * half_width))
        crop = shown[row : row + 2 * half_height, column : column + 2 * half_width].astype(np.uint8)
        scale = 3
        crop = cv2.resize(crop, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
        if pose is not None:
            _outline(crop, seen.camera, actor, pose, np.array([column, row]), scale)
        panels.append(crop)
    grid = np.vstack([np.hstack(panels[:2]), np.hstack(panels[2:])])
    cv2.imwrite(path, grid[..., ::-1])


def _outline(
    crop: Array, camera: CameraModel, actor: ObjectActor, pose: Array, corner: Array, scale: int
) -> None:
    """Draw the fitted shape's outline and the axes of its frame."""

    def pixels(points: Array) -> Array:
        at, _ = project(camera, poses.transform(pose, points))
        return np.round((at - corner) * scale).astype(np.int32)

    hull = cv2.convexHull(pixels(actor.shape().visual.vertices))
    cv2.polylines(crop, [hull], True, (255, 255, 255), 2, cv2.LINE_AA)
    tips = pixels(np.concatenate([np.zeros((1, 3)), 0.04 * np.eye(3)]))
    for tip, colour in zip(tips[1:], ((230, 30, 30), (30, 180, 30), (30, 60, 230)), strict=True):
        cv2.arrowedLine(crop, tips[0].tolist(), tip.tolist(), colour, 2, cv2.LINE_AA, tipLength=0.2)


def _spread(values: list[float]) -> str:
    if not values:
        return f"{'-':>6}{'-':>6}{'-':>6}"
    return f"{np.median(values):6.1f}{np.quantile(values, 0.9):6.1f}{max(values):6.1f}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--draws", type=int, default=50, help="worlds for each line")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first world")
    parser.add_argument("--robot", default="panda", help="whose arm may stand in the way")
    parser.add_argument("--perfect", action="store_true", help="a camera without errors")
    parser.add_argument("--picture", help="write a picture of what is seen to this file, and measure nothing")
    options = parser.parse_args()
    measure = Measurement(options.robot, PERFECT if options.perfect else CameraErrors())
    if options.picture:
        picture(measure, options.picture)
        return
    seeds = range(options.seed, options.seed + options.draws)
    errors = "without errors" if options.perfect else "with errors"
    print(f"{options.draws} draws a line, robot {options.robot}, camera {errors}")
    print(
        f"{'':<34}{'|x|':>5}{'|y|':>5}{'|z|':>5}   "
        f"{'position, mm':>18}   {'rotation, deg':>18}   {'not seen':>12}"
    )
    spread = f"{'median':>6}{'90 %':>6}{'max':>6}"
    print(f"{'':<34}{'median, mm':>15}   {spread}   {spread}   {'':>12}{'time':>9}")
    for kind in KINDS:
        on_table = Scene(options.robot, objects={"it": ObjectSpec((kind,), on="table")})
        on_shelf = Scene(
            options.robot, fixtures=["shelf"], objects={"it": ObjectSpec((kind,), on="upper_board")}
        )
        worlds = [on_table.sample(s) for s in seeds]
        measure.row(f"{kind} on the table", worlds)
        measure.row(f"{kind} on the upper board", [on_shelf.sample(s) for s in seeds])
        rng = np.random.default_rng(options.seed)
        measure.row(f"{kind} lying", [tipped(w, rng) for w in worlds], lying=True)
    for name in SCENARIOS:
        scene = importlib.import_module(f"bt_tasksim.trees.scenarios.{name}").scene(options.robot)
        measure.row(name, [scene.sample(s) for s in seeds])


if __name__ == "__main__":
    main()
