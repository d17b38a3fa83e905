"""Extract: real pulls, and what is refused."""

import pytest
from draws import successes

from bt_tasksim import Runner
from bt_tasksim.concept_nodes import Extract, Grasp, Pick
from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.load import load_source


@pytest.mark.physical
@pytest.mark.parametrize("engines", ["sapien", "mujoco"])
def test_a_peg_comes_out_of_its_hole(engines):
    source = load_source("extract")
    runner = Runner(source.build(), source.scene, EngineOptions(engines=engines))
    for result in successes(runner.run, range(3), n=2):
        assert result.verdict.outcome.cause.reason.name == "stands"


@pytest.mark.physical
def test_a_book_goes_into_its_row():
    source = load_source("insert_book")
    for result in successes(Runner(source.build(), source.scene).run, range(3), n=2):
        assert result.verdict.outcome.cause.reason.name == "is_inserted"


def test_nothing_is_pulled_out_of_what_is_no_hole():
    scene = Scene(objects={"box": ObjectSpec(("box",), on="table")}, goal=Goal("box", "table"))
    tree = sequence("no hole", Grasp("box"), Pick("box"), Extract("box", out_of="table"))
    result = Runner(tree, scene, EngineOptions(noise="none")).run(3)
    assert not result.success
    assert "'table' is no hole but a table" in result.why
    with pytest.raises(InputError, match="parameter 'out_of' is missing"):
        Extract("box")
    with pytest.raises(InputError, match="'clear' should be at least"):
        Extract("box", out_of="table", clear=0.004)
