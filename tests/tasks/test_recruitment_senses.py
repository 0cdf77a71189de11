"""Loads that are felt and not told: what is observed against closed forms, and that the load itself is hidden."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ndtri

from motorgrad.bodies import tendon_force_length
from motorgrad.tasks import ArmRecruitment, Drift, LinearRecruitment, make
from motorgrad.tasks._senses import strain
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import Attempt, RepeatedLoads, SweepingLoads

NONE = jnp.zeros(0)
LOADS = np.array([-2.0, -0.1, 0.0, 0.05, 1.0, 6.0, 13.9, 14.0], np.float32)


def seen(task, load, uniforms=NONE, attempt=None, memory=None):
    """What a task shows of a load, before the attempt of this number."""
    state = jnp.float32(load)
    state = state if attempt is None else Attempt(state, jnp.int32(attempt))
    return np.asarray(task.observe(task.init(NONE) if memory is None else memory, state, uniforms)[1])


def test_the_strain_is_that_of_a_tendon_on_which_the_load_hangs():
    task = ArmRecruitment(senses="strain")
    for load in LOADS:
        (felt,) = seen(task, load)
        assert float(tendon_force_length(1 + felt / 100)) == pytest.approx(max(load, 0) / 14, abs=1e-5)
    assert float(strain(1.0)) == pytest.approx(4.9)  # as in OpenSim
    linear = LinearRecruitment(senses="strain", low=-1.0, high=2.0)
    for load in (-1.0, 0.5, 2.0):
        assert float(seen(linear, load)[0]) == pytest.approx(float(strain(load / 2)), rel=1e-6)


def test_the_noise_of_a_strain_is_normal():
    task = ArmRecruitment(senses="strain", noise=0.3)
    assert task.uniforms == 1
    for chance in (0.1, 0.5, 0.99):
        (felt,) = seen(task, 6.0, jnp.array([chance]))
        assert float(felt) == pytest.approx(float(strain(6 / 14)) + 0.3 * ndtri(chance), rel=1e-4)
    assert np.isfinite(seen(task, 6.0, jnp.zeros(1))).all()


def test_a_tool_in_the_hand_is_felt_but_not_told():
    drift = Drift(3.0, 10, "steps", "load")
    felt, told = (ArmRecruitment(senses=senses, drift=drift) for senses in ("strain", "load"))
    later = felt.init(NONE)._replace(clock=jnp.int32(5))
    assert seen(felt, 4.0, memory=later) == pytest.approx(float(strain(7 / 14)), rel=1e-6)
    assert seen(told, 4.0, memory=later) == pytest.approx(4.0)


def test_the_last_lift_is_felt_and_the_first_attempt_knows_nothing():
    task = ArmRecruitment(senses="lifts", attempts=3, units=4)
    load, action = 9.0, jnp.array([1.0, 0.0, 1.0, 0.0])
    memory, first = task.observe(task.init(NONE), Attempt(jnp.float32(load), jnp.int32(0)), NONE)
    np.testing.assert_array_equal(first, [0, 0])
    memory, reward, over = task.reward(memory, Attempt(jnp.float32(load), jnp.int32(1)), action)
    height = float(reward + 4 * 0.5)  # less the cost
    assert 0 < height < 5
    assert not over
    np.testing.assert_allclose(seen(task, load, attempt=1, memory=memory), [height / 10, 0.5], rtol=1e-5)
    np.testing.assert_array_equal(seen(task, load, attempt=0, memory=memory), [0, 0])  # the load has changed


@pytest.mark.parametrize(
    "settings",
    [{"senses": "strain", "noise": 0.2}, {"senses": "nothing"}, {"senses": "lifts", "attempts": 2}],
    ids=lambda settings: settings["senses"],
)
def test_the_load_is_hidden_and_yet_lifted(settings):
    task = ArmRecruitment(**settings)
    chance, action = jnp.full(task.uniforms, 0.7), jnp.array([1.0, 1.0, 0.0, 0.0])

    def shown(load):
        """What is seen of a load that is not lifted by half of the pool, and earned."""
        state = Attempt(load, jnp.int32(0)) if task.attempts > 1 else load
        memory, observation = task.observe(task.init(NONE), state, chance)
        return observation, task.reward(memory, state, action)[1]

    by_load = jax.jacfwd(shown)(jnp.float32(9.0))
    assert by_load[1] < 0
    if settings["senses"] == "strain":
        slope = float(strain(9 / 14 + 1e-3) - strain(9 / 14)) / (14 * 1e-3)
        np.testing.assert_allclose(by_load[0], [slope], rtol=1e-2)
    else:
        np.testing.assert_array_equal(by_load[0], 0)


@pytest.mark.parametrize("attempts", [1, 3])
def test_a_load_stays_for_its_attempts(attempts):
    world = RepeatedLoads(SweepingLoads(-2.0, 0.1, 0.3), attempts)
    state, loads, places = world.reset(NONE), [], []
    for _ in range(7):
        loads.append(float(state.load))
        places.append(int(state.attempt))
        state = world.step(state, jnp.zeros(1), jnp.array([0.5]))
    np.testing.assert_array_equal(places, np.arange(7) % attempts)
    np.testing.assert_allclose(loads, -2.0 + 0.2 * (np.arange(7) // attempts), rtol=1e-5)
    with pytest.raises(ValueError, match="attempts = 0: must be at least 1"):
        RepeatedLoads(world.loads, 0)


def test_a_sweep_of_lifts_takes_as_many_times_as_long_and_senses_each_last_lift():
    task = ArmRecruitment(senses="lifts", attempts=2, least=2.0, most=2.0, low=-2.0, high=9.0, units=2)  # -2, 0 … 8
    stepper = stepper_for(task, agent_for(task), range(2))
    last = None
    for decision in range(12):
        observation = np.asarray(stepper.state["cycle"].observation)
        if decision % 2 == 0:
            np.testing.assert_array_equal(observation, 0)
        else:
            np.testing.assert_array_equal(observation[:, 1], last)
        stepper.advance(1)
        last = np.asarray(stepper.state["cycle"].action).mean(1)
    assert (stepper.harvest()["episodes"] == 1).all()


def test_a_step_is_as_long_on_the_axis_of_strains_as_on_that_of_loads():
    unit = 4.9 / 14  # % per kg
    told, felt = (ArmRecruitment(senses=senses).learner["learning_rate"] for senses in ("load", "strain"))
    assert told == {"gain": 2e-4, "threshold": 4e-4}
    assert felt == pytest.approx({"gain": 2e-4 / unit**2, "threshold": 4e-4 * unit**2})
    assert LinearRecruitment(senses="strain").learner["learning_rate"]["threshold"] == pytest.approx(2e-4 * 4.9**2)


REFUSED = [
    ("arm-recruitment", {"senses": "weight"}, "unknown arm-recruitment.senses 'weight': known are"),
    ("arm-recruitment", {"noise": 0.1}, "noise = 0.1: must be 0 unless the strain is sensed"),
    ("arm-recruitment", {"senses": "strain", "noise": -0.1}, "noise = -0.1"),
    ("arm-recruitment", {"senses": "strain", "low": -3.0, "high": -1.0}, "high = -1.0: must be above 0 to be felt"),
    ("arm-recruitment", {"senses": "lifts"}, "attempts = 1: must be at least 2"),
    ("arm-recruitment", {"senses": "lifts", "attempts": 2, "scale": 0.0}, "scale = 0.0: must be other than 0"),
    ("linear-recruitment", {"senses": "lifts", "attempts": 2}, "senses = 'lifts': must be .* a pull has no height"),
    ("linear-recruitment", {"loads": "queried", "senses": "nothing"}, "senses, attempts = .* loads that are queried"),
    ("linear-recruitment", {"loads": "queried", "attempts": 2}, "senses, attempts = .* loads that are queried"),
]


@pytest.mark.parametrize(("name", "settings", "words"), REFUSED)
def test_senses_that_make_no_sense_are_refused(name, settings, words):
    with pytest.raises(ValueError, match=words):
        make(name, **settings)


def test_the_reward_of_an_observation_is_unknown_where_the_load_is_hidden():
    with pytest.raises(ValueError, match="senses = 'strain': must be 'load'"):
        LinearRecruitment(senses="strain").immediate(jnp.zeros(1), jnp.zeros(4))


def test_motoneurons_do_not_take_two_numbers():
    with pytest.raises(ValueError, match="a motoneuron has a single input"):
        agent_for(ArmRecruitment(senses="lifts", attempts=2), policy="motoneurons")
