"""Synthetic demonstrations from runs in simulation: what a tree did, as if a person had, and been recorded.

No task is known here. Whatever leaves a tree has, the log shows the motion of the hand and of the objects
with the errors of a recording, the labels are the spans in which leaves were at work, and the narration is
what their concepts say of themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.functions import ConceptFunctions
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.demos_decomp.log import Demonstration, Floats, Track, Utterance
from bt_tasksim.demos_decomp.synthetic import TaskLabel
from bt_tasksim.demos_decomp.synthetic_motion import Sensing, kept_samples, noisy_poses, tremor
from bt_tasksim.policy.policy import concept_name

RUNNING, SUCCESS = 1, 2
"""Of statuses in run logs, see `bt_tasksim.execution.run_log`."""
TALKS = 0.75
"""Share of the tasks of which a person who talks says something."""


def as_person(
    run: Demonstration,
    nodes: Sequence[Behaviour],
    seed: int,
    sensing: Sensing | None = None,
    name: str = "000",
    talk: bool = True,
) -> tuple[Demonstration, list[TaskLabel]]:
    """A run as a recording of a person's hand.

    Args:
        run: What a run recorder kept.
        nodes: The nodes of the tree that ran, in the order of the run's statuses.
        seed: The same seed, the same errors.
        sensing: Quality of the recording.
        name: Its name in a log.
        talk: The person says what they do, now and then.

    Returns:
        The demonstration, and what was really done when.

    Raises:
        InputError: The run has no statuses of these nodes.
    """
    status = run.extra.get("tree/status")
    if status is None or status.shape != (len(run.time), len(nodes)):
        raise InputError(f"the run '{run.name}' holds no statuses of the {len(nodes)} nodes of this tree")
    sensing, rng = sensing or Sensing(), np.random.default_rng(seed)
    done = [
        (TaskLabel(concept_name(type(leaf.model)), start, end), leaf)
        for k, leaf in enumerate(nodes)
        if isinstance(leaf, ConceptNode)
        for start, end in _spans(np.asarray(run.time, float), status[:, k])
    ]
    done.sort(key=lambda each: each[0].start)
    ticks = kept_samples(run.time - run.time[0], sensing, rng) + run.time[0]
    hand = _at(run.time, run.hand_pose, ticks)
    hand[:, :3] += tremor(ticks, sensing.tremor, rng)
    objects = {}
    for key, track in run.objects.items():
        seen = noisy_poses(_at(run.time, track.pose, ticks), sensing.object, sensing.object_angle, rng)
        seen[:, :3] += rng.normal(0, sensing.bias, 3)
        objects[key] = Track(seen, track.kind, track.size)
    opening = np.interp(ticks, run.time, run.hand_opening) + rng.normal(0, sensing.opening, len(ticks))
    demonstration = Demonstration(
        name=name,
        time=ticks,
        hand_pose=noisy_poses(hand, sensing.hand, sensing.hand_angle, rng),
        hand_opening=np.maximum(opening, 0.0),
        objects=objects,
        places=run.places,
        task=run.task,
        seed=run.seed,
        narration=_narration(done, rng) if talk else (),
    )
    return demonstration, [label for label, _ in done]


def _spans(time: Floats, status: Floats) -> list[tuple[float, float]]:
    """First and last second of each activation of a node that succeeded; of one that failed nothing is said.

    Args:
        time: ``(T,)``.
        status: Of the node ``(T,)``.
    """
    found, began = [], None
    for k, now in enumerate(status.tolist()):
        if now == RUNNING and began is None:
            began = float(time[k])
        elif now != RUNNING and began is not None:
            if now == SUCCESS:
                found.append((began, float(time[k])))
            began = None
    return found


def _at(time: Floats, track: Floats, ticks: Floats) -> Floats:
    """Poses ``(T, 7)`` of a track ``(N, 7)`` at other times."""
    after = np.clip(np.searchsorted(time, ticks, side="right"), 1, len(time) - 1)
    share = np.clip((ticks - time[after - 1]) / (time[after] - time[after - 1]), 0.0, 1.0)
    return np.array(poses.interpolate(track[after - 1], track[after], share))


def _narration(
    done: Sequence[tuple[TaskLabel, ConceptNode]], rng: np.random.Generator
) -> tuple[Utterance, ...]:
    said = []
    for label, leaf in done:
        presentation = type(leaf.model).presentation
        sayings = presentation.sayings
        if not sayings or rng.random() >= TALKS:
            continue
        names = _named(leaf.model)
        of = "place" if presentation.says_destination and "place" in names else "object"
        word = names.get(of, "it")
        text = str(rng.choice(sayings)).format(word.replace("_", " "))
        when = rng.uniform(label.start - 0.3, max(label.start, label.end - 0.2))
        said.append(Utterance(round(float(max(when, 0.0)), 2), text))
    return tuple(sorted(said, key=lambda utterance: utterance.time))


def _named(model: ConceptFunctions[Any]) -> dict[str, str]:
    """The first object and the first place that a concept's parameters name."""
    found: dict[str, str] = {}
    for name, parameter in type(model).parameters().items():
        value = model.values.get(name)
        if isinstance(value, str) and parameter.quantity.kind in ("object", "place"):
            found.setdefault(parameter.quantity.kind, value)
    return found
