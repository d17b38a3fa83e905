"""A look: which known object is where in pictures that cameras took at one time.

Each camera's picture is looked at by itself. Of what several cameras see of one object the fit counts that
explains all their pictures best: one camera may see the handle that is hidden from the other. Nothing here
remembers anything but the generator's state.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import PlaceModel, WorldModel
from bt_tasksim.engines.images import CameraModel, Image
from bt_tasksim.engines.perception.camera_errors import CameraErrors, as_calibrated
from bt_tasksim.engines.perception.fixture_faces import boxes_near
from bt_tasksim.engines.perception.pose_estimation import Target, estimate_pose, follow
from bt_tasksim.engines.perception.registration import DepthView, Fit, judge_fit, sample_surface
from bt_tasksim.engines.perception.segmentation import NEUTRAL, SMALLEST, Segment, classify, find_segments
from bt_tasksim.scene.configuration import ActorConfiguration

UPRIGHT = 0.99
"""Height of an object's own z axis from which it is taken to stand."""
HELD = (0.3, 0.02, 0.35)
"""Cost of a fit to what the hand holds, and metres and radians that it may have moved in the hand, up to
which such a look is believed."""


@dataclass(frozen=True)
class Capture:
    """Pictures of one time, and what was believed when they came.

    Attributes:
        images: The pictures by camera.
        estimate: Poses ``(n, 7)`` of the objects, NaN where one was never seen.
        handled: For each object, whether the hand held it, and whether it had touched it.
    """

    images: Mapping[str, Image]
    estimate: Array
    handled: tuple[tuple[bool, bool], ...]


class Sighting(NamedTuple):
    """An object in a picture.

    Attributes:
        fit: Its pose there.
        camera: Name of the camera.
        segment: Its pixels.
        doubt: Cost of the fit in all pictures that show something of its colour; the least of several is
            believed.
    """

    fit: Fit
    camera: str
    segment: Segment
    doubt: float


@dataclass(frozen=True)
class Found:
    """What a capture found: sightings by object, and for each object a sentence in case that it has none."""

    sightings: Mapping[int, Sighting]
    notes: tuple[str, ...]


class _Picture(NamedTuple):
    """A picture as it is looked at: what each object's pixels may be."""

    camera: CameraModel
    depth: Array
    others: tuple[Array, ...]
    segments: tuple[list[Segment], ...]


