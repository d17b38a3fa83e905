"""The cell behind the topics, with real physics and without ROS."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.hardware.ros.messages import in_tool_frame
from bt_tasksim.hardware.twin.cell import Cell
from bt_tasksim.hardware.twin.controller import RefusedTrajectoryError, Trajectory
from bt_tasksim.hardware.twin.gap import load_gap
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import Scene

pytest.importorskip("mujoco")
ROBOT = load_robot("panda")
WORLD = Scene("panda", objects={"cup": "on table"}).sample(3)


def made(**options: Any) -> Cell:
    """A cell whose notes are taken in its own time, since the tests do not wait."""
    cell = Cell(ROBOT, load_gap(), WORLD, seed=1, now=lambda: cell.time, **options)
    return cell


@pytest.fixture
def cell() -> Cell:
    return made()


def run(cell: Cell, seconds: float) -> None:
    for _ in range(round(seconds / cell.period)):
        cell.step()


def forward(cell: Cell, run: str = "one", step: float = 0.02) -> Trajectory:
    """The first joint a little further, and to rest."""
    here = ROBOT.rest.copy()
    here[0] = cell.state.joint_position[0]
    a, b = here.copy(), here.copy()
    a[0] += step
    b[0] += 1.5 * step
    slow = np.zeros(7)
    slow[0] = step / 0.05
    return Trajectory(
        ROBOT.arm_joints, [a.tolist(), b.tolist()], [slow.tolist(), [0.0] * 7], [0.05, 0.15], run
    )


def first_joint(cell: Cell) -> float:
    return float(cell.state.joint_position[0])


def test_no_command_before_a_run_and_of_no_other_run(cell: Cell) -> None:
    with pytest.raises(RefusedTrajectoryError, match="no run has begun"):
        cell.command("arm", forward(cell))
    cell.begin("one")
    with pytest.raises(RefusedTrajectoryError, match="another run"):
        cell.command("arm", forward(cell, run="two"))
    with pytest.raises(RefusedTrajectoryError, match="another run"):
        cell.command("arm", forward(cell, run=""))
    run(cell, 0.2)
    assert abs(first_joint(cell)) < 1e-3 and cell.refused == 3
    assert cell.unfit == 2, "nothing is wrong with what comes while it holds"


def test_commands_that_stop_expire(cell: Cell) -> None:
    cell.begin("one")
    for _ in range(5):
        cell.command("arm", forward(cell))
        run(cell, 0.05)
    cell.watch("silence")
    moving = first_joint(cell)
    assert moving > 0.05
    run(cell, 1.0)
    there = first_joint(cell)
    assert 0.0 < there - moving < 0.05
    run(cell, 0.5)
    assert abs(first_joint(cell) - there) < 1e-3
    note = cell.tell()["fault"]
    assert note["why"] == "the command has expired" and 0.05 <= note["held"] <= 0.2 and note["still"] < 0.3


def test_a_hold_lasts_until_a_new_run(cell: Cell) -> None:
    cell.begin("one")
    cell.command("arm", forward(cell))
    run(cell, 0.05)
    cell.watch("hold")
    cell.hold("enough")
    for again in ("one", ""):
        cell.begin(again)  # neither the same run nor none ends it
        with pytest.raises(RefusedTrajectoryError, match="it holds: enough"):
            cell.command("arm", forward(cell))
    run(cell, 0.6)
    before = first_joint(cell)
    run(cell, 0.2)
    assert abs(first_joint(cell) - before) < 1e-3
    assert cell.tell()["fault"]["why"] == "enough" and cell.tell()["fault"]["held"] == 0.0
    cell.begin("two")
    cell.command("arm", forward(cell, run="two"))
    cell.begin("one")  # nor does it come back
    run(cell, 0.3)
    assert first_joint(cell) - before > 0.01


def test_the_emergency_stop(cell: Cell) -> None:
    cell.begin("one")
    cell.command("arm", forward(cell))
    run(cell, 0.06)
    cell.watch("stop")
    cell.press(True)
    run(cell, 0.5)
    still, note = first_joint(cell), cell.tell()["fault"]
    assert 0.0 < note["fastest"] <= 1.0 and 0.0 < note["hardest"] <= 1.05, "within the arm's limits"
    cell.begin("two")  # as long as it is pressed there is no new run
    with pytest.raises(RefusedTrajectoryError, match="emergency stop"):
        cell.command("arm", forward(cell, run="two"))
    cell.press(False)
    with pytest.raises(RefusedTrajectoryError, match="emergency stop"):
        cell.command("arm", forward(cell))
    cell.begin("two")
    cell.command("arm", forward(cell, run="two"))
    run(cell, 0.3)
    assert first_joint(cell) > still + 0.01


def test_the_emergency_stop_brakes_whatever_is_under_way(cell: Cell) -> None:
    cell.begin("one")
    for _ in range(4):
        cell.command("arm", forward(cell))
        run(cell, 0.05)
    cell.command("arm", forward(cell, step=0.04))  # it takes its latency
    before = first_joint(cell)
    cell.press(True)
    run(cell, 0.4)
    assert abs(first_joint(cell) - before) < 0.015
    assert cell.accepted == 4


def test_a_run_that_another_one_has_replaced_does_not_come_back(cell: Cell) -> None:
    for name in ("one", "two", "one"):
        cell.begin(name)
    cell.command("arm", forward(cell, run="two"))
    with pytest.raises(RefusedTrajectoryError, match="another run"):
        cell.command("arm", forward(cell, run="one"))


def test_a_cell_whose_runs_are_not_announced() -> None:
    """As ros2_control alone is: whoever commands moves it, and the emergency stop lasts until its release."""
    cell = made(announced=False)
    for name in ("", "one"):
        cell.command("arm", forward(cell, run=name))
        run(cell, 0.05)
    assert first_joint(cell) > 0.01 and not cell.stopped
    cell.press(True)
    with pytest.raises(RefusedTrajectoryError, match="emergency stop"):
        cell.command("arm", forward(cell))
    run(cell, 0.3)
    still = first_joint(cell)
    cell.press(False)
    cell.command("arm", forward(cell))
    run(cell, 0.3)
    assert first_joint(cell) > still + 0.01
    cell.press(True)
    cell.load(WORLD)
    assert not cell.stopped


def test_notes_are_taken_in_real_time() -> None:
    """A cell whose time stands still for a while does not make a hold look early."""
    clock = [100.0]
    cell = Cell(ROBOT, load_gap(), WORLD, now=lambda: clock[0])
    cell.begin("one")
    cell.watch("late")
    clock[0] += 0.4
    cell.left_out += 0.4
    cell.hold("told to")
    told = cell.tell()
    assert told["fault"]["held"] == pytest.approx(0.4) and told["left_out"] == 0.4


def test_readings_are_late_and_noisy_as_stated(cell: Cell) -> None:
    run(cell, 1.0)
    cell.readings()
    got = []
    for _ in range(200):
        cell.step()
        got += cell.readings()
    assert len(got) == 200
    assert cell.time - got[-1].time == pytest.approx(0.01, abs=1e-6)  # 6 ms, and at the next step
    sizes = cell.gap.sizes
    tremble = np.std([r.position for r in got], axis=0)
    assert np.all(tremble > 0.5 * sizes["joint_position"]) and np.all(tremble < 2 * sizes["joint_position"])
    truth = cell.hidden().objects[0]
    seen = np.mean([r.objects[0][:3] for r in got], axis=0)
    assert 1e-5 < np.linalg.norm(seen - truth[:3]) < 5 * 0.002
    force = np.array([r.wrench[:3] for r in got])
    assert 0.15 < np.mean(np.std(force, axis=0)) < 0.6


def test_the_wrench_is_that_of_the_sensor_where_it_sits() -> None:
    """What the engine makes of it, with the sensor's pose, is the wrench at the tool."""
    pose = np.array([0.02, 0.0, -0.1, 0.0, 1.0, 0.0, 0.0])
    here, there = made(), made(sensor=pose)
    for cell in (here, there):
        push = dataclasses.replace(cell.state, wrench=np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]))
        cell._state, cell._wrench_bias = push, np.zeros(6)
        cell.gap = dataclasses.replace(cell.gap, wrench=dict.fromkeys(cell.gap.wrench, 0.0))
    at_tool, at_sensor = here._read().wrench, there._read().wrench
    assert not np.allclose(at_sensor, at_tool, atol=0.1)
    assert np.allclose(in_tool_frame(at_sensor, pose), at_tool)


