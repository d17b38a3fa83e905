"""From holds and flights to tasks: which contact state was broken, kept or made.

A hold begins with grasp and ends with release. In between, breaking contact (PC -> NC) is pick, making it
(NC -> PC) is place, and what keeps the object in the air (NC) is bring. Contact alone does not say how far
a pick goes: it lasts as long as the object moves along the direction that detached it.
"""

from __future__ import annotations

import numpy as np

from bt_tasksim.concept.contact import ContactChange
from bt_tasksim.concept.task import Task
from bt_tasksim.demos_decomp.concepts import CARRIES, GRASPS, LANDS, LIFTS, RELEASES, concepts, name_of
from bt_tasksim.demos_decomp.evidence import Check, confidence, spoken_odds
from bt_tasksim.demos_decomp.log import Demonstration, Floats
from bt_tasksim.demos_decomp.parameters import bring_parameters, grasp_parameters, straight_parameters
from bt_tasksim.demos_decomp.remarks import Remark, RemarkKind
from bt_tasksim.demos_decomp.segmentation import DROP, Flight, HandClosed, find_flights, find_holds
from bt_tasksim.demos_decomp.signals import SmoothMotion, evenly_sampled
from bt_tasksim.demos_decomp.support import Support, bin_under, resting_on

SIDEWAYS = 0.015
"""Metres sideways from the detaching direction after which motion in the air is bring and no longer pick."""

CLEARANCE = 0.03
"""Metres that a pick goes where it passes into bring without a bend."""

SLID = 0.03
"""Metres along its support that a task may move its object before it lifts it, or after it sets it down."""

LONGEST_GAP = 0.6
"""Seconds without data in which a whole task could pass unseen."""


def recognise(shown: Demonstration) -> tuple[list[Task], list[Remark]]:
    """Recognises the tasks of a demonstration.

    Args:
        shown: A checked demonstration.

    Returns:
        Tasks in order of time, and remarks about what was seen and not understood.
    """
    motion = evenly_sampled(shown)
    holds, remarks = find_holds(shown, motion)
    tasks: list[Task] = []
    free = 0
    for hold in holds:
        if hold.closing is not None:
            tasks.append(_grasp(shown, motion, hold, free))
        flights, seen = find_flights(shown, motion, hold)
        remarks += seen
        since = hold.first
        for flight in flights:
            tasks += _flight_tasks(shown, motion, hold, flight, since)
            remarks += [remark for _, remark in _slides(motion, hold, flight).values()]
            since = flight.last
        free = hold.last
        if hold.opening is not None:
            tasks.append(_release(shown, motion, hold, flights, since))
            free = hold.opening.last
    for concept in concepts().values():
        tasks = list(concept.recognise(shown, tasks))
    return tasks, remarks


def _grasp(shown: Demonstration, motion: SmoothMotion, hold: HandClosed, since: int) -> Task:
    checks = list(hold.checks)
    parameters = grasp_parameters(motion, hold)
    return _task(motion, name_of(GRASPS), since, hold.first, checks, parameters)


def _release(
    shown: Demonstration, motion: SmoothMotion, hold: HandClosed, flights: list[Flight], since: int
) -> Task:
    assert hold.opening is not None
    name = hold.target
    end = min(hold.opening.last, len(motion.time) - 1)
    parameters: dict[str, object] = {"target": name}
    inside = bin_under(shown, motion, name, min(hold.last + 1, len(motion.time) - 1))
    if inside is not None:
        parameters["into"] = inside.name
    spread = 0.002 + motion.opening_noise
    said = spoken_odds(shown.narration, name_of(RELEASES), motion.time[since], motion.time[end])
    checks = [Check("hand opens, m", hold.opening.change, 0.006, spread, odds=said)]
    landed = flights[-1].landed if flights else None
    falls = landed is not None and not landed
    if landed is not None and falls:
        checks.append(landed.opposite())
    stays = np.linalg.norm(motion.objects[name][hold.until, :3] - motion.objects[name][hold.last, :3])
    leaves = np.linalg.norm(motion.hand[hold.until, :3] - motion.hand[hold.last, :3])
    if leaves > 0.03 and not falls:
        checks.append(
            Check(f"{name} stays as the hand leaves, m", float(stays), float(leaves), 0.01, below=True)
        )
    return _task(motion, name_of(RELEASES), since, end, checks, parameters)


