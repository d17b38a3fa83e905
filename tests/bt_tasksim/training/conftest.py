"""Makes `toys`, which the tests here share, importable by its name."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import toys


@pytest.fixture
def toy_engines(monkeypatch):
    """Every pipeline that is built is a toy world."""
    toys.instead_of_engines(monkeypatch.setattr)


@pytest.fixture
def env_of(toy_engines):
    """Builds an environment in a toy world: ``env_of(tree, ...)``."""
    from bt_tasksim.training.env import EpisodeEnv

    def make(tree, scene=toys.SCENE, **settings):
        return EpisodeEnv(tree, scene, **settings)

    return make
