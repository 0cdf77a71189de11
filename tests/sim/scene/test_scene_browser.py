"""What a browser shows of a scene while the run plays."""

import contextlib
import io
import threading

import mujoco
import numpy as np
import pytest
from patience import PATIENCE, until
from PIL import Image
from scene_moments import moment

from motorgrad.bodies import Hexapod, Hopper, Mjcf, compile_model

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


@pytest.mark.parametrize("body", BODIES, ids=lambda body: type(body).__name__)
def test_muscles_are_in_every_picture_while_it_plays(body, browser, server, staged, messages_to_who_has_left):
    from motorgrad.sim.scene._muscles import Muscles

    model, muscles = compile_model(body), Muscles()
    scene, pose = staged(model, [muscles])
    moments = motion(model)

    def show(snapshot):
        pose.place(snapshot)
        scene.update(snapshot, pose)

    show(moments[0])
    server.initial_camera.look_at = pose.centre
    server.initial_camera.position = pose.centre + np.array([0.4, -1.0, 0.3]) * pose.size
    page = browser.new_page(viewport={"width": 900, "height": 400})
    try:
        page.set_default_timeout(1000 * PATIENCE)

        def shot():
            return np.asarray(Image.open(io.BytesIO(page.screenshot(clip=PLACE))).convert("RGB")).astype(int)

        muscles.shown = False
        page.goto(f"http://127.0.0.1:{server.get_port()}")
        page.locator("canvas").first.wait_for()
        page.add_style_tag(content=".mantine-Notification-root { display: none }")  # says that no GPU is there
        assert until(lambda: (shot() == 255).all(axis=2).mean() > 0.9, pause=page.wait_for_timeout)
        empty = shot()

        def drawn():
            return int(np.sum(np.abs(shot() - empty).max(axis=2) > 30))

        muscles.shown = True
        assert until(lambda: drawn() > 150, pause=page.wait_for_timeout)
        still = drawn()
        with playing(show, moments):
            counts = [drawn() for _ in range(SHOTS)]
        assert min(counts) > still / 2, (still, counts)
    finally:
        page.close()
