"""Bodies to film, and a browser that shows pages of them. (Pytest ends where a conftest.py that it starts with cannot
be imported, so fixtures import TimSim.)"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
import pytest

import needed

if TYPE_CHECKING:
    from timsim import Motion

SOFTWARE = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]


@pytest.fixture
def leg() -> mujoco.MjModel:
    """A trunk on two slides with a two-link leg and four muscles, two of them wrapped over the knee."""
    return mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("leg.xml")))


@pytest.fixture
def hop(leg) -> Motion:
    """Half a second of the leg, 50 frames a second, with muscles firing in turn."""
    from timsim import Motion

    time = np.arange(26) / 50
    bend = np.sin(9 * time)
    position = np.stack([0.3 * time, 0.1 * bend**2 - 0.05, 0.5 + 0.3 * bend, -0.9 - 0.5 * bend], 1)
    activation = 0.5 + 0.5 * np.sin(9 * time[:, None] + np.arange(4))
    return Motion(leg, time, position, activation, "hopping")


@pytest.fixture(params=["drawn", pytest.param("gl", marks=pytest.mark.needs("OpenGL"))])
def renderer(request) -> str:
    """Each renderer in turn."""
    return request.param


@pytest.fixture(scope="session")
def messages_to_who_has_left():
    """Leaves out what viser warns of in a page's threads when a browser leaves between two messages.

    A filter of warnings would not do: pytest sets the filters anew for every phase of a test, and for a moment they
    make errors of all warnings, in every thread.
    """
    warn = warnings.warn

    def others(message, *arguments, stacklevel=1, **options):
        if not str(message).startswith("Queued a "):
            warn(message, *arguments, stacklevel=stacklevel + 1, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(warnings, "warn", others)
        yield


@pytest.fixture(scope="module")
def browser():
    """A browser that draws WebGL in software."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=str(needed.CHROMIUM), args=SOFTWARE)
        yield browser
        browser.close()
