"""Estimators in the engine, against exact gradients; learning on a problem with a known optimum.

Seeds are fixed, so that a result is always the same on one machine; tolerances are those of independent runs.
"""

import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import SGD, Agent, Episodic, Estimator, MeanReward, Window, gpomdp, olgarb
from motorgrad.policies import Softmax
from motorgrad.tasks import Chain, ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
CHAIN_POINT = Softmax(np.array([[0.3, -0.2, 0.1, 0.0], [0.0, 0.4, 0.2, 0.0]]))


def estimates(stepper):
    """The gradient estimate of every seed, (seeds, parameters)."""
    mean = stepper.state["cycle"].agent.gradient.mean
    return np.asarray(mean.weights, float).reshape(len(stepper.seeds), -1)


PUBLISHED = {
    "no baseline": (None, {1_000: 0.752, 10_000: 0.241, 100_000: 0.084}),
    "running mean": (MeanReward(), {1_000: 0.217, 10_000: 0.066, 100_000: 0.021}),
}


def check_relative_errors(name, longest):
    baseline, published = PUBLISHED[name]
    exact, runs = oracle.flat(oracle.gradient(ThreeState().dynamics, POINT)), 500
    stepper = stepper_for(ThreeState(), Agent(POINT, gpomdp(0.95, baseline)), range(runs))
    for decisions, figure in published.items():
        if decisions > longest:
            break
        stepper.advance(decisions - stepper.decision)
        error = np.linalg.norm(estimates(stepper) - exact, axis=1) / np.linalg.norm(exact)
        # Both figures are means over 500 runs: four standard errors of their difference, and the figure's rounding.
        tolerance = 4 * error.std() * np.sqrt(2 / runs) + 0.0005
        assert error.mean() == pytest.approx(figure, abs=tolerance), decisions


@pytest.mark.representatives("no baseline")
@pytest.mark.parametrize("name", PUBLISHED)
def test_the_relative_error_of_gpomdp_is_the_published_one(name):
    check_relative_errors(name, 10_000)


@pytest.mark.slow
@pytest.mark.parametrize("name", PUBLISHED)
def test_the_relative_error_of_gpomdp_is_the_published_one_over_long_runs(name):
    check_relative_errors(name, 100_000)


def episode_gradient(mdp, policy, length, step=1e-3):
    """The gradient of the expected reward of an episode of `length` decisions, by two-sided differences.

    Parameters are single precision, so the step is coarse: its error is step² = 1e-6 of the third derivative, and
    rounding's 6e-8 / 1e-3 of the parameter.
    """

    def earned(weights):
        matrix = oracle.transition_matrix(mdp, Softmax(weights))
        return sum(np.linalg.matrix_power(matrix, t)[mdp.start] @ mdp.rewards for t in range(1, length + 1))

    weights = np.asarray(policy.weights, float)
    shifts = step * np.eye(weights.size).reshape(-1, *weights.shape)
    return np.array([earned(weights + d) - earned(weights - d) for d in shifts]) / (2 * step)


# name: (task, policy, estimator, decisions in an episode or 1, exact gradient given the MDP)
UNBIASED = {
    "exponential": (ThreeState(), POINT, gpomdp(0.8), 1, lambda mdp: oracle.biased_gradient(mdp, POINT, 0.8)),
    # the second eigenvalue is −.73: what the window leaves out is .73²⁰ = 2e-3 of the gradient
    "window": (
        ThreeState(),
        POINT,
        Estimator(Window(20), MeanReward(), update_every="never"),
        1,
        lambda mdp: oracle.gradient(mdp, POINT),
    ),
    "episodic": (
        Chain(length=4, time_limit=6),
        CHAIN_POINT,
        Estimator(Episodic(), None, update_every="never"),
        6,
        lambda mdp: episode_gradient(mdp, CHAIN_POINT, 6),
    ),
    # 40 decisions leave out .8⁴⁰ = 1e-4 of the return
    "discounted": (
        ThreeState(time_limit=40),
        POINT,
        Estimator(Episodic(), MeanReward(), discount=0.8, update_every="never"),
        40,
        lambda mdp: oracle.discounted_gradient(mdp, POINT, 0.8),
    ),
}


def check_unbiased(name, decisions, precision):
    task, policy, estimator, episode, gradient = UNBIASED[name]
    exact = gradient(task.dynamics)
    exact = exact if isinstance(exact, np.ndarray) else oracle.flat(exact)
    stepper = stepper_for(task, Agent(policy, estimator), range(400))
    stepper.advance(decisions)
    per_seed = episode * estimates(stepper)
    error = per_seed.std(0) / np.sqrt(len(per_seed))
    assert np.linalg.norm(error) < precision * np.linalg.norm(exact)  # sharp enough for a bias to show
    # Four standard errors, and what the estimator leaves out (see the table).
    np.testing.assert_array_less(np.abs(per_seed.mean(0) - exact), 4 * error + 2e-3 * np.linalg.norm(exact))


@pytest.mark.ci
@pytest.mark.parametrize("name", UNBIASED)
def test_the_mean_estimate_over_seeds_is_the_exact_gradient(name):
    check_unbiased(name, 4_800, 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", UNBIASED)
def test_the_mean_estimate_over_long_runs_is_the_exact_gradient(name):
    check_unbiased(name, 120_000, 0.01)


def test_olgarb_finds_the_best_policy_of_the_three_state_mdp_on_every_seed():
    stepper = stepper_for(ThreeState(), Agent(Softmax(jnp.zeros((2, 2))), olgarb(0.8), SGD(0.05)), range(20))
    stepper.advance(120_000)
    earned = [oracle.average_reward(ThreeState().dynamics, Softmax(w)) for w in stepper.policies().weights]
    assert min(earned) >= 0.799
