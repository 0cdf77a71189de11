"""Hidden layers of stochastic units: what each pool sees, what the task gets, and means over hidden draws."""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from policy_examples import Compiled, compiled, observation_of, policy_of, started

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
    abilities,
    initial,
    split,
)


def planes(units, inputs, seed=0):
    rng = np.random.default_rng(seed)
    return Hyperplanes(rng.normal(size=(units, inputs)), rng.normal(size=units))


@compiled
def _told(policy, look, uniforms):
    """What a policy draws, and what each of its pools sees, does and learns."""
    actions = jax.vmap(policy.sample, (None, 0))(look, uniforms)
    drawn, likely = policy.drawn(actions[0]), policy.drawn(policy.mode(look))
    own = [pool.score(policy.view(look, drawn[:k]), drawn[k]) for k, pool in enumerate(policy.pools)]
    every = abilities.enumerate(policy)
    return {
        "action": actions,
        "drawn": jax.vmap(policy.drawn)(actions),
        "joined": jax.vmap(lambda action: policy.joined(policy.drawn(action)))(actions),
        "emitted": jax.vmap(lambda action: abilities.task_action(policy, action))(actions),
        "score": ravel_pytree(policy.score(look, actions[0]))[0],
        "scores of the pools": jnp.concatenate([ravel_pytree(each)[0] for each in own]),
        "activations": abilities.hidden_activations(policy, look),
        "prob": [pool.prob(policy.view(look, likely[:k])) for k, pool in enumerate(policy.pools[:-1])],
        "log_prob of every action": jax.vmap(lambda action: policy.log_prob(look, action))(every),
        "fisher of every action": jax.vmap(lambda action: abilities.fisher(policy, look, action))(every),
        "blocks of every action": jax.vmap(lambda action: abilities.blocks(policy, policy.score(look, action)))(every),
    }


@functools.cache
def told(name):
    with jax.enable_x64(True):
        policy = policy_of(name)
        uniforms = np.random.default_rng(1).random((20, policy.uniforms))
        shapes = [() if pool.actions == "discrete" else (pool.outputs,) for pool in policy.pools]
        return shapes, jax.tree.map(np.asarray, _told(policy, observation_of(policy), uniforms))


LAYERED = ("layered", "layered-skip", "controller", "controller-softmax")
few = pytest.mark.representatives("layered-skip", "controller")


@few
@pytest.mark.parametrize("name", LAYERED)
def test_an_action_is_what_all_pools_draw_and_the_task_gets_that_of_the_last(name):
    shapes, all_of = told(name)
    np.testing.assert_array_equal(all_of["joined"], all_of["action"])
    np.testing.assert_array_equal(all_of["emitted"], all_of["drawn"][-1])
    assert [each.shape[1:] for each in all_of["drawn"]] == shapes


def test_each_pool_sees_the_draws_below_it_and_a_constant_where_it_has_room():
    first, second, last = planes(2, 3), Softmax(np.zeros((4, 3))), planes(1, 2)
    policy, look = Layered([first, second], last), jnp.array([0.1, 0.2, 0.3])
    fired, chosen = jnp.array([1.0, 0.0]), jnp.asarray(3)
    np.testing.assert_array_equal(policy.view(look, []), look)
    np.testing.assert_array_equal(policy.view(look, [fired]), [1, 0, 1])
    np.testing.assert_array_equal(policy.view(look, [fired, chosen]), [3, 1])
    skipping = Layered([first], planes(1, 6), skip=True)
    np.testing.assert_array_equal(skipping.view(look, [fired]), np.float32([0.1, 0.2, 0.3, 1, 0, 1]))


@few
@pytest.mark.parametrize("name", LAYERED)
def test_hidden_activations_are_those_of_each_hidden_pool_after_the_most_probable_actions_below(name):
    shapes, all_of = told(name)
    assert len(all_of["activations"]) == len(shapes) - 1
    for found, wanted in zip(all_of["activations"], all_of["prob"], strict=True):
        np.testing.assert_array_equal(found, wanted)


