"""Panels of real sessions: which there are, what they show, what they say when something is refused."""

import csv
import io
import math
import types
from unittest.mock import Mock

import mujoco
import numpy as np
import pytest
import viser
from PIL import Image

from motorgrad.bodies import Hexapod, compile_model, measure_gait, walk
from patience import until
from timsim.live import Edit, Pause, Play, Push, Session, Setup, Trail, Undo
from timsim.panels import FilmRecorder, Panels
from timsim.panels._gait import GaitReader, is_hexapod
from timsim.panels._joints import moment_arms
from timsim.panels._panel import csv_of
from timsim.panels._policy_diagrams import weights_of
from timsim.scene import Pose


@pytest.fixture(scope="module")
def server():
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server
    server.stop()


@pytest.fixture(scope="module")
def hopping(hopping):
    """The hopper, paused after some decisions: it need not learn while it is looked at."""
    hopping.order(Pause())
    assert until(lambda: not hopping.snapshot().playing)
    return hopping


def panels_of(server, session):
    server.gui.reset()
    panels = Panels()
    panels.build(server, session)
    return panels


def nobody(**more):
    """An event that no browser caused."""
    return types.SimpleNamespace(client=None, **more)


@pytest.fixture(params=["hopping", pytest.param("legged", marks=pytest.mark.ci)])
def session(request):
    """A learner, and a bare model without one; each in a process, which takes seconds to start."""
    return request.getfixturevalue(request.param)


def test_panels_that_do_not_apply_do_not_appear(server, hopping):
    assert list(panels_of(server, hopping).panels) == [
        "Run",
        "Learning",
        "Body",
        "Joints",
        "Muscles",
        "Policy",
        "Capture",
    ]
    assert is_hexapod(compile_model(Hexapod()))
    assert not is_hexapod(hopping.model)
    assert not is_hexapod(None)


def test_what_a_user_has_moved_is_left_alone_before_the_panel_is_told_too(server, hopping):
    """viser sets a value some time before it calls back. If the panel put it back, the edit would be lost."""
    run = panels_of(server, hopping).panels["Run"]
    snapshot = hopping.snapshot()
    pose = Pose(hopping.model)
    for slider, following, moved in (
        (run._speed, run._following_speed, (1.0,)),
        (run._back, run._following_past, -0.125),
    ):
        run.show(snapshot, pose)
        followed = slider.value
        slider._impl.value = moved  # as viser does when a browser says so
        run.show(snapshot, pose)
        assert slider.value == moved
        following.moved()  # as the callback says
        run.show(snapshot, pose)
        assert slider.value == moved
        following._moved = -math.inf  # a while ago
        run.show(snapshot, pose)
        assert slider.value == pytest.approx(followed, abs=0.02)


@pytest.mark.ci
def test_a_bare_model_has_the_panels_that_need_no_learner(server, legged):
    assert list(panels_of(server, legged).panels) == ["Run", "Motion", "Body", "Joints", "Muscles", "Capture"]


def test_every_panel_shows_something_and_its_numbers_are_a_table(server, session):
    panels, pose = panels_of(server, session), Pose(session.model)
    snapshot = session.snapshot()
    pose.place(snapshot)
    for panel in panels.panels.values():
        panel.show(snapshot, pose)
        try:
            columns = panel.numbers()
        except NotImplementedError:
            assert panel.title in ("Motion", "Body", "Capture")
            continue
        rows = list(csv.reader(io.StringIO(csv_of(columns).decode())))
        assert len(rows) > 3
        assert len({len(row) for row in rows}) == 1


def test_moment_arms_take_a_small_share_of_a_core(server, hopping, monkeypatch):
    panel, pose, snapshot = panels_of(server, hopping).panels["Joints"], Pose(hopping.model), hopping.snapshot()
    pose.place(snapshot)
    clock = [0.0]
    monkeypatch.setattr("timsim.panels._joints.time", types.SimpleNamespace(monotonic=lambda: clock[0]))
    drawn = []

    def slow_arms(model, position, joint):
        clock[0] += 0.5
        drawn.append(joint)
        return moment_arms(model, position, joint)

    monkeypatch.setattr("timsim.panels._joints.moment_arms", slow_arms)
    panel.show(snapshot, pose)
    for _ in range(24):  # half a second in 25
        clock[0] += 1.0
        panel.show(snapshot, pose)
    assert len(drawn) == 1
    clock[0] += 1.5
    panel.show(snapshot, pose)
    assert len(drawn) == 2
    panel._which.value = list(panel._joints)[-1]
    panel.show(snapshot, pose)
    assert drawn[2:] == [panel._joints[panel._which.value]]  # another joint is drawn at once


