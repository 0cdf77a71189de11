"""Recruitment: what is seen and paid, ideal thresholds, sizes, drift, sweeps; and that the default learners learn."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.bodies import Arm, lift
from motorgrad.tasks import ArmRecruitment, Drift, LinearRecruitment, make, spacing_error
from motorgrad.training import agent_for, stepper_for, train

NONE = jnp.zeros(0)


def pays(task, load, action, clock=None):
    """The reward of an action at a load."""
    memory = task.init(NONE)
    memory = memory if clock is None else memory._replace(clock=jnp.asarray(clock))
    memory, seen = task.observe(memory, jnp.asarray(load, jnp.float32), NONE)
    np.testing.assert_allclose(seen, [load], rtol=1e-6)
    memory, reward, _ = task.reward(memory, jnp.asarray(0.123), jnp.asarray(action, jnp.float32))
    return float(reward)


@pytest.mark.parametrize("load", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("fired", range(4))
def test_the_linear_reward_is_minus_the_squared_error(load, fired):
    action, wanted = [1.0] * fired + [0.0] * (3 - fired), 1.2 * load - 0.1
    assert pays(LinearRecruitment(units=3), load, action) == pytest.approx(-((fired - 3 * wanted) ** 2), abs=1e-5)
    ratio = LinearRecruitment(units=3, output="ratio")
    assert pays(ratio, load, action) == pytest.approx(-((fired / 3 - wanted) ** 2), abs=1e-5)


def test_the_mapping_and_the_loads_are_settings():
    task = LinearRecruitment(units=2, slope=2.0, intercept=0.5, low=-1.0, high=3.0)
    assert pays(task, 0.25, [1.0, 1.0]) == pytest.approx(0.0)
    assert float(task.dynamics.reset(jnp.array([0.5]))) == 1.0


@pytest.mark.parametrize("units", [1, 2, 5])
def test_ideal_thresholds_are_equally_spaced(units):
    expected = [((i - 0.5) / units + 0.1) / 1.2 for i in range(1, units + 1)]
    np.testing.assert_allclose(LinearRecruitment(units=units).ideal_thresholds(), expected)


def earned(task, thresholds):
    """The mean reward of units without noise, on a fine grid of loads."""
    loads = np.linspace(0, 1, 20_001)
    ratio = (task.sizes[:, None] * (loads > np.asarray(thresholds)[:, None])).sum(0)
    return float(np.mean(np.asarray(task.pay(loads, ratio, task.effect(loads, ratio)))))


@pytest.mark.parametrize("size_ratio", [1.0, 5.0])
def test_no_thresholds_nearby_are_better_than_the_ideal(size_ratio):
    task = LinearRecruitment(units=4, output="ratio", size_ratio=size_ratio)
    ideal = task.ideal_thresholds()
    best = earned(task, ideal)
    assert best == pytest.approx(earned(task, task.ideal_thresholds([3, 1, 0, 2])), abs=1e-6)  # every order as good
    generator = np.random.default_rng(0)
    assert all(earned(task, ideal + 0.02 * generator.standard_normal(4)) < best for _ in range(20))


def test_sizes_grow_exponentially():
    task = LinearRecruitment(units=3, size_ratio=9.0, output="ratio")
    np.testing.assert_allclose(task.sizes, np.array([1, 3, 9]) / 13)
    assert pays(task, 0.0, [0.0, 0.0, 1.0]) == pytest.approx(-((9 / 13 + 0.1) ** 2))
    np.testing.assert_allclose(LinearRecruitment(units=3).sizes, 1 / 3)
    np.testing.assert_allclose(LinearRecruitment(units=1, size_ratio=4.0).sizes, [1.0])


def test_units_may_have_any_sizes():
    task = LinearRecruitment(units=3, strengths=(2.0, 0.5, 5.5), output="ratio")
    np.testing.assert_allclose(task.sizes, [0.25, 0.0625, 0.6875])
    assert pays(task, 0.0, [0.0, 0.0, 1.0]) == pytest.approx(-((0.6875 + 0.1) ** 2))
    even = LinearRecruitment(units=3, strengths=(7.0, 7.0, 7.0), output="ratio")
    assert pays(even, 0.3, [0.0, 1.0, 1.0]) == pytest.approx(pays(LinearRecruitment(3, output="ratio"), 0.3, [0, 1, 1]))
    with pytest.raises(ValueError, match=r"strengths = \(1.0,\): must be empty, or a force for each of 3 units"):
        LinearRecruitment(units=3, strengths=(1.0,))
    with pytest.raises(ValueError, match=r"size_ratio = 2.0: must be 1 where strengths are given"):
        LinearRecruitment(units=2, strengths=(1.0, 2.0), size_ratio=2.0)
    with pytest.raises(ValueError, match=r"strengths\[1\] = 0.0"):
        LinearRecruitment(units=2, strengths=(1.0, 0.0))


def test_spacing_error_counts_in_spacings_and_knows_no_order():
    task = LinearRecruitment(units=4)
    ideal = task.ideal_thresholds()
    assert spacing_error(ideal[::-1], task) == pytest.approx(0.0)
    spacing = ideal[1] - ideal[0]
    pools = np.stack([ideal, ideal + np.array([0, 0, 0.3 * spacing, 0]), np.full(4, ideal[0])])
    np.testing.assert_allclose(spacing_error(pools, task), [0.0, 0.3, 3.0], atol=1e-12)
    assert spacing_error(pools[None], task).shape == (1, 3)
    sized = LinearRecruitment(units=3, size_ratio=6.0)
    assert spacing_error(sized.ideal_thresholds([2, 0, 1]), sized) == pytest.approx(0.0)
    with pytest.raises(ValueError, match=r"thresholds.shape = \(3,\): must be \(..., 4\)"):
        spacing_error([1, 2, 3], task)


def test_a_drift_goes_there_and_back():
    sine, steps = Drift(-0.4, 100), Drift(-0.4, 100, "steps")
    clocks = jnp.arange(100)
    np.testing.assert_allclose(sine.strength(clocks)[jnp.array([0, 25, 50, 75])], [1.0, 0.8, 0.6, 0.8], atol=1e-6)
    np.testing.assert_allclose(steps.strength(clocks), [1.0] * 50 + [0.6] * 50)
    clock = sine.start()
    for _ in range(103):
        clock = sine.tick(clock)
    assert int(clock) == 3
    assert Drift().start() is None
    assert Drift().strength(Drift().start()) == 1.0


def test_a_weak_muscle_pulls_less():
    task = LinearRecruitment(units=2, drift=Drift(-0.5, 10, "steps"))
    for clock, strength in ((0, 1.0), (4, 1.0), (5, 0.5), (9, 0.5)):
        assert pays(task, 0.5, [1.0, 1.0], clock) == pytest.approx(-((2 * strength - 1.0) ** 2), abs=1e-6)
    arm = ArmRecruitment(units=2, drift=Drift(-0.5, 10, "steps"))
    assert pays(arm, 6.0, [1.0, 1.0], 5) == pytest.approx(pays(arm, 6.0, [1.0, 0.0], 0) - 2.0, abs=1e-5)


def test_a_load_drifts_there_and_back():
    sine, steps = Drift(0.4, 100, of="load"), Drift(-2.0, 100, "steps", "load")
    clocks = jnp.arange(100)
    np.testing.assert_allclose(sine.load(clocks)[jnp.array([0, 25, 50, 75])], [0.0, 0.2, 0.4, 0.2], atol=1e-6)
    np.testing.assert_allclose(steps.load(clocks), [0.0] * 50 + [-2.0] * 50)
    assert sine.strength(clocks) == 1.0
    assert Drift(0.4, 100).load(clocks) == 0.0
    assert Drift(of="load").load(Drift(of="load").start()) == 0.0


def test_more_hangs_in_the_hand_than_is_seen():
    drift = Drift(0.25, 10, "steps", "load")
    task = LinearRecruitment(units=2, drift=drift)
    for clock, wanted in ((0, 0.5), (4, 0.5), (5, 0.8), (9, 0.8)):  # 1.2 × 0.5 − 0.1, and 1.2 × 0.25 more
        assert pays(task, 0.5, [1.0, 0.0], clock) == pytest.approx(-((1.0 - 2 * wanted) ** 2), abs=1e-6)
    arm = ArmRecruitment(units=2, drift=Drift(3.0, 10, "steps", "load"))
    for load in (-1.0, 3.0):  # no load, and a tool of 3 kg: 2 kg
        assert pays(arm, load, [1.0, 0.0], 5) == pytest.approx(pays(arm, load + 3.0, [1.0, 0.0], 0), abs=1e-5)
        assert pays(arm, load, [1.0, 0.0], 4) == pytest.approx(pays(arm, load, [1.0, 0.0], 0), abs=1e-6)


@pytest.mark.ci
def test_readings_are_of_what_hangs_in_the_hand():
    task = LinearRecruitment(units=1, drift=Drift(0.25, 10, "steps", "load"))
    stepper = stepper_for(task, agent_for(task), [0])
    for decision in range(20):
        load = float(stepper.state["cycle"].observation[0, 0]) + 0.25 * (decision % 10 >= 5)
        stepper.advance(1)
        action = float(stepper.state["cycle"].action[0, 0])
        assert float(stepper.harvest()["error"][0]) == pytest.approx(abs(action - (1.2 * load - 0.1)), abs=1e-6)
    arm = ArmRecruitment(low=-0.05, drift=Drift(1.0, 4, "steps", "load"))
    stepper = stepper_for(arm, agent_for(arm), [0])
    stepper.advance(1)
    assert not np.isfinite(stepper.harvest()["height"][0])  # no load yet
    stepper.advance(1)
    assert np.isfinite(stepper.harvest()["height"][0])


def test_a_learned_pool_meets_an_added_load_with_more_force():
    added = LinearRecruitment(units=2, output="ratio", drift=Drift(0.25, 2, "steps", "load"))
    ideal = added.ideal_thresholds() - 0.125  # half of the time the load is 0.25 more
    loads, parts = (
        np.linspace(0.0, 1.0, 2001),
        lambda thresholds: (np.linspace(0, 1, 2001)[:, None] > thresholds).mean(1),
    )

    def earns(thresholds):
        found = [added.pay(loads + more, parts(thresholds), parts(thresholds)) for more in (0.0, 0.25)]
        return float(np.mean(found))

    assert earns(ideal) > earns(added.ideal_thresholds())


@pytest.fixture(scope="module")
def sweeps():
    """What happens to one learner of the arm: load, whether a sweep ended, clock and gains, of each decision."""
    task = ArmRecruitment(drift=Drift(-0.2, 1000))
    stepper = stepper_for(task, agent_for(task), [0])
    told = []
    for _ in range(200):
        load = float(stepper.state["cycle"].observation[0, 0])
        stepper.advance(1)
        clock, gains = stepper.state["cycle"].memory.clock[0], stepper.policies().gain[0].copy()
        told.append((load, int(stepper.harvest()["episodes"][0]), int(clock), gains))
    return [np.array(each) for each in zip(*told, strict=True)]


def test_drift_outlives_an_episode(sweeps):
    _, ended, clock, _ = sweeps
    assert ended[:123].sum() == 1
    np.testing.assert_array_equal(clock, np.arange(200) + 1)


def test_the_parameters_move_once_a_sweep(sweeps):
    _, ended, _, gains = sweeps
    moved = (np.diff(gains, axis=0) != 0).any(1)
    np.testing.assert_array_equal(moved, ended[1:] > 0)


def test_the_arm_is_paid_its_height_less_the_cost():
    task = ArmRecruitment(units=4)
    for load, fired in ((3.0, 1), (3.0, 0), (10.0, 2), (14.0, 4)):
        height = 10 * lift(Arm(), load, Arm().full_force * fired / 4)
        assert pays(task, load, [1.0] * fired + [0.0] * (4 - fired)) == pytest.approx(height - fired, abs=5e-3)
    assert pays(task, 14.0, [1.0] * 4) == pytest.approx(6.0, abs=5e-3)
    for load in (-2.0, -0.1, 0.0):  # no load: only the cost counts
        assert pays(task, load, [1.0, 0.0, 0.0, 1.0]) == pytest.approx(-2.0)
        assert pays(ArmRecruitment(unloaded=7.0), load, [0.0] * 4) == pytest.approx(7.0)
    assert pays(ArmRecruitment(scale=1.0, cost=0.5), 1.0, [1.0] * 4) == pytest.approx(0.5, abs=1e-3)


def test_where_only_complete_lifts_pay_less_is_nothing():
    task, graded = ArmRecruitment(units=4, reward_type="complete"), ArmRecruitment(units=4)
    parts = np.linspace(0.0, 1.0, 201, dtype=np.float32)
    complete, partly = (jax.jit(each.effect) for each in (task, graded))
    for load in np.float32([0.5, 6.0, 13.0]):
        height, whole = np.asarray(complete(load, parts)), np.asarray(partly(load, parts))
        assert set(np.unique(height)) == {0.0, np.float32(10.0)}
        np.testing.assert_array_equal(height > 0, whole >= 9.99)
    unloaded = ArmRecruitment(reward_type="complete", unloaded=2.0)
    assert float(unloaded.effect(jnp.float32(-1.0), jnp.float32(0.0))) == 2.0
    assert make("arm-recruitment", units=4, reward_type="complete") == task


@pytest.mark.ci
def test_the_best_activation_rises_from_nought_to_one():
    task = ArmRecruitment()
    loads, activations = np.array([-1.0, 0.01, 1, 3, 6, 9, 12, 14]), np.linspace(0, 1, 2001)
    ratio = jnp.asarray(activations)[None]
    paid = np.asarray(task.pay(loads[:, None], ratio, task.effect(jnp.asarray(loads)[:, None], ratio)))
    best = activations[paid.argmax(1)]
    assert (np.diff(best) > 0).all()
    assert best[0] == 0
    assert best[1] < 0.05
    assert best[-1] > 0.99
    assert (paid.max(1)[1:] > 5.9).all()


@pytest.mark.ci
def test_direct_simulation_pays_what_the_table_does():
    stepped = []
    for height in ("table", "direct"):
        task = ArmRecruitment(units=3, height=height, least=1.0, most=3.0)
        stepper = stepper_for(task, agent_for(task), range(2))
        stepper.advance(12)
        stepped.append(stepper.harvest())
    table, direct = stepped
    np.testing.assert_allclose(direct["reward"], table["reward"], atol=0.03)
    np.testing.assert_allclose(direct["height"], table["height"], atol=5e-3)
    assert (direct["height"] > 0.5).any()


@pytest.mark.ci
@pytest.mark.parametrize("change", [{}, {"reduction": "mean"}])
def test_the_parameters_move_once_a_sweep_by_its_sum_or_its_mean(change):
    task = ArmRecruitment(least=2.0, most=2.0, low=-2.0, high=9.0)  # -2, 0 … 8: six decisions
    stepper = stepper_for(task, agent_for(task, **change), range(3))
    start = stepper.policies().gain.copy()
    stepper.advance(5)
    np.testing.assert_array_equal(stepper.policies().gain, start)
    gradient = np.array(stepper.state["cycle"].agent.gradient.mean.gain)
    stepper.advance(1)
    assert (stepper.harvest()["episodes"] == 1).all()
    moved = stepper.policies().gain - start
    assert (moved != 0).any()
    # the sixth sample is unknown here, but the sum is six times the mean
    other = stepper_for(task, agent_for(task, reduction="mean" if not change else "sum"), range(3))
    other.advance(6)
    times = 6.0 if not change else 1 / 6
    np.testing.assert_allclose(moved, times * (other.policies().gain - start), rtol=1e-4)
    assert np.isfinite(gradient).all()


def test_a_sweep_ends_above_its_heaviest_load(sweeps):
    loads, *_ = sweeps
    starts = np.flatnonzero(loads == -2.0)
    assert max(loads) <= 14.0
    assert len(starts) >= 2
    assert all(70 <= length <= 90 for length in np.diff(starts))  # 16 kg by .2 each
    rising = np.diff(loads)[np.diff(loads) > 0]
    assert 0.0999 < rising.min() < 0.13 < 0.27 < rising.max() < 0.3001


@pytest.mark.ci
def test_a_time_limit_cuts_a_sweep():
    task = ArmRecruitment(time_limit=7)
    stepper = stepper_for(task, agent_for(task), [0])
    stepper.advance(21)
    assert stepper.harvest()["episodes"] == 3


def test_the_readings_are_of_the_action_just_taken():
    task = LinearRecruitment(units=1, output="ratio")
    stepper = stepper_for(task, agent_for(task), [0])
    for _ in range(20):
        load = float(stepper.state["cycle"].observation[0, 0])
        stepper.advance(1)
        action = float(stepper.state["cycle"].action[0, 0])
        record = stepper.harvest()
        assert float(record["error"][0]) == pytest.approx(abs(action - (1.2 * load - 0.1)), abs=1e-6)
        assert float(record["reward"][0]) == pytest.approx(-(float(record["error"][0]) ** 2), abs=1e-5)


LINEAR = [
    *(("units", value) for value in (0, -1, 10_001)),
    *(("size_ratio", value) for value in (0.5, math.nan, math.inf)),
    *(("slope", value) for value in (0.0, -1.0, math.nan)),
    ("intercept", math.inf),
    ("output", "sum"),
    *(("time_limit", value) for value in (0, 2**31)),
]


@pytest.mark.parametrize(("name", "value"), LINEAR)
def test_impossible_settings_are_refused_by_name(name, value):
    with pytest.raises(ValueError, match=rf"{name} (= )?{value!r}: (must be|known are|did you mean)"):
        LinearRecruitment(**{name: value})


ARM = [
    ({"height": "tabel"}, "unknown arm-recruitment.height 'tabel': did you mean 'table'"),
    ({"low": 3.0, "high": 3.0}, r"low, high = \(3.0, 3.0\): must be an interval, low < high"),
    ({"high": 21.0}, "high = 21.0: must be a finite number of at most 20, in kg"),
    ({"least": 0.0}, "least = 0.0: must be a finite number above 0, in kg"),
    ({"least": 0.4}, r"least, most = \(0.4, 0.3\): must be least <= most"),
    ({"cost": math.nan}, "cost = nan"),
    ({"body": {"strength": 0}}, "strength = 0.0: must be"),
    ({"drift": {"amount": -1.0}}, "amount = -1.0: must be above -1"),
    ({"drift": {"period": 1}}, "period = 1: must be an integer of at least 2"),
    ({"drift": {"form": "sinus"}}, "'sinus'"),
    ({"drift": {"of": "loads"}}, "'loads': did you mean 'load'"),
    ({"drift": {"of": "load", "amount": 7.0}}, r"drift.amount = 7.0: must be such that high \+ drift.amount <= 20 kg"),
    ({"drift": {"of": "load", "amount": -1e7}}, r"amount = -10000000.0: must be in \(-1e\+06, 1e\+06\)"),
    ({"reward_type": "full"}, "reward_type 'full': known are complete, height"),
    ({"body": {"timestep": 3.0}}, r"body.timestep = 3.0: must be in \(0, 0.01\], in s"),
]


@pytest.mark.parametrize(("settings", "words"), ARM)
def test_impossible_settings_of_the_arm_are_refused(settings, words):
    with pytest.raises(ValueError, match=words):
        make("arm-recruitment", **settings)


@pytest.mark.ci
def test_the_default_learners_get_better():
    linear = train(LinearRecruitment(units=2), steps=400_000, seeds=8, window=20_000, progress=False)
    rewards = linear.curve()[1].mean(0)
    assert rewards[-1] > 0.6 * rewards[0]  # both negative
    assert (linear.policies.gain > 1).all()
    arm = train(ArmRecruitment(), steps=100_000, seeds=8, window=10_000, progress=False)
    assert arm.curve()[1].mean(0)[-1] > arm.curve()[1].mean(0)[0] + 0.3
    assert arm.curve("height")[1].mean(0)[-1] > arm.curve("height")[1].mean(0)[0]


@pytest.mark.slow
def test_four_units_come_to_equal_spacing():
    task = LinearRecruitment()
    run = train(task, steps=6_000_000, seeds=8, progress=False)
    assert np.median(spacing_error(run.policies.threshold, task)) < 0.25
    assert (run.policies.gain > 5).all()
    assert run.curve("error")[1][:, -1].mean() < 0.75 * run.curve("error")[1][:, 0].mean()
