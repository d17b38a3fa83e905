"""What starts inside the robot is no draw, whoever runs it."""

import dataclasses

import pytest

from bt_tasksim import Fixture, ObjectSpec, Scene, evaluate, load_robot
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.core.errors import NoDrawError
from bt_tasksim.execution.clear_start import clear_draw
from bt_tasksim.execution.runner import Runner

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
    found = evaluate(Grasp("some", timeout=0.1), scene, episodes=6, seed=0)
    assert [o.seed for o in found.outcomes if o.reason == "no_draw"] == inside
