"""Whether a robot's links run into each other: at rest, and where the inverse kinematics takes them.

Links are the convex hulls of what their URDF says they collide with. Neighbours may touch, and so may pairs
that touch in nearly every posture: these are drawn so.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.link_parts import DEEP, LinkPart, link_parts
from bt_tasksim.robot.urdf_links import load_links

if TYPE_CHECKING:
    from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics

MOST = 60
"""Postures that are looked at."""
DRAWN, ALWAYS = 40, 0.9
"""Random postures, and the share of them in which a pair touches that is made so."""
OFTEN = 0.2
"""Share of the postures in which links may meet."""
BETWEEN = 2
"""Moving joints between two links up to which they are neighbours."""


def check_touching(kinematics: PinocchioKinematics, postures: Array, report: Report) -> None:
    """Find links that overlap.

    Args:
        kinematics: Of the robot.
        postures: Arm joints ``(n, n_arm)`` that the inverse kinematics has found.
        report: Where findings go.
    """
    robot = kinematics.robot
    try:
        parts, left_out = link_parts(robot)
    except InputError as error:
        report.add(WARNING, robot.name, "urdf", f"links were not compared: {error}", "put the files there")
        return
    for said in left_out:
        report.add(WARNING, robot.name, "urdf", said, "give the shape a thickness, or leave it out")
    pairs = _pairs(kinematics, parts)
    rng = np.random.default_rng(0)
    anywhere = rng.uniform(robot.arm_lower, robot.arm_upper, (DRAWN, len(robot.rest)))
    often: dict[tuple[str, str], int] = {}
    for arm in anywhere:
        for pair in _overlaps(kinematics, arm, parts, pairs):
            often[pair] = often.get(pair, 0) + 1
    made_so = {pair for pair, count in often.items() if count >= ALWAYS * DRAWN}
    for pair, depth in _overlaps(kinematics, robot.rest, parts, pairs).items():
        if pair not in made_so:
            what = f"puts '{pair[0]}' {1000 * depth:.0f} mm into '{pair[1]}'"
            report.add(ERROR, robot.name, "arm.rest", what, "choose a posture in which no link meets another")
    chosen = postures[:: max(1, len(postures) // MOST)]
    hit: dict[tuple[str, str], int] = {}
    count = 0
    for arm in chosen:
        found = [pair for pair in _overlaps(kinematics, arm, parts, pairs) if pair not in made_so]
        count += bool(found)
        for pair in found:
            hit[pair] = hit.get(pair, 0) + 1
    if not count:
        return
    worst = max(hit, key=lambda pair: hit[pair])
    said = f"{count} of {len(chosen)} postures of the inverse kinematics in which links meet"
    report.seen.append(f"links  {said}, mostly '{worst[0]}' and '{worst[1]}'")
    if count > OFTEN * len(chosen):
        what = f"has {said}, mostly '{worst[0]}' and '{worst[1]}'"
        remedy = "narrow arm.lower and arm.upper, or let arm.rest and arm.posture lead away from there"
        report.add(WARNING, robot.name, "arm", what, remedy)


def _pairs(kinematics: PinocchioKinematics, parts: Sequence[LinkPart]) -> list[tuple[int, int]]:
    """Numbers of parts of links that are no neighbours; the hand's fingers may touch one another."""
    links = {item.link: item for item in load_links(kinematics.robot.urdf)}
    hand = {item.link for item in links.values() if item.joint in kinematics.robot.hand_joints}

    def chain(link: str) -> list[tuple[str, int]]:
        """A link and those that carry it, each with the moving joints up to it."""
        out, moved = [(link, 0)], 0
        while parent := links[out[-1][0]].parent:
            moved += links[out[-1][0]].moves
            out.append((parent, moved))
        return out

    above = {link: dict(chain(link)) for link in {part.link for part in parts}}

    def apart(a: str, b: str) -> bool:
        common = [above[a][link] + above[b][link] for link in above[a] if link in above[b]]
        return min(common) > BETWEEN and not (above[a].keys() & hand and above[b].keys() & hand)

    return [(i, j) for i in range(len(parts)) for j in range(i) if apart(parts[i].link, parts[j].link)]


def _overlaps(
    kinematics: PinocchioKinematics, arm: Array, parts: Sequence[LinkPart], pairs: list[tuple[int, int]]
) -> dict[tuple[str, str], float]:
    """Metres by which links overlap in a posture, by their names, where it is more than `DEEP`."""
    from bt_tasksim.core.narrow_phase import coal

    joints = np.concatenate([arm, kinematics.robot.hand_open])
    at = kinematics.link_poses(joints, sorted({part.link for part in parts}))
    frames = [poses.multiply(at[part.link], part.pose) for part in parts]
    forms = [coal.Transform3s(poses.to_matrix(f[3:]), f[:3]) for f in frames]
    request, out = coal.DistanceRequest(), dict[tuple[str, str], float]()
    for i, j in pairs:
        distance = coal.distance(
            parts[i].form, forms[i], parts[j].form, forms[j], request, coal.DistanceResult()
        )
        if distance < -DEEP:
            pair = parts[j].link, parts[i].link
            out[pair] = max(out.get(pair, 0.0), -float(distance))
    return out
