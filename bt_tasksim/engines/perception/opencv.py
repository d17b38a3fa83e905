"""Post-process with images: where the objects are, as an RGB-D camera sees them and the hand feels them.

Images are few, because they are dear: one at the beginning, one when a concept asks for it, one a second
while the hand holds something, and some after it has let go, until the thing lies still. In between, an
object that the fingers hold moves with the tool, and everything else stays where it was seen.

Nothing here knows where objects truly are. What is used of the configuration is what a robot is told: the
objects' shapes and colours by category, the calibrated fixtures and places.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Observation, PlaceModel, WorldModel, WorldState
from bt_tasksim.engines.base import EngineSetup, PostProcessEngine
from bt_tasksim.engines.images import Image
from bt_tasksim.engines.perception.camera_errors import PERFECT, CameraErrors, as_calibrated
from bt_tasksim.engines.perception.features import TOUCH, ObservationBuilder
from bt_tasksim.engines.perception.pose_estimation import Target, estimate_pose, follow
from bt_tasksim.engines.perception.registration import DepthView, Fit
from bt_tasksim.engines.perception.segmentation import NEUTRAL, SMALLEST, Segment, classify, find_segments
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

REACH = 0.03
"""Metres between tool and object within which opposing contacts mean that the object is held."""
APART = 3
"""Ticks in a row without contact after which the hand has let go (contacts flicker)."""
WAIT = 0.25
"""Seconds from the end of contact to a capture, and from that to the next one."""
HELD = (0.2, 1.0)
"""Seconds from the beginning of a hold to a capture, and from that to the next one: things slip in a hand."""
CAPTURES = 8
"""Looks after the end of contact, at most."""
AGE = 0.1
"""Seconds by which a picture may be old while the hand holds something, which has moved since."""
SAME = (0.006, np.deg2rad(6.0))
"""Metres and radians within which two captures agree: the object is at rest."""


@dataclass
class TrackedObject:
    """What is remembered of one object.

    Attributes:
        grip: Pose ``(7,)`` in the tool frame while the hand holds it, or None.
        apart: Ticks in a row without the contacts that hold it or touch it.
        touched: The hand has touched it since it last was seen at rest.
        due: Time of the next capture, seconds; infinite for none.
        captures: Captures that are left before it is given up.
        note: Why it was not seen in the last capture; empty when it was.
    """

    grip: Array | None = None
    apart: int = 0
    touched: bool = False
    due: float = np.inf
    captures: int = 0
    note: str = ""


@dataclass(frozen=True)
class Capture:
    """A picture, and what was believed when it came.

    Attributes:
        image: The picture.
        estimate: Poses ``(n, 7)`` of the objects.
        handled: For each object, whether the hand held it, and whether it had touched it.
    """

    image: Image
    estimate: Array
    handled: tuple[tuple[bool, bool], ...]


@dataclass(frozen=True)
class Found:
    """What a capture found: fits by object, and for each object a sentence in case that it has none."""

    fits: Mapping[int, Fit]
    notes: tuple[str, ...]


@register("engine/postprocess", "camera")
class CameraPostProcess(PostProcessEngine):
    """A post-process engine with images.

    An object that was never seen has NaN for its estimated pose, and `unseen` says why; one that was seen and
    is not any more keeps the pose at which it last was.

    Args:
        robot: The robot.
        errors: Errors that are added to rendered images; on a real robot `camera_errors.PERFECT`.
        camera: Name of the RGB-D camera.
        background: Look in a thread of its own, as a robot's control rate wants it. What was found counts
            once it is there, unless the hand has taken or let go the object since. Where an object was never
            seen, a capture is waited for all the same.
    """

    def __init__(
        self,
        robot: RobotDescription,
        errors: CameraErrors | None = None,
        camera: str = "scene",
        background: bool = False,
    ) -> None:
        self.robot = robot
        self.errors = CameraErrors() if errors is None else errors
        self.camera = camera
        self._thread = ThreadPoolExecutor(1, "bt-tasksim-look") if background else None
        self._pending: tuple[Capture, Future[Found]] | None = None

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """See `Engine.create`; a real robot's images have errors of their own, and its rate does not wait."""
        return cls(robot, PERFECT, background=True) if setup.real else cls(robot)

    @property
    def wants_images(self) -> bool:
        """See `PostProcessEngine.wants_images`."""
        return True

    def reset(self, configuration: ActorConfiguration, model: WorldModel) -> None:
        """See `PostProcessEngine.reset`."""
        n = len(configuration.objects)
        if self._pending is not None:
            self._pending[1].exception()  # it is over before anything changes under it
            self._pending = None
        self._model = model
        self._targets = [
            Target(known, actor.shape())
            for known, actor in zip(model.objects, configuration.objects, strict=True)
        ]
        self._colours = [actor.colour for actor in configuration.objects]
        fixtures = {box.colour for fixture in configuration.fixtures for box in fixture.boxes}
        self._others = np.array([NEUTRAL, *sorted(fixtures)])
        self._rng = configuration.generator("camera")
        self._calibration = self.errors.calibration(self._rng)
        self._tracks = [TrackedObject() for _ in range(n)]
        self._estimate = np.full((n, 7), np.nan)
        self._builder = ObservationBuilder(self.robot, configuration)
        self._next, self._taken = 0.0, -np.inf

    def cameras(self, first: bool) -> tuple[str, ...]:
        """The camera, at an episode's begin and when an object is to be looked at."""
        if self._pending is not None:
            return ()  # what is found now counts first
        due = any(track.due <= self._next + 1e-6 for track in self._tracks)
        return (self.camera,) if self._tracks and (first or due) else ()

    def observe(self, state: WorldState, images: Mapping[str, Image]) -> Observation:
        """See `PostProcessEngine.observe`.

        Raises:
            MachineError: An image has no depth.
        """
        time = float(state.time)
        self._next = time + self._model.control_period
        self._feel(state)
        if self._pending is not None and self._pending[1].done():
            capture, found = self._pending
            self._pending = None
            self._conclude(capture, found.result(), time)
        for image in images.values():
            if self._shows_now(image, time):
                self._look(image, time)
        return self._builder.build(state, self._estimate.copy())

    def unseen(self) -> dict[str, str]:
        """For each object that was not seen in the last look at it, one sentence that says so, by name."""
        return {
            target.model.name: track.note
            for target, track in zip(self._targets, self._tracks, strict=True)
            if track.note
        }

    def _feel(self, state: WorldState) -> None:
        """Move what the hand holds; notice what it takes and what it lets go."""
        touching = np.sum(state.tip_force**2, axis=-1) > TOUCH * TOUCH
        opposed = all(any(touching[i] for i in group) for group in self.robot.opposition)
        near = self._in_reach(state.tool_pose)
        for i, track in enumerate(self._tracks):
            if track.grip is not None:
                track.apart = 0 if opposed else track.apart + 1
                if opposed:
                    self._estimate[i] = poses.multiply(state.tool_pose, track.grip)
                elif track.apart >= APART:
                    track.grip = None
                    self._look_later(track, float(state.time))
            elif i == near and opposed and not any(t.grip is not None for t in self._tracks):
                track.grip = poses.multiply(poses.inverse(state.tool_pose), self._estimate[i])
                track.touched, track.apart, track.due = True, 0, float(state.time) + HELD[0]
            elif i == near and np.any(touching):
                track.touched, track.apart, track.due = True, 0, np.inf
            elif track.touched and not np.isfinite(track.due):
                track.apart += 1
                if track.apart >= APART:
                    self._look_later(track, float(state.time))

    def _look_later(self, track: TrackedObject, time: float) -> None:
        track.touched, track.apart, track.due, track.captures = False, 0, time + WAIT, CAPTURES

    def _in_reach(self, tool: Array) -> int:
        """Index of the object nearest to the tool, its nominal box within the fingers' reach; or -1."""
        best, found = REACH, -1
        for i, target in enumerate(self._targets):
            if np.isfinite(self._estimate[i, 0]):
                local = poses.transform(poses.inverse(self._estimate[i]), tool[:3])
                gap = np.maximum(np.abs(local) - np.array(target.model.extent) / 2, 0.0)
                distance = float(np.linalg.norm(gap))
                if distance < best:
                    best, found = distance, i
        return found

    def _shows_now(self, image: Image, time: float) -> bool:
        """Whether a picture is new and what it shows is still so; else a capture waits for the next one."""
        taken = image.taken
        if taken is None:
            return True
        if taken <= self._taken:
            return False
        for track in self._tracks:
            if track.grip is not None and time - taken > AGE:
                return False
            if track.grip is None and np.isfinite(track.due) and taken < track.due - WAIT:
                return False  # it had not been let go, or it is the last capture's once more
        self._taken = taken
        return True

    def _look(self, image: Image, time: float) -> None:
        """Have a picture looked at, and believe what was found, now or later."""
        capture = Capture(image, self._estimate.copy(), tuple(map(_handled, self._tracks)))
        if self._thread is None or not np.all(np.isfinite(self._estimate)):
            self._conclude(capture, self._search(capture), time)
        elif self._pending is None:
            self._pending = (capture, self._thread.submit(self._search, capture))

    def _search(self, capture: Capture) -> Found:
        """Find the objects in a picture; changes nothing but the state of the generator.

        Raises:
            MachineError: The image has no depth.
        """
        image, notes = capture.image, []
        if image.depth is None:
            raise MachineError(f"camera '{image.camera.name}' gives no depth: poses need an RGB-D camera")
        camera = as_calibrated(image.camera, self._calibration)
        depth = self.errors.depth(image.depth, self._rng)
        masks = classify(image.colour, self._colours, self._others)
        fits: list[tuple[Fit, int, Segment]] = []
        for i, target in enumerate(self._targets):
            alike = [k for k, colour in enumerate(self._colours) if colour == self._colours[i]]
            segments = find_segments(
                camera,
                depth,
                masks[i],
                self._model.obstacles,
                size=target.diameter,
                join=len(alike) == 1,
            )
            others = np.any([m for k, m in enumerate(masks) if k not in alike] or [0 * masks[i]], axis=0)
            for segment in segments[: 2 + len(alike)]:
                view = DepthView(camera, depth, self._rng.permutation(segment.points), others)
                fit = self._estimated(i, view, capture)
                if fit is not None:
                    fits.append((fit, i, segment))
            pixels = segments[0].pixels if segments else 0
            amount = f"{pixels} pixels" if pixels else f"fewer than {SMALLEST} pixels"
            notes.append(
                f"{target.model.name} is not seen: camera '{image.camera.name}' shows {amount} "
                f"of its colour{' but not its shape' if pixels else ''}"
            )
        found: dict[int, Fit] = {}
        taken = np.zeros(depth.shape, bool)
        for fit, i, segment in sorted(fits, key=lambda f: f[0].cost):  # objects of one colour compete
            if i not in found and np.count_nonzero(taken & segment.mask) < segment.pixels / 4:
                found[i] = fit
                taken |= segment.mask
        return Found(found, tuple(notes))

    def _conclude(self, capture: Capture, found: Found, time: float) -> None:
        """Believe what a capture has found, but for what the hand has taken or let go since."""
        for i, track in enumerate(self._tracks):
            if _handled(track) != capture.handled[i]:
                continue
            track.note = "" if i in found.fits else found.notes[i]
            if i in found.fits:
                self._accept(i, found.fits[i], capture.estimate[i], time)
            else:
                self._again(track, time, settled=False)

    def _estimated(self, i: int, view: DepthView, capture: Capture) -> Fit | None:
        """The fit of object ``i`` to what may be it, or None."""
        target, before = self._targets[i], capture.estimate[i]
        if capture.handled[i][0]:
            fit = follow(target, view, before, self._model.places.values())
            moved = float(np.linalg.norm(fit.pose[:3] - before[:3]))
            turned = float(poses.angle_between(fit.pose[3:], before[3:]))
            return fit if fit.cost < 0.3 and moved < 0.02 and turned < 0.35 else None
        known = before if np.isfinite(before[0]) else None
        places = [*self._model.places.values(), *self._tops(i, capture.estimate)]
        return estimate_pose(target, view, places, known)

    def _tops(self, i: int, estimate: Array) -> list[PlaceModel]:
        """The tops of the other objects that stand, as places."""
        tops = []
        table = next(iter(self._model.places.values()), None)
        for k, target in enumerate(self._targets):
            pose = estimate[k]
            if k == i or table is None or not np.isfinite(pose[0]):
                continue
            if poses.z_axis(pose[3:])[2] > 0.99:
                x, y, z = target.model.extent
                top = poses.multiply(pose, poses.pose([0.0, 0.0, z / 2]))
                tops.append(
                    replace(table, name=target.model.name, pose=top, extent=(x, y), centre=(0.0, 0.0))
                )
        return tops

    def _accept(self, i: int, fit: Fit, before: Array, time: float) -> None:
        track = self._tracks[i]
        if track.grip is None or self._thread is None:  # else the hand has moved on with it
            self._estimate[i] = fit.pose
        if track.grip is not None:
            # What holds is the tool: its pose is known far better than the object's.
            back = poses.multiply(poses.inverse(before), fit.pose)
            track.grip = poses.multiply(track.grip, back)
            self._again(track, time, settled=False)
            return
        moved = float(np.linalg.norm(fit.pose[:3] - before[:3]))
        tipped = float(np.linalg.norm(poses.z_axis(fit.pose[3:]) - poses.z_axis(before[3:])))
        self._again(track, time, settled=moved < SAME[0] and tipped < SAME[1])

    def _again(self, track: TrackedObject, time: float, settled: bool) -> None:
        """Whether to look once more at something that the hand has let go."""
        if track.grip is not None:
            track.due = time + HELD[1]
        elif np.isfinite(track.due) and track.due <= time + 1e-6:
            track.captures -= 1
            track.due = np.inf if settled or track.captures <= 0 else time + WAIT


def _handled(track: TrackedObject) -> tuple[bool, bool]:
    return track.grip is not None, track.touched
