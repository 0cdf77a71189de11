"""The learner against a hand-written loop in NumPy, and what it does at the ends of episodes."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from compiled_learner import decision

from motorgrad.learning import (
    SGD,
    Agent,
    Episodic,
    Estimator,
    Exponential,
    FixedStep,
    LaggedGaussian,
    MeanReward,
    RunningMean,
    Transition,
    Window,
    gpomdp,
    olgarb,
    olpomdp,
)
from motorgrad.policies import Hyperplanes, LocalGaussians, Softmax, hyperplanes

STEPS, UNITS, INPUTS = 200, 2, 3
RATE = 0.05


def experience(seed=0):
    """Observations, actions, rewards and ends of episodes, drawn once and for all."""
    rng = np.random.default_rng(seed)
    return (
        rng.normal(size=(STEPS, INPUTS)),
        rng.integers(0, 2, size=(STEPS, UNITS)).astype(float),
        rng.normal(size=STEPS) + 1,
        rng.random(STEPS) < 0.06,
    )


def reference(beta, baseline, update_every, sum_up, discount):
    """The table of the learner, line by line, for hyperplane units: the parameters after every decision."""
    weights, bias = np.zeros((UNITS, INPUTS)), np.zeros(UNITS)
    z_w, z_b = np.zeros_like(weights), np.zeros_like(bias)
    collected, path = [], []
    b, gamma = 0.0, 1.0
    for n, (y, a, r, ended) in enumerate(zip(*experience(), strict=True), start=1):
        p = 1 / (1 + np.exp(-(weights @ y + bias)))
        z_w = beta * z_w + np.outer(a - p, y)
        z_b = beta * z_b + (a - p)
        delta = r - b
        collected.append((gamma * delta * z_w, gamma * delta * z_b))
        if baseline == "mean":
            b = b + delta / n
        elif baseline is not None:
            b = b + baseline * delta
        gamma = gamma * discount
        if ended:
            z_w, z_b, gamma = np.zeros_like(z_w), np.zeros_like(z_b), 1.0
        if update_every != "never" and (ended if update_every == "episode" else len(collected) == update_every):
            size = 1 if sum_up else len(collected)
            weights = weights + RATE * sum(g for g, _ in collected) / size
            bias = bias + RATE * sum(g for _, g in collected) / size
            collected = []
        path.append(np.append(weights.ravel(), bias))
    estimate = (
        np.append(np.mean([g for g, _ in collected], axis=0), np.mean([g for _, g in collected], axis=0))
        if (collected)
        else None
    )
    return np.array(path), estimate


# name: (the estimator, what it is in the reference: decay, baseline, update_every, sum, discount)
ESTIMATORS = {
    "OLGARB": (olgarb(0.8), (0.8, "mean", 1, True, 1)),
    "OLGARB, fixed-step baseline": (olgarb(0.8, FixedStep(0.1)), (0.8, 0.1, 1, True, 1)),
    "OLPOMDP": (olpomdp(0.95), (0.95, None, 1, True, 1)),
    "no memory": (olpomdp(0.0), (0.0, None, 1, True, 1)),
    "GPOMDP": (gpomdp(0.9), (0.9, None, "never", False, 1)),
    "GPOMDP with a baseline": (gpomdp(0.9, MeanReward()), (0.9, "mean", "never", False, 1)),
    "every seventh, mean": (Estimator(Exponential(0.8), update_every=7), (0.8, "mean", 7, False, 1)),
    "every seventh, sum": (Estimator(Exponential(0.8), update_every=7, reduction="sum"), (0.8, "mean", 7, True, 1)),
    "episode, mean": (Estimator(Episodic(), update_every="episode"), (1.0, "mean", "episode", False, 1)),
    "episode, sum": (
        Estimator(Episodic(), None, update_every="episode", reduction="sum"),
        (1.0, None, "episode", True, 1),
    ),
    "discounted": (Estimator(Episodic(), discount=0.9), (1.0, "mean", 1, True, 0.9)),
    "discounted, episode": (
        Estimator(Episodic(), discount=0.7, update_every="episode"),
        (1.0, "mean", "episode", False, 0.7),
    ),
}


def learn(estimator):
    """The library's learner on the same experience: the path of its parameters, and its state in the end."""
    agent = Agent(Hyperplanes(jnp.zeros((UNITS, INPUTS)), jnp.zeros(UNITS)), estimator, SGD(RATE))
    observations, actions, rewards, ends = map(jnp.asarray, experience())

    def decide(state, now):
        y, a, r, ended = now
        # 0 makes any unit fire and 1 none: the action is as we want it
        _, taken, _, state = decision(agent, state, y, 1 - a, r, terminated=ended)
        parameters = jnp.append(state.policy.weights.ravel(), state.policy.bias)
        return state, (parameters, jnp.all(taken == a))

    run = jax.jit(lambda state: jax.lax.scan(decide, state, (observations, actions, rewards, ends)))
    state, (path, obeyed) = run(agent.init(jax.random.key(0)))
    assert np.all(obeyed)
    return np.asarray(path), jax.tree.map(np.asarray, state)


