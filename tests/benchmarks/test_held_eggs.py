"""An egg held below its middle does not swing in the hand."""

from pathlib import Path

import numpy as np
import py_trees
import pytest

from benchmarks.any_tree.meshes import made, obj_text
from bt_tasksim import EngineOptions, ObjectSpec, Runner, Scene
from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.core import poses

pytestmark = pytest.mark.physical
SEEDS = range(16)
EGG = """\
mesh: egg.obj
scale: 0.75
grasps:
  - point: [0, 0, -0.006]
    closing: [0, 1, 0]
    approach: [0, 0, -1]
"""


def eggs(folder: Path) -> Scene:
    """A scene with an egg of 6 cm that may be held 4 mm below its centre of mass alone."""
    (folder / "egg.obj").write_text(obj_text(*made("egg", 1), "an egg"))
    (folder / "egg.yaml").write_text(EGG)
    return Scene("panda", objects={"egg": ObjectSpec(file=str(folder / "egg.yaml"), on="table")})


def leans(seed: int, scene: Scene) -> float:
    """How many degrees the egg leans at most while it is taken and lifted."""
    tree = py_trees.composites.Sequence("lift", memory=True, children=[Grasp("egg"), Pick("egg")])
    found = [0.0]
    with Runner(tree, scene, EngineOptions()) as runner:

        def note(step):
            egg = runner.pipeline.hidden().objects[0]
            found.append(float(np.degrees(poses.tilt(egg[3:], np.array([1.0, 0.0, 0.0, 0.0])))))

        runner.run(seed, record=note)
        assert runner.pipeline.hidden().objects[0, 2] > 0.1, "it was lifted"
    return max(found)


def test_an_egg_does_not_swing_between_two_fingers(tmp_path):
    scene = eggs(tmp_path)
    assert max(leans(seed, scene) for seed in SEEDS) < 8.0
