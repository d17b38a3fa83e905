"""Whether a simulated robot is the one that its kinematics knows, holds itself, and opens and closes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.core import poses
from bt_tasksim.core.errors import UnreachableError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Command, WorldState
from bt_tasksim.robot.description import load_robot

if TYPE_CHECKING:
    from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
    from bt_tasksim.engines.pipeline import EnginePipeline

SAME = 1e-3
"""Metres by which kinematics and physics may differ at a reset."""
SAG = 5e-3
"""Metres by which the tool may drift while the arm holds still, or miss where it was sent."""
OPENED = 5e-3
"""Metres by which the measured opening may differ from that of the joints' positions."""
LONG = 1.0
"""Seconds for which something is waited for."""
MOVE = (0.03, -0.03)
"""Metres up and down, one of which the tool is sent."""


def check_drives(robot: str, kinematics: PinocchioKinematics, report: Report) -> None:
    """Reset the simulated robot, hold still, open, close and move the hand, and measure.

    Args:
        robot: Name of the robot, or its file.
        kinematics: Of the robot.
        report: Where findings go.

    Raises:
        InputError: The engine cannot build the robot.
        MachineError: The engine is not installed.
    """
    from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline
    from bt_tasksim.scene.scene import Scene

    found = kinematics.robot
    configuration = Scene(robot).sample(0)
    periods = round(LONG * configuration.control_frequency)
    pipeline = build_pipeline(load_robot(robot), EngineOptions(noise="none"))
    try:
        state = pipeline.physics.reset(configuration)
        apart = _distance(kinematics.forward(state.joint_position), state.tool_pose)
        if apart > SAME:
            what = f"has its tool {1000 * apart:.1f} mm off in physics, for the same joints"
            remedy = "name the URDF's root as base_link, or the link that stands still at the base"
            report.add(ERROR, found.name, "base_link", what, remedy)
            return  # nothing else would say anything of this robot
        pipeline.reset(configuration, configuration.world_model([t.name for t in found.tips], found.opening))
        before = _state(pipeline)
        drift = _distance(
            _after(pipeline, Command(tool=before.tool_pose), periods).tool_pose, before.tool_pose
        )
        report.seen.append(f"drives hold the tool within {1000 * drift:.1f} mm for {LONG:g} s")
        if drift > SAG:
            what = f"lets the tool drift by {1000 * drift:.0f} mm in {LONG:g} s of holding still"
            remedy = (
                "see whether links meet at rest; else raise stiffness and force_limit, and damping with them"
            )
            report.add(ERROR, found.name, "arm.drive", what, remedy)
        _check_hand(kinematics, pipeline, periods, report)
        _check_move(kinematics, pipeline, periods, report)
    finally:
        pipeline.close()


def _check_hand(
    kinematics: PinocchioKinematics, pipeline: EnginePipeline, periods: int, report: Report
) -> None:
    """The hand goes to where it is told, and is then as wide as the joints' positions say."""
    robot = kinematics.robot
    widths = []
    for closure in (1.0, 0.0):
        asked = np.array([closure] + [0.0] * len(robot.synergies))
        state = _after(pipeline, Command(hand=asked), round(periods * max(1.0, 1.5 / robot.hand_speed)))
        joints = np.concatenate([state.joint_position[: len(robot.rest)], robot.hand_position(asked)])
        measured, meant = _gap(robot.opposition, state.tips), _gap(robot.opposition, kinematics.tips(joints))
        widths.append(measured)
        if closure == 0.0 and abs(measured - meant) > OPENED:
            what = f"opens to {1000 * measured:.0f} mm between the tips, in its URDF to {1000 * meant:.0f} mm"
            remedy = "see whether the fingers meet the hand, and hand.drive"
            report.add(WARNING, robot.name, "hand", what, remedy)
    if widths[1] - widths[0] < 0.5 * _gap(robot.opposition, _open_tips(kinematics)):
        what = f"moves its tips from {1000 * widths[1]:.0f} to {1000 * widths[0]:.0f} mm apart when it closes"
        remedy = "see hand.drive: stiffness and force_limit may be too small for the fingers, or hand.closed"
        report.add(WARNING, robot.name, "hand.drive", what, remedy)


def _check_move(
    kinematics: PinocchioKinematics, pipeline: EnginePipeline, periods: int, report: Report
) -> None:
    """The tool gets to where it is sent."""
    robot, start = kinematics.robot, _state(pipeline).tool_pose
    for up in MOVE:
        goal = start + np.array([0.0, 0.0, up, 0.0, 0.0, 0.0, 0.0])
        try:
            kinematics.inverse(goal)
            error = _distance(_after(pipeline, Command(tool=goal), periods).tool_pose, goal)
        except UnreachableError:
            continue
        if error > SAG:
            what = f"leaves the tool {1000 * error:.0f} mm from where it was sent, {LONG:g} s later"
            remedy = "raise stiffness, and see arm.velocity and force_limit"
            report.add(WARNING, robot.name, "arm.drive", what, remedy)
        return


def _after(pipeline: EnginePipeline, command: Command, periods: int) -> WorldState:
    for _ in range(periods):
        pipeline.step(command)
    return _state(pipeline)


def _state(pipeline: EnginePipeline) -> WorldState:
    assert pipeline.state is not None
    return pipeline.state


def _open_tips(kinematics: PinocchioKinematics) -> Array:
    return kinematics.tips(np.concatenate([kinematics.robot.rest, kinematics.robot.hand_open]))


def _gap(opposition: tuple[tuple[int, ...], ...], tips: Array) -> float:
    """Metres between the middles of the first two groups of tips."""
    first, second = (tips[list(group)].mean(axis=0) for group in opposition[:2])
    return float(np.linalg.norm(first - second))


def _distance(a: Array, b: Array) -> float:
    return float(poses.norm((a - b)[:3]))
