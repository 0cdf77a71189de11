"""A page's scene on a server of its own."""

import contextlib
import io

import pytest

from motorgrad.bodies import Hexapod, Hopper, compile_model
from timsim.live import setup_of


@pytest.fixture(scope="module")
def hexapod():
    return compile_model(Hexapod())


@pytest.fixture(scope="module")
def hopper():
    return compile_model(Hopper())


@pytest.fixture
def server():
    import viser

    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield server
    server.stop()


@pytest.fixture
def staged(server):
    """Builds a scene of a model, with every layer on: the scene and its pose."""
    from timsim.scene import Pose, Scene

    def build(model, layers=None):
        scene, pose = Scene(layers), Pose(model)
        for layer in scene.layers:
            layer.shown = True
        scene.build(server, setup_of(model))
        return scene, pose

    return build
