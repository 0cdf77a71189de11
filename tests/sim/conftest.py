"""Bodies to film."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from motorgrad.sim import Motion, gl_problem


@pytest.fixture
def leg() -> mujoco.MjModel:
    """A trunk on two slides with a two-link leg and four muscles, two of them wrapped over the knee."""
    return mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("leg.xml")))


@pytest.fixture
def hop(leg) -> Motion:
    """Half a second of the leg, 50 frames a second, with muscles firing in turn."""
    time = np.arange(26) / 50
    bend = np.sin(9 * time)
    position = np.stack([0.3 * time, 0.1 * bend**2 - 0.05, 0.5 + 0.3 * bend, -0.9 - 0.5 * bend], 1)
    activation = 0.5 + 0.5 * np.sin(9 * time[:, None] + np.arange(4))
    return Motion(leg, time, position, activation, "hopping")


@pytest.fixture(params=["drawn", "gl"])
def renderer(request) -> str:
    """Each renderer in turn; OpenGL is skipped, aloud, where it does not work."""
    if request.param == "gl" and gl_problem():
        pytest.skip(f"no OpenGL here: {gl_problem()}")
    return request.param