class Looker:
    """Looks for the objects of one episode.

    Args:
        configuration: The episode; of its objects only what a robot is told is used, and no pose.
        model: What is known of the world.
        errors: What is added to pictures.
        cameras: Names of the cameras that there may be.
    """

    def __init__(
        self,
        configuration: ActorConfiguration,
        model: WorldModel,
        errors: CameraErrors,
        cameras: Sequence[str],
    ) -> None:
        self.targets = tuple(
            Target(known, actor.shape())
            for known, actor in zip(model.objects, configuration.objects, strict=True)
        )
        self._model, self._errors = model, errors
        self._colours = [actor.colour for actor in configuration.objects]
        fixtures = {box.colour for fixture in configuration.fixtures for box in fixture.boxes}
        self._neither = np.array([NEUTRAL, *sorted(fixtures)])
        self._rng = configuration.generator("camera")
        self._calibration = {name: errors.calibration(self._rng) for name in cameras}

    def look(self, capture: Capture) -> Found:
        """Find the objects in a capture.

        Raises:
            MachineError: An image has no depth.
        """
        pictures = {name: self._picture(name, image) for name, image in capture.images.items()}
        every = range(len(self.targets))
        seen = self._sightings(pictures, capture, every)
        found = shared_out(seen)
        if not np.isfinite(capture.estimate).all():
            # At the first look it was not known yet what others stand on.
            lean = [i for i in every if i not in found or not _stands(found[i].fit.pose)]
            known = capture.estimate.copy()
            for i, sighting in found.items():
                if i not in lean:  # else what was found does not count as what was believed before
                    known[i] = sighting.fit.pose
            rest = [sighting for sighting in seen if sighting[0] not in lean]
            again = self._sightings(pictures, replace(capture, estimate=known), lean)
            found = shared_out(rest + again)
        return Found(found, tuple(self._note(i, pictures) for i in every))

    def _picture(self, name: str, image: Image) -> _Picture:
        if image.depth is None:
            raise MachineError(f"camera '{image.camera.name}' gives no depth: poses need an RGB-D camera")
        camera = as_calibrated(image.camera, self._calibration[name])
        depth = self._errors.depth(image.depth, self._rng)
        masks = classify(image.colour, self._colours, self._neither)
        segments, others = [], []
        for i, target in enumerate(self.targets):
            alike = self._alike(i)
            boxes, join = self._model.obstacles, len(alike) == 1
            segments.append(
                find_segments(camera, depth, masks[i], boxes, size=target.diameter, join=join)[
                    : 2 + len(alike)
                ]
            )
            unlike = [mask for k, mask in enumerate(masks) if k not in alike]
            others.append(np.any(unlike or [0 * masks[i]], axis=0))
        return _Picture(camera, depth, tuple(others), tuple(segments))

    def _alike(self, i: int) -> list[int]:
        """Objects of the colour of object ``i``, itself included."""
        return [k for k, colour in enumerate(self._colours) if colour == self._colours[i]]

    def _sightings(
        self, pictures: Mapping[str, _Picture], capture: Capture, wanted: Iterable[int]
    ) -> list[tuple[int, Sighting]]:
        """All that may be one of the wanted objects, with their numbers."""
        found = []
        for i in wanted:
            views = {name: self._views(i, picture) for name, picture in pictures.items()}
            for name, picture in pictures.items():
                for segment, view in zip(picture.segments[i], views[name], strict=True):
                    fit = self._estimated(i, view, capture)
                    if fit is not None:
                        others = [views[other] for other in pictures if other != name]
                        found.append((i, Sighting(fit, name, segment, self._doubt(i, fit, view, others))))
        return found

    def _views(self, i: int, picture: _Picture) -> list[DepthView]:
        """What may be an object in a picture."""
        found = []
        for segment in picture.segments[i]:
            points = self._rng.permutation(segment.points)
            near = boxes_near(self._model.obstacles, np.median(points, axis=0), self.targets[i].diameter)
            found.append(DepthView(picture.camera, picture.depth, points, picture.others[i], near))
        return found

    def _doubt(self, i: int, fit: Fit, view: DepthView, others: Sequence[Sequence[DepthView]]) -> float:
        """How badly a fit to a view explains what all pictures show, each by how much it shows."""
        points = sample_surface(self.targets[i].shape)
        costs, pixels = [fit.cost], [len(view.points)]
        for views in filter(None, others):
            judged = [(judge_fit(points, other, fit.pose).cost, len(other.points)) for other in views]
            cost, size = min(judged)
            costs.append(cost)
            pixels.append(size)
        return float(np.average(costs, weights=pixels))

    def _estimated(self, i: int, view: DepthView, capture: Capture) -> Fit | None:
        """The fit of object ``i`` to what may be it, or None."""
        target, before = self.targets[i], capture.estimate[i]
        if capture.handled[i][0]:
            fit = follow(target, view, before, self._model.places.values())
            moved = float(np.linalg.norm(fit.pose[:3] - before[:3]))
            turned = float(poses.angle_between(fit.pose[3:], before[3:]))
            cost, far, wide = HELD
            return fit if fit.cost < cost and moved < far and turned < wide else None
        known = before if np.isfinite(before[0]) else None
        places = [*self._model.places.values(), *self._tops(i, capture.estimate)]
        return estimate_pose(target, view, places, known)

    def _tops(self, i: int, estimate: Array) -> list[PlaceModel]:
        """The tops of the other objects that stand, as places."""
        tops: list[PlaceModel] = []
        table = next(iter(self._model.places.values()), None)
        for k, target in enumerate(self.targets):
            pose = estimate[k]
            if k == i or table is None or not np.isfinite(pose[0]) or not _stands(pose):
                continue
            x, y, z = target.model.extent
            top = poses.multiply(pose, poses.pose([0.0, 0.0, z / 2]))
            name = target.model.name
            tops.append(replace(table, name=name, pose=top, extent=(x, y), centre=(0.0, 0.0)))
        return tops

    def _note(self, i: int, pictures: Mapping[str, _Picture]) -> str:
        most = max(
            (segment.pixels for picture in pictures.values() for segment in picture.segments[i]), default=0
        )
        amount = f"{most} pixels" if most else f"fewer than {SMALLEST} pixels"
        names = " and ".join(f"'{name}'" for name in pictures)
        cameras = f"cameras {names} show" if len(pictures) > 1 else f"camera {names} shows"
        return (
            f"{self.targets[i].model.name} is not seen: {cameras} {amount} "
            f"of its colour{' but not its shape' if most else ''}"
        )


def shared_out(seen: Sequence[tuple[int, Sighting]]) -> dict[int, Sighting]:
    """One sighting for each object: those of one colour compete for the segments of each picture."""
    by_camera: dict[str, list[tuple[int, Sighting]]] = {}
    for number, sighting in seen:
        by_camera.setdefault(sighting.camera, []).append((number, sighting))
    found: dict[int, Sighting] = {}
    for own in by_camera.values():
        taken: Array = np.zeros(own[0][1].segment.mask.shape, bool)
        here: set[int] = set()
        for number, sighting in sorted(own, key=lambda one: one[1].fit.cost):
            mask = sighting.segment.mask
            if number in here or np.count_nonzero(taken & mask) >= sighting.segment.pixels / 4:
                continue
            here.add(number)
            taken |= mask
            if number not in found or sighting.doubt < found[number].doubt:
                found[number] = sighting
    return found


def _stands(pose: Array) -> bool:
    return float(poses.z_axis(pose[3:])[2]) > UPRIGHT