def test_hidden_activations_come_through_policies_around_and_within():
    inner = Layered([planes(3, 4)], planes(1, 3))
    layers = eqx.filter_eval_shape(MultilayerPerceptron(hidden=(5, 4)).build, 2, jax.random.key(0))
    behind = Network(inner, layers, 2)
    within = Layered([planes(2, 3)], Network(planes(1, 4), layers, 2))

    def sizes(policy, look):
        hidden = eqx.filter_eval_shape(lambda policy: abilities.hidden_activations(policy, look), policy)
        return [each.size for each in hidden]

    assert sizes(behind, [0.3, -0.1]) == [5, 4, 3]
    assert sizes(Featured(behind, FeatureMap(), 2), [0.3, -0.1]) == [5, 4, 3]
    assert sizes(within, [0.3, -0.1, 0.2]) == [2, 5, 4]
    with pytest.raises(ValueError, match="must be 3 numbers, what the task shows"):
        abilities.hidden_activations(within, [0.3])


@few
@pytest.mark.parametrize("name", LAYERED)
def test_the_score_of_each_pool_is_its_own_given_what_it_saw(name):
    _, all_of = told(name)
    np.testing.assert_array_equal(all_of["score"], all_of["scores of the pools"])


@few
@pytest.mark.parametrize("name", LAYERED)
def test_fisher_matrices_are_on_average_those_of_the_score_and_pools_are_uncorrelated(name):
    _, all_of = told(name)
    chance, rows = np.exp(all_of["log_prob of every action"]), all_of["blocks of every action"]
    matrices = all_of["fisher of every action"]
    for block, own in zip(rows, matrices, strict=True):
        exact = np.einsum("a,aui,auj->uij", chance, block, block)
        np.testing.assert_allclose(np.tensordot(chance, own, 1), exact, atol=1e-13)
    one, other = (np.asarray(block).reshape(len(chance), -1) for block in rows[:2])
    np.testing.assert_allclose(np.einsum("a,ai,aj->ij", chance, one, other), 0, atol=1e-13)


@pytest.mark.ci
def test_the_entropy_is_at_least_that_of_the_outputs():
    policy = policy_of("layered-skip")
    look = observation_of(policy)
    ask = Compiled(policy)
    prob = ask.prob(look)
    assert ask.entropy(look) > -np.sum(prob * np.log(prob))


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
    assert policy.actions == ("binary", "continuous")
    action = policy.sample(jnp.array([0.3]), jnp.full(policy.uniforms, 0.3))
    assert action.shape == (4,)
    assert policy.prob(jnp.array([0.3])).shape == (2,)
    assert np.isfinite(policy.entropy(jnp.array([0.3])))


def test_initial_layers_are_those_that_were_asked_for():
    start = compiled(initial("layered", 3, units=2, hidden=(5, 4), skip=True))
    policy = start(jax.random.key(0))
    assert [pool.inputs for pool in policy.pools] == [3, 8, 7]
    assert [pool.outputs for pool in policy.pools] == [5, 4, 2]
    np.testing.assert_array_equal(policy.output.weights, 0)
    other = start(jax.random.key(1))
    assert not np.array_equal(policy.hidden[0].weights, other.hidden[0].weights)
    start = initial("layered", 3, units=4, hidden=(2,), output="softmax")
    chosen = eqx.filter_eval_shape(start, jax.random.key(0))
    assert (chosen.actions, chosen.output.weights.shape) == ("discrete", (4, 3))


@pytest.mark.ci
def test_the_first_layer_may_see_features():
    policy = started(initial("layered", 2, units=1, features=FeatureMap(products=True)))
    assert isinstance(policy, Featured)
    assert abilities.has_hidden_units(policy)
    action = Compiled(policy).sample(np.ones(2), np.full(policy.uniforms, 0.5))
    np.testing.assert_array_equal(abilities.task_action(policy, action), abilities.task_action(policy.pool, action))


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
        (lambda: initial("layered", 2, units=1, hidden=(0,)), "hidden[0] = 0"),
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
