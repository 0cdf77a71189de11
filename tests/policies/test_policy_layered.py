"""Hidden layers of stochastic units: what each pool sees, what the task gets, and means over hidden draws."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from policy_examples import observation_of, over_actions, policy_of

from motorgrad.policies import (
    Factored,
    Featured,
    FeatureMap,
    FiniteStateController,
    GradedHyperplanes,
    Hyperplanes,
    Layered,
    Mixed,
    MultilayerPerceptron,
    Network,
    Softmax,
    initial,
    split,
)


def flat(tree):
    return np.asarray(ravel_pytree(tree)[0])


def planes(units, inputs, seed=0):
    rng = np.random.default_rng(seed)
    return Hyperplanes(rng.normal(size=(units, inputs)), rng.normal(size=units))


@pytest.mark.parametrize("name", ["layered", "layered-skip", "controller", "controller-softmax"])
def test_an_action_is_what_all_pools_draw_and_the_task_gets_that_of_the_last(name):
    policy, uniforms = policy_of(name), np.random.default_rng(1).random((20, policy_of(name).uniforms), np.float32)
    for numbers in uniforms:
        action = policy.sample(observation_of(policy), numbers)
        drawn = policy.drawn(action)
        np.testing.assert_array_equal(policy.joined(drawn), action)
        np.testing.assert_array_equal(policy.emit(action), drawn[-1])
        assert [each.shape for each in drawn] == [() if p.actions == "discrete" else (p.outputs,) for p in policy.pools]


def test_each_pool_sees_the_draws_below_it_and_a_constant_where_it_has_room():
    first, second, last = planes(2, 3), Softmax(np.zeros((4, 3))), planes(1, 2)
    policy, look = Layered([first, second], last), jnp.array([0.1, 0.2, 0.3])
    fired, chosen = jnp.array([1.0, 0.0]), jnp.asarray(3)
    np.testing.assert_array_equal(policy.view(look, []), look)
    np.testing.assert_array_equal(policy.view(look, [fired]), [1, 0, 1])
    np.testing.assert_array_equal(policy.view(look, [fired, chosen]), [3, 1])
    skipping = Layered([first], planes(1, 6), skip=True)
    np.testing.assert_array_equal(skipping.view(look, [fired]), np.float32([0.1, 0.2, 0.3, 1, 0, 1]))


@pytest.mark.parametrize("name", ["layered", "layered-skip", "controller"])
def test_hidden_activations_are_those_of_each_hidden_pool_after_the_most_probable_actions_below(name):
    policy = policy_of(name)
    look = observation_of(policy)
    drawn = policy.drawn(policy.mode(look))
    layers = policy.hidden_activations(look)
    assert len(layers) == len(policy.pools) - 1
    for k, layer in enumerate(layers):
        np.testing.assert_array_equal(layer, policy.pools[k].prob(policy.view(look, drawn[:k])))


def test_hidden_activations_come_through_policies_around_and_within():
    inner = Layered([planes(3, 4)], planes(1, 3))
    layers = MultilayerPerceptron(hidden=(5, 4)).build(2, jax.random.key(0))
    behind = Network(inner, layers, 2)
    assert [each.size for each in behind.hidden_activations([0.3, -0.1])] == [5, 4, 3]
    assert [each.size for each in Featured(behind, FeatureMap(), 2).hidden_activations([0.3, -0.1])] == [5, 4, 3]
    within = Layered([planes(2, 3)], Network(planes(1, 4), layers, 2))
    assert [each.size for each in within.hidden_activations([0.3, -0.1, 0.2])] == [2, 5, 4]
    with pytest.raises(ValueError, match="must be 3 numbers, what the task shows"):
        within.hidden_activations([0.3])


@pytest.mark.parametrize("name", ["layered", "layered-skip", "controller"])
def test_the_score_of_each_pool_is_its_own_given_what_it_saw(name):
    with jax.enable_x64(True):
        policy = policy_of(name)
        look = observation_of(policy)
        action = policy.sample(look, np.random.default_rng(2).random(policy.uniforms))
        drawn = policy.drawn(action)
        own = [flat(pool.score(policy.view(look, drawn[:k]), drawn[k])) for k, pool in enumerate(policy.pools)]
        score = flat(policy.score(look, action))
    np.testing.assert_array_equal(score, np.concatenate(own))


@pytest.mark.parametrize("name", ["layered", "layered-skip", "controller", "controller-softmax"])
def test_fisher_matrices_are_on_average_those_of_the_score_and_pools_are_uncorrelated(name):
    with jax.enable_x64(True):
        policy = policy_of(name)
        look = observation_of(policy)
        chance = np.exp(np.asarray(over_actions(policy, "log_prob", look)))
        matrices = over_actions(policy, "fisher", look)
        scores = over_actions(policy, "score", look)
        rows = jax.vmap(policy.blocks)(scores)
    for block, own in zip(rows, matrices, strict=True):
        exact = np.einsum("a,aui,auj->uij", chance, block, block)
        np.testing.assert_allclose(np.tensordot(chance, own, 1), exact, atol=1e-13)
    one, other = (np.asarray(block).reshape(len(chance), -1) for block in rows[:2])
    np.testing.assert_allclose(np.einsum("a,ai,aj->ij", chance, one, other), 0, atol=1e-13)


def test_the_entropy_is_at_least_that_of_the_outputs():
    policy = policy_of("layered-skip")
    look = observation_of(policy)
    prob = np.asarray(policy.prob(look))
    assert policy.entropy(look) > -np.sum(prob * np.log(prob))


@pytest.mark.ci
def test_beyond_256_patterns_means_are_over_draws_and_have_the_derivative_of_the_exact_mean():
    """Eight hidden units are summed exactly; with a ninth that nothing sees, the same mean is drawn."""
    with jax.enable_x64(True):
        hidden, last = planes(8, 2), planes(1, 8)
        blind = Hyperplanes(np.zeros((1, 2)), np.zeros(1))
        exact = Layered([hidden], last)
        drawn = Layered([Factored([hidden, blind])], Hyperplanes(np.pad(last.weights, ((0, 0), (0, 1))), last.bias))
        look = jnp.array([0.4, -0.8])
        assert drawn.prob(look)[0] == pytest.approx(exact.prob(look)[0], abs=4 * 0.5 / np.sqrt(256))
        assert float(drawn.entropy(look)) == pytest.approx(float(exact.entropy(look)) + np.log(2), abs=0.1)

        def slope(policy):
            theta, rest = split(policy)
            return jax.grad(lambda part: eqx.combine(part, rest).prob(look)[0])(theta)

        one, other = slope(exact), slope(drawn)
    weights = np.asarray(other.hidden[0].pools[0].weights)
    # 256 draws of a product of a probability and a score, of the order of one
    np.testing.assert_allclose(weights, one.hidden[0].weights, atol=4 / np.sqrt(256))
    assert np.corrcoef(weights.ravel(), np.asarray(one.hidden[0].weights).ravel())[0, 1] > 0.5


@pytest.mark.ci
def test_hidden_units_may_be_graded_and_outputs_mixed():
    hidden = GradedHyperplanes(np.ones((2, 1)), np.zeros(2), np.zeros(2))
    output = Mixed([planes(1, 2), GradedHyperplanes(np.ones((1, 2)), np.zeros(1), np.zeros(1))])
    policy = Layered([hidden], output)
    assert policy.actions == ("binary", "graded")
    action = policy.sample(jnp.array([0.3]), jnp.full(policy.uniforms, 0.3))
    assert action.shape == (4,)
    assert policy.prob(jnp.array([0.3])).shape == (2,)
    assert np.isfinite(policy.entropy(jnp.array([0.3])))


def test_initial_layers_are_those_that_were_asked_for():
    policy = initial("layered", 3, units=2, hidden=(5, 4), skip=True)(jax.random.key(0))
    assert [pool.inputs for pool in policy.pools] == [3, 8, 7]
    assert [pool.outputs for pool in policy.pools] == [5, 4, 2]
    np.testing.assert_array_equal(policy.output.weights, 0)
    other = initial("layered", 3, units=2, hidden=(5, 4), skip=True)(jax.random.key(1))
    assert not np.array_equal(policy.hidden[0].weights, other.hidden[0].weights)
    chosen = initial("layered", 3, units=4, hidden=(2,), output="softmax")(jax.random.key(0))
    assert (chosen.actions, chosen.output.weights.shape) == ("discrete", (4, 3))


def test_the_first_layer_may_see_features():
    policy = initial("layered", 2, units=1, features=FeatureMap(products=True))(jax.random.key(0))
    assert isinstance(policy, Featured)
    assert policy.hides
    action = policy.sample(jnp.ones(2), jnp.full(policy.uniforms, 0.5))
    np.testing.assert_array_equal(policy.emit(action), policy.pool.emit(action))


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Layered([], planes(1, 2)), "hidden = (): must be at least one pool"),
        (lambda: Layered([planes(2, 1)], planes(1, 4)), "output.inputs = 4: must be 2, what it sees, or one more"),
        (lambda: Layered([planes(2, 1), planes(2, 5)], planes(1, 2)), "hidden[1].inputs = 5"),
        (lambda: Layered([policy_of("layered")], planes(1, 2)), "hidden = ['Layered']: must be units without hidden"),
        (lambda: Layered([planes(2, 1)], policy_of("controller")), "output = 'FiniteStateController'"),
        (lambda: Factored([planes(1, 2), planes(1, 3)]), "pools = [2, 3]"),
        (lambda: Mixed([policy_of("layered")]), "pools = ['Layered']"),
        (lambda: Featured(policy_of("controller"), FeatureMap(), 5), "pool = 'FiniteStateController'"),
        (lambda: FiniteStateController(planes(2, 2), planes(1, 2)), "transition = 'binary'"),
        (lambda: FiniteStateController(Softmax(np.zeros((2, 3))), planes(1, 3)), "transition.inputs = 3"),
        (lambda: FiniteStateController(Softmax(np.zeros((2, 4))), planes(1, 3)), "act.inputs = 3: must be 4"),
        (lambda: initial("layered", 2, units=1, hidden=()), "hidden = (): must be at least one layer"),
        (lambda: initial("layered", 2, units=1, hidden=(0,)), "hidden = 0"),
        (lambda: initial("layered", 2, units=1, output="hyperplane"), "'hyperplanes'"),
        (lambda: initial("layered", 2, units=1, scale=0.0), "scale = 0.0"),
        (lambda: initial("finite-state-controller", 2, units=1, links=5), "links = 5"),
        (lambda: initial("finite-state-controller", 2, units=1, states=0), "states = 0"),
    ],
)
def test_what_cannot_be_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
