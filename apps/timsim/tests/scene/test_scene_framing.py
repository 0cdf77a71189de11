"""A following camera keeps the whole body in its picture: the silhouette is rendered from where the camera is."""

import types

import mujoco
import numpy as np
import pytest
from scene_moments import moment

from motorgrad.bodies import Arm, Mjcf, compile_model
from timsim.film import Viewpoint, camera_axes, natural_angles
from timsim.film._gl import backend, make_context
from timsim.live import setup_of
from timsim.scene import Pose
from timsim.scene import _cameras as cameras
from timsim.scene._framing import History

WIDE, HIGH = 320, 240
EDGE = 4  # pixels of margin
LEAST = 0.08  # of the picture's height, or width, that a body fills at least


class Silhouette:
    """What pixels of a picture show a body, or a part of it."""

    def __init__(self, model):
        self.context = make_context(backend(), WIDE, HIGH)
        self.context.make_current()
        self.model, self.scene = model, mujoco.MjvScene(model, 1000)
        model.vis.global_.offwidth, model.vis.global_.offheight = WIDE, HIGH
        model.vis.map.zfar = 1000.0
        self.resources = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self.resources)

    def close(self):
        self.context.make_current()
        self.resources.free()
        self.context.free()

    def of(self, data, camera, names=()):
        """Which pixels `(height, width)` show geoms of these names, by default all that move."""
        self.context.make_current()
        eye, away = mujoco.MjvCamera(), camera.position - camera.look_at
        eye.lookat[:], eye.distance = camera.look_at, np.linalg.norm(away)
        eye.azimuth = np.degrees(np.arctan2(-away[1], -away[0]))
        eye.elevation = np.degrees(np.arcsin(-away[2] / eye.distance))
        self.model.vis.global_.fovy = np.degrees(camera.fov)
        scene, option = self.scene, mujoco.MjvOption()
        every = mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(self.model, data, option, None, eye, every, scene)
        scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = True
        pixels = np.empty((HIGH, WIDE, 3), np.uint8)
        frame = mujoco.MjrRect(0, 0, WIDE, HIGH)
        mujoco.mjr_render(frame, scene, self.resources)
        mujoco.mjr_readPixels(pixels, None, frame, self.resources)
        number = pixels.astype(int) @ [1, 256, 65536]  # one more than the place in the scene
        moving = [
            geom.name if names else self.model.body_weldid[self.model.geom_bodyid[geom.id]]
            for geom in map(self.model.geom, range(self.model.ngeom))
        ]
        wanted = [i for i, value in enumerate(moving) if (value in names if names else value != 0)]
        places = [
            each.segid + 1
            for each in scene.geoms[: scene.ngeom]
            if each.objtype == mujoco.mjtObj.mjOBJ_GEOM and each.objid in wanted
        ]
        return np.isin(number, places)


@pytest.fixture(scope="module")
def silhouette():
    """That of a model, made once, as a context of OpenGL takes long to make."""
    made = {}

    def of(model):
        if model not in made:
            made[model] = Silhouette(model)
        return made[model]

    yield of
    for each in made.values():
        each.close()


def whole(seen):
    """Whether a silhouette is in the picture as a whole, with a margin, and large enough."""
    rows, columns = np.flatnonzero(seen.any(1)), np.flatnonzero(seen.any(0))
    if not len(rows):
        return False
    inside = rows[0] >= EDGE and rows[-1] < HIGH - EDGE and columns[0] >= EDGE and columns[-1] < WIDE - EDGE
    return bool(inside and max(np.ptp(rows) / HIGH, np.ptp(columns) / WIDE) >= LEAST)


BEFORE = np.array([3.0, 3.0, 3.0])  # where a browser's camera looked before
AWAY = np.array([-0.6, -1.8, 0.7])


def eye_of(pose, travels):
    """A camera as a browser has it, in the mode Follow."""
    camera = types.SimpleNamespace(
        position=BEFORE + AWAY, look_at=BEFORE, fov=np.radians(45), aspect=WIDE / HIGH, update_timestamp=0.0
    )
    history = History()
    history.add(pose)
    mode = cameras.Follow(history, travels)
    mode.begin(camera, pose)
    return camera, mode, history