@pytest.mark.ci
@pytest.mark.needs("OpenGL")
def test_the_form_makes_the_film_that_is_chosen(server, hopping):
    form = panels_of(server, hopping).panels["Capture"]._film
    form._format.value, form._camera.value, form._pace.value = "GIF", "framed", "½×"
    client = Mock()
    event = types.SimpleNamespace(client=client)
    form._plots[0].value, form._height.value, form._width.value = True, 64, 65
    with pytest.raises(ValueError, match="width = 65"):
        form._toggle(event)
    assert not form.at_work
    form._width.value = 96
    hopping.order(Play())
    form._toggle(event)
    film = form._film
    assert form._button.label == "Stop film"
    assert until(lambda: film.seconds > 0.4)
    film.stop()
    hopping.order(Pause())
    assert dict(form.rows())["being made"] == "100%"
    content = film.path.read_bytes()
    with Image.open(io.BytesIO(content)) as made:
        assert (made.format, made.size) == ("GIF", (96 + 4 + 84, 64))  # the body and a plot
        assert made.info["duration"] == 50
        assert abs(made.n_frames - film.seconds / 0.5 * 20) < 3
    form._toggle(event)  # sends it to who asked
    client.send_file_download.assert_called_once_with(film.path.name, content, save_immediately=True)
    assert not form.at_work
    assert form._button.label == "Record film"
    assert not film.path.exists()


def test_the_policy_on_the_page_is_the_one_that_acts(hopping):
    snapshot = hopping.snapshot()
    policy = hopping.policy(snapshot)
    seen = np.asarray(snapshot.observation[0], np.float32)
    np.testing.assert_allclose(policy.prob(seen), snapshot.probability[0], atol=1e-5)
    assert weights_of(policy).shape == (2, 4)
    assert hopping.policy(snapshot._replace(parameters=snapshot.parameters[:, :-1])) is None  # it has grown


def test_nothing_is_drawn_for_nobody(server, hopping):
    panels, pose = panels_of(server, hopping), Pose(hopping.model)
    for _ in range(3):
        snapshot = hopping.snapshot()
        pose.place(snapshot)
        panels.update(snapshot, pose)
    assert [panel.spent for panel in panels.panels.values()] == [0.0] * len(panels.panels)


def test_what_is_refused_changes_nothing_and_is_told(server, hopping):
    panels = panels_of(server, hopping)
    learning = panels.panels["Learning"]
    before, told = dict(hopping.settings), []
    name = next(name for name in before if name.endswith(".strength"))  # which only the run can judge
    learning.guarded(lambda _: learning.order(Edit(name, -1.0)))(nobody())
    assert until(lambda: told.extend(hopping.events()) or any(event.kind == "error" for event in told))
    (error,) = [event for event in told if event.kind == "error"]
    assert "\n" not in error.text
    assert name in error.text
    assert hopping.settings == before
    learning.tell(told)
    assert name in learning._lines.content
    learning.guarded(lambda _: learning.order(Edit("agent.optimizer.learning_rate", -1.0)))(nobody())  # raises nothing
    learning.guarded(lambda _: learning.order(Edit("speed of light", 1.0)))(nobody())
    assert hopping.settings == before


def test_an_edit_is_made_and_logged(server, hopping):
    panels = panels_of(server, hopping)
    learning, told = panels.panels["Learning"], []
    learning.order(Edit("agent.optimizer.learning_rate", 2.5e-4))
    assert until(lambda: hopping.settings["agent.optimizer.learning_rate"] == pytest.approx(2.5e-4))
    assert until(lambda: told.extend(hopping.events()) or told)
    learning.tell(told)
    assert "0.00025" in learning._lines.content


def test_a_fault_of_ours_is_not_taken_for_the_users(server, hopping):
    panel = panels_of(server, hopping).panels["Run"]
    with pytest.raises(ZeroDivisionError):
        panel.guarded(lambda _: 1 / 0)(nobody())


@pytest.mark.ci
def test_a_bare_models_muscles_are_driven_by_hand(server, legged):
    muscles = panels_of(server, legged).panels["Muscles"]
    muscles._which.value = legged.muscles[2]
    muscles._drive._slider.value = 0.75
    muscles._drive._control(types.SimpleNamespace(client=object()))
    assert until(lambda: legged.snapshot().control[0, 2] == pytest.approx(0.75))
    legged.order(Pause())
    assert until(lambda: not legged.snapshot().playing)
    pose, snapshot = Pose(legged.model), legged.snapshot()
    pose.place(snapshot)
    muscles.show(snapshot, pose)
    assert "75%" in muscles._summary.content


@pytest.fixture(scope="module")
def march():
    """A walk of the fixed controller, and the trail that a session would have of it."""
    body = Hexapod(drive="servos")
    recorded = walk(body, seconds=5.0)
    late = recorded.time > 2.0
    model = compile_model(body)
    reading = type(recorded.reading)(*(part[late] for part in recorded.reading))
    feet = [model.sensor(i).name for i in range(model.nsensor) if "contact_" in model.sensor(i).name]
    return recorded, late, model, reading, feet


