"""What a grasp remembers from one tick to the next."""

from __future__ import annotations

from typing import NamedTuple

from bt_tasksim.core.poses import Array
from bt_tasksim.planning.reference_motion import Path


class GraspMemory(NamedTuple):
    """What a grasp remembers in ``N`` worlds.

    Attributes:
        path: Tool path to the grasp pose.
        begins: Seconds after which the straight approach begins, and with it what is decided by a policy.
        goal: Grasp pose ``(N, 7)`` of the reference motion.
        delay: Seconds by which the motion is behind the reference.
        middle: Offsets ``(N, 5)`` in units of `grasp_features.SCALE` that the middle of an action stands
            for: the tool goes on, or stays behind, by as much as the estimate is above or below where the
            object would stand, and goes deeper where it comes slanted.
        offset: Offsets ``(N, 5)`` from the reference motion, see `grasp_features.SCALE`.
        target: Tool pose ``(N, 7)`` that was last commanded.
        closing: Seconds since the hand began to close; negative before.
        closed: Closure that was last commanded.
        closure: Closure at the previous tick.
        settled: Ticks in a row with opposing contacts and a still hand.
        preshape: Closure at which the hand comes.
        tight: Boolean ``(N,)``: the hand feels its way, see `grasp_choice.Choice.tight`.
        lands: Boolean ``(N,)``: the palm comes close to the object's top, see `grasp_landing`.
        touched: Which fingertips ``(N, n_tips)`` have touched anything since the approach began, 0 or 1.
        first: How far before the grasp pose the tool was at the first contact, metres; 0 without one.
        estimate: What the estimate says ``(N, 5)``: height of the grasp pose and of the object's centre
            above what it stands on, the centre beyond the grasp pose along the approach (units of 50 mm), the
            cosine between the approach and straight down onto the support, and how far along the approach the
            estimate is from where an object of the known size would stand (units of 20 mm).
        start: Estimated pose ``(N, 7)`` of the object at the start.
        now: Estimated pose ``(N, 7)`` of the object at the previous tick.
    """

    path: Path
    begins: Array
    goal: Array
    delay: Array
    middle: Array
    offset: Array
    target: Array
    closing: Array
    closed: Array
    closure: Array
    settled: Array
    preshape: Array
    tight: Array
    lands: Array
    touched: Array
    first: Array
    estimate: Array
    start: Array
    now: Array
