"""Baselines that see the observation: what they learn, that they do not bias, and how much noise they take away."""

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decided, started
from hypothesis import given, settings
from hypothesis import strategies as st

import motorgrad as mg
from motorgrad.learning import (
    SGD,
    Agent,
    BinnedBaseline,
    Episodic,
    Estimator,
    Exponential,
    InputBaseline,
    LinearBaseline,
    MeanReward,
    Window,
    gpomdp,
    number,
    olgarb,
)
from motorgrad.policies import Softmax
from motorgrad.tasks import ThreeState
from motorgrad.tasks._finite import FiniteTask
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import FiniteMDP, oracle

few = settings(max_examples=25, deadline=None, derandomize=True)
POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
SEES_ONE = Softmax([[0.5], [-0.5]])
EXAMPLES = {
    "linear": LinearBaseline(0.02),
    "binned": BinnedBaseline(0.2, 0.8, 6),
    "binned, forgetting": BinnedBaseline(0.2, 0.8, 6, rate=0.02),
}


BINS = (0.0, 2.0, 4)


@jax.jit
def binned(rate, state, look, reward):
    """What a baseline expects at an observation and at all, and its state after the reward."""
    baseline = BinnedBaseline(*BINS, rate=rate)
    return baseline.value_at(state, look), baseline.level(state), baseline.learn(state, look, reward)


@few
@given(
    rewards=st.lists(st.tuples(st.floats(-1, 3), st.floats(-100, 100)), max_size=30),
    rate=st.sampled_from([0.0, 0.1, 1.0]),
)
def test_a_bin_is_the_mean_of_its_rewards(rewards, rate):
    low, high, bins = BINS
    means, counts = np.zeros(bins + 1), np.zeros(bins + 1)
    with jax.enable_x64(True):
        state = BinnedBaseline(*BINS, rate=rate).init(SEES_ONE, jnp.float64)
        for y, reward in rewards:
            here = int(np.clip(np.floor((y - low) / (high - low) * bins), 0, bins - 1))
            expected = means[here] if counts[here] else means[-1]
            value, level, state = binned(rate, state, np.array([y]), np.float64(reward))
            assert float(value) == pytest.approx(expected, abs=1e-9)
            assert float(level) == pytest.approx(means[-1], abs=1e-9)
            for place in (here, -1):
                counts[place] += 1
                means[place] += max(1 / counts[place], 0 if place == -1 else rate) * (reward - means[place])


def test_what_lies_outside_the_bounds_belongs_to_the_outer_bins():
    baseline = BinnedBaseline(-1.0, 1.0, 4, input=1)
    found = [int(baseline.bin(jnp.array([9.0, y]))) for y in (-np.inf, -1.1, -1.0, -0.5, 0.0, 0.99, 1.0, 7.0, np.inf)]
    assert found == [0, 0, 0, 1, 2, 3, 3, 3, 3]


def test_the_linear_baseline_finds_a_linear_reward_in_inputs_of_any_size():
    baseline, rng = LinearBaseline(0.5), np.random.default_rng(0)
    state = baseline.init(POINT, jnp.float32)
    inputs = rng.uniform(-3, 3, size=(5_000, 2)).astype(np.float32)

    def step(state, y):
        return baseline.learn(state, y, 2 * y[0] - 0.5 * y[1] + 7), None

    state = jax.jit(lambda state: jax.lax.scan(step, state, inputs)[0])(state)
    np.testing.assert_allclose(state.weights, [2, -0.5, 7], atol=1e-4)
    assert float(baseline.value_at(state, jnp.array([100.0, 0.0]))) == pytest.approx(207, abs=1e-2)
    # with a rate of 1 it fits the newest reward at once, however large the input
    sure = LinearBaseline(1.0)
    state = sure.learn(sure.init(POINT, jnp.float32), jnp.array([1e4, -3e3]), jnp.float32(5.0))
    assert float(sure.value_at(state, jnp.array([1e4, -3e3]))) == pytest.approx(5, rel=1e-5)


class Told(InputBaseline):
    """A baseline that knows what to expect: `slope` · y₀ for the newest action, `others` for the others."""

    slope: float = number()
    others: float = number(0.0)

    def init(self, policy, dtype):
        return jnp.zeros((), dtype)

    def level(self, state):
        return state + self.others

    def value_at(self, state, observation):
        return self.slope * observation[0]

    def learn(self, state, observation, reward):
        return state


def estimates(task, policy, estimator, decisions, seeds):
    """The gradient estimate of every seed at fixed parameters."""
    stepper = stepper_for(task, Agent(policy, estimator), range(seeds))
    stepper.advance(decisions)
    mean = stepper.state["cycle"].agent.gradient.mean
    return np.asarray(mean.weights, float).reshape(seeds, -1)


