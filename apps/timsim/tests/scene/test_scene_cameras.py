"""Each kind of camera moves as it should, in a real browser, for each browser by itself."""

import threading

import numpy as np
import pytest
from scene_moments import moment

from motorgrad.bodies import Hexapod, OnTerrain, Terrain, compile_model
from patience import PATIENCE, until
from timsim._watching_client import watch
from timsim.live import setup_of
from timsim.scene import Cameras, Pose, Scene, View

SPEED = 0.3  # m/s, at which the body goes along x
EYES = 0.5  # m, of a walker in this test


class Walker:
    """A page of a hexapod that glides over hills when told to: the loop of a page, thirty times a second."""

    def __init__(self, server):
        self.server = server
        terrain = Terrain(kind="waves", height=0.3, spacing=2.0, size=(12.0, 12.0), clearing=0.3)
        self.model = compile_model(OnTerrain(Hexapod(), terrain))
        self.pose, self.scene = Pose(self.model), Scene()
        self.view = View(self.scene)
        session = setup_of(self.model)
        self.scene.build(server, session)
        next(layer for layer in self.scene.layers if layer.name == "Shadows").shown = False  # slow in software
        with server.gui.add_tab_group().add_tab("View"):
            self.view.build(server, session)
        self.going, self.decision, self._stop = False, 0, threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        start, along = self.model.key_qpos[0].copy(), 0.0
        while not self._stop.wait(1 / 30):
            if self.going:
                along += SPEED / 30
                self.decision += 1
            position = start + along * (np.arange(self.model.nq) == 0)
            snapshot = moment(position, decision=self.decision, model=self.model)
            self.pose.place(snapshot)
            self.scene.update(snapshot, self.pose)
            self.view.update(snapshot, self.pose)

    def close(self):
        self._stop.set()
        self._thread.join()


@pytest.fixture
def walker(server):
    walker = Walker(server)
    yield walker
    walker.close()


class Looker:
    """A browser at the page: what it does, and where the server has its camera."""

    def __init__(self, browser, walker):
        self.walker, known = walker, set(walker.server.get_clients())
        self.page = browser.new_page(viewport={"width": 640, "height": 240})
        self.page.set_default_timeout(1000 * PATIENCE)
        self.page.goto(f"http://127.0.0.1:{walker.server.get_port()}")
        self.until(lambda: set(walker.server.get_clients()) - known)
        (self.id,) = set(walker.server.get_clients()) - known
        self.until(lambda: self.id in walker.view.cameras._viewers)
        self.camera = walker.server.get_clients()[self.id].camera
        self.page.wait_for_timeout(1000)

    def until(self, condition):
        """Wait until something holds, with the browser at work."""
        assert until(condition, pause=lambda seconds: self.page.wait_for_timeout(1000 * seconds))

    def select(self, key, name):
        def chosen():
            self.page.keyboard.press(key)  # again, as a page that is still being built does not hear it
            self.page.wait_for_timeout(200)
            return self.walker.view.cameras.chosen(self.id) == name

        self.until(chosen)
        self.page.wait_for_timeout(500)

    def stands(self):
        """Whether the camera stays where it is, also where a page draws but one picture in a second."""
        before = self.camera.position.copy()
        self.page.wait_for_timeout(1500)
        return np.linalg.norm(self.camera.position - before) < 0.005

    def drag(self, across, steps=8):
        """Drag the mouse slowly, as a hand does."""
        self.page.mouse.move(60, 200)
        self.page.mouse.down()
        for step in range(1, steps + 1):
            self.page.mouse.move(60 + across * step / steps, 200)
            self.page.wait_for_timeout(60)
        self.page.mouse.up()
        self.page.wait_for_timeout(500)

    @property
    def away(self):
        """From what the camera looks at to the camera."""
        return self.camera.position - self.camera.look_at