def test_a_hopper_that_hops_higher_and_higher_stays_in_the_picture(hopper, silhouette):
    pose, sight = Pose(hopper), silhouette(hopper)
    start = hopper.key_qpos[0]
    pose.place(moment(start, model=hopper))
    camera, mode, history = eye_of(pose, travels=False)
    for decision in range(1, 60):
        position = start.copy()
        position[0] += 0.02 * decision * abs(np.sin(0.7 * decision))  # up to 1.2 m, far between two pictures
        pose.place(moment(position, model=hopper, decision=decision))
        history.add(pose)
        mode.move(camera, pose)
        if decision % 5 == 0:
            assert whole(sight.of(pose.bodies[0], camera)), decision


@pytest.mark.ci
@pytest.mark.representatives("120.0")
@pytest.mark.parametrize("speed", [0.3, 6.0, 120.0])
def test_a_hexapod_is_followed_from_the_first_moment_at_every_speed(hexapod, silhouette, speed):
    """Metres a second of wall time: 120 is four metres between two pictures."""
    pose, sight = Pose(hexapod), silhouette(hexapod)
    position = hexapod.key_qpos[0].copy()
    position[0] += 50.0
    pose.place(moment(position, model=hexapod))
    camera, mode, history = eye_of(pose, travels=True)
    assert whole(sight.of(pose.bodies[0], camera))
    for decision in range(1, 20):
        position[:2] += speed / 30 * np.array([0.8, 0.6])
        pose.place(moment(position, model=hexapod, decision=decision))
        history.add(pose)
        mode.move(camera, pose)
        if decision % 4 == 0:
            assert whole(sight.of(pose.bodies[0], camera)), decision


@pytest.mark.ci
def test_the_arm_is_in_the_picture_with_its_shoulder(silhouette):
    model = compile_model(Arm())
    pose, sight = Pose(model), silhouette(model)
    pose.place(moment(model.key_qpos[0], model=model))
    camera, *_ = eye_of(pose, travels=False)
    assert whole(sight.of(pose.bodies[0], camera))
    assert whole(sight.of(pose.bodies[0], camera, names=("upper_arm", "harness")))


def test_what_the_user_turns_and_zooms_stays_so(hopper):
    pose = Pose(hopper)
    pose.place(moment(hopper.key_qpos[0], model=hopper))
    camera, mode, _ = eye_of(pose, travels=False)
    length = np.linalg.norm(camera.position - camera.look_at)
    camera.position = camera.look_at + np.array([0.0, -0.7 * length, 0.0])
    camera.update_timestamp += 1.0
    for _ in range(3):
        mode.move(camera, pose)
    mode._turned = -np.inf  # the hand has let go
    mode.move(camera, pose)
    np.testing.assert_allclose(camera.position - camera.look_at, [0.0, -0.7 * length, 0.0], atol=1e-6)


def test_late_reports_of_a_slow_browser_are_not_the_users_zoom(hopper, silhouette):
    """It draws a picture in seconds, and reports meanwhile on where its camera was before."""
    pose, sight = Pose(hopper), silhouette(hopper)
    position = hopper.key_qpos[0].copy()
    pose.place(moment(position, model=hopper))
    camera, mode, history = eye_of(pose, travels=False)
    seen = [(BEFORE + AWAY, BEFORE)]
    for decision in range(1, 200):
        position[0] = 0.01 * min(decision, 60)  # it rises, and the camera moves away
        pose.place(moment(position, model=hopper, decision=decision))
        history.add(pose)
        mode.move(camera, pose)
        seen.append((camera.position.copy(), camera.look_at.copy()))
        if decision % 10 == 0:  # what the browser reports is a hundred pictures old
            camera.position, camera.look_at = seen[max(0, decision - 100)]
            camera.update_timestamp += 1.0
    mode._turned = -np.inf
    mode.move(camera, pose)
    assert mode._zoom == 1.0
    assert whole(sight.of(pose.bodies[0], camera))
    camera.position = camera.look_at + 2.0 * (camera.position - camera.look_at)  # the hand zooms after all
    camera.update_timestamp += 1.0
    mode.move(camera, pose)
    assert mode._zoom == pytest.approx(2.0, rel=0.01)