@pytest.mark.ci
@pytest.mark.representatives("OLGARB", "no memory", "episode, sum")
@pytest.mark.parametrize("name", ESTIMATORS)
def test_the_learner_is_the_hand_written_loop(name):
    estimator, table = ESTIMATORS[name]
    path, estimate = reference(*table)
    with jax.enable_x64(True):
        got, state = learn(estimator)
    # two hundred steps, each rounded to 1e-16; an episode's sum of some 20 samples comes back from their mean
    np.testing.assert_allclose(got, path, rtol=1e-10, atol=1e-12)
    if estimate is not None and not estimator.online:
        mean = state.gradient.mean
        np.testing.assert_allclose(np.append(mean.weights.ravel(), mean.bias), estimate, rtol=1e-10, atol=1e-12)


def test_single_precision_follows_the_hand_written_loop():
    path, _ = reference(*ESTIMATORS["OLGARB"][1])
    got, _ = learn(ESTIMATORS["OLGARB"][0])
    assert got.dtype == np.float32
    # 200 steps, each rounded to 6e-8 of parameters of size 1
    np.testing.assert_allclose(got, path, atol=2e-5)


def moves(estimator):
    """After which decisions the parameters moved."""
    path, _ = learn(estimator)
    return np.flatnonzero(np.any(np.diff(path, axis=0, prepend=0) != 0, axis=1))


def test_an_online_learner_moves_at_every_decision():
    np.testing.assert_array_equal(moves(olgarb(0.8)), np.arange(STEPS))


def test_a_batch_learner_moves_after_every_so_many_decisions():
    np.testing.assert_array_equal(moves(Estimator(update_every=10)), np.arange(9, STEPS, 10))


def test_an_episodic_learner_moves_at_the_ends_of_episodes_only():
    np.testing.assert_array_equal(moves(Estimator(Episodic(), update_every="episode")), np.flatnonzero(experience()[3]))


def test_an_estimate_at_fixed_parameters_never_moves_them():
    assert len(moves(gpomdp(0.9))) == 0


def test_the_named_estimators_are_configurations():
    assert olgarb(0.7) == Estimator(Exponential(0.7), MeanReward(), update_every=1)
    assert olpomdp(0.7) == Estimator(Exponential(0.7), None, update_every=1)
    assert gpomdp(0.7) == Estimator(Exponential(0.7), None, update_every="never")


TRACES = [Exponential(0.9), Episodic(), Window(4), LaggedGaussian(2.0, 1.0)]


