"""Laws of a batch in torch: the same outcomes, and next to nothing goes between host and device."""

import numpy as np
import pytest

from bt_tasksim.core.errors import BtTasksimWarning, InputError, MachineError
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.laws import laws_of
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.trees.load import load_source

torch = pytest.importorskip("torch")
from tests.transfers import Transfers  # noqa: E402

SEEDS = range(16)


def outcomes(laws, worlds=8, tree="pick_and_place", seeds=SEEDS):
    source = load_source(tree)
    runner = BatchRunner(source.build, source.scene, EngineOptions(laws=laws), worlds)
    found = dict(runner.run(seeds))
    runner.close()
    return runner, found


@pytest.mark.physical
def test_episodes_come_to_the_same_in_torch():
    _, wanted = outcomes("numpy")
    runner, found = outcomes("torch")
    assert isinstance(runner.context.observation.tool_pose, torch.Tensor)
    for seed, result in wanted.items():
        other = found[seed]
        assert (other.success, other.control_steps, other.leaf) == (
            result.success, result.control_steps, result.leaf,
        )  # fmt: skip
        ends = [
            (r.verdict.position_error, r.verdict.angle_error, r.verdict.penetration) for r in (result, other)
        ]
        np.testing.assert_allclose(*ends, atol=1e-6, err_msg=f"seed {seed}")


@pytest.mark.physical
def test_few_transfers_and_none_that_nobody_asked_for():
    source = load_source("pick_and_place")
    runner = BatchRunner(source.build, source.scene, EngineOptions(laws="torch"), 4)
    list(runner.run(range(4)))  # constants go to the device
    periods, period = 0, runner._period

    def counted(*arguments):
        nonlocal periods
        periods += 1
        return period(*arguments)

    runner._period = counted
    with Transfers() as transfers:
        list(runner.run(range(4, 8)))
    runner.close()
    assert not transfers.silent
    assert transfers.up.total() < 25 * periods, transfers.up.most_common(5)
    assert transfers.down.total() < 45 * periods, transfers.down.most_common(5)


def test_silent_moves_are_seen():
    """What `Transfers` is to find is found."""
    values, rows = torch.zeros(3, dtype=torch.float64), np.array([0, 2])
    with Transfers() as transfers:
        values[rows]
        values[values > 0.0]
        bool(values[0] > 0.0)
        torch.asarray(rows)
    assert transfers.silent.total() == 2
    assert (transfers.up.total(), transfers.down.total()) == (1, 1)


def test_what_options_say():
    assert isinstance(laws_of(EngineOptions()), np.ndarray)
    assert isinstance(laws_of(EngineOptions(engines="mujoco_warp", device="cuda", laws="numpy")), np.ndarray)
    like = laws_of(EngineOptions(laws="torch"))
    assert (like.dtype, like.device.type) == (torch.float64, "cpu")
    with pytest.raises(InputError, match="tor"):
        EngineOptions(laws="torhc")


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU")
def test_a_gpu_that_torch_does_not_have():
    with pytest.raises(MachineError, match="cuda"):
        laws_of(EngineOptions(engines="mujoco_warp", device="cuda", laws="torch"))
    with pytest.warns(BtTasksimWarning, match="cuda"):
        assert isinstance(laws_of(EngineOptions(engines="mujoco_warp", device="cuda")), np.ndarray)
