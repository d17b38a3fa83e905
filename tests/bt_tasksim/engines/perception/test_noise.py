"""The stated noise of the estimate: its size, its names, and that none is none."""

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import parts
from bt_tasksim.engines.perception.noise import noise_model

N = 20000


def draws(name, seed=0):
    return noise_model(name).draw(np.random.default_rng(seed), N)


def test_none_is_none():
    error = draws("none")
    assert np.array_equal(error, np.tile(poses.pose([0, 0, 0]), (N, 1)))


def test_fine_is_two_millimetres_and_two_degrees():
    error = draws("fine")
    assert np.allclose(error[:, :3].std(axis=0), 0.002, rtol=0.03)
    assert np.allclose(error[:, :3].mean(axis=0), 0, atol=1e-4)
    assert np.allclose(np.rad2deg(poses.rotation_vector(error[:, 3:]).std(axis=0)), 2.0, rtol=0.03)


def test_original_is_uniform_and_hard_is_normal():
    error = draws("original")
    assert np.all(np.abs(error[:, :3]).max(axis=0) <= [0.005, 0.005, 0.02])
    assert np.allclose(np.abs(error[:, :3]).max(axis=0), [0.005, 0.005, 0.02], rtol=0.01)
    assert np.abs(poses.rotation_vector(error[:, 3:])).max() <= 0.06 + 1e-12
    assert np.allclose(draws("hard")[:, :3].std(axis=0), [0.008, 0.008, 0.015], rtol=0.03)


@pytest.mark.parametrize("name", sorted(parts("noise model")))
def test_the_generator_alone_decides(name):
    assert np.array_equal(draws(name, 3), draws(name, 3))
    assert name == "none" or not np.array_equal(draws(name, 3), draws(name, 4))
    assert np.allclose(np.linalg.norm(draws(name)[:, 3:], axis=-1), 1.0)


def test_unknown_names_are_refused_with_the_nearest():
    with pytest.raises(InputError, match=r"unknown noise model 'fime'; did you mean 'fine'\?"):
        noise_model("fime")
    with pytest.raises(InputError, match="known: fine, hard, none, original"):
        noise_model("xxxxxxxx")