def _flight_tasks(
    shown: Demonstration, motion: SmoothMotion, hold: HandClosed, flight: Flight, since: int
) -> list[Task]:
    """Pick, bring and place of one flight; those that took place."""
    name = hold.target
    path = motion.objects[name][flight.first : flight.last + 1, :3]
    lands = flight.landed is not None and bool(flight.landed)
    up, down, carried = _phases(shown, motion, hold, flight, lands)
    slides = _slides(motion, hold, flight)
    tasks: list[Task] = []
    if flight.lifted is not None:
        off = resting_on(
            shown, motion, name, flight.first, _standing(motion, name, flight.first, flight.rest_before)
        )
        parameters = {"target": name, **straight_parameters(flight.rest_before, path[up])}
        if off is not None:
            parameters["off"] = off.name
        tasks.append(
            _task(
                motion,
                name_of(LIFTS),
                since,
                flight.first + up,
                [*_gap_check(off), flight.lifted, *_checks_of(slides, LIFTS)],
                parameters,
            )
        )
        since = flight.first + up
    target = _destination(shown, motion, hold, flight, lands)
    if carried:
        until = flight.first + down
        moved, way = bring_parameters(path[up : down + 1], target)
        tasks.append(_task(motion, name_of(CARRIES), since, until, [carried], {"target": name, **moved}, way))
        since = until
    if lands and flight.landed is not None:
        parameters = {"target": name, **straight_parameters(path[down], flight.rest_after)}
        if target is not None:
            parameters["on"] = target.name
        else:
            parameters["position"] = flight.rest_after
        checks = [*_gap_check(target), flight.landed, *_checks_of(slides, LANDS)]
        tasks.append(_task(motion, name_of(LANDS), since, flight.last, checks, parameters))
    return tasks


def _slides(
    motion: SmoothMotion, hold: HandClosed, flight: Flight
) -> dict[ContactChange, tuple[Check, Remark]]:
    """Motion along the support before a pick and after a place, which these do not explain, by what they do.

    A short one counts for nothing: hands push what they take, and settle what they set down.
    """
    name, noise = hold.target, motion.noise[hold.target]
    path = motion.objects[name][flight.first : flight.last + 1, :3]
    ends = {}
    if flight.lifted is not None:
        ends[LIFTS] = (path[0] - flight.rest_before, "before it was lifted", flight.first)
    if flight.landed is not None and flight.landed:
        ends[LANDS] = (flight.rest_after - path[-1], "after it was set down", flight.last)
    found = {}
    for does, (way, when, at) in ends.items():
        slid = float(np.linalg.norm(way[:2]))
        if slid > SLID + 4 * noise:
            check = Check(f"{name} stays {when}, m", slid, SLID, 0.005 + noise, below=True)
            said = f"{name} moved {slid:.3f} m {when} at {motion.time[at]:.1f} s"
            found[does] = (check, Remark(RemarkKind.MOTION, said))
    return found


def _checks_of(slides: dict[ContactChange, tuple[Check, Remark]], does: ContactChange) -> list[Check]:
    return [slides[does][0]] if does in slides else []


