"""Environments that are registered for the time of a test."""

import gymnasium
import pytest
from gymnasium_examples import Told


@pytest.fixture
def register():
    """Register environments for the time of a test."""
    before = set(gymnasium.registry)

    def one(make, **keywords):
        name = f"Mine{len(gymnasium.registry)}-v0"
        gymnasium.register(id=name, entry_point=make, disable_env_checker=True, **keywords)
        return name

    yield one
    for name in set(gymnasium.registry) - before:
        del gymnasium.registry[name]


@pytest.fixture
def told(register):
    """The id of an environment as `Told` is told to be."""
    return lambda **settings: register(lambda **more: Told(**settings, **more))
