"""A look: which known object is where in pictures that cameras took at one time.

Each camera's picture is looked at by itself. Of what several cameras see of one object the fit counts that
explains all their pictures best: one camera may see the handle that is hidden from the other. Objects of one
colour are looked for together (`together.py`), parts of furniture along their joints (`part_sight.py`), those
that are not sensed at the first look alone. Nothing here remembers anything but the generator's state.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.joints import Joints
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import PlaceModel, WorldModel
from bt_tasksim.engines.images import CameraModel, Image
from bt_tasksim.engines.perception.camera_errors import CameraErrors, as_calibrated
from bt_tasksim.engines.perception.fixture_faces import boxes_near
from bt_tasksim.engines.perception.part_sight import PartView, seen_part
from bt_tasksim.engines.perception.pose_estimation import Target, estimate_pose, follow, still_held
from bt_tasksim.engines.perception.registration import DepthView, Fit, judge_fit, sample_surface
from bt_tasksim.engines.perception.segmentation import (
    NEUTRAL,
    SMALLEST,
    Segment,
    classify,
    find_segments,
    groups_of_colour,
)
from bt_tasksim.engines.perception.together import (
    STAGES,
    STANDING,
    ColourView,
    FitStage,
    SameColour,
    Sight,
    group_of,
    pairs_of,
)
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.interchange import told_apart

UPRIGHT = 0.99
"""Height of an object's own z axis from which it is taken to stand."""


@dataclass(frozen=True)
class Capture:
    """Pictures of one time, and what was believed when they came.

    Attributes:
        images: The pictures by camera.
        estimate: Poses ``(n, 7)`` of the objects, NaN where one was never seen.
        handled: For each object, whether the hand held it, and whether it had touched it.
        unsettled: Numbers of those that may have moved since they were seen: the hand let them go.
    """

    images: Mapping[str, Image]
    estimate: Array
    handled: tuple[tuple[bool, bool], ...]
    unsettled: frozenset[int] = frozenset()


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
    """What a capture found: sightings by object, and for each object a sentence in case that it has none.

    ``alike`` are pairs of objects never seen before, of which the pictures do not say which is which although
    it matters; they have no sightings.
    """

    sightings: Mapping[int, Sighting]
    notes: tuple[str, ...]
    alike: tuple[tuple[int, int], ...] = ()