def compared_with(mdp, slope):
    """The MDP whose rewards are less by slope · y₀ of the state that an action was taken in."""
    return FiniteMDP(mdp.transitions, mdp.expected_rewards - slope * mdp.observations[:, 0], mdp.observations)


@pytest.mark.parametrize("decay", [0.0, 0.8])
def test_compared_with_the_input_older_actions_would_lose_what_led_to_it(decay):
    mdp, slope = ThreeState().dynamics, 3.0
    right = oracle.flat(oracle.biased_gradient(mdp, POINT, decay))
    naive = oracle.flat(oracle.biased_gradient(compared_with(mdp, slope), POINT, decay))
    # b(y) as a reward on entering a state: what the trace of all older actions would credit it with
    expected = FiniteMDP(mdp.transitions, slope * mdp.observations[:, 0], mdp.observations)
    lost = decay * oracle.flat(oracle.biased_gradient(expected, POINT, decay))
    np.testing.assert_allclose(naive, right - lost, atol=1e-12)
    assert (np.linalg.norm(naive - right) > 0.3 * np.linalg.norm(right)) == (decay > 0)


TRACES = {
    "no memory": (Exponential(0.0), lambda mdp: oracle.biased_gradient(mdp, POINT, 0.0)),
    "exponential": (Exponential(0.8), lambda mdp: oracle.biased_gradient(mdp, POINT, 0.8)),
    "window": (Window(20), lambda mdp: oracle.gradient(mdp, POINT)),  # what it leaves out is 2e-3 of the gradient
}


@pytest.mark.representatives("binned, forgetting-no memory")
@pytest.mark.parametrize(
    "trace", [pytest.param(name, marks=[pytest.mark.ci] * (name == "no memory")) for name in TRACES]
)
@pytest.mark.parametrize("baseline", [Told(3.0, 0.3), *EXAMPLES.values()], ids=["told", *EXAMPLES])
def test_no_input_baseline_biases_the_estimate(baseline, trace):
    filter_, gradient = TRACES[trace]
    task = ThreeState()
    exact = oracle.flat(gradient(task.dynamics))
    found = estimates(task, POINT, Estimator(filter_, baseline, update_every="never"), 4_800, 300)
    error = found.std(0) / np.sqrt(len(found))
    assert np.linalg.norm(error) < 0.06 * np.linalg.norm(exact)
    # the level, a mean of all rewards, is correlated with each by 1/n: 1/4800 for each score in the trace's memory
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error + 1e-2 * np.linalg.norm(exact))


@pytest.mark.ci
def test_told_the_level_for_all_it_is_the_plain_baseline():
    task = ThreeState()
    plain = estimates(task, POINT, gpomdp(0.8, mg.learning.Constant(0.3)), 200, 3)

    class Same(Told):
        def value_at(self, state, observation):
            return self.level(state)

    # 200 samples, each rounded to 6e-8
    np.testing.assert_allclose(estimates(task, POINT, gpomdp(0.8, Same(0.0, 0.3)), 200, 3), plain, atol=1e-7)


@pytest.mark.ci
def test_the_weight_of_a_discounted_episode_is_on_both_parts():
    task = ThreeState(time_limit=40)  # 40 decisions leave out .8⁴⁰ = 1e-4 of the return
    estimator = Estimator(Episodic(), Told(3.0, 0.3), discount=0.8, update_every="never")
    exact = oracle.flat(oracle.discounted_gradient(task.dynamics, POINT, 0.8))
    found = 40 * estimates(task, POINT, estimator, 4_800, 400)
    error = found.std(0) / np.sqrt(len(found))
    assert np.linalg.norm(error) < 0.05 * np.linalg.norm(exact)
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error + 2e-3 * np.linalg.norm(exact))


@dataclasses.dataclass(frozen=True)
class Payday(FiniteTask):
    """Twelve inputs at random, whatever is done; the reward depends on the input far more than on the action."""

    name: ClassVar[str] = "payday"
    actions: ClassVar = "discrete"
    quadratic: bool = False

    @property
    def dynamics(self) -> FiniteMDP:
        y = np.linspace(0, 1, 12)
        input_worth = 20 * y**2 - 10 * y if self.quadratic else 10 * y
        right = (y > 0.5).astype(float)
        rewards = np.stack([input_worth + 1 - right, input_worth + right])
        seen = np.stack([y, np.ones(12)], axis=1)
        return _CACHE.setdefault(self.quadratic, FiniteMDP(np.full((2, 12, 12), 1 / 12), rewards, seen))


_CACHE: dict[bool, FiniteMDP] = {}


