"""When the hand holds which object, and when that object is in the air.

The hand's opening says when it closes and opens; that an object moves with the hand says what it holds; the
height above where the object stood, stands and will stand says when its contact with the world is broken
and made. In the taxonomy's words: an object that stands is in contact state PC, one in the air in NC.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.demos_decomp.concepts import GRASPS, LANDS, LIFTS, RELEASES, name_of
from bt_tasksim.demos_decomp.evidence import NAMED, Check, spoken_odds
from bt_tasksim.demos_decomp.log import Demonstration, Floats
from bt_tasksim.demos_decomp.remarks import Remark, RemarkKind
from bt_tasksim.demos_decomp.signals import RATE, SmoothMotion, Swing, speed, swings
from bt_tasksim.demos_decomp.support import bin_under, half_height, resting_on

LEAST_SWING = 0.006
"""Smallest change of the hand's opening, metres, that counts as closing or opening."""

LIFT = 0.008
"""Height in metres above its stand from which an object counts as lifted."""

DROP = 0.025
"""Fall in metres after which an object was let go in the air and not placed."""

PLACED = 3.0
"""Odds that a person places a thing and does not drop it, where there is no bin to drop it into."""

NEAR = 0.06
"""Largest distance in metres between the tool's origin and the box around what it holds."""

STILL = 0.03
"""Speed in m/s below which an object counts as resting."""


@dataclass(frozen=True)
class HandClosed:
    """A span of time in which the hand holds an object.

    Attributes:
        target: The object.
        first: Sample at which the hand has closed.
        last: Sample at which the hand, opening, parts from the object; or the last sample.
        closing: The closing of the hand; None where the demonstration begins with the object in the hand.
        opening: The opening; None where it ends with the object in the hand.
        until: Sample at which the next hold begins, or the last sample.
        checks: What the claim that this object is held rests on.
    """

    target: str
    first: int
    last: int
    closing: Swing | None
    opening: Swing | None
    until: int
    checks: tuple[Check, ...]


@dataclass(frozen=True)
class Flight:
    """A span of a hold in which the object touches nothing but the hand.

    Attributes:
        first: Sample at which the contact is broken, or the hold begins.
        last: Sample at which contact is made, or the hold ends.
        lifted: The claim that contact was broken; None where the object was in the air from the start.
        landed: The claim that the object was put onto something; None where it was still held at the end.
        rest_before: ``(3,)`` position at which it stood before.
        rest_after: ``(3,)`` position at which it came to stand.
    """

    first: int
    last: int
    lifted: Check | None
    landed: Check | None
    rest_before: Floats
    rest_after: Floats


def find_holds(shown: Demonstration, motion: SmoothMotion) -> tuple[list[HandClosed], list[Remark]]:
    """Finds what the hand holds, and when.

    Args:
        shown: The demonstration.
        motion: The same, evenly sampled.

    Returns:
        Holds in order of time, and remarks about closings of the hand that held nothing.
    """
    span = float(np.ptp(motion.opening))
    threshold = max(LEAST_SWING, 7 * motion.opening_noise, 0.12 * span)
    found = swings(motion.opening, threshold)
    end = len(motion.time) - 1
    closed: list[tuple[Swing | None, Swing | None]] = []
    if not found or found[0].change > 0:
        closed.append((None, found[0] if found else None))
    for i, swing in enumerate(found):
        if swing.change < 0:
            closed.append((swing, found[i + 1] if i + 1 < len(found) else None))
    holds: list[HandClosed] = []
    remarks: list[Remark] = []
    for closing, opening in closed:
        first = closing.last if closing else 0
        last = opening.first if opening else end
        hold, why_not = _held(shown, motion, first, last, closing, opening, threshold)
        if hold is not None:
            holds.append(hold)
        elif closing is not None:
            said = f"the hand closed at {motion.time[first]:.1f} s, but held no object ({why_not})"
            remarks.append(Remark(RemarkKind.EMPTY_HAND, said))
    holds = [_until_parting(motion, hold) for hold in _without_regrips(motion, holds)]
    limits = [later.closing.first if later.closing else later.first for later in holds[1:]] + [end]
    return [replace(hold, until=limit) for hold, limit in zip(holds, limits, strict=False)], remarks