def _phases(
    shown: Demonstration, motion: SmoothMotion, hold: HandClosed, flight: Flight, lands: bool
) -> tuple[int, int, Check]:
    """Where pick ends and place begins on the path of a flight, and whether there is a bring between."""
    path = motion.objects[hold.target][flight.first : flight.last + 1, :3]
    noise = motion.noise[hold.target]
    end = len(path) - 1
    up = _bend(path, flight.rest_before, noise) if flight.lifted is not None else 0
    down = end - _bend(path[::-1], flight.rest_after, noise) if lands else end
    sideways = float(np.linalg.norm(path[end, :2] - path[0, :2]))
    rise = float(abs(path[end, 2] - path[0, 2]))
    steep = sideways > 0.006 and sideways > 0.2 * rise  # 11 degrees off the normal
    moves_on = steep or sideways > SIDEWAYS
    if moves_on and (down <= up or _length(path[up : down + 1]) < SIDEWAYS):
        if flight.lifted is not None:
            up = _cleared(path)
        if lands:
            down = end - _cleared(path[::-1])
        if down <= up:
            up = down = max(1, (up + down) // 2)
    down = max(down, up)
    start, stop = motion.time[flight.first + up], motion.time[flight.first + down]
    said = spoken_odds(shown.narration, name_of(CARRIES), start, stop) if stop > start else 1.0
    travel = _length(path[up : down + 1]) if stop > start else 0.0
    if lands or flight.lifted is None:
        what, value, limit = "carried, m", travel, SIDEWAYS
    else:
        what, value, limit = "carried sideways, m", sideways, 0.006 if steep else SIDEWAYS
        if up < end and travel > 2 * SIDEWAYS and not sideways > SIDEWAYS:
            what, value, limit = "carried on, m", travel, 2 * SIDEWAYS
    carried = Check(what, value, limit, 0.002 + noise, odds=said)
    if not carried:
        up = down = end if not lands else max(up, down)
    return up, down, carried


def _bend(path: Floats, rest: Floats, noise: float) -> int:
    """Index up to which a path leaves its resting point along the vertical, within 27 degrees.

    It is the first peak of height minus twice the distance sideways; a later dip of less than 8 mm (and of
    less than the noise) does not end it. Where there is no such peak above half the `CLEARANCE`, it is
    where the object is clear.
    """
    height = np.abs(path[:, 2] - rest[2])
    score = height - 2 * np.linalg.norm(path[:, :2] - path[0, :2], axis=1)
    highest = np.maximum.accumulate(score)
    ends = np.flatnonzero(highest - score > 0.008 + 4 * noise)
    peak = int(np.argmax(score[: ends[0] + 1] if ends.size else score))
    return peak if height[peak] > CLEARANCE / 2 else _cleared(path)


def _cleared(path: Floats) -> int:
    """Index at which a path has left its first point by `CLEARANCE`, or by half its reach if that is less."""
    distance = np.linalg.norm(path - path[0], axis=1)
    return max(1, int(np.argmax(distance >= min(CLEARANCE, 0.5 * float(distance.max())))))


def _destination(
    shown: Demonstration, motion: SmoothMotion, hold: HandClosed, flight: Flight, lands: bool
) -> Support | None:
    if lands:
        pose = _standing(motion, hold.target, flight.last, flight.rest_after)
        return resting_on(shown, motion, hold.target, flight.last, pose)
    if hold.opening is not None:
        return bin_under(shown, motion, hold.target, min(hold.last + 1, len(motion.time) - 1))
    return None


def _standing(motion: SmoothMotion, name: str, index: int, position: Floats) -> Floats:
    return np.concatenate([position, motion.objects[name][index, 3:]])


def _gap_check(support: Support | None) -> list[Check]:
    if support is None:
        return []
    return [Check(f"gap to {support.name}, m", abs(support.gap), DROP, 0.005, below=True)]


def _length(path: Floats) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _task(
    motion: SmoothMotion,
    concept: str,
    first: int,
    last: int,
    checks: list[Check],
    parameters: dict[str, object],
    path: Floats | None = None,
) -> Task:
    start, end = float(motion.time[first]), float(motion.time[max(first, last)])
    gap = motion.gap(first, max(first, last))
    checks = [*checks, Check("longest gap in the data, s", gap, LONGEST_GAP, 0.1, below=True)]
    reasons = tuple(str(check) for check in checks)
    return Task(concept, start, end, confidence(checks), parameters, reasons, path)
