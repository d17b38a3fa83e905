"""Post-process with images: where the objects are, as an RGB-D camera sees them and the hand feels them.

Images are few, because they are dear: one at the beginning, one when a concept asks for it, one a second
while the hand holds something, and some after it has let go, until the thing lies still. In between, an
object that the fingers hold moves with the tool, and everything else stays where it was seen.

Nothing here knows where objects truly are. What is used of the configuration is what a robot is told: the
objects' shapes and colours by category, the calibrated fixtures and places.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Self

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import NotToldApartError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Observation, WorldModel, WorldState
from bt_tasksim.engines.base import EngineSetup, PostProcessEngine
from bt_tasksim.engines.images import Image
from bt_tasksim.engines.perception.camera_errors import PERFECT, CameraErrors
from bt_tasksim.engines.perception.features import TOUCH, ObservationBuilder
from bt_tasksim.engines.perception.looking import Capture, Found, Looker
from bt_tasksim.engines.perception.registration import Fit
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

SIDES = ("scene", "scene_right")
"""Cameras of every simulated scene (`bt_tasksim.engines.cameras`); a robot may have the first one alone."""
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
        camera: Name of the camera that saw it best; empty before any did.
    """

    grip: Array | None = None
    apart: int = 0
    touched: bool = False
    due: float = np.inf
    captures: int = 0
    note: str = ""
    camera: str = ""


