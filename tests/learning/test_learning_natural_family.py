"""Natural gradients that are learned: by increments, by rank-one updates and by regression, against exact ones."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decided, started, told

from motorgrad.learning import (
    SGD,
    Agent,
    CompatibleWeights,
    Constant,
    EpisodicNatural,
    Estimator,
    Exponential,
    Features,
    FisherMetric,
    LeastSquares,
    LeastSquaresNatural,
    ShermanMorrison,
    TemporalDifference,
    Transition,
    actor_critic,
    gpomdp,
    olgarb,
)
from motorgrad.policies import Hyperplanes, Network, Softmax, abilities, trainable
from motorgrad.tasks import Chain, ThreeState
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import oracle

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
CHAIN = Chain(length=4)
CHAIN_POINT = Softmax(np.array([[0.3, -0.2, 0.1, 0.0], [0.0, 0.4, 0.2, 0.0]]))
POOL = Hyperplanes(jnp.array([[0.5, -0.2], [0.1, 0.3]]), jnp.array([0.1, -0.3]))


def decisions(count, seed=0):
    """Observations, uniforms and rewards at random."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(count + 1, 2)), rng.random((count, 2)), rng.normal(size=count)


def flat(tree):
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(tree)])


def in_double(policy):
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.float64) if eqx.is_inexact_array(leaf) else leaf, policy)


def network():
    layers = eqx.nn.MLP(2, 3, 4, 1, key=jax.random.key(1))
    return Network(Hyperplanes(jnp.full((2, 3), 0.4), jnp.array([0.1, -0.3])), layers, 2)


@pytest.mark.ci
@pytest.mark.representatives("pool")
@pytest.mark.parametrize("make", [lambda: POOL, network], ids=["pool", "network"])
def test_compatible_weights_are_bhatnagars(make):
    """The rule of the paper, written out, with a score over the parameters of all units and layers."""
    rate, step = 0.1, 0.05
    with jax.enable_x64(True):
        policy = in_double(make())
        agent = Agent(policy, Estimator(Exponential(0.0), Constant(0.3)), SGD(step), CompatibleWeights(rate))
        state, score_of = started(agent), eqx.filter_jit(lambda policy, y, action: policy.score(y, action))
        theta = flat(trainable(state.policy))
        weights = np.zeros(theta.size)
        seen, uniforms, rewards = decisions(10)
        for y, after, number, reward in zip(seen, seen[1:], uniforms, rewards, strict=False):
            before = state.policy
            _, action, _, state = decided(agent, state, y, number, reward, after)
            score = flat(score_of(before, y, action))
            weights = weights - rate * score * (score @ weights) + rate * (reward - 0.3) * score
            theta = theta + step * weights
            np.testing.assert_allclose(flat(trainable(state.policy)), theta, atol=1e-12)


def test_rank_one_updates_keep_the_inverse_of_the_damped_matrix():
    metric = ShermanMorrison(0.02, 0.05, 0.5)
    with jax.enable_x64(True):
        policy = in_double(POOL)
        state, matrices = metric.init(policy), np.stack([0.5 * np.eye(3)] * 2)
        seen, uniforms, _ = decisions(50)

        @eqx.filter_jit
        def observed(state, y, number):
            action = policy.sample(y, number)
            (rows,) = abilities.blocks(policy, policy.score(y, action))
            return metric.observe(state, policy, Transition(y, action, 0.0, y)), rows

        for turn, (y, number) in enumerate(zip(seen, uniforms, strict=False)):
            state, rows = jax.tree.map(np.asarray, observed(state, y, number))
            one = 0.02 * 3 * 0.05 * np.diag(np.arange(3) == turn % 3)
            matrices = 0.98 * matrices + 0.02 * np.einsum("ui,uj->uij", rows, rows) + one
        np.testing.assert_allclose(state.blocks[0], np.linalg.inv(matrices), rtol=1e-9)
        gradient = jax.tree.map(jnp.ones_like, policy)
        updates, _ = metric.update(gradient, state, policy, None, True)
        wanted = np.linalg.solve(matrices, np.ones((2, 3, 1)))[..., 0]
        np.testing.assert_allclose(abilities.blocks(policy, updates)[0], wanted, rtol=1e-9)


