"""Gymnasium environments in view: their own picture, made when somebody asks, or the body that MuJoCo moves in them."""

import gymnasium
import numpy as np
import pytest

import motorgrad as mg
from motorgrad.tasks import EnvironmentPictures
from patience import until
from pictured import Lamp
from timsim import live


def looked(session):
    before = session.pictures
    session.order(live.Look())
    assert until(lambda: session.pictures > before)
    return session.picture


def column(picture):
    return int(np.argmax(picture.pixels[0, :, 0]))


def test_a_picture_leaves_an_environment_as_it_was():
    environment, pictures = gymnasium.wrappers.TimeLimit(Lamp(), 100), EnvironmentPictures()
    environment.reset(seed=0)
    for step in range(3):
        environment.step(0)
        assert pictures.of(environment)[0, :, 0].argmax() == step + 1
        bare = environment.unwrapped
        assert (bare.canvas, bare.render_mode) == (None, None)
    canvas = pictures._kept["canvas"]
    pictures.of(environment)
    assert pictures._kept["canvas"] is canvas  # made once


@pytest.mark.ci
def test_an_environment_shows_its_own_picture_and_goes_on_as_without():
    """Watched and unwatched, the learner is the same bit for bit; and the past has its picture, too."""
    task = mg.tasks.from_gymnasium(Lamp)
    ends = []
    for watched in (False, True):
        with live.Session(live.setup_of(task, seed=3), playing=False) as session:
            assert session.model is None
            for _ in range(4):
                session.order(live.Step(10))
                if watched:
                    picture = looked(session)
                    assert (picture.pixels.shape, picture.problem) == ((64, 64, 3), "")
                    assert column(picture) == session.snapshot().decision
            assert until(lambda: session.snapshot().decision == 40)
            ends.append(session.snapshot().parameters)
            if watched:
                session.order(live.Scrub(15))
                assert until(lambda: session.snapshot().decision == 15)
                assert column(looked(session)) == 15
                assert not [event for event in session.log if event.kind == "error"]
    assert np.array_equal(*ends)


@pytest.mark.ci
def test_one_that_cannot_be_drawn_says_why():
    task = mg.tasks.from_gymnasium(Lamp, fails=True)
    with live.Session(live.setup_of(task), playing=False) as session:
        picture = looked(session)
    assert (picture.pixels, picture.problem) == (None, "RuntimeError: a library is missing")
    with live.Session(live.setup_of("chain"), playing=False) as session, pytest.raises(ValueError, match="look"):
        session.order(live.Look())


@pytest.mark.ci
def test_an_environment_of_mujoco_shows_its_body():
    task = mg.tasks.from_gymnasium("Hopper-v5")
    with live.Session(live.setup_of(task, seed=3), playing=False) as session:
        assert session.model.body("torso").id > 0
        assert len(session.muscles) == session.model.nu == 3
        before = session.snapshot()
        assert before.position.shape == (1, session.model.nq)
        session.order(live.Step(5))
        assert until(lambda: session.snapshot().decision == 5)
        after = session.snapshot()
        assert np.abs(after.position - before.position).max() > 1e-3
        assert np.abs(after.control).max() > 0
        trail = session.trail()
        assert np.array_equal(trail.position[-1], after.position[0])
        # a push moves it, and the past comes back as it was
        session.order(live.Push("torso", (400.0, 0.0, 0.0), 0.05))
        session.order(live.Step(5))
        assert until(lambda: session.snapshot().decision == 10)
        pushed = session.snapshot().position
        session.order(live.Undo())
        assert until(lambda: session.snapshot().decision == 5)
        session.order(live.Step(5))
        assert until(lambda: session.snapshot().decision == 10)
        assert np.abs(session.snapshot().position - pushed).max() > 0.01
