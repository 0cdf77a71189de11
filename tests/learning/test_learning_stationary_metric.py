"""The natural gradient of states and actions together: against exact gradients of stationary probabilities."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decision

from motorgrad.learning import SGD, Agent, Estimator, Exponential, Features, Growth, StationaryMetric, olgarb
from motorgrad.policies import INITIAL, Hyperplanes, Softmax, abilities
from motorgrad.tasks import Chain, LinearRecruitment, ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
TABLE = Softmax(np.array([[0.3, -0.2, 0.1, 0.0], [0.0, 0.4, 0.2, 0.0]]))
PLACES = {"three states": (ThreeState(), POINT, Features()), "chain": (Chain(length=4), TABLE, Features(bias=False))}


def matrix_of(mdp, policy, weight):
    score, pi = oracle.stationary_score(mdp, policy), oracle.stationary_distribution(mdp, policy)
    return oracle.fisher(mdp, policy) + weight * np.einsum("s,si,sj->ij", pi, score, score)


@pytest.mark.ci
@pytest.mark.representatives("three states-0.7")
@pytest.mark.parametrize("decay", [0.0, 0.7])
@pytest.mark.parametrize("name", PLACES)
def test_it_finds_the_exact_scores_of_states_and_the_exact_direction(name, decay):
    """The features tell the states apart, so the scores are exact for any trace."""
    task, policy, features = PLACES[name]
    mdp, weight, seeds = task.dynamics, 0.6, 60
    metric = StationaryMetric(features, weight, decay, rate=0.0, ridge=1e-6, damping=0.05, initial=0.0)
    stepper = stepper_for(
        task, Agent(policy, Estimator(Exponential(0.0), update_every="never"), metric=metric), range(seeds)
    )
    stepper.advance(6_000)
    state = stepper.state["cycle"].agent.chain[0]
    looks = np.asarray(mdp.observations, np.float32)
    gradient = oracle.gradient(mdp, policy)

    @jax.jit
    def told(state, given):
        scores = jax.vmap(lambda one: jax.vmap(lambda y: metric.stationary_score(one, y))(looks))(state)
        return scores, jax.vmap(lambda one: metric.update(given, one, policy, None, True)[0].weights.ravel())(state)

    found, steps = told(state, jax.tree.map(np.float32, gradient))
    found, exact = np.asarray(found, float), oracle.stationary_score(mdp, policy)
    error, size = found.std(0) / np.sqrt(seeds), np.abs(exact).max()
    assert error.max() < 0.05 * size
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4.5 * error + 0.02 * size)
    pi = oracle.stationary_distribution(mdp, policy)
    np.testing.assert_allclose(pi @ exact, 0, atol=1e-12)

    wanted = np.linalg.solve(matrix_of(mdp, policy, weight) + 0.05 * np.eye(exact.shape[1]), oracle.flat(gradient))
    steps = np.asarray(steps, float)
    error, size = steps.std(0) / np.sqrt(seeds), np.abs(wanted).max()
    np.testing.assert_array_less(np.abs(steps.mean(0) - wanted), 4.5 * error + 0.02 * size)


def test_the_exact_scores_are_slopes():
    mdp, step, weights = ThreeState().dynamics, 1e-3, np.asarray(POINT.weights, float)
    found = [
        [np.log(oracle.stationary_distribution(mdp, Softmax(weights + sign * shift))) for sign in (1, -1)]
        for shift in step * np.eye(4).reshape(-1, 2, 2)
    ]
    slopes = np.array([more - less for more, less in found]).T / (2 * step)
    np.testing.assert_allclose(slopes, oracle.stationary_score(mdp, POINT), atol=3e-4)


@pytest.mark.ci
def test_the_means_are_those_written_out_and_a_diverged_decision_breaks_the_chain():
    decay, lost = 0.6, 5
    with jax.enable_x64(True):
        policy = Hyperplanes(jnp.array([[0.5, -0.2], [0.1, 0.3]], jnp.float64), jnp.array([0.1, -0.3], jnp.float64))
        metric = StationaryMetric(Features(), 1.0, decay, rate=0.0, damping=0.1)
        agent = Agent(policy, Estimator(Exponential(0.0), None, update_every="never"), metric=metric)
        state, rng = agent.init(jax.random.key(0)), np.random.default_rng(0)
        samples, known, blocks = [], None, [np.stack([np.eye(3)] * 2)]
        for step in range(10):
            y = rng.normal(size=2)
            diverged = step == lost
            flags = {"truncated": jnp.asarray(step == 2), "diverged": jnp.asarray(diverged)}
            given = map(jnp.asarray, (y, rng.random(2), 1.0, np.zeros(2)))
            _, action, state, _ = decision(agent, state, *given, **flags)
            score = policy.score(jnp.asarray(y), action)
            score, phi = np.append(np.ravel(score.weights), score.bias), np.append(y, 1)
            if diverged:
                known = None
                continue
            blocks.append(np.asarray(abilities.fisher(policy, jnp.asarray(y), action)[0]))
            if known is None:
                known = (phi, score)
                continue
            u, z = known
            samples.append((np.outer(phi, phi - u), np.outer(phi, z), phi, np.outer(phi, phi)))
            known = ((1 - decay) * phi + decay * u, score + decay * z)
        inner = state.chain[0]
        means = [np.mean([sample[place] for sample in samples], axis=0) for place in range(4)]
        for mean, found in zip(means, inner.backward.mean, strict=True):
            np.testing.assert_allclose(found, mean, atol=1e-12)
        np.testing.assert_allclose(inner.blocks.mean[0], np.mean(blocks, axis=0), atol=1e-12)
        omega = np.linalg.solve(means[0] + np.outer(means[2], means[2]) + 1e-3 * np.eye(3), means[1])
        whole = omega.T @ (means[3] - np.outer(means[2], means[2])) @ omega
        where = [[0, 1, 4], [2, 3, 5]]  # the parameters of each unit among all
        for unit, places in enumerate(where):
            whole[np.ix_(places, places)] += np.mean(blocks, axis=0)[unit]
        np.testing.assert_allclose(metric.fisher(inner, policy), whole, atol=1e-10)


@pytest.mark.ci
def test_it_finds_the_best_policy():
    agent = Agent(Softmax(jnp.zeros((2, 2))), olgarb(0.8), SGD(0.01), StationaryMetric())
    stepper = stepper_for(ThreeState(), agent, range(10))
    stepper.advance(30_000)
    earned = [oracle.average_reward(ThreeState().dynamics, Softmax(w)) for w in stepper.policies().weights]
    assert min(earned) >= 0.79


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: StationaryMetric(Features(actions=True)), "features.actions = True: must be False"),
        (lambda: StationaryMetric(weight=1.5), "weight = 1.5"),
        (lambda: StationaryMetric(damping=0.0), "damping = 0.0"),
        (
            lambda: StationaryMetric().init(Softmax(jnp.zeros((2, 3000)))),
            "policy = 'Softmax of 6,000 parameters': must be one of at most 4,096",
        ),
        (
            lambda: Agent(
                INITIAL["growing"](units=3).bound(LinearRecruitment(units=3)),
                growth=Growth(),
                metric=StationaryMetric(),
            ),
            "growth = 'Growth': must be None with StationaryMetric",
        ),
        (lambda: oracle.lagged_gradient(ThreeState().dynamics, POINT, -1), "lag = -1: must be an integer >= 0"),
    ],
)
def test_impossible_settings_are_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_several_environments_are_refused():
    assert Agent(POINT, olgarb(0.5), metric=StationaryMetric()).needs.single_stream == "StationaryMetric"
