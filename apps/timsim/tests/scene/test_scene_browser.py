"""What a browser shows of a scene while the run plays."""

import contextlib
import io
import threading

import mujoco
import numpy as np
import pytest
from PIL import Image
from scene_moments import moment

from motorgrad.bodies import Hexapod, Hopper, Mjcf, compile_model
from patience import PATIENCE, until
from timsim.live import setup_of

SHOTS = 20
PLACE = {"x": 0, "y": 0, "width": 540, "height": 400}  # left of the panel


def motion(model, count=40):
    """Moments of a body whose muscles fire at random, `count` of 20 ms each."""
    data, random, found = mujoco.MjData(model), np.random.default_rng(2), []
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for decision in range(count):
        data.ctrl[:] = random.uniform(0, 1, model.nu)
        until_then = data.time + 0.02
        while data.time < until_then:
            mujoco.mj_step(model, data)
        state = {"velocity": data.qvel, "activation": data.act, "control": data.ctrl}
        copies = {name: np.array(array) for name, array in state.items()}
        found.append(moment(data.qpos.copy(), decision=decision, model=model, **copies))
    return found


@contextlib.contextmanager
def playing(show, moments):
    """Show moments again and again, thirty a second, as a page does."""
    stop, failed = threading.Event(), []

    def run():
        try:
            while not stop.is_set():
                for each in moments:
                    show(each)
                    if stop.wait(1 / 30):
                        return
        except Exception as error:
            failed.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
    assert not failed, failed


BODIES = [pytest.param(Hopper(), marks=pytest.mark.journey), Hexapod(), Mjcf("arm6")]


class Pictured:
    """A body in a browser's page: what is to be shown, and how much of its muscles is drawn."""

    def __init__(self, body, page, server):
        from timsim.scene import Pose, Scene
        from timsim.scene._muscles import Muscles

        model, self.muscles = compile_model(body), Muscles()
        self.scene, self.pose, self.page = Scene([self.muscles]), Pose(model), page
        self.muscles.shown = True
        self.scene.build(server, setup_of(model))
        self.moments = motion(model)
        self.show(self.moments[0])
        server.initial_camera.look_at = self.pose.centre
        server.initial_camera.position = self.pose.centre + np.array([0.4, -1.0, 0.3]) * self.pose.size
        self.muscles.shown = False
        page.goto(f"http://127.0.0.1:{server.get_port()}")
        page.locator("canvas").first.wait_for()
        page.add_style_tag(content=".mantine-Notification-root { display: none }")  # says that no GPU is there
        assert self.until(lambda: (self._shot() == 255).all(axis=2).mean() > 0.9)
        self._empty = self._shot()
        self.muscles.shown = True

    def show(self, snapshot):
        self.pose.place(snapshot)
        self.scene.update(snapshot, self.pose)

    def until(self, true):
        return until(true, pause=self.page.wait_for_timeout)

    def drawn(self):
        """The number of pixels that differ from those without muscles."""
        return int(np.sum(np.abs(self._shot() - self._empty).max(axis=2) > 30))

    def _shot(self):
        return np.asarray(Image.open(io.BytesIO(self.page.screenshot(clip=PLACE))).convert("RGB")).astype(int)


@pytest.fixture(scope="module")
def page(browser, messages_to_who_has_left):
    """One page for all bodies."""
    page = browser.new_page(viewport={"width": 900, "height": 400})
    page.set_default_timeout(1000 * PATIENCE)
    yield page
    page.close()


@pytest.fixture(scope="module", params=BODIES, ids=lambda body: type(body).__name__)
def pictured(request, page):
    """Each body in turn, opened once."""
    import viser

    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield Pictured(request.param, page, server)
    page.goto("about:blank")
    server.stop()


def test_muscles_are_drawn_where_nothing_moves(pictured):
    assert pictured.until(lambda: pictured.drawn() > 150)


def test_muscles_are_in_every_picture_while_it_plays(pictured):
    still = pictured.drawn()
    with playing(pictured.show, pictured.moments):
        counts = [pictured.drawn() for _ in range(SHOTS)]
    assert min(counts) > still / 2, (still, counts)