def halfway(agent, decisions=5):
    """A learner in the middle of an episode."""
    state, observation = agent.init(jax.random.key(0)), jnp.asarray([1.0, -0.5])
    for number in range(decisions):
        uniforms = jax.random.uniform(jax.random.key(number), (1,))
        state = decision(agent, state, observation, uniforms, jnp.asarray(1.0 + number)).state
    return state, observation


def observed(agent, state, observation, reward, **flags):
    """The learner after the reward for an action that it has not chosen: its traces are those before."""
    return agent.observe(state, Transition(observation, jnp.zeros(1), jnp.asarray(reward), observation, **flags))


def agent_with(trace, **settings):
    return Agent(Hyperplanes([[0.1, 0.2]], [0.0]), Estimator(trace, **settings), SGD(0.1))


@pytest.mark.parametrize("traced", [pytest.param(False, marks=pytest.mark.ci), True])
@pytest.mark.parametrize("flag", ["terminated", "truncated", "diverged"])
@pytest.mark.parametrize(
    "trace",
    [pytest.param(each, marks=[pytest.mark.ci] * isinstance(each, Window | LaggedGaussian)) for each in TRACES],
    ids=repr,
)
def test_every_end_of_an_episode_empties_the_trace(trace, flag, traced):
    agent = agent_with(trace, discount=0.9)
    state, observation = halfway(agent)
    assert all(jnp.any(leaf != 0) for leaf in jax.tree.leaves(state.estimator.trace))
    after = observed(agent, state, observation, 2.0, **{flag: jnp.asarray(True) if traced else True})
    for leaf in jax.tree.leaves(after.estimator.trace):
        np.testing.assert_array_equal(leaf, 0)
    assert float(after.estimator.weight) == 1


@pytest.mark.parametrize("flag", ["terminated", "truncated", "diverged"])
def test_a_lowered_flag_changes_nothing(flag):
    agent = agent_with(Exponential(0.9), discount=0.9)
    state, observation = halfway(agent)
    plain = observed(agent, state, observation, 2.0)
    flagged = observed(agent, state, observation, 2.0, **{flag: jnp.asarray(False)})
    for a, b in zip(jax.tree.leaves(plain), jax.tree.leaves(flagged), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("flag", ["terminated", "truncated"])
def test_the_last_reward_of_an_episode_counts(flag):
    agent = agent_with(Exponential(0.9), update_every="never")
    state, observation = halfway(agent)
    plain = observed(agent, state, observation, 2.0)
    ended = observed(agent, state, observation, 2.0, **{flag: True})
    for part in (lambda state: state.gradient, lambda state: state.estimator.baseline):
        for a, b in zip(jax.tree.leaves(part(plain)), jax.tree.leaves(part(ended)), strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("reward", [2.0, np.nan, np.inf])
@pytest.mark.parametrize("update_every", ["never", 1])
def test_a_diverged_sample_is_dropped_and_the_baseline_and_counts_stay(update_every, reward):
    agent = agent_with(Exponential(0.9), update_every=update_every)
    state, observation = halfway(agent)
    dropped = observed(agent, state, observation, reward, diverged=jnp.asarray(True))
    after = agent.update(dropped)
    for part in (lambda state: state.policy, lambda state: state.estimator.baseline):
        for a, b in zip(jax.tree.leaves(part(state)), jax.tree.leaves(part(after)), strict=True):
            np.testing.assert_array_equal(a, b)
    if update_every == "never":
        assert isinstance(after.gradient, RunningMean)
        assert int(after.gradient.count) == 5
        np.testing.assert_array_equal(after.gradient.mean.weights, state.gradient.mean.weights)
    else:
        np.testing.assert_array_equal(dropped.gradient.weights, 0)


def test_the_discount_weighs_the_decisions_of_an_episode_from_its_start():
    agent = agent_with(Episodic(), discount=0.8, update_every="never")
    state, observation = agent.init(jax.random.key(0)), jnp.asarray([1.0, -0.5])
    seen = []
    for number in range(6):
        seen.append(float(state.estimator.weight))
        given = observation, jnp.asarray([0.3]), jnp.asarray(1.0)
        state = decision(agent, state, *given, terminated=number == 2).observed
    np.testing.assert_allclose(seen, [1, 0.8, 0.64, 1, 0.8, 0.64], rtol=1e-6)  # float32


def test_a_random_initial_policy_is_drawn_from_the_key():
    agent = Agent(lambda key: Softmax(jax.random.normal(key, (2, 2))))
    first, same, other = (agent.init(jax.random.key(k)).policy.weights for k in (1, 1, 2))
    np.testing.assert_array_equal(first, same)
    assert not np.array_equal(first, other)


def test_fixed_settings_of_a_policy_are_not_learned():
    agent = Agent(LocalGaussians([[0.5, 0.0]], [[0.0, 0.0]], 0.6), olpomdp(0.5), SGD(0.1))
    state, _ = halfway(agent)
    assert float(state.policy.p_max) == pytest.approx(0.6, rel=1e-6)
    assert not np.array_equal(state.policy.centre, [[0.5, 0.0]])


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: Agent("softmax"), "policy = 'softmax'"),
        (lambda: Agent(Softmax([[1.0]]), estimator=0.9), "estimator = 0.9: must be an Estimator"),
        (lambda: Agent(Softmax([[1.0]]), optimizer=0.01), "optimizer = 0.01: must be an Optimizer"),
        (lambda: Estimator(update_every=0), "update_every = 0"),
        (lambda: Estimator(update_every="always"), "update_every = 'always'"),
        (lambda: Estimator(discount=0.0), "discount = 0.0"),
        (lambda: Estimator(discount=1.1), "discount = 1.1"),
        (lambda: Estimator(reduction="median"), "reduction 'median': did you mean 'mean'"),
        (lambda: Agent(Softmax(np.array([[1, 2]]))).init(jax.random.key(0)), "policy = 'Softmax': must be .*trainable"),
    ],
)
def test_impossible_settings_are_refused_by_name(make, names):
    with pytest.raises(ValueError, match=names):
        make()


