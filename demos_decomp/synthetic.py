"""Labelled synthetic demonstrations of a person at work, for tests and for the shipped logs.

They are made up by a program (``source`` is ``synthetic``): scripted hand motion in the scenes of the
ready-made scenarios, with the errors of a recording. ``python -m demos_decomp.synthetic --out FOLDER`` makes
the shipped logs again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import BtTasksimError, InputError, nearest
from bt_tasksim.demos_decomp.concepts import concepts
from bt_tasksim.demos_decomp.log import Demonstration, Floats, Log, Track, Utterance
from bt_tasksim.demos_decomp.log_file import write_log
from bt_tasksim.demos_decomp.synthetic_motion import Sensing, kept_samples, noisy_poses, tremor
from bt_tasksim.demos_decomp.synthetic_scenes import SCRIPTS, Performance

SHIPPED = 10

CHATTER = ("like this", "let's see", "okay", "this is easy")
"""What people say besides."""


@dataclass(frozen=True)
class TaskLabel:
    """What the script did: a concept, and its first and last second."""

    concept: str
    start: float
    end: float


def make(
    scenario: str, seed: int, sensing: Sensing | None = None, name: str = "000", talk: bool | None = None
) -> tuple[Demonstration, list[TaskLabel]]:
    """Makes a demonstration.

    Args:
        scenario: ``pick_and_place``, ``shelf_to_shelf`` or ``pick_and_throw``.
        seed: Same seed, same demonstration.
        sensing: Quality of the recording.
        name: Its name in a log.
        talk: Whether the person says what they do; by default seven in ten do.

    Returns:
        The demonstration, and what was really done when.

    Raises:
        InputError: There is no such scenario.
    """
    if scenario not in SCRIPTS:
        raise InputError(f"there is no synthetic scenario '{scenario}'{nearest(scenario, SCRIPTS)}")
    sensing = sensing or Sensing()
    rng = np.random.default_rng([seed, sorted(SCRIPTS).index(scenario)])
    shown = SCRIPTS[scenario](rng)
    time, hand, opening = shown.hand.trajectory()
    hand[:, :3] += tremor(time, sensing.tremor, rng)
    moving = _object_track(time, hand, shown)

    ticks = kept_samples(time, sensing, rng)
    at = np.clip(np.searchsorted(time, ticks), 0, len(time) - 1)
    objects = {}
    for key, thing in shown.objects.items():
        track = moving[at] if key == shown.target else np.tile(thing.pose, (len(at), 1))
        seen = noisy_poses(track, sensing.object, sensing.object_angle, rng)
        seen[:, :3] += rng.normal(0, sensing.bias, 3)
        objects[key] = Track(seen, thing.kind, thing.size)
    width = np.maximum(opening[at] + rng.normal(0, sensing.opening, len(at)), 0.0)
    says = rng.random() < 0.7 if talk is None else talk
    labels = [TaskLabel(*label) for label in shown.labels]
    demonstration = Demonstration(
        name=name,
        time=ticks,
        hand_pose=noisy_poses(hand[at], sensing.hand, sensing.hand_angle, rng),
        hand_opening=width,
        objects=objects,
        places=shown.places,
        task=scenario,
        seed=seed,
        narration=_narration(labels, shown, rng) if says else (),
    )
    return demonstration, labels


def _object_track(time: Floats, hand: Floats, shown: Performance) -> Floats:
    """True poses ``(N, 7)`` of the target: it stands, moves with the hand, and stands, or falls, again."""
    track = np.tile(shown.objects[shown.target].pose, (len(time), 1))
    held = (time >= shown.closed) & (time < shown.opened)
    first = int(np.argmax(held))
    grip = poses.multiply(poses.inverse(hand[first]), track[first])
    track[held] = poses.multiply(hand[held], np.broadcast_to(grip, (int(held.sum()), 7)))
    last = int(np.flatnonzero(held)[-1])
    floor = shown.rest[2]
    standing = held & (np.arange(len(time)) < last) & (time > shown.closed)
    track[standing, 2] = np.maximum(track[standing, 2], shown.lowest)
    falls = np.maximum(time[last + 1 :] - time[last], 0.0)
    drop = 0.5 * 9.81 * falls**2
    height = max(float(track[last, 2] - floor), 0.0)
    share = np.clip(falls / max(np.sqrt(2 * height / 9.81), 0.12), 0.0, 1.0)
    track[last + 1 :] = poses.interpolate(
        np.broadcast_to(track[last], (len(falls), 7)), np.broadcast_to(shown.rest, (len(falls), 7)), share
    )
    track[last + 1 :, 2] = np.maximum(track[last, 2] - drop, floor)
    return track


def _narration(
    labels: Sequence[TaskLabel], shown: Performance, rng: np.random.Generator
) -> tuple[Utterance, ...]:
    said = []
    known = concepts()
    for label in labels:
        if rng.random() < 0.75:
            presentation = known[label.concept].presentation
            word = shown.destination if presentation.says_destination else shown.target
            text = str(rng.choice(presentation.sayings)).format(word.replace("_", " "))
            when = rng.uniform(label.start - 0.3, max(label.start, label.end - 0.2))
            said.append(Utterance(round(float(max(when, 0.0)), 2), text))
    if rng.random() < 0.5:
        when = float(rng.uniform(0.2, labels[-1].end))
        said.append(Utterance(round(when, 2), str(rng.choice(CHATTER))))
    return tuple(sorted(said, key=lambda utterance: utterance.time))


def shipped(scenario: str) -> list[tuple[Demonstration, list[TaskLabel]]]:
    """The demonstrations that are shipped, one to a file."""
    return [make(scenario, 1000 + number) for number in range(SHIPPED)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the shipped logs: ``FOLDER/<scenario>/00.h5`` to ``09.h5``."""
    parser = argparse.ArgumentParser(description="Makes the shipped synthetic demonstrations again.")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    out = parser.parse_args(arguments).out
    try:
        for scenario in SCRIPTS:
            (out / scenario).mkdir(parents=True, exist_ok=True)
            for number, (demonstration, _) in enumerate(shipped(scenario)):
                about = (
                    f"Made up by demos_decomp.synthetic: a person's {scenario}, seed {demonstration.seed}."
                )
                write_log(out / scenario / f"{number:02d}.h5", Log("synthetic", (demonstration,), about))
    except BtTasksimError as error:
        sys.stderr.write(f"{error}\n")
        return 2 if isinstance(error, InputError) else 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