def test_the_same_seed_is_the_same_world() -> None:
    def told(seed: int) -> np.ndarray:
        cell = Cell(ROBOT, load_gap(), WORLD, seed)
        run(cell, 0.2)
        return np.concatenate([cell.readings()[-1].position, cell.readings() or np.zeros(0)])

    assert np.array_equal(told(4), told(4))
    assert not np.array_equal(told(4), told(5))


def test_factors_are_drawn_as_stated() -> None:
    gap = load_gap()
    rng = np.random.default_rng(0)
    for _ in range(50):
        robot, world = gap.world(ROBOT, WORLD, rng)
        mass = world.objects[0].mass / WORLD.objects[0].mass
        assert 0.8 <= mass <= 1.25
        assert 0.85 <= robot.arm_drive.stiffness / ROBOT.arm_drive.stiffness <= 1.15
        assert world.control_frequency == 100
    assert world.objects[0].pose == WORLD.objects[0].pose


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("object_mass: [0.8, 1.25]", "object_mass: [1.2, 0.8]", "the lower one first"),
        ("object_mass: [0.8, 1.25]", "object_mass: 3", "line 5: 'object_mass' should be 2 numbers"),
        ("state_latency: 0.006", "state_latency: -1", "should not be negative"),
        ("control_rate: 100", "control_rate: 300", "should divide 1000"),
        ("tip_force: 0.03", "tip_forse: 0.03", "did you mean 'tip_force'"),
    ],
)
def test_a_wrong_file_of_differences(tmp_path, old: str, new: str, sentence: str) -> None:
    from bt_tasksim.core.resources import asset

    text = asset("twin", "gap.yaml").read_text()
    assert old in text
    (tmp_path / "gap.yaml").write_text(text.replace(old, new))
    with pytest.raises(InputError, match=sentence):
        load_gap(str(tmp_path / "gap.yaml"))


def test_a_world_without_objects() -> None:
    empty = dataclasses.replace(WORLD, objects=(), goal=None)
    cell = Cell(ROBOT, load_gap(), ActorConfiguration.from_json(empty.to_json()))
    cell.step()
    cell.step()
    assert cell.readings()[0].objects.shape == (0, 7)
