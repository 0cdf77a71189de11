"""Recurrent units: their score against automatic differentiation through the whole past, and what they forget."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from policy_examples import Compiled, compiled

from motorgrad.policies import (
    GradedHyperplanes,
    Hyperplanes,
    Layered,
    Recurrent,
    Softmax,
    abilities,
    initial,
    split,
)

STEPS = 40


def outputs(kind, rng):
    if kind == "binary":
        return Hyperplanes(rng.normal(size=(2, 6)), rng.normal(size=2))
    if kind == "discrete":
        return Softmax(rng.normal(size=(3, 6)))
    if kind == "graded":
        return GradedHyperplanes(rng.normal(size=(2, 6)), rng.normal(size=2), rng.normal(size=2))
    return Layered([Hyperplanes(rng.normal(size=(2, 6)), rng.normal(size=2))], Softmax(rng.normal(size=(2, 3))))


def example(kind="binary"):
    rng = np.random.default_rng(0)
    shape = (4, 2)
    return Recurrent(rng.normal(size=4, scale=2), rng.normal(size=shape), rng.normal(size=4), outputs(kind, rng))


def unrolled(policy, observations, action):
    """The log-probability of the last action, through the whole past, from the definition."""
    a = jnp.exp(-jnp.exp(policy.log_rate))

    def step(h, y):
        return a * h + jnp.sqrt(1 - a**2) * (policy.weights @ y + policy.bias), None

    h, _ = jax.lax.scan(step, jnp.zeros(4), observations)
    return policy.output.log_prob(jnp.concatenate([observations[-1], h]), action)


@compiled
def both_scores(policy, observations, uniforms):
    """The score at the last of some observations as it is carried online, and by differentiating all of them."""

    def step(memory, observation):
        seen = abilities.observation_with_memory(policy, memory, observation)
        return abilities.remember(policy, seen, None), seen

    _, seen = jax.lax.scan(step, abilities.initial_memory(policy), observations)
    action = policy.sample(seen[-1], uniforms)
    theta, rest = split(policy)
    exact = jax.grad(lambda part: unrolled(eqx.combine(part, rest), observations, action))(theta)
    automatic = jax.grad(lambda part: eqx.combine(part, rest).log_prob(seen[-1], action))(theta)
    return [ravel_pytree(each)[0] for each in (policy.score(seen[-1], action), exact, automatic)]


@pytest.mark.representatives("binary-True-1e-10", "graded-True-1e-10")
@pytest.mark.parametrize(("double", "tolerance"), [(False, 1e-5), (True, 1e-10)])
@pytest.mark.parametrize("kind", ["binary", "discrete", "graded", "layered"])
def test_the_online_score_is_the_derivative_through_the_whole_past(kind, double, tolerance):
    with jax.enable_x64(double):
        policy, rng = example(kind), np.random.default_rng(1)
        observations = jnp.asarray(rng.normal(size=(STEPS, 2)))
        online, exact, automatic = both_scores(policy, observations, jnp.asarray(rng.random(policy.uniforms)))
        scale = 1 + np.abs(exact).max()
    assert np.abs(exact[:12]).min() > 0  # of the recurrent units, too
    np.testing.assert_allclose(online, exact, atol=tolerance * scale)
    np.testing.assert_allclose(automatic, exact, atol=tolerance * scale)


def test_without_a_past_the_score_is_that_of_the_drive_alone_and_memory_starts_from_nothing():
    policy = example()
    ask = Compiled(policy)
    np.testing.assert_array_equal(abilities.initial_memory(policy), 0)
    seen = ask.observation_with_memory(abilities.initial_memory(policy), np.array([1.0, -1.0]))
    gain = np.sqrt(1 - np.asarray(policy.decay) ** 2)
    expected = gain * (np.asarray(policy.weights) @ [1, -1] + np.asarray(policy.bias))
    np.testing.assert_allclose(abilities.critic_observation(policy, seen), [1, -1, *expected], rtol=1e-5)
    (hidden,) = ask.hidden_activations(seen)
    np.testing.assert_allclose(hidden, expected, rtol=1e-5)


def test_hidden_units_of_the_output_come_after_the_recurrent_ones():
    policy = example("layered")

    def hidden():
        seen = policy.observation_with_memory(policy.initial_memory(), [0.5, 0.2])
        return abilities.hidden_activations(policy, seen)

    recurrent, drawing = jax.eval_shape(hidden)
    assert (recurrent.shape, drawing.shape) == ((4,), (2,))


def test_a_critic_sees_the_observation_and_the_activations_only():
    policy = example()
    assert (policy.observation_size, policy.inputs) == (2, 2 + 4 * 5)
    assert abilities.critic_observation(policy, jnp.arange(22.0)).tolist() == [0, 1, 2, 3, 4, 5]


def test_gradients_survive_the_way_through_blocks():
    policy = example("graded")
    ask = Compiled(policy)
    score = ask.score(np.ones(policy.inputs), np.ones(2))
    blocks = ask.blocks(score)
    assert [block.shape for block in blocks] == [(4, 4), (2, 8)]
    for one, other in zip(jax.tree.leaves(ask.from_blocks(blocks)), jax.tree.leaves(score), strict=True):
        np.testing.assert_array_equal(one, other)
    matrices = jax.eval_shape(abilities.fisher, policy, jnp.ones(policy.inputs), jnp.ones(2))
    assert [matrix.shape for matrix in matrices] == [(4, 4, 4), (2, 8, 8)]


def test_time_constants_stay_within_their_limits():
    wild = eqx.tree_at(lambda policy: policy.log_rate, example(), jnp.array([-100.0, 100.0, 0.0, -1.0]))
    np.testing.assert_allclose(1 / np.exp(abilities.limited(wild).log_rate), [1e6, 0.1, 1, np.e], rtol=1e-5)


def test_initial_time_constants_are_spread_between_the_ends():
    policy = initial("recurrent", 3, units=2, hidden=3, shortest=1.0, longest=100.0)(jax.random.key(0))
    np.testing.assert_allclose(-1 / np.log(policy.decay), [1, 10, 100], rtol=1e-4)
    assert policy.output.inputs == 6


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Recurrent([0.0], [[1.0]], [0.0, 0.0], Hyperplanes([[1.0, 1.0]], [0.0])), "bias = (2,)"),
        (lambda: Recurrent([0.0], [1.0], [0.0], Hyperplanes([[1.0, 1.0]], [0.0])), "weights = (1,)"),
        (lambda: Recurrent([0.0], [[1.0]], [0.0], Hyperplanes([[1.0]], [0.0])), "output.inputs = 1: must be 2"),
        (lambda: Recurrent([0.0], [[1.0] * 22], [0.0], example()), "output = 'Recurrent'"),
        (lambda: initial("recurrent", 2, units=1, longest=0.5), "shortest, longest = (1.0, 0.5)"),
        (lambda: initial("recurrent", 2, units=1, hidden=0), "hidden = 0"),
    ],
)
def test_what_cannot_be_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
