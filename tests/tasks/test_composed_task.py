"""A composed task as a whole: actions, settings, files, environments."""

import dataclasses
import pickle

import gymnasium
import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import tomli_w
from composed_examples import BODY, MODEL, task
from gymnasium.utils.env_checker import check_env

import motorgrad as mg
from motorgrad.bodies import Hopper, Mjcf
from motorgrad.environments import TaskEnv
from motorgrad.schema import table
from motorgrad.tasks import Composed, terms

REACH = """
body = "arm.xml"
time_limit = 2.0
actions = "binary"
groups = ["shoulder flexor", ["shoulder extensor", "elbow*"]]

[[targets]]
kind = "follow"
parts = "hand"
file = "track.csv"

[[observe]]
kind = "joint-positions"
[[observe]]
kind = "target-error"
scale = 2.0

[[reward]]
kind = "distance"
weight = -2.0

[[reset]]
kind = "random-joints"

[[terminate]]
kind = "distance"
above = 1.0

[[metrics]]
kind = "within"
name = "solved"
tolerance = 0.1
"""


@pytest.fixture
def file(tmp_path):
    """The file of a task in a folder of its own, with its model and trajectory."""
    (tmp_path / "arm.xml").write_bytes(mg.bodies.BUNDLED["arm6"].read_bytes())
    (tmp_path / "track.csv").write_text("0,.1,.2,0\n1,.2,.2,0\n")
    (tmp_path / "reach.toml").write_text(REACH)
    return tmp_path / "reach.toml"


def test_graded_actions_are_controls_in_the_actuators_ranges():
    made = task()
    assert made.action_names == ("lift", "bend", "hold")
    assert made.action_range == ((0, 1), (-1, 1), (0, 2))
    np.testing.assert_allclose(made.control(jnp.array([0.3, -0.4, 1.5])), (0.3, -0.4, 1.5))
    np.testing.assert_allclose(made.control(jnp.array([[-3.0, -3.0, -3.0], [3.0, 3.0, 3.0]])), [(0, -1, 0), (1, 1, 2)])
    two = task(groups=["hold", "lift"])
    np.testing.assert_allclose(two.control(jnp.array([1.5, 0.3])), (0.3, 0, 1.5))
    assert two.action_range == ((0, 2), (0, 1))


def test_binary_actions_are_on_or_off_and_opposed_where_a_range_has_two_sides():
    made = task(actions="binary")
    assert made.action_names == ("lift", "bend", "bend backwards", "hold")
    for units, wanted in (
        ((0, 0, 0, 0), (0, 0, 0)),
        ((1, 1, 0, 1), (1, 1, 2)),
        ((0, 0, 1, 0), (0, -1, 0)),
        ((0, 1, 1, 0), (0, 0, 0)),
    ):
        np.testing.assert_array_equal(made.control(jnp.array(units, jnp.float32)), wanted)
    together = task(actions="binary", groups=[("lift", "hold"), "bend"])
    np.testing.assert_array_equal(together.control(jnp.array([1.0, 0.0, 1.0])), (1, -1, 2))
    muscles = mg.tasks.compose("arm6", observe=["joint-positions"], reward=["alive"], groups=["*flexor", "*extensor"])
    np.testing.assert_allclose(muscles.control(jnp.array([0.2, 0.7])), [0.2, 0.7] * 3)


def test_several_binary_units_may_drive_a_group_and_graded_ones_may_not():
    made = task(actions="binary", groups=["lift", "hold", "lift"])
    assert made.action_names == ("lift", "hold", "lift 2")
    for units, lifted in (((0, 0, 0), 0), ((1, 0, 0), 1), ((0, 0, 1), 1), ((1, 0, 1), 1)):
        np.testing.assert_array_equal(made.control(jnp.array(units, jnp.float32)), (lifted, 0, 0))
    with pytest.raises(ValueError, match="all different for continuous actions"):
        task(groups=["lift", "hold", "lift"])


def test_controls_outside_no_range_stay_at_the_nearest_to_rest():
    body = Mjcf(MODEL.replace('ctrlrange="0 2"', 'ctrlrange="1 2"'))
    assert float(task(body=body, groups=["lift"]).control(jnp.array([0.5]))[2]) == 1.0
    assert task(body=body, actions="binary").control(jnp.array([0.0, 0, 0, 1]))[2] == 2.0


def test_a_composed_task_is_a_setting(file):
    followed = mg.tasks.load(file)
    for made in (
        task(),
        Composed(),
        followed,
        task(body="hopper", observe=["alive"]),
        task(body=mujoco.MjSpec.from_string(MODEL)),
    ):
        again = mg.make("composed", **table(made))
        assert again == made
        assert hash(again) == hash(made)
        assert pickle.loads(pickle.dumps(made)) == made
        assert tomli_w.dumps(table(again)) == tomli_w.dumps(table(made))
    assert dataclasses.replace(task(), time_limit=1.0) != task()


