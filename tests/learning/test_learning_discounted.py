"""Discounted actor-critics: what is estimated, by which trace, against exact gradients."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import Agent, Estimator, Exponential, LinearCritic, TemporalDifference, actor_critic
from motorgrad.policies import Softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import oracle

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
MDP = ThreeState().dynamics
DISCOUNT, DECAY = 0.8, 0.6
SEEN = np.concatenate([MDP.observations, np.ones((3, 1))], axis=1)
WEIGHTS = np.linalg.solve(SEEN, oracle.values(MDP, POINT, DISCOUNT))


class Known(LinearCritic):
    """A critic that keeps the exact discounted values, `share` times.

    **Arguments:** those of `LinearCritic`, and

    - `share`: what the exact values are multiplied by.
    """

    share: float = 1.0

    def first_weights(self, features, dtype, key):
        return jnp.asarray(self.share * WEIGHTS, dtype)


# What a critic says, whether returns are from the start, and the exact gradient. Without values (share 0) it shows
# which decay the trace has.
CASES = {
    "from the start, no values": (0.0, True, oracle.discounted_gradient(MDP, POINT, DISCOUNT, DECAY)),
    "from the start": (1.0, True, oracle.discounted_gradient(MDP, POINT, DISCOUNT)),
    "all alike, no values": (0.0, False, oracle.biased_gradient(MDP, POINT, DISCOUNT * DECAY)),
    "all alike": (1.0, False, oracle.biased_gradient(MDP, POINT, DISCOUNT)),
}


@pytest.mark.ci
@pytest.mark.representatives("from the start, no values")
@pytest.mark.parametrize("name", CASES)
def test_the_mean_estimate_is_the_exact_gradient(name):
    share, from_start, gradient = CASES[name]
    exact, length = oracle.flat(gradient), 40  # .8⁴⁰ = 1e-4 of the return is left out
    task = ThreeState(time_limit=length) if from_start else ThreeState()
    critic = Known(fit=TemporalDifference(0.0), share=share)
    estimator = dataclasses.replace(actor_critic(critic, DECAY, DISCOUNT, from_start), update_every="never")
    stepper = stepper_for(task, Agent(POINT, estimator), range(400))
    stepper.advance(4_800)
    found = np.asarray(stepper.state["cycle"].agent.gradient.mean.weights, float).reshape(400, -1)
    found = length * found if from_start else found
    error = found.std(0) / 20
    assert np.linalg.norm(error) < 0.05 * np.linalg.norm(exact)
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error + 2e-3 * np.linalg.norm(exact))


def test_a_shorter_trace_discounts_more():
    """Against the sum over time that defines it; with a decay of 1 it is the gradient of the return."""
    matrix, step = oracle.transition_matrix(MDP, POINT), 1e-3
    weights = np.asarray(POINT.weights, float)
    visits = np.linalg.solve((np.eye(3) - DISCOUNT * matrix).T, np.eye(3)[MDP.start])
    value = np.linalg.solve(np.eye(3) - DISCOUNT * DECAY * matrix, matrix @ MDP.rewards)
    worth = MDP.rewards + DISCOUNT * DECAY * value

    def earned(shift):
        return visits @ oracle.transition_matrix(MDP, Softmax(weights + shift)) @ worth

    shifts = step * np.eye(4).reshape(-1, 2, 2)
    slope = np.array([earned(d) - earned(-d) for d in shifts]) / (2 * step)
    np.testing.assert_allclose(
        slope, oracle.flat(oracle.discounted_gradient(MDP, POINT, DISCOUNT, DECAY)), rtol=1e-3, atol=1e-4
    )


def test_discount_and_decays_are_where_they_belong():
    alike, start = actor_critic(decay=0.5, discount=0.8), actor_critic(decay=0.5, discount=0.8, from_start=True)
    assert (alike.discount, alike.trace, alike.baseline.discount) == (None, Exponential(0.4), 0.8)
    assert (start.discount, start.trace, start.baseline.discount) == (0.8, Exponential(0.5), 0.8)
    assert actor_critic(LinearCritic(discount=0.8), 0.5, from_start=True).discount == 0.8
    assert actor_critic(decay=0.5).baseline.discount is None


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: actor_critic(from_start=True), "discount = None: must be in .* with from_start"),
        (lambda: actor_critic(discount=1.5), "discount = 1.5"),
        (
            lambda: Estimator(baseline=LinearCritic(), discount=0.9),
            "baseline.discount = None: must be a number where estimator.discount is one",
        ),
        (
            lambda: agent_for("three-state", estimator="actor-critic", discount=0.9),
            "baseline.discount = None: must be a number",
        ),
        (
            lambda: stepper_for(ThreeState(), Agent(POINT, actor_critic(discount=0.8, from_start=True)), [0]),
            "discount = 0.8: needs episodes",
        ),
        (lambda: oracle.discounted_gradient(MDP, POINT, 0.8, 1.2), r"decay = 1.2: must be in \[0, 1\]"),
    ],
)
def test_what_does_not_fit_together_is_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()