@pytest.mark.ci
@pytest.mark.representatives("hexapod")
@pytest.mark.parametrize("which", ["hopper", "hexapod"])
def test_before_and_after_both_bodies_are_whole_in_the_picture(which, request, silhouette):
    model = request.getfixturevalue(which)
    pose, sight, travels = Pose(model), silhouette(model), which == "hexapod"
    start = model.key_qpos[0]
    pose.place(moment(start, model=model))
    camera, mode, history = eye_of(pose, travels)
    for decision in range(1, 20):
        positions = np.stack([start, start])
        positions[0, 0] += 0.05 * decision  # the one that learns gets ahead
        pose.place(moment(positions, model=model, decision=decision))
        history.add(pose)
        mode.move(camera, pose)
    for data, offset in zip(pose.bodies, pose.offset, strict=True):  # each is drawn beside its own place
        there = types.SimpleNamespace(**vars(camera))
        there.position, there.look_at = camera.position - offset, camera.look_at - offset
        assert whole(sight.of(data, there))


def test_f_frames_again_what_the_user_has_lost_by_zooming(hopper, silhouette):
    pose, sight = Pose(hopper), silhouette(hopper)
    pose.place(moment(hopper.key_qpos[0], model=hopper))
    camera, mode, history = eye_of(pose, travels=False)
    towards = (camera.position - camera.look_at) / np.linalg.norm(camera.position - camera.look_at)
    camera.position = camera.look_at + 0.2 * pose.size * towards
    camera.update_timestamp += 1.0
    for _ in range(3):
        mode.move(camera, pose)
    assert not whole(sight.of(pose.bodies[0], camera))
    cameras.Follow(history, travels=False).begin(camera, pose)  # what the key does
    assert whole(sight.of(pose.bodies[0], camera))
    again = camera.position - camera.look_at
    np.testing.assert_allclose(again / np.linalg.norm(again), towards, atol=1e-6)  # seen from the same side


BENT = """<mujoco><worldbody><body><joint axis="0 0 {0}"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/>
<body pos=".3 0 0"><joint axis="0 0 1"/><geom type="capsule" fromto="0 0 0 0 .2 0" size=".02"/></body></body>
</worldbody></mujoco>"""


@pytest.fixture(params=["arm6", BENT.format(1), BENT.format(-1)], ids=["arm6", "bent", "turned"])
def planar(request):
    """An arm whose joints all turn about z."""
    return Mjcf(request.param).model


def picture_of(camera, up):
    """The directions of the world that are right and up in a camera's picture."""
    return Viewpoint(tuple(camera.position), tuple(camera.look_at), 45.0, tuple(up)).axes[:2]


def test_a_planar_arm_is_seen_upright_along_z_in_films_and_on_the_page(planar, server):
    upright = [[1, 0, 0], [0, 1, 0]]
    np.testing.assert_allclose(camera_axes(*natural_angles(planar))[:2], upright, atol=1e-12)
    cameras.Cameras().build(server, setup_of(planar))
    first = server.initial_camera
    np.testing.assert_allclose(picture_of(first, first.up), upright, atol=1e-12)


def test_a_spatial_body_is_seen_with_z_up_on_the_page(hexapod, hopper, server):
    for model in (hexapod, hopper):
        cameras.Cameras().build(server, setup_of(model))
        first = server.initial_camera
        right, up = picture_of(first, first.up)
        assert right[2] == pytest.approx(0.0, abs=1e-12)
        assert up[2] > 0.9


def test_a_planar_arm_is_upright_again_after_every_other_camera(planar, server):
    page = cameras.Cameras()
    page.build(server, setup_of(planar))
    first, pose = server.initial_camera, Pose(planar)
    pose.place(moment(planar.qpos0, model=planar))
    page._history.add(pose)
    camera = types.SimpleNamespace(
        **{"position": first.position, "look_at": first.look_at, "up_direction": np.array(first.up)},
        **{"fov": first.fov, "aspect": WIDE / HIGH, "update_timestamp": 0.0},
    )
    viewer = cameras.Viewer(types.SimpleNamespace(camera=camera), "Follow", 1.0)
    for name in ("Follow", "Walk", "Follow", "Walk", "Orbit", "Follow"):
        viewer.wanted = name
        page._switch(viewer, pose)
        for _ in range(2):
            viewer.mode.move(camera, pose)
        right, up = picture_of(camera, camera.up_direction)
        if name == "Walk":  # on the ground, with the horizon level
            assert right[2] == pytest.approx(0.0, abs=1e-12)
            assert up[2] > 0.5
        else:
            np.testing.assert_allclose([right, up], [[1, 0, 0], [0, 1, 0]], atol=1e-9)