def test_the_file_of_a_task_is_the_task(file):
    loaded = mg.tasks.load(file)
    assert loaded == mg.tasks.compose(
        file.parent / "arm.xml",
        targets=[terms.Follow("hand", file=str(file.parent / "track.csv"))],
        observe=["joint-positions", terms.TargetError(scale=2)],
        reward=[terms.Distance(weight=-2)],
        reset=["random-joints"],
        terminate=[{"kind": "distance", "above": 1}],
        metrics=[terms.Within(tolerance=0.1, name="solved")],
        actions="binary",
        groups=["shoulder flexor", ("shoulder extensor", "elbow*")],
        time_limit=2,
    )
    (file.parent / "track.csv").unlink()  # the numbers are part of the task
    assert mg.make("composed", **table(loaded)) == loaded
    file.write_text(REACH.replace('"hand"', '"hnd"').replace("file =", "#"))
    with pytest.raises(ValueError, match=r"reach.toml: .*targets\[0\]"):
        mg.tasks.load(file)
    file.write_text(REACH + 'reward = "x"')
    with pytest.raises(ValueError, match=r"reach\.toml"):
        mg.tasks.load(file)
    file.write_text('name = "hopper"\npenalty = 0.3')
    assert mg.tasks.load(file) == mg.make("hopper", penalty=0.3)


def test_a_body_without_actuators_is_named_by_its_file(tmp_path):
    file = tmp_path / "statue.xml"
    file.write_text("<mujoco><worldbody><body><joint/><geom size='.1'/></body></worldbody></mujoco>")
    with pytest.raises(ValueError, match=r"statue\.xml.* has no muscles and no other actuators: it needs at least one"):
        mg.tasks.compose(Mjcf(file), observe=["joint-positions"], reward=["alive"])


def test_short_names_may_not_be_given_twice():
    with pytest.raises(ValueError, match="given once"):
        mg.make("composed", body="arm6", reward=["alive"], rewards=["alive"], observe=["clock"])


def on_the_hopper(**settings):
    return mg.tasks.compose(
        Hopper(),
        observe=[terms.SensorReadings(("knee_angle", "knee_velocity"))],
        reward=[terms.Height("foot"), terms.Effort(weight=-0.1)],
        action_period=0.01,
        actions="binary",
        **settings,
    )


def test_other_bodies_compose_too():
    made = on_the_hopper(scaling="none")
    assert made.action_names == ("flexor", "extensor")
    batch = made.batch([0], threads=1)
    batch.step(np.asarray(made.control(np.array([[1.0, 0.0]], np.float32))))
    state = batch.unpack(batch.packed[0])
    memory, seen = made.observe(made.init(jnp.zeros(0)), state, jnp.zeros(0))
    angle, velocity = (state.sensors[name] for name in ("knee_angle", "knee_velocity"))
    np.testing.assert_allclose(seen, [angle, velocity], rtol=1e-6)
    assert np.isfinite(float(made.reward(memory, state, jnp.zeros(2))[1]))


@pytest.mark.ci
def test_a_task_on_another_body_learns():
    run = mg.train(on_the_hopper(), steps=30, seeds=1, progress=False)
    assert np.isfinite(run.curve()[1]).all()


def test_observations_are_standardised_by_this_seeds_own_past():
    made = task(scaling="running")
    memory = made.init(jnp.zeros(0))
    batch = made.batch([0], threads=1)
    look, raw, seen = jax.jit(made.observe), [], []
    plain = task()
    for action in np.random.default_rng(0).uniform(-1, 1, (40, 3)):
        state = batch.unpack(batch.packed[0])
        raw.append(np.array(plain.observe(plain.init(jnp.zeros(0)), state, jnp.zeros(0))[1], float))
        memory, observation = look(memory, state, jnp.zeros(0))
        seen.append(np.array(observation))
        batch.step(action[None])
    past = np.array(raw)
    spread = past.std(axis=0)
    wanted = np.clip((past[-1] - past.mean(axis=0)) / np.where(spread > 0, spread, 1), -5, 5)
    moving = spread > 1e-4
    np.testing.assert_allclose(seen[-1][moving], wanted[moving], rtol=1e-2, atol=1e-2)
    frozen = made.freeze(memory)
    assert jax.tree.all(jax.tree.map(lambda a, b: bool((a == b).all()), look(frozen, state, jnp.zeros(0))[0], frozen))


def test_it_is_a_gymnasium_environment():
    env = gymnasium.make(
        "motorgrad/Composed-v0",
        targets=["reach"],
        body="arm6",
        observe=["target-error"],
        reward=["distance"],
        reset=["random-joints"],
        time_limit=0.1,
    )
    check_env(env.unwrapped, skip_render_check=True)
    first = env.reset(seed=3)[0]
    again = env.reset()[0]
    np.testing.assert_array_equal(env.reset(seed=3)[0], first)
    assert not np.array_equal(first, again)
    for _ in range(5):
        *_, truncated, _ = env.step(env.action_space.sample())
    assert truncated
    body = TaskEnv(task(), render_mode="rgb_array", width=64, height=64)
    body.reset(seed=0)
    body.step(np.zeros(3, np.float32))
    assert body.render().shape == (64, 64, 3)
    body.close()


def test_text_is_kept_with_the_task():
    assert table(task())["body"]["source"] == MODEL
    assert table(task())["body"]["timestep"] == BODY.timestep