@pytest.mark.ci
@pytest.mark.parametrize(
    ("baseline", "quadratic", "at_most"),
    [
        (LinearBaseline(0.05), False, 0.2),
        (BinnedBaseline(0.0, 1.0, 12), False, 0.1),
        (BinnedBaseline(0.0, 1.0, 12), True, 0.2),
        (BinnedBaseline(0.0, 1.0, 12, rate=0.05), True, 0.25),
    ],
)
def test_it_takes_away_most_noise_where_the_reward_depends_on_the_input(baseline, quadratic, at_most):
    task, policy = Payday(quadratic=quadratic), Softmax([[0.2, 0.1], [-0.1, 0.0]])
    exact = oracle.flat(oracle.biased_gradient(task.dynamics, policy, 0.0))
    plain, seeing = (estimates(task, policy, gpomdp(0.0, b), 3_000, 100) for b in (MeanReward(), baseline))
    assert seeing.var(0).sum() < at_most * plain.var(0).sum()
    for found in (plain, seeing):
        np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * found.std(0) / 10 + 2e-3)


@pytest.mark.ci
@pytest.mark.representatives("linear", "binned")
@pytest.mark.parametrize("name", EXAMPLES)
def test_a_diverged_decision_teaches_it_nothing(name):
    agent = Agent(POINT, olgarb(0.8, EXAMPLES[name]), SGD(0.1))
    state = decided(agent, started(agent), [0.3, 0.5], [0.3], 2.0).state
    after = decided(agent, state, [np.nan, np.nan], [0.3], np.nan, [0.3, 0.5], diverged=True).state
    for a, b in zip(
        jax.tree.leaves((after.policy, after.estimator.baseline)),
        jax.tree.leaves((state.policy, state.estimator.baseline)),
        strict=True,
    ):
        np.testing.assert_array_equal(a, b)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["linear", "binned"])
def test_a_run_that_was_stopped_goes_on_bit_for_bit(name, tmp_path):
    task = mg.make("call-admission")
    numbers = {"input": 3, "high": 10.0} if name == "binned" else {}
    agent = agent_for(task, baseline={"kind": name, "rate": 0.05, **numbers})
    whole = mg.train(task, agent, 600, 3, tmp_path / "whole", window=100, progress=False)
    mg.train(task, agent, 300, 3, tmp_path / "parts", window=100, progress=False)
    parts = mg.train(task, agent, 600, 3, tmp_path / "parts", window=100, progress=False)
    assert jax.tree.all(jax.tree.map(np.array_equal, parts.policies, whole.policies))
    np.testing.assert_array_equal(parts.curve("baseline")[1], whole.curve("baseline")[1])
    assert np.abs(whole.curve("baseline")[1]).min() > 0
    plain = mg.train(task, agent_for(task), 600, 3, progress=False)
    assert not jax.tree.all(jax.tree.map(np.array_equal, plain.policies, whole.policies))


def test_settings_make_them():
    task = mg.make("chain")
    found = agent_for(task, {"baseline": "linear", "estimator.baseline.rate": 0.2}).estimator.baseline
    assert found == LinearBaseline(0.2)
    numbers = {"low": -1.0, "high": 2.0, "bins": 7, "input": 1}
    found = agent_for(task, baseline={"kind": "binned", "rate": 0.0, **numbers}).estimator.baseline
    assert found == BinnedBaseline(-1.0, 2.0, 7, 1, 0.0)


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: LinearBaseline(0.0), r"rate = 0.0: must be in \(0, 1\]"),
        (lambda: LinearBaseline(float("nan")), "rate = nan"),
        (lambda: BinnedBaseline(1.0, 1.0), r"low, high = \(1.0, 1.0\): must be finite, low < high"),
        (lambda: BinnedBaseline(0.0, float("inf")), "high = inf: must be a finite number"),
        (lambda: BinnedBaseline(bins=0), "bins = 0"),
        (lambda: BinnedBaseline(input=-1), "input = -1"),
        (lambda: BinnedBaseline(rate=1.5), r"rate = 1.5: must be in \[0, 1\]"),
        (
            lambda: Agent(POINT, olgarb(0.8, BinnedBaseline(input=2))).init(jax.random.key(0)),
            "input = 2: must be one of 2 observed numbers, 0 … 1",
        ),
        (lambda: Estimator(baseline=0.5), "baseline = 0.5: must be None or a Baseline"),
        (lambda: agent_for(mg.make("chain"), baseline="bined"), "'bined': did you mean 'binned'"),
        (
            lambda: agent_for(mg.make("chain"), baseline={"kind": "binned", "low": 2.0}),
            r"agent\.estimator\.baseline\.low, high = \(2\.0, 1\.0\)",
        ),
        (
            lambda: mg.train("chain", agent_for(mg.make("chain"), baseline={"kind": "binned", "input": 9}), 10),
            "input = 9",
        ),
    ],
)
def test_impossible_settings_are_refused_by_name(make, names):
    with pytest.raises(ValueError, match=names):
        make()


def test_without_one_no_observation_is_kept():
    assert Agent(POINT, olgarb(0.8, None)).init(jax.random.key(0)).decision is None
