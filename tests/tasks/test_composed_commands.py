"""What composed tasks have for MyoSuite's: commands in [-1, 1], reachable places in a box, penalties after a while."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.tasks import compose, terms

MOTORS = """
<mujoco>
  <worldbody>
    <body><joint name="a"/><geom size="0.1"/>
      <body pos="1 0 0"><joint name="b" range="-1 1"/><geom size="0.1"/></body></body>
  </worldbody>
  <actuator>
    <motor name="a" joint="a" ctrlrange="-2 6" ctrllimited="true"/>
    %s
  </actuator>
</mujoco>
"""
MUSCLE = """<muscle name="b" joint="b" ctrlrange="0 1" ctrllimited="true" lengthrange="0.1 1"/>"""


def commanded(extra="", **settings):
    """A task on motors whose units give commands."""
    return compose(
        MOTORS % extra,
        observe=["joint-positions"],
        reward=["alive"],
        commands="sigmoid",
        action_period=0.01,
        **settings,
    )


def test_commands_of_motors_are_shares_of_their_ranges():
    task = commanded()
    assert task.action_range == ((-1.0, 1.0),)
    found = task.control(jnp.array([[-1.5], [-1.0], [0.0], [0.5], [1.0]]))
    np.testing.assert_allclose(found[:, 0], [-2, -2, 2, 4, 6])


def test_commands_of_muscles_pass_a_sigmoid_and_motors_beside_them_take_the_command():
    task = commanded(MUSCLE)
    action = np.array([0.3, -0.4], np.float32)
    np.testing.assert_allclose(task.control(action), [0.3, 1 / (1 + np.exp(-5 * (-0.4 - 0.5)))], rtol=1e-6)
    on_off = commanded(MUSCLE, actions="binary")
    assert on_off.action_range[-1] == (0.0, 1.0)
    np.testing.assert_allclose(
        on_off.control(np.array([[0, 0], [1, 1]], np.float32))[:, -1], 1 / (1 + np.exp([7.5, -2.5])), rtol=1e-5
    )


def test_commands_and_groups_do_not_go_together():
    with pytest.raises(ValueError, match="groups"):
        commanded(MUSCLE, groups=["a"])


def test_a_reachable_place_in_a_box_is_where_some_pose_reaches():
    low, high = (0.2, 0.2, -1.0), (0.6, 0.5, 1.0)
    task = compose(
        "arm6",
        targets=[terms.Reach("hand", low=low, high=high, reachable=True)],
        observe=["target-error"],
        reward=["distance"],
        time_limit=1.0,
    )
    uniforms = np.random.default_rng(0).random((300, task.init_uniforms), np.float32)
    places = np.asarray(jax.vmap(lambda each: task.init(each).drawn["target"])(uniforms))
    assert (places >= np.array(low, np.float32)).all()
    assert (places <= np.array(high, np.float32)).all()
    np.testing.assert_allclose(places[:, 2], places[0, 2], atol=1e-6)  # the arm is planar; most of the box is not in it
    assert np.ptp(places[:, 0]) > 0.2
    with pytest.raises(ValueError, match="a box that some pose reaches"):
        compose(
            "arm6",
            targets=[terms.Reach("hand", low=(2.0, 2.0, 2.0), high=(3.0, 3.0, 3.0), reachable=True)],
            observe=["target-error"],
            reward=["distance"],
        )


def test_a_penalty_may_wait():
    task = compose(
        "arm6",
        targets=[terms.Reach("hand", at=(5.0, 0.0, 0.0))],
        observe=["target-error"],
        reward=[terms.Beyond(limit=1.0, after=0.06)],
        terminate=[terms.Beyond(limit=1.0, after=0.06, above=0.5)],
        action_period=0.02,
    )
    batch, memory, seen = task.batch([0], threads=1), task.init(jnp.zeros(0)), []
    for _ in range(4):
        batch.step(np.zeros((1, 6)))
        memory, reward, ended = task.reward(memory, batch.unpack(batch.packed[0]), jnp.zeros(6))
        seen.append((float(reward), bool(ended)))
    assert seen == [(0.0, False), (0.0, False), (-1.0, True), (-1.0, True)]