@pytest.mark.slow
def test_each_camera_moves_as_it_should(walker, browser):
    looker, cameras = Looker(browser, walker), walker.view.cameras
    camera, pose = looker.camera, walker.pose

    # a body that can go away is followed at first
    looker.until(lambda: cameras.chosen(looker.id) == "Follow")
    np.testing.assert_allclose(camera.look_at, pose.centre, atol=0.01)

    # orbit: the hand turns it about the body, as far away as before; the body goes, the camera stays
    looker.select("o", "Orbit")
    before = looker.away.copy()
    looker.until(lambda: (looker.drag(120), np.linalg.norm(looker.away - before) > 0.2)[1])
    assert np.linalg.norm(looker.away) == pytest.approx(np.linalg.norm(before), rel=1e-3)
    still = camera.position.copy()
    walker.going = True
    looker.until(lambda: walker.decision > 30)
    np.testing.assert_allclose(camera.position, still, atol=1e-3)

    # follow: it keeps its distance while the body goes, a little behind, and catches up when it stops
    looker.select("f", "Follow")
    away, started = looker.away.copy(), pose.centre[0]
    looker.until(lambda: pose.centre[0] > started + 0.6)
    assert 0.0 < pose.centre[0] - camera.look_at[0] < 1.0 * SPEED
    looker.until(lambda: np.allclose(looker.away, away, atol=0.05))  # its two ends are not read at one instant
    walker.going = False
    looker.until(lambda: np.linalg.norm(camera.look_at - pose.centre) < 0.01)
    turned = looker.away.copy()
    looker.until(lambda: (looker.drag(140), np.linalg.norm(looker.away - turned) > 0.1)[1])
    looker.until(lambda: np.linalg.norm(camera.look_at - pose.centre) < 0.01)

    # walk: at eye height over the hills, whichever way it goes; the mouse looks around from where it stands
    cameras._viewers[looker.id].height = EYES
    looker.select("g", "Walk")
    feet, _ = cameras._model_ground(camera.position)
    assert camera.position[2] - feet[2] == pytest.approx(EYES, abs=0.1 * EYES)
    for key in "ws":
        begun = camera.position.copy()
        looker.page.keyboard.down(key)
        looker.until(lambda begun=begun: np.linalg.norm((camera.position - begun)[:2]) > 0.7)
        looker.page.keyboard.up(key)
        looker.until(looker.stands)
        feet, _ = cameras._model_ground(camera.position)
        assert camera.position[2] - feet[2] == pytest.approx(EYES, abs=0.1 * EYES)
    stood, looked = camera.position.copy(), looker.away / np.linalg.norm(looker.away)
    looker.drag(120)
    assert (
        np.linalg.norm(camera.position - stood) < 0.3 * EYES
    )  # it may still come to rest; an orbit moves it by more than 0.2 m
    assert looker.away @ looked < 0.95 * np.linalg.norm(looker.away)

    # the model's own: as it is in the model, with its field of view, and moving with the body
    looker.select("1", "Fixed: above")
    walker.going = True
    begun = walker.decision
    looker.until(lambda: walker.decision > begun + 10)
    walker.going = False
    looker.page.wait_for_timeout(500)
    own = walker.model.camera("above").id
    np.testing.assert_allclose(camera.position, pose.bodies[0].cam_xpos[own], atol=1e-3)
    ahead = -pose.bodies[0].cam_xmat[own].reshape(3, 3)[:, 2]
    np.testing.assert_allclose(-looker.away / np.linalg.norm(looker.away), ahead, atol=1e-3)
    assert np.degrees(camera.fov) == pytest.approx(walker.model.cam_fovy[own])

    # back to the orbit: upright, with the field of view that it had
    looker.select("o", "Orbit")
    looker.until(lambda: abs(np.degrees(camera.fov) - 45) < 0.1)
    np.testing.assert_allclose(camera.up_direction, [0, 0, 1], atol=1e-6)

    # the list of keys, on the key that everyone tries
    looker.page.keyboard.press("Shift+?")
    looker.page.get_by_text("camera: walk on the ground, at eye height").wait_for()

    # another browser, which need not draw, has a camera of its own
    here, known = camera.position.copy(), set(walker.server.get_clients())
    other = threading.Thread(target=watch, args=(f"http://127.0.0.1:{walker.server.get_port()}", 4.0))
    other.start()
    looker.until(lambda: set(cameras._viewers) - known)
    (second,) = set(cameras._viewers) - known
    cameras.select(second, "Fixed: above")
    looker.until(lambda: cameras.chosen(second) == "Fixed: above")
    looker.page.wait_for_timeout(500)
    theirs = walker.server.get_clients()[second].camera.position
    np.testing.assert_allclose(theirs, pose.bodies[0].cam_xpos[own], atol=1e-3)
    assert cameras.chosen(looker.id) == "Orbit"
    np.testing.assert_allclose(camera.position, here, atol=1e-3)
    other.join()
    looker.until(lambda: second not in cameras._viewers)


def test_a_camera_that_there_is_not_is_refused(hopper, server):
    cameras = Cameras()
    cameras.build(server, setup_of(hopper))
    assert cameras.names == ["Orbit", "Walk", "Follow", "Fixed: stand", "Fixed: side"]
    with pytest.raises(ValueError, match=r"camera = 'Fly': must be one of Orbit, Walk, Follow, Fixed: stand"):
        cameras.select(0, "Fly")
