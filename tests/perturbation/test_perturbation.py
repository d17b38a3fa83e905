"""Perturbations reach the physics of this process, of workers and of commands, and change nothing else."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

PROGRAM = """
import json, multiprocessing
import numpy as np
from bt_tasksim.core.world import JointTarget
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene, ObjectSpec

def found(engine):
    import importlib
    module = importlib.import_module("bt_tasksim.engines.physics." + engine.lower())
    physics = getattr(module, engine + "Physics")(load_robot("panda"))
    drawn = Scene(objects={"cup": ObjectSpec(kinds=("cup",), on="table")}).sample(3)
    start = physics.reset(drawn).joint_position
    stood = physics.step(JointTarget(start, np.zeros_like(start)))
    return drawn.seed, list(drawn.objects[0].pose), stood.joint_effort.tolist()

if __name__ == "__main__":
    here = [found("Sapien"), found("Mujoco")]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        print(json.dumps([here, pool.map(found, ["Sapien", "Mujoco"])]))
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    path = tmp_path_factory.mktemp("program") / "program.py"
    path.write_text(PROGRAM)
    return path


def run(program, radians, shift):
    from perturbation import HERE, NUDGE, SHIFT

    environment = dict(os.environ)
    kept = environment.get("PYTHONPATH", "").split(os.pathsep)
    environment["PYTHONPATH"] = os.pathsep.join([HERE, *(p for p in kept if p and p != HERE)])
    environment |= {NUDGE: repr(radians), SHIFT: str(shift)}
    done = subprocess.run(
        [sys.executable, str(program)], env=environment, capture_output=True, text=True, check=True
    )
    here, worker = json.loads(done.stdout)
    assert here == worker, "workers are perturbed, too"
    return here


def test_targets_and_draws_move_and_seeds_keep_their_numbers(program):
    plain, perturbed = run(program, 0.0, 0), run(program, 1e-6, 1000)
    for (seed, pose, effort), (same, other, moved) in zip(plain, perturbed, strict=True):
        assert seed == same == 3 and pose != other
        assert moved != effort and np.abs(np.subtract(moved, effort)).max() < 0.1
