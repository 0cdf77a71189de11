"""Newton steps: the exact curvature two ways, its estimate from scores and traces, and the step itself."""

import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import Agent, NewtonMetric, gpomdp
from motorgrad.policies import Softmax, softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import biased_hessian, hessian, oracle, three_state

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])


def test_the_hessian_is_the_slope_of_the_gradient_and_the_limit_of_what_traces_estimate():
    mdp = three_state()
    exact = hessian(mdp, POINT)
    np.testing.assert_allclose(exact, exact.T, atol=1e-12)
    step = 1e-3  # parameters are kept in single precision

    def moved(shift):
        return oracle.flat(oracle.gradient(mdp, Softmax(np.asarray(POINT.weights) + shift.reshape(2, 2))))

    slopes = [(moved(d) - moved(-d)) / (2 * step) for d in step * np.eye(4)]
    np.testing.assert_allclose(exact, slopes, atol=2e-5)
    off = [np.linalg.norm(biased_hessian(mdp, POINT, decay) - exact) for decay in (0.9, 0.99, 0.999)]
    assert off[0] > 5 * off[1] > 25 * off[2]
    assert off[2] < 1e-3 * np.linalg.norm(exact)


@pytest.mark.parametrize("terms", ["whole", "approximate"])
def test_the_mean_estimate_over_seeds_is_what_the_oracle_says(terms):
    decay = 0.6
    exact = biased_hessian(three_state(), POINT, decay, whole=terms == "whole")
    metric = NewtonMetric(decay=decay, terms=terms, rate=1e-9)
    stepper = stepper_for(ThreeState(), Agent(POINT, gpomdp(decay), metric=metric), range(300))
    stepper.advance(6_000)
    found = np.asarray(stepper.state["cycle"].agent.chain[0].hessian.mean, float)
    error = found.std(0) / np.sqrt(len(found))
    assert np.linalg.norm(error) < 0.1 * np.linalg.norm(exact)
    # four standard errors, and a first state that is not drawn from the stationary distribution
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error + 2e-3 * np.linalg.norm(exact))


def test_a_step_goes_uphill_along_every_eigenvector_by_newtons_length():
    metric = NewtonMetric(damping=1e-6)
    state = metric.init(softmax(2, 2))
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(4, 4)))[0]
    values = np.array([-2.0, -0.5, 0.25, 4.0])
    matrix = jnp.asarray(turn @ np.diag(values) @ turn.T, jnp.float32)
    state = state._replace(hessian=state.hessian._replace(mean=matrix))
    gradient = turn @ np.array([1.0, -1.0, 2.0, 1.0])
    found = metric.precondition(state, jnp.asarray(gradient, jnp.float32))
    np.testing.assert_allclose(turn.T @ np.asarray(found), [0.5, -2.0, 8.0, 0.25], rtol=1e-3)


def test_a_policy_of_many_parameters_is_refused():
    with pytest.raises(ValueError, match="at most 256 parameters"):
        NewtonMetric().init(softmax(200, 2))