@pytest.mark.ci
def test_a_simulation_that_breaks_down_leaves_no_file_and_comes_back(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    body = '<body name="ball"><freejoint/><geom size=".1" mass="1e-8"/></body>'
    ball = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    with Session(Setup("ball", model=ball)) as session:
        session.order(Push("ball", (0.0, 0.0, 1e6), 20.0))
        assert until(lambda: any(event.kind == "lost" for event in session.log))
        assert "broke down" in session.log[-1].text
        assert not session.snapshot().playing
        session.order(Undo())
        assert until(lambda: session.log[-1].text == "took back: push")
        assert np.abs(session.snapshot().position).max() < 1e3
    assert list(tmp_path.iterdir()) == []


def test_a_gait_is_what_the_recording_of_the_walk_says(march):
    recorded, late, model, reading, feet = march
    count = int(late.sum())
    position = recorded.posture[late, 0]
    velocity = np.zeros((count, model.nv))
    import mujoco

    for row in range(count):  # as the engine had them, from one posture to the next
        other = min(row + 1, count - 1)
        mujoco.mj_differentiatePos(model, velocity[row], recorded.period, position[max(other - 2, 0)], position[other])
        velocity[row] /= max(other - max(other - 2, 0), 1)
    nothing = np.zeros((count, 0))
    trail = Trail(
        decision=np.arange(count),
        seconds=recorded.time[late],
        position=position,
        velocity=velocity,
        activation=nothing,
        action=nothing,
        reward=np.zeros(count),
        contacts=np.asarray(reading.contact)[:, 0],
        observation=nothing,
        probability=nothing,
    )
    walked = GaitReader(model, recorded.period, feet)
    found, expected = walked.gait(trail), measure_gait(reading, recorded.period)
    assert found.kind[0] == expected.kind[0] == "tripod"
    for name in ("phase", "correlation", "duty", "net", "frequency"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(found.speed, expected.speed, rtol=0.05)
    again = walked.gait(trail)  # from what it remembers
    np.testing.assert_array_equal(again.speed, found.speed)
    assert walked.contacts(trail).shape == (count, 6)
    broken = trail._replace(decision=np.concatenate([np.arange(count - 20), 10_000 + np.arange(20)]))
    assert walked.gait(broken) is None  # too little since the break


def test_parts_of_the_body_are_pulled_by_dragging(server, hopping):
    import asyncio

    from timsim.live import Scrub, Step
    from timsim.panels import DragPush
    from timsim.scene import Scene

    scene, pose = Scene(), Pose(hopping.model)
    scene.build(server, hopping)
    begin = hopping.snapshot().decision + 1
    hopping.order(Step())
    assert until(lambda: hopping.snapshot().decision == begin)
    pose.place(hopping.snapshot())
    scene.update(hopping.snapshot(), pose)
    drag = DragPush(scene.draggable)
    drag.build(server, hopping)
    for _ in range(2):  # of which the second finds nothing new
        drag.update(hopping.snapshot(), pose)
    handles = [handle for handle, _ in scene.draggable()]
    assert handles
    assert [len(handle._impl.drag_cb) for handle in handles] == [1] * len(handles)
    free = hopping.model.body_weldid[hopping.model.geom_bodyid] > 0
    handle, geoms = next((handle, geoms) for handle, geoms in scene.draggable() if free[geoms].any())
    pull, moving = handle._impl.drag_cb[0].callback, int(np.argmax(free[geoms]))
    ends = []
    for phase, copy in (("end", moving), ("update", len(geoms)), ("update", moving)):
        hopping.order(Scrub(begin))
        assert until(lambda: hopping.snapshot().decision == begin)
        grip = {"start_position": (0.0, 0.0, 0.3), "end_position": (0.0, 0.0, 1.3)}
        asyncio.run(pull(types.SimpleNamespace(instance_index=copy, phase=phase, client=None, **grip)))
        hopping.order(Step(5))
        assert until(lambda: hopping.snapshot().decision == begin + 5)
        ends.append(hopping.snapshot().position[0])
    np.testing.assert_array_equal(ends[0], ends[1])  # neither the end of a drag nor the untrained body pulls
    assert np.abs(ends[2] - ends[1]).max() > 1e-3
    server.scene.reset()


@pytest.mark.parametrize(
    ("name", "settings", "said"),
    [
        ("run.avi", {}, "ending in .mp4"),
        ("run.mp4", {"fps": 0}, "fps = 0"),
        ("run.mp4", {"fps": float("nan")}, "fps = nan"),
        ("run.mp4", {"width": 63}, "width = 63"),
        ("run.mp4", {"height": "high"}, "height = 'high'"),
    ],
)
def test_what_cannot_be_filmed_is_refused_before_it_begins(hopping, tmp_path, name, settings, said):
    with pytest.raises(ValueError, match=said):
        FilmRecorder(hopping, tmp_path / name, **settings)
    assert list(tmp_path.iterdir()) == []


def test_the_form_refuses_a_number_out_of_range_before_it_is_sent(server, hopping):
    learning = panels_of(server, hopping).panels["Learning"]
    form = learning._form
    field = form._fields[form._names.index("agent.estimator.trace.decay")]
    field.value = "1.5"
    message = r"agent\.estimator\.trace\.decay = 1\.5: must be in \[0, 1\]"
    with pytest.raises(ValueError, match=message) as refused:
        form._submit(nobody())
    assert [each.name for each in refused.traceback][-6:] == ["_submit", "order", "order", "check", "check", "check"]
    assert float(field.value) == hopping.settings["agent.estimator.trace.decay"]  # as the run has it
