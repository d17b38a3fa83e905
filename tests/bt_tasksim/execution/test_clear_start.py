"""What starts inside the robot is no draw, whoever runs it."""

import dataclasses
import re
import warnings

import numpy as np
import pytest

from bt_tasksim import Fixture, ObjectSpec, Scene, evaluate, load_robot
from bt_tasksim.checking.recording import record
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.core.errors import BtTasksimWarning, NoDrawError
from bt_tasksim.execution.clear_start import clear_draw
from bt_tasksim.execution.runner import Runner
from bt_tasksim.scene.configuration import ObjectActor
from bt_tasksim.scene.shapes import ConvexPiece

pytestmark = pytest.mark.physical
PANDA = load_robot("panda")
FAR = ObjectSpec("box", on="table", area=(0.0, 0.0))
NEAR = ObjectSpec("box", on="table", centre=(-0.55, 0.0), area=(0.0, 0.0))
WITHIN = r"with seed 3 {} starts \d+ mm inside 'panda_link\d' of panda"


def test_an_object_or_furniture_in_the_robot_is_no_draw():
    with pytest.raises(NoDrawError, match=WITHIN.format("'near'")):
        clear_draw(Scene(objects={"far": FAR, "near": NEAR}), 3, "evaluation", PANDA)
    inside = Scene(objects={"far": FAR}, fixtures=[Fixture("stand", at=(0.02, 0.0))])
    with pytest.raises(NoDrawError, match=WITHIN.format("the fixture 'stand'")):
        clear_draw(inside, 3, "evaluation", PANDA)


def test_a_drawer_that_opens_into_the_robot_is_no_draw():
    shut, opened = (
        Scene(fixtures=[Fixture("drawer", at=(0.30, 0.0), parameters={"opens": 0.2, "value": value})])
        for value in (0.0, 0.2)
    )
    clear_draw(shut, 3, "evaluation", PANDA)
    remedy = "put 'drawer' elsewhere, or draw it less open"
    with pytest.raises(NoDrawError, match=WITHIN.format("'drawer'") + f".*{remedy}"):
        clear_draw(opened, 3, "evaluation", PANDA)


def test_what_stands_beside_it_is_as_drawn_and_a_hand_elsewhere_is_not_asked(monkeypatch):
    scene = Scene(objects={"far": FAR}, fixtures=["shelf"])
    assert clear_draw(scene, 3, "evaluation", PANDA).to_json() == scene.sample(3).to_json()
    near = Scene(objects={"near": NEAR})
    elsewhere = dataclasses.replace(near.sample(3), hand_start=(0.5, 0.0, 0.3, 0.0))
    monkeypatch.setattr(Scene, "sample", lambda *_: elsewhere)
    assert clear_draw(near, 3, "evaluation", PANDA) is elsewhere


def test_a_run_refuses_it_and_an_evaluation_counts_it_as_no_draw():
    some = ObjectSpec("box", on="table", centre=(-0.38, 0.0), area=(0.12, 0.0))
    scene = Scene(objects={"some": some})
    inside = []
    for seed in range(6):
        try:
            clear_draw(scene, seed, "evaluation", PANDA)
        except NoDrawError:
            inside.append(seed)
    assert 0 < len(inside) < 6
    with Runner(Grasp("some", timeout=0.1), scene) as runner, pytest.raises(NoDrawError):
        runner.run(inside[0])
    for tree in (Grasp("some", timeout=0.1), lambda: Grasp("some", timeout=0.1)):
        found = evaluate(tree, scene, episodes=6, seed=0)
        assert [o.seed for o in found.outcomes if o.reason == "no_draw"] == inside


def test_a_recording_for_a_check_refuses_it():
    found = record(Grasp("near", timeout=0.1), Scene(objects={"near": NEAR}), seeds=(3,))
    (error,) = found.errors
    assert isinstance(error, NoDrawError) and found.ends == [str(error)]


FLAT_MESH = "v 0 0 0\nv 0.1 0 0\nv 0.1 0.1 0\nv 0 0.1 0\nf 1 2 3\nf 1 3 4\n"


def panda_with(mesh, folder):
    """A panda of which the collision mesh of link 3 is another file."""
    urdf, before = PANDA.urdf, "collision/link3.stl"
    text = urdf.read_text()
    assert before in text
    absolute = re.sub(r'filename="([^"]+)"', lambda m: f'filename="{(urdf.parent / m[1]).resolve()}"', text)
    other = re.sub(rf'filename="[^"]*{before}"', f'filename="{mesh}"', absolute)
    (folder / "panda.urdf").write_text(other)
    return load_robot("panda", folder / "panda.urdf")


def test_a_flat_mesh_is_named_once_and_all_other_links_are_looked_at(tmp_path):
    (tmp_path / "flat.obj").write_text(FLAT_MESH)
    robot = panda_with(tmp_path / "flat.obj", tmp_path)
    near = Scene(objects={"far": FAR, "near": NEAR})
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for seed in (3, 4):
            with pytest.raises(NoDrawError, match="'near' starts"):
                clear_draw(near, seed, "evaluation", robot)
    (only,) = said
    assert only.category is BtTasksimWarning
    for word in ("panda", "'panda_link3'", "flat.obj", "one plane"):
        assert word in str(only.message)


def test_without_a_mesh_file_a_warning_says_that_nothing_is_looked_at(tmp_path):
    robot = panda_with(tmp_path / "nowhere.stl", tmp_path)
    near = Scene(objects={"near": NEAR})
    with pytest.warns(
        BtTasksimWarning, match=r"inside panda is not noticed: .*no mesh file '.*nowhere\.stl'"
    ) as said:
        drawn = [clear_draw(near, seed, "evaluation", robot) for seed in (3, 4)]
    assert len(said) == 1 and drawn[0].to_json() == near.sample(3).to_json()


def test_a_piece_of_an_object_that_is_no_body_is_named_and_the_others_are_looked_at(monkeypatch):
    flat = ConvexPiece(np.array([(0, 0, 0), (0.01, 0, 0), (0.01, 0.01, 0), (0, 0.01, 0)], float))
    shape = ObjectActor.shape
    monkeypatch.setattr(
        ObjectActor,
        "shape",
        lambda actor: dataclasses.replace(shape(actor), collision=(flat, *shape(actor).collision)),
    )
    with pytest.warns(BtTasksimWarning, match="a piece of 'far' is not looked for"):
        clear_draw(Scene(objects={"far": FAR}), 3, "evaluation", PANDA)
    with (
        pytest.warns(BtTasksimWarning, match="a piece of 'near' is not looked for"),
        pytest.raises(NoDrawError, match="'near' starts"),
    ):
        clear_draw(Scene(objects={"near": NEAR}), 3, "evaluation", PANDA)