def find_flights(
    shown: Demonstration, motion: SmoothMotion, hold: HandClosed
) -> tuple[list[Flight], list[Remark]]:
    """Finds when a held object is in the air.

    Args:
        shown: The demonstration.
        motion: The same, evenly sampled.
        hold: From `find_holds`.

    Returns:
        Flights in order of time, and remarks about motion in contact that none of the concepts explains.
    """
    track = motion.objects[hold.target]
    noise = motion.noise[hold.target]
    before = _rest_before(motion, hold)
    after = _rest_after(motion, hold)
    name = hold.target
    flights: list[Flight] = []
    start, stood = hold.first, before
    starts_in_air = hold.closing is None and not _stands_at_start(shown, motion, hold)
    pauses = _pauses(shown, motion, hold)
    for pause in [*pauses, (hold.last, hold.last)]:
        piece = track[start : pause[0] + 1, :3]
        final = pause[0] == hold.last
        rest = after if final else np.median(track[pause[0] : pause[1] + 1, :3], axis=0)
        height = np.abs(piece[:, 2] - stood[2])
        odds = spoken_odds(shown.narration, name_of(LIFTS), motion.time[start], motion.time[pause[0]])
        lifted: Check | None = Check(f"{name} lifted, m", float(height.max()), LIFT, 0.002 + noise, odds=odds)
        broken = start
        if starts_in_air and not flights:
            lifted = None
        elif not lifted:
            moved = float(np.linalg.norm(piece[:, :2] - stood[:2], axis=1).max())
            if moved > 0.01:
                at = f"{motion.time[start]:.1f} to {motion.time[pause[0]]:.1f} s"
                said = f"{name} moved {moved:.3f} m without being lifted ({height.max():.3f} m) from {at}"
                return flights, [Remark(RemarkKind.MOTION, said)]
            return flights, []
        else:
            clear = int(np.argmax(height > min(LIFT, 0.9 * height.max())))
            stands = np.flatnonzero(height[: clear + 1] < 0.003 + 2 * noise)
            broken = start + (int(stands[-1]) if stands.size else 0)
        landed = _landing(shown, motion, hold, after) if final else _sure(name)
        made = pause[0]
        if landed is not None and landed:
            above = np.abs(track[broken : pause[0] + 1, 2] - rest[2])
            high = np.flatnonzero(above > LIFT)
            low = np.flatnonzero(above < 0.003 + 2 * noise)
            low = low[low > (high[-1] if high.size else 0)]
            made = broken + int(low[0]) if low.size else pause[0]
        flights.append(Flight(broken, max(made, broken + 1), lifted, landed, stood, rest))
        start, stood = pause[1], rest
    return flights, []


def _held(
    shown: Demonstration,
    motion: SmoothMotion,
    first: int,
    last: int,
    closing: Swing | None,
    opening: Swing | None,
    threshold: float,
) -> tuple[HandClosed | None, str]:
    """The hold between two samples, if it is one; and if not, what speaks most clearly against it."""
    if last - first < 3:
        return None, "it opened at once"
    best: HandClosed | None = None
    score = np.inf
    against: list[Check] = []
    hand = motion.hand[first : last + 1]
    for name, track in motion.objects.items():
        moved = track[first : last + 1]
        # Where the hand grips, in the object's frame: there, although the object may turn in the grip.
        grip = poses.transform(poses.inverse(moved), hand[:, :3])
        travel = float(np.linalg.norm(moved[:, :3] - moved[0, :3], axis=1).max())
        slip = float(np.linalg.norm(grip - np.median(grip, axis=0), axis=1).max())
        distance = float(np.linalg.norm(np.maximum(np.abs(grip[0]) - shown.objects[name].size / 2, 0)))
        noise = motion.noise[name]
        odds = spoken_odds(shown.narration, name_of(GRASPS), motion.time[first] - 1, motion.time[first])
        checks = [
            Check(f"{name} follows the hand, m", travel, 0.007 + 3 * noise, 0.002 + noise, odds=odds),
            Check(
                f"{name} stays in the hand, m",
                slip,
                0.015 + 0.2 * travel + 3 * noise,
                0.004 + 2 * noise,
                below=True,
            ),
            Check(f"hand at {name}, m", distance, NEAR, 0.01, below=True),
        ]
        if closing is not None:
            spread = 0.001 + motion.opening_noise
            left = float(np.median(motion.opening[first : last + 1]))
            checks.append(Check("hand closes, m", -closing.change, threshold, spread))
            checks.append(Check("hand is not shut, m", left, 0.001, spread / 2))
        ratio = slip / max(travel, 1e-9) + distance
        if all(checks) and ratio < score:
            best, score = HandClosed(name, first, last, closing, opening, last, tuple(checks)), ratio
        against.append(min(checks, key=lambda check: check.probability))
    return best, str(max(against, key=lambda check: check.probability))


def _until_parting(motion: SmoothMotion, hold: HandClosed) -> HandClosed:
    """The hold up to where the opening hand parts from the object, not just begins to open."""
    if hold.opening is None:
        return hold
    span = slice(hold.last, min(hold.opening.last, len(motion.time) - 1) + 1)
    grip = poses.transform(poses.inverse(motion.objects[hold.target][span]), motion.hand[span, :3])
    apart = np.linalg.norm(grip - grip[0], axis=1) > 0.003 + 3 * motion.noise[hold.target]
    parted = max(int(np.argmax(apart)) - 2, 0) if apart.any() else len(apart) - 1
    return replace(hold, last=hold.last + parted)


