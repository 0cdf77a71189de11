"""CONJPOMDP: directions and line search by exact gradients, estimates that grow, and learning to the end."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import SGD, Agent, ConjugateAscent, Estimator, Exponential, FisherMetric, MeanReward
from motorgrad.policies import Softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle

HILL = np.diag([1.0, 2.0, 4.0, 8.0])
TOP = np.array([1.0, -1.0, 0.5, 0.25])


@eqx.filter_jit
def updated(optimizer, descent, state, policy):
    return optimizer.update(descent, state, policy, None, True)


def climb(optimizer, batches, noise=0.0, seed=0):
    """The parameters after each batch, on a quadratic hill whose gradient is known but for noise."""
    rng, policy = np.random.default_rng(seed), Softmax(jnp.zeros((2, 2)))
    state, visited = optimizer.init(policy), []
    for _ in range(batches):
        gradient = -HILL @ (np.ravel(policy.weights) - TOP) + noise * rng.normal(size=4)
        descent = Softmax(jnp.asarray(-gradient.reshape(2, 2), jnp.float32))
        step, state = updated(optimizer, descent, state, policy)
        policy = Softmax(policy.weights + step.weights)
        visited.append(np.ravel(policy.weights))
    return np.array(visited), state


def written_out(first, batches):
    """The same with exact gradients, as Baxter, Bartlett and Weaver describe it."""

    def slope(x):
        return -HILL @ (x - TOP)

    x, visited, h, before = np.zeros(4), [], np.zeros(4), None
    while len(visited) < batches:
        g = slope(x)
        share = 0.0 if before is None else max(0.0, (g - before) @ g / (before @ before))
        h = g + share * h
        h = h if g @ h > 0 else g
        before, s, near, far = g, first, (0.0, g @ h), None
        ahead = None
        while True:
            visited.append(x + s * h)
            p = slope(x + s * h) @ h
            turned = ahead is not None and ahead != (p > 0)
            ahead = p > 0
            near, far = ((s, p), far) if ahead else (near, (s, p))
            if turned:
                break
            s = 2 * s if ahead else s / 2
        x = x + (near[0] + near[1] * (far[0] - near[0]) / (near[1] - far[1])) * h
        visited.append(x)
    return np.array(visited[:batches])


@pytest.mark.ci
@pytest.mark.representatives("3.0")
@pytest.mark.parametrize("first", [0.01, 3.0])
def test_directions_and_lines_are_the_published_ones(first):
    found, _ = climb(ConjugateAscent(first), 20)
    np.testing.assert_allclose(found, written_out(first, 20), atol=2e-4)


def test_a_quadratic_hill_is_climbed_in_as_many_lines_as_dimensions():
    visited, state = climb(ConjugateAscent(0.05), 30)
    lines = np.linalg.norm(visited - TOP, axis=1)
    assert lines[-1] < 1e-3
    assert int(state.trials) >= 0


def test_an_estimate_grows_until_its_sign_is_known():
    """Two signs that agree are enough; with noise the parameters stay where they are for more batches."""
    stayed = {}
    for noise in (0.0, 2.0):
        visited, _ = climb(ConjugateAscent(0.05, certainty=2.0, most=50), 60, noise)
        stayed[noise] = (np.diff(visited, axis=0) == 0).all(1).mean()
    plain, _ = climb(ConjugateAscent(0.05), 60, 2.0)
    assert not (np.diff(plain, axis=0) == 0).all(1).any()
    assert 0.5 <= stayed[0.0] < 0.62  # of two batches at a trial, and of three at an origin, the last moves
    assert stayed[2.0] > stayed[0.0] + 0.1


@pytest.mark.ci
def test_an_estimate_does_not_grow_beyond_the_most_batches():
    _, state = climb(ConjugateAscent(0.05, certainty=100.0, most=3), 8, 5.0)
    assert int(state.estimate.count) == 2  # of the third estimate


@pytest.mark.ci
def test_it_finds_the_best_policy():
    estimator = Estimator(Exponential(0.8), MeanReward(), update_every=1_000)
    agent = Agent(Softmax(jnp.zeros((2, 2))), estimator, ConjugateAscent(30.0))
    stepper = stepper_for(ThreeState(), agent, range(10))
    stepper.advance(100_000)
    earned = [oracle.average_reward(ThreeState().dynamics, Softmax(w)) for w in stepper.policies().weights]
    assert np.median(earned) >= 0.795


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: Agent(Softmax(jnp.zeros((2, 2))), Estimator(), ConjugateAscent()),
            "estimator.update_every = 1: must be a batch of more than 1 with ConjugateAscent; SGD and Adam step online",
        ),
        (
            lambda: Agent(Softmax(jnp.zeros((2, 2))), Estimator(update_every=9), ConjugateAscent(), FisherMetric()),
            "metric = .*: must be None with ConjugateAscent; SGD and Adam take one",
        ),
        (lambda: ConjugateAscent(initial=0.0), "initial = 0.0"),
        (lambda: ConjugateAscent(trials=1), "trials = 1"),
    ],
)
def test_what_does_not_fit_together_is_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_other_optimizers_take_any_batch():
    assert (
        Agent(Softmax(jnp.zeros((2, 2))), Estimator(update_every=9), SGD(0.1), FisherMetric()).metric == FisherMetric()
    )