@register("engine/postprocess", "camera")
class CameraPostProcess(PostProcessEngine):
    """A post-process engine with images.

    An object that was never seen has NaN for its estimated pose, and `unseen` says why; one that was seen and
    is not any more keeps the pose at which it last was.

    Args:
        robot: The robot.
        errors: Errors that are added to rendered images; on a real robot `camera_errors.PERFECT`.
        cameras: Names of the RGB-D cameras: one may see what something hides from another.
        background: Look in a thread of its own, as a robot's control rate wants it. What was found counts
            once it is there, unless the hand has taken or let go the object since. Where an object was never
            seen, a capture is waited for all the same.
    """

    def __init__(
        self,
        robot: RobotDescription,
        errors: CameraErrors | None = None,
        cameras: Sequence[str] = SIDES,
        background: bool = False,
    ) -> None:
        self.robot = robot
        self.errors = CameraErrors() if errors is None else errors
        self.every = tuple(cameras)
        self._thread = ThreadPoolExecutor(1, "bt-tasksim-look") if background else None
        self._pending: tuple[Capture, Future[Found]] | None = None

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """See `Engine.create`; a real robot's images have errors of their own, and its rate does not wait."""
        return cls(robot, PERFECT, SIDES[:1], background=True) if setup.real else cls(robot)

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
        self._looker = Looker(configuration, model, self.errors, self.every)
        self._tracks = [TrackedObject() for _ in range(n)]
        self._parts = [i for i, known in enumerate(model.objects) if known.joint is not None]
        self._estimate = np.full((n, 7), np.nan)
        self._builder = ObservationBuilder(self.robot, configuration)
        self._begun = False
        self._next, self._taken = 0.0, dict.fromkeys(self.every, -np.inf)

    def cameras(self, first: bool) -> tuple[str, ...]:
        """Those that see what is to be looked at; all of them at an episode's begin."""
        if self._pending is not None:
            return ()  # what is found now counts first
        if first and self._tracks:
            return self.every
        due = [track for track in self._tracks if track.due <= self._next + 1e-6]
        lost = any(track.note or not track.camera for track in due)
        return tuple(name for name in self.every if lost or any(track.camera == name for track in due))

    def observe(self, state: WorldState, images: Mapping[str, Image]) -> Observation:
        """See `PostProcessEngine.observe`.

        Raises:
            MachineError: An image has no depth.
            NotToldApartError: The first look does not say which of some objects is which, and it matters.
        """
        time = float(state.time)
        self._next = time + self._model.control_period
        self._feel(state)
        if self._pending is not None and self._pending[1].done():
            capture, found = self._pending
            self._pending = None
            self._conclude(capture, found.result(), time)
        shown = {name: image for name, image in images.items() if self._shows_now(name, image, time)}
        if shown:
            self._look(shown, time)
        seen = self._builder.build(state, self._estimate.copy())
        self._estimate[self._parts] = seen.objects[self._parts]
        return seen

    def unseen(self) -> dict[str, str]:
        """For each object that was not seen in the last look at it, one sentence that says so, by name."""
        return {
            target.model.name: track.note
            for i, (target, track) in enumerate(zip(self._looker.targets, self._tracks, strict=True))
            if track.note and self._looker.sought(i, first=False)
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
                again = float(state.time) + HELD[0] if self._looker.sought(i, first=False) else np.inf
                track.touched, track.apart, track.due = True, 0, again
            elif i == near and np.any(touching):
                track.touched, track.apart, track.due = True, 0, np.inf
            elif track.touched and not np.isfinite(track.due):
                track.apart += 1
                if track.apart >= APART:
                    self._look_later(track, float(state.time))

    def _look_later(self, track: TrackedObject, time: float) -> None:
        track.touched, track.apart = False, 0
        part = any(track is self._tracks[i] for i in self._parts)
        for i, other in enumerate(self._tracks):
            seen_anew = self._looker.sought(i, first=False) and other.grip is None
            if seen_anew and (other is track or part):  # what is in a drawer goes along with it
                other.due, other.captures = time + WAIT, CAPTURES

    def _in_reach(self, tool: Array) -> int:
        """Index of the object nearest to the tool, its nominal box within the fingers' reach; or -1."""
        best, found = REACH, -1
        for i, target in enumerate(self._looker.targets):
            if np.isfinite(self._estimate[i, 0]):
                local = poses.transform(poses.inverse(self._estimate[i]), tool[:3])
                gap = np.maximum(np.abs(local) - np.array(target.model.extent) / 2, 0.0)
                distance = float(np.linalg.norm(gap))
                if distance < best:
                    best, found = distance, i
        return found

    def _shows_now(self, camera: str, image: Image, time: float) -> bool:
        """Whether a picture is new and what it shows is still so; else a capture waits for the next one."""
        taken = image.taken
        if taken is None:
            return True
        if taken <= self._taken[camera]:
            return False
        for track in self._tracks:
            if track.grip is not None and time - taken > AGE:
                return False
            if track.grip is None and np.isfinite(track.due) and taken < track.due - WAIT:
                return False  # it had not been let go, or it is the last capture's once more
        self._taken[camera] = taken
        return True

    def _look(self, images: Mapping[str, Image], time: float) -> None:
        """Have pictures looked at, and believe what was found, now or later."""
        unsettled = frozenset(i for i, track in enumerate(self._tracks) if np.isfinite(track.due))
        capture = Capture(images, self._estimate.copy(), tuple(map(_handled, self._tracks)), unsettled)
        if self._thread is None or not np.all(np.isfinite(self._estimate)):
            self._conclude(capture, self._looker.look(capture), time)
        elif self._pending is None:
            self._pending = (capture, self._thread.submit(self._looker.look, capture))

    def _conclude(self, capture: Capture, found: Found, time: float) -> None:
        """Believe what a capture has found, but for what the hand has taken or let go since.

        Raises:
            NotToldApartError: It is the first one, and does not say which is which.
        """
        first, self._begun = not self._begun, True
        if first and found.alike:
            said = {found.notes[min(pair)] for pair in found.alike}
            raise NotToldApartError("; ".join(sorted(said)))
        for i, track in enumerate(self._tracks):
            if _handled(track) != capture.handled[i] or not self._looker.sought(i, first):
                continue
            sighting = found.sightings.get(i)
            if sighting is not None:
                track.note, track.camera = "", sighting.camera
                self._accept(i, sighting.fit, capture.estimate[i], time)
            elif not track.camera or track.camera in capture.images:
                track.note = found.notes[i]
                self._again(track, time, settled=False)

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