def _without_regrips(motion: SmoothMotion, holds: Sequence[HandClosed]) -> list[HandClosed]:
    """Joins holds of one object between which the hand only shifted its grip."""
    joined: list[HandClosed] = []
    for hold in holds:
        earlier = joined[-1] if joined else None
        if (
            earlier is None
            or earlier.target != hold.target
            or earlier.opening is None
            or hold.closing is None
        ):
            joined.append(hold)
            continue
        span = slice(earlier.last, hold.first + 1)
        in_hand = poses.transform(poses.inverse(motion.hand[span]), motion.objects[hold.target][span, :3])
        drift = float(np.linalg.norm(in_hand - in_hand[0], axis=1).max())
        stays = drift < 0.012 + 4 * motion.noise[hold.target]
        grip = abs(earlier.closing.change) if earlier.closing else abs(hold.closing.change)
        if stays and earlier.opening.change < 0.4 * grip:
            joined[-1] = replace(earlier, last=hold.last, opening=hold.opening)
        else:
            joined.append(hold)
    return joined


def _rest_before(motion: SmoothMotion, hold: HandClosed) -> Floats:
    end = hold.first if hold.closing else min(hold.first + 5, hold.last)
    begin = max(0, (hold.closing.first if hold.closing else hold.first) - int(0.3 * RATE))
    return np.asarray(np.median(motion.objects[hold.target][begin : end + 1, :3], axis=0))


def _rest_after(motion: SmoothMotion, hold: HandClosed) -> Floats:
    """Where the object has come to rest after the hold, or where the hold ends."""
    if hold.opening is None:
        return motion.objects[hold.target][hold.last, :3]
    end = min(hold.until, hold.opening.last + int(1.5 * RATE), len(motion.time) - 1)
    begin = max(hold.last, end - int(0.4 * RATE))
    return np.asarray(np.median(motion.objects[hold.target][begin : end + 1, :3], axis=0))


def _stands_at_start(shown: Demonstration, motion: SmoothMotion, hold: HandClosed) -> bool:
    resting = resting_on(shown, motion, hold.target, hold.first)
    return resting is not None and abs(resting.gap) < 0.012


def _landing(shown: Demonstration, motion: SmoothMotion, hold: HandClosed, after: Floats) -> Check | None:
    """The claim that the object was placed and not let go in the air; None while it is held."""
    if hold.opening is None:
        return None
    track = motion.objects[hold.target]
    noise = motion.noise[hold.target]
    released = hold.last
    lowest = track[:, 2] - half_height(track, shown.objects[hold.target].size)
    end = min(hold.until, released + int(2 * RATE))
    rests = np.flatnonzero(np.abs(lowest[released : end + 1] - lowest[end]) < 0.004 + 2 * noise)
    rest = released + int(rests[0]) if rests.size else end
    # What the hand lowers goes down with the hand, what it lets go falls away from it.
    lags = (track[rest, :3] - track[released, :3]) - (motion.hand[rest, :3] - motion.hand[released, :3])
    drop = min(float(lowest[released] - lowest[end]), float(np.linalg.norm(lags)))
    if len(track) - 1 - released < 0.1 * RATE:  # the log ends here: only what is below can tell
        support = resting_on(shown, motion, hold.target, released)
        drop = abs(support.gap) if support else 2 * DROP
    last = motion.time[hold.last]
    odds = spoken_odds(shown.narration, name_of(LANDS), last - 0.5, last)
    if spoken_odds(shown.narration, name_of(RELEASES), last, last) == NAMED:
        odds = 1.0
    if bin_under(shown, motion, hold.target, released) is None:
        odds = max(odds, PLACED)
    spread = 0.004 + 2 * noise
    return Check(f"{hold.target} falls after release, m", drop, DROP, spread, below=True, odds=odds)


def _pauses(shown: Demonstration, motion: SmoothMotion, hold: HandClosed) -> list[tuple[int, int]]:
    """Spans within a hold in which the object was put down, not let go, and lifted again."""
    track = motion.objects[hold.target]
    slow = speed(track[:, :3]) < STILL
    spans = []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], slow[hold.first : hold.last + 1], [0]])))
    for a, b in edges.reshape(-1, 2) + hold.first:
        earlier, later = track[hold.first : a + 1, 2], track[b - 1 : hold.last + 1, 2]
        middle = (a + b) // 2
        support = resting_on(shown, motion, hold.target, middle)
        if b - a < 0.3 * RATE or support is None or abs(support.gap) > LIFT:
            continue
        if min(earlier.max(), later.max()) - track[middle, 2] > 0.02:
            spans.append((int(a), int(b) - 1))
    return spans


def _sure(name: str) -> Check:
    return Check(f"{name} rests in between, m/s", 0.0, STILL, STILL / 3, below=True)