@pytest.mark.slow
def test_the_inverse_stays_finite_along_directions_without_scores():
    """Of a softmax all weights on one input may rise together. Forgetting alone overflows after 9,000 decisions."""
    agent = Agent(POINT, olgarb(0.5), SGD(0.0), ShermanMorrison(0.01, 0.01))
    stepper = stepper_for(ThreeState(), agent, range(2))
    stepper.advance(20_000)
    (block,) = stepper.state["cycle"].agent.chain[0].blocks
    damped = oracle.fisher(ThreeState().dynamics, POINT) + 0.01 * np.eye(4)
    assert np.abs(np.linalg.inv(np.asarray(block, float)) - damped).max() < 0.1
    assert np.linalg.eigvalsh(np.asarray(block[0], float)).max() < 200


def regressed(task, policy, metric, count, seeds=40):
    """The directions that a metric has found after so many decisions at a fixed policy."""
    agent = Agent(policy, Estimator(Exponential(0.0), None, update_every=count), SGD(0.0), metric)
    stepper = stepper_for(task, agent, range(seeds))
    stepper.advance(count)
    state = stepper.state["cycle"].agent.chain[0]
    found = state.direction if hasattr(state, "direction") else state.weights[:, -policy.weights.size :]
    return np.asarray(found, float)


def check_direction(found, exact, precision):
    """The mean over seeds is the exact direction."""
    error = found.std(0) / np.sqrt(len(found))
    scale = np.linalg.norm(exact)
    assert np.linalg.norm(error) < precision * scale
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error + 0.03 * scale)


@pytest.mark.representatives("0.0")
@pytest.mark.parametrize("decay", [0.0, 0.8])
def test_least_squares_find_the_exact_natural_gradient(decay):
    """The inputs of three states and a constant tell them apart, so that the values are exact for any trace."""
    exact = flat(oracle.natural_gradient(ThreeState().dynamics, POINT))
    fit = LeastSquares(0.0, 1.0, damping=1e-7, interval=100)
    metric = LeastSquaresNatural(Features(bias=False), None, decay, fit)
    check_direction(regressed(ThreeState(), POINT, metric, 10_000), exact, 0.1)


def episodic_natural(mdp, policy, length, discount, damping):
    """The exact solution of the regression, by a sum over all episodes of so many decisions."""
    chance = oracle.action_probabilities(mdp, policy)
    scores = np.asarray(
        jax.jit(jax.vmap(lambda y: jax.vmap(lambda a: policy.score(y, a).weights)(jnp.arange(2))))(mdp.observations)
    ).reshape(mdp.states, 2, -1)
    paths = [(1.0, mdp.start, np.zeros(scores.shape[-1]), 0.0)]
    for t in range(length):
        paths = [
            (
                weight * chance[s, a] * mdp.transitions[a, s, after],
                after,
                total + discount**t * scores[s, a],
                earned + discount**t * mdp.rewards[after],
            )
            for weight, s, total, earned in paths
            for a in range(2)
            for after in np.flatnonzero(mdp.transitions[a, s])
        ]
    weights = np.array([path[0] for path in paths])
    totals, earned = np.array([path[2] for path in paths]), np.array([path[3] for path in paths])
    totals, earned = totals - weights @ totals, earned - weights @ earned
    matrix = np.einsum("p,pi,pj->ij", weights, totals, totals) + damping * np.eye(totals.shape[1])
    return np.linalg.solve(matrix, np.einsum("p,pi,p->i", weights, totals, earned))