def test_a_diverged_step_moves_nothing_even_with_momentum():
    agent = Agent(hyperplanes(2, 1), olgarb(0.9), optax.chain(optax.trace(0.9), optax.sgd(0.1)))
    state = agent.init(jax.random.key(0))
    y, u = jnp.array([0.3, -0.4]), jnp.array([0.1])
    state = decision(agent, state, y, u, jnp.float32(1.0)).state
    after = decision(agent, state, y, u, jnp.float32(5.0), diverged=jnp.array(True)).state
    for before, now in zip(
        jax.tree.leaves((state.policy, state.chain)), jax.tree.leaves((after.policy, after.chain)), strict=True
    ):
        np.testing.assert_array_equal(before, now)


class Holding(Softmax):
    """A policy of one's own that holds an equinox module."""

    net: eqx.nn.MLP


@pytest.mark.ci
def test_a_policy_may_hold_any_equinox_module():
    net = eqx.nn.MLP(2, 2, 4, 1, key=jax.random.key(0))
    agent = Agent(Holding(jnp.zeros((2, 2)), net), olgarb(decay=0.5), SGD(0.1))
    state = jax.jit(lambda key: agent.init(key))(jax.random.key(0))  # activation functions are no arrays
    held = state.policy.net  # type: ignore[attr-defined]
    np.testing.assert_allclose(held(jnp.ones(2)), net(jnp.ones(2)), rtol=1e-6)


def test_a_network_alone_is_told_how_to_become_a_policy():
    net = eqx.nn.MLP(2, 2, 4, 1, key=jax.random.key(0))
    with pytest.raises(ValueError, match=r"policy = 'MLP': must be a Policy; motorgrad\.policies\.Network"):
        Agent(net, olgarb(decay=0.5), SGD(0.1))