class _Picture(NamedTuple):
    """A picture as it is looked at: what shows each object's colour, other colours, the object alone."""

    camera: CameraModel
    depth: Array
    masks: tuple[Array, ...]
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
        self._free = [i for i, actor in enumerate(configuration.objects) if actor.joint is None]
        alike = groups_of_colour([self._colours[i] for i in self._free])
        self._groups = [[self._free[k] for k in group] for group in alike]
        self._told_apart = partial(told_apart, configuration)
        boxes = [box for fixture in configuration.fixtures for box in fixture.boxes]
        boxes += [box for part in configuration.objects if part.joint is not None for box in part.boxes]
        fixtures = {box.colour for box in boxes}
        self._neither = np.array([NEUTRAL, *sorted(fixtures)])
        self._rng = configuration.generator("camera")
        self._calibration = {name: errors.calibration(self._rng) for name in cameras}

    def look(self, capture: Capture) -> Found:
        """Find the objects in a capture.

        Raises:
            MachineError: An image has no depth.
        """
        pictures = {name: self._picture(name, image) for name, image in capture.images.items()}
        groups = [self._group(group, pictures) for group in self._groups if len(group) > 1]
        every = self._free
        first = not np.isfinite(capture.estimate[every]).all()
        found, sights = self._found(pictures, groups, capture, every, {}, STANDING if first else STAGES)
        known = capture.estimate.copy()
        if first:
            # At the first look it was not known yet what others stand on.
            lean = [i for i in every if i not in found or not _stands(found[i].fit.pose)]
            found = {i: sighting for i, sighting in found.items() if i not in lean}
            sights = {i: sight for i, sight in sights.items() if i not in lean}
            for i, sighting in found.items():
                known[i] = sighting.fit.pose  # what leans does not count as what was believed before
            again, more = self._found(pictures, groups, replace(capture, estimate=known), lean, sights)
            found, sights = found | again, sights | more
        for i, sighting in found.items():
            known[i] = sighting.fit.pose
        never = {i for i in every if not np.isfinite(capture.estimate[i, 0])}
        alike = [
            pair
            for group in groups
            for pair in group.alike(self._mattering(group.members, never), sights, known)
        ]
        unclear = {i for pair in alike for i in pair}
        found = {i: sighting for i, sighting in found.items() if i not in unclear}
        found |= self._seen_parts(pictures, capture)
        notes = tuple(self._note(i, pictures, alike) for i in range(len(self.targets)))
        return Found(found, notes, tuple(alike))

    def sought(self, i: int, first: bool) -> bool:
        """Whether an object is looked for, at the first look or later: all but parts that are not sensed."""
        joint = self.targets[i].model.joint
        return first or joint is None or joint.sensed

    def _seen_parts(self, pictures: Mapping[str, _Picture], capture: Capture) -> dict[int, Sighting]:
        """Sightings of parts of furniture."""
        views = {name: PartView(picture.camera, picture.depth) for name, picture in pictures.items()}
        found = {}
        for i, target in enumerate(self.targets):
            joint, first = target.model.joint, not np.isfinite(capture.estimate[i, 0])
            if joint is None or not self.sought(i, first):
                continue
            joints = Joints.of([joint])
            seen = seen_part(joints, sample_surface(target.shape), views)
            if seen is not None:
                pose = joints.pose(np.array([seen.value]))[0]
                nothing = Segment(np.zeros(views[seen.camera].depth.shape, bool), np.empty((0, 3)))
                found[i] = Sighting(Fit(pose, 0.0, 0.0), seen.camera, nothing, 0.0)
        return found

    def _found(
        self,
        pictures: Mapping[str, _Picture],
        groups: Sequence[SameColour],
        capture: Capture,
        wanted: Collection[int],
        given: Mapping[int, Sight],
        stages: Sequence[FitStage] = STAGES,
    ) -> tuple[dict[int, Sighting], dict[int, Sight]]:
        """Sightings of the wanted objects; and of those that share a colour, what is theirs of it."""
        alone = [i for i in wanted if not any(i in group.members for group in groups)]
        found = best_of(self._sightings(pictures, capture, alone))
        estimate = capture.estimate.copy()
        for i, sighting in found.items():
            if not np.isfinite(estimate[i, 0]) and _stands(sighting.fit.pose):
                estimate[i] = sighting.fit.pose
        held = {i for i, (grip, _) in enumerate(capture.handled) if grip}
        sights: dict[int, Sight] = {}
        for group in groups:
            own = [i for i in wanted if i in group.members]
            there = {i: sight for i, sight in given.items() if i in group.members}
            new = group.track(set(own) - set(there), capture.estimate, held)
            lost = set(own) - set(there) - set(new) - held
            new |= group.find(
                [i for i in lost if not self._still_there(i, group, capture)], estimate, there | new, stages
            )
            sights |= new
            for i, sight in new.items():
                found[i] = self._sighting(sight, group, list(pictures))
        return found, sights

    def _still_there(self, i: int, group: SameColour, capture: Capture) -> bool:
        """Whether an object that nothing has moved is but hidden: then nothing else is taken for it."""
        known = bool(np.isfinite(capture.estimate[i, 0]))
        moved = any(capture.handled[i]) or i in capture.unsettled
        return known and not moved and group.hidden(i, capture.estimate[i])

    def _group(self, members: Sequence[int], pictures: Mapping[str, _Picture]) -> SameColour:
        """The objects of one colour."""
        first = members[0]
        shown = [ColourView(p.camera, p.depth, p.others[first]) for p in pictures.values()]
        masks = [np.any([p.masks[i] for i in members], axis=0) for p in pictures.values()]
        return group_of(self.targets, members, shown, masks, self._model.obstacles, self._places, self._rng)

    def _mattering(self, members: Sequence[int], never: Collection[int]) -> list[tuple[int, int]]:
        """Pairs of objects never seen before, for which it matters which is which."""
        names = [target.model.name for target in self.targets]
        pairs = pairs_of([i for i in members if i in never])
        return [(a, b) for a, b in pairs if self._told_apart(names[a], names[b])]

    def _sighting(self, sight: Sight, group: SameColour, names: Sequence[str]) -> Sighting:
        """What was found together with others, as it is told of one object: the camera that shows most."""
        cloud, own = group.cloud, sight.points
        best = int(np.argmax(np.bincount(cloud.camera[own], minlength=len(names))))
        here = own & (cloud.camera == best)
        mask = np.zeros(group.pictures[best].depth.shape, bool)
        mask[tuple(cloud.pixels[here].T)] = True
        return Sighting(sight.fit, names[best], Segment(mask, cloud.points[here]), sight.fit.cost)

    def _picture(self, name: str, image: Image) -> _Picture:
        if image.depth is None:
            raise MachineError(f"camera '{image.camera.name}' gives no depth: poses need an RGB-D camera")
        camera = as_calibrated(image.camera, self._calibration[name])
        depth = self._errors.depth(image.depth, self._rng)
        nothing = np.zeros(depth.shape, bool)
        masks = [nothing] * len(self.targets)
        own = classify(image.colour, [self._colours[i] for i in self._free], self._neither)
        for i, mask in zip(self._free, own, strict=True):
            masks[i] = mask
        segments: list[list[Segment]] = [[] for _ in self.targets]
        others = [nothing] * len(self.targets)
        for i in self._free:
            target = self.targets[i]
            alike = next(group for group in self._groups if i in group)
            boxes, size = self._model.obstacles, target.diameter
            found = find_segments(camera, depth, masks[i], boxes, size=size) if len(alike) == 1 else []
            segments[i] = found[:3]
            unlike = [mask for k, mask in enumerate(masks) if k not in alike]
            others[i] = np.any(unlike or [nothing], axis=0)
        return _Picture(camera, depth, tuple(masks), tuple(others), tuple(segments))

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
            return fit if still_held(fit, before) else None
        known = before if np.isfinite(before[0]) else None
        return estimate_pose(target, view, self._places(i, capture.estimate), known)

    def _places(self, i: int, estimate: Array) -> list[PlaceModel]:
        """Surfaces on which object ``i`` may stand, others' tops included."""
        return [*self._model.places.values(), *self._tops(i, estimate)]

    def _tops(self, i: int, estimate: Array) -> list[PlaceModel]:
        """The tops of the other objects that stand, as places."""
        tops: list[PlaceModel] = []
        table = next(iter(self._model.places.values()), None)
        for k in self._free:
            target, pose = self.targets[k], estimate[k]
            if k == i or table is None or not np.isfinite(pose[0]) or not _stands(pose):
                continue
            x, y, z = target.model.extent
            top = poses.multiply(pose, poses.pose([0.0, 0.0, z / 2]))
            name = target.model.name
            tops.append(replace(table, name=name, pose=top, extent=(x, y), centre=(0.0, 0.0)))
        return tops

    def _note(self, i: int, pictures: Mapping[str, _Picture], alike: Sequence[tuple[int, int]]) -> str:
        names = " and ".join(f"'{name}'" for name in pictures)
        same = [k for pair in alike for k in pair if i in pair and k != i]
        if same:
            others = " and ".join(f"'{self.targets[k].model.name}'" for k in same)
            one = "cameras" if len(pictures) > 1 else "camera"
            return (
                f"'{self.targets[i].model.name}' and {others} cannot be told apart: they have one colour, "
                f"and {one} {names} would show much the same if they changed places; give them different "
                f"colours"
            )
        cameras = f"cameras {names} show" if len(pictures) > 1 else f"camera {names} shows"
        if self.targets[i].model.joint is not None:
            return f"{self.targets[i].model.name} is not seen: {cameras} too little of where it may be"
        most = max(
            (
                max((segment.pixels for segment in picture.segments[i]), default=0)
                or int(np.count_nonzero(picture.masks[i]))
                for picture in pictures.values()
            ),
            default=0,
        )
        amount = f"{most} pixels" if most >= SMALLEST else f"fewer than {SMALLEST} pixels"
        return (
            f"{self.targets[i].model.name} is not seen: {cameras} {amount} "
            f"of its colour{' but not its shape' if most >= SMALLEST else ''}"
        )


def best_of(seen: Sequence[tuple[int, Sighting]]) -> dict[int, Sighting]:
    """One sighting for each object: of each camera the one that fits best, of these that of least doubt."""
    by_camera: dict[tuple[int, str], Sighting] = {}
    for number, sighting in seen:
        kept = by_camera.get((number, sighting.camera))
        if kept is None or sighting.fit.cost < kept.fit.cost:
            by_camera[number, sighting.camera] = sighting
    found: dict[int, Sighting] = {}
    for (number, _), sighting in by_camera.items():
        if number not in found or sighting.doubt < found[number].doubt:
            found[number] = sighting
    return found


def _stands(pose: Array) -> bool:
    return float(poses.z_axis(pose[3:])[2]) > UPRIGHT