def test_episodes_find_the_exact_natural_gradient():
    task = ThreeState(time_limit=4)
    exact = episodic_natural(task.dynamics, POINT, 4, 0.9, 0.01)
    metric = EpisodicNatural(0.9, 0.0, 0.01)
    check_direction(regressed(task, POINT, metric, 5_000), exact, 0.05)


def test_a_broken_episode_is_left_out():
    metric = EpisodicNatural()
    agent = Agent(POINT, Estimator(Exponential(0.0), None, update_every="episode"), SGD(1.0), metric)
    state = started(agent)
    for diverged in (False, True):
        flags = {"truncated": not diverged, "diverged": diverged}
        state = told(agent, state, [0.5, 0.25], [0.3], np.nan if diverged else 1.0, np.zeros(2), **flags)[2]
    means = state.chain[0].means
    assert int(means.count) == 1
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(means))
    again = agent.restart(state)  # an empty episode is none
    jax.tree.map(np.testing.assert_array_equal, again.chain, state.chain)


LEARNERS = {
    "compatible": lambda task: Agent(start(task), actor_critic(decay=0.5), SGD(0.001), CompatibleWeights(0.02)),
    "rank one": lambda task: Agent(start(task), actor_critic(decay=0.5), SGD(0.01), ShermanMorrison(1e-3, 0.01)),
    "least squares": lambda task: Agent(
        start(task),
        Estimator(Exponential(0.0), None, update_every=200),
        SGD(0.1),
        LeastSquaresNatural(Features(bias=False), None, 0.5, LeastSquares(1e-3, interval=200)),
    ),
    "episodes": lambda task: Agent(
        start(task), Estimator(Exponential(0.0), None, update_every=200), SGD(0.1), EpisodicNatural(1.0, 0.005)
    ),
}


def start(task):
    return Softmax(jnp.zeros((2, task.observation_size)))


@pytest.mark.ci
@pytest.mark.parametrize("name", LEARNERS)
def test_it_finds_the_best_policy(name):
    task = ThreeState(time_limit=20) if name == "episodes" else ThreeState()
    stepper = stepper_for(task, LEARNERS[name](task), range(10))
    stepper.advance(100_000)
    earned = [oracle.average_reward(task.dynamics, Softmax(w)) for w in stepper.policies().weights]
    assert min(earned) >= 0.795


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: Agent(POINT, Estimator(update_every=100), metric=CompatibleWeights()),
            "update_every = 100: must be 1, at every decision, with CompatibleWeights; FisherMetric takes batches",
        ),
        (
            lambda: stepper_for(ThreeState(), Agent(POINT, gpomdp(0.9), metric=EpisodicNatural()), [0]),
            "metric.kind = 'episodic-nac': needs episodes, but the task 'three-state' has none",
        ),
        (
            lambda: stepper_for(ThreeState(), Agent(POINT, gpomdp(0.9), metric=LeastSquaresNatural(discount=1.0)), [0]),
            "metric.discount = 1: needs episodes",
        ),
        (lambda: LeastSquaresNatural(fit=TemporalDifference()), "fit = 'TemporalDifference': must be LeastSquares"),
        (lambda: LeastSquaresNatural(Features(actions=True)), "features.actions = True: must be False"),
        (
            lambda: LeastSquaresNatural().init(Softmax(jnp.zeros((2, 3000)))),
            "policy = 'Softmax of 6,000 parameters': must be one of at most 4,096 parameters; CompatibleWeights takes",
        ),
        (lambda: ShermanMorrison(damping=0.0), "damping = 0.0"),
        (lambda: agent_for("three-state", metric="lstd"), "did you mean 'lstd-nac'"),
    ],
)
def test_what_does_not_fit_together_is_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_an_estimator_in_batches_may_have_any_other_metric():
    agent = Agent(POINT, Estimator(update_every=100), metric=FisherMetric())
    assert dataclasses.replace(agent, metric=ShermanMorrison()).metric == ShermanMorrison()
