"""Policies behind hidden layers: any module, any output units, and the multilayer perceptron."""

import json
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import Compiled, compiled, drawn_scores, from_initial, started
from test_policy_features import MAKE, moved

from motorgrad.learning import Agent, gpomdp
from motorgrad.policies import (
    INITIAL,
    Featured,
    FeatureMap,
    MultilayerPerceptron,
    Network,
    describe,
    fixed,
    hyperplanes,
    rebuild,
    softmax,
    trainable,
)
from motorgrad.tasks import Chain, ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import oracle

SEEN = np.array([0.5, -1.0, 2.0])
SMALL = MultilayerPerceptron(hidden=(5, 4), sparsity=0.5)
KEY = jax.random.key(0)
START = compiled(softmax(3, 4, network=SMALL))


def filled(build):
    """A module with small random numbers of NumPy, which compiles nothing to draw them."""
    rng = np.random.default_rng(3)

    def drawn(leaf):
        return jnp.asarray(rng.normal(size=leaf.shape, scale=0.5)) if isinstance(leaf, jax.ShapeDtypeStruct) else leaf

    return jax.tree.map(drawn, eqx.filter_eval_shape(build))


def linear(inputs, outputs):
    return filled(lambda: eqx.nn.Linear(inputs, outputs, key=KEY))


def check_scores(policy, count=4):
    """Scores equal the derivatives of the log-probability, all through the layers."""
    uniforms = np.random.default_rng(2).random((count, policy.uniforms))
    _, scores, derivatives = map(np.asarray, drawn_scores(policy, SEEN[: policy.inputs], uniforms))
    np.testing.assert_allclose(scores, derivatives, rtol=1e-7, atol=1e-9)
    assert np.any(scores != 0)
    return scores


LEFT_OUT = {"growing", "mirrored", "finite-state-controller", "mosaic", "recurrent", "spiking"}
"""Policies that are all off, that need a task, and that have a memory, which no layers may stand before."""


@pytest.mark.ci
@pytest.mark.parametrize("name", sorted(INITIAL.keys() - LEFT_OUT))
def test_scores_of_any_output_units_behind_layers_are_the_derivatives(name):
    with jax.enable_x64(True):
        pool = from_initial(name, np.random.default_rng(0))
        # primitives start above 0.5
        layers = filled(lambda: eqx.nn.MLP(3, pool.inputs, 5, 1, jnp.tanh, lambda h: h + 0.6, key=KEY))
        policy = Network(pool, layers, 3)
        assert (policy.inputs, policy.outputs, policy.actions) == (3, pool.outputs, pool.actions)
        check_scores(policy)


@pytest.mark.ci
@pytest.mark.parametrize("name", MAKE)
def test_hidden_layers_stand_between_the_features_and_the_units(name):
    with jax.enable_x64(True):
        start = MAKE[name](network=SMALL)
        policy = moved(started(start))
        assert isinstance(policy, Network)
        assert (policy.inputs, policy.pool.inputs) == (3, 4)
        check_scores(policy)
        start = MAKE[name](network=SMALL, features=FeatureMap(squares=True))
        squares = eqx.filter_eval_shape(start, jax.random.key(0))
        assert isinstance(squares, Featured)
        assert squares.pool.module.layers[0].weight.shape == (5, 6)


def by_hand(module, observation):
    """A perceptron's output in NumPy."""
    h = np.asarray(observation, float)
    for layer in module.layers[::3]:
        h = np.asarray(layer.weight, float) @ h + np.asarray(layer.bias, float)
        h = (h - h.mean()) / np.sqrt(h.var() + 1e-5)
        h = np.where(h > 0, h, 0.01 * h)
    return h


def test_the_perceptron_normalises_its_potentials_before_the_nonlinearity():
    policy = moved(START(KEY))
    ask, observation = Compiled(policy), SEEN.astype(np.float32)
    seen = ask.seen(observation)
    np.testing.assert_allclose(seen, by_hand(policy.module, SEEN), rtol=1e-4, atol=1e-5)
    first, last = ask.hidden_activations(observation)
    assert (first.shape, last.shape) == ((5,), (4,))
    np.testing.assert_array_equal(last, seen)


@pytest.mark.representatives("20-0.9-2", "1-0.9-1")
@pytest.mark.parametrize(("inputs", "sparsity", "kept"), [(20, 0.9, 2), (4, 0.9, 1), (1, 0.9, 1), (5, 0.0, 5)])
def test_each_unit_starts_with_few_weights_and_never_without_any(inputs, sparsity, kept):
    build = compiled(MultilayerPerceptron(hidden=(50,), sparsity=sparsity).build)
    module = build(inputs, jax.random.key(0))
    weight = np.asarray(module.layers[0].weight)
    np.testing.assert_array_equal((weight != 0).sum(1), kept)
    assert 0.8 < np.abs(weight).max() * np.sqrt(inputs) <= 1
    assert not np.any(module.layers[0].bias)
    if kept < inputs:
        assert len({tuple(row) for row in weight != 0}) > 1  # not the same inputs for all units


def test_every_seed_starts_from_its_own_network_of_one_structure():
    one, same, other = (START(jax.random.key(seed)) for seed in (0, 0, 1))
    assert eqx.tree_equal(one, same)
    assert not eqx.tree_equal(one, other)
    assert jax.tree.structure(one) == jax.tree.structure(other)
    assert hash(jax.tree.structure(one)) == hash(jax.tree.structure(other))


class Own(eqx.Module):
    """What a user may write: functions, numbers and words among the leaves, lists, and arrays that do not learn."""

    layers: list
    activation: Callable
    named: dict
    places: jax.Array
    scale: jax.Array = fixed()
    final: Callable = eqx.field(static=True)
    name: str
    power: int = 2

    def __init__(self, key, activation=jax.nn.relu, name="mine"):
        first, second = jax.random.split(key)
        self.layers = [eqx.nn.Linear(3, 6, key=first), eqx.nn.Linear(6, 4, key=second)]
        self.activation, self.final, self.name = activation, jax.nn.soft_sign, name
        self.named = {"gain": jnp.ones(4), "steps": 3}
        self.places = jnp.array([2, 0, 1])
        self.scale = np.full(3, 0.5)

    def __call__(self, y):
        hidden = self.activation(self.layers[0](y[self.places] * self.scale)) ** self.power
        return self.final(self.named["gain"] * self.layers[1](hidden)) * len(self.name) / self.named["steps"]


@compiled
def _own(key, options):
    return Own(key, **dict(options))


def own(seed=0, **options):
    return Network(softmax(4, 3), _own(jax.random.key(seed), tuple(options.items())), 3)


def test_a_module_of_ones_own_learns_with_its_arrays_alone():
    policy = moved(own())
    assert all(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(policy))
    learned = trainable(policy)
    assert learned.module.places is None
    assert learned.module.scale is None
    assert len(jax.tree.leaves(learned)) == 6  # the weights of softmax, of two layers with biases, and the gain
    with jax.enable_x64(True):
        check_scores(
            jax.tree.map(lambda x: jnp.asarray(np.asarray(x, float)) if eqx.is_inexact_array(x) else x, policy)
        )


def test_leaves_that_are_no_arrays_are_compared_by_value():
    def structure(**options):
        return jax.tree.structure(own(**options))

    assert structure(seed=0) == structure(seed=1)
    assert hash(structure(seed=0)) == hash(structure(seed=1))
    assert structure() != structure(activation=jax.nn.silu)
    assert structure() != structure(name="other")


@pytest.mark.parametrize(
    "make", [own, lambda: Network(softmax(4, 2), filled(lambda: eqx.nn.MLP(3, 4, 5, 1, key=KEY)), 3)]
)
def test_a_network_is_rebuilt_from_its_description(make):
    policy = make()
    shapes = rebuild(json.loads(json.dumps(describe(policy))))
    assert jax.tree.structure(shapes) == jax.tree.structure(policy)
    again = jax.tree.unflatten(jax.tree.structure(shapes), jax.tree.leaves(policy))
    np.testing.assert_array_equal(Compiled(again).prob(SEEN), Compiled(policy).prob(SEEN))


def test_a_function_of_ones_own_is_never_looked_up_for_a_stored_network():
    described = describe(own(activation=lambda x: x))
    with pytest.raises(ValueError, match=r"function = '.*<lambda>': must be a function of jax\.nn.* be given again"):
        rebuild(described)
    described["module"]["activation"] = {"kind": "frozen", "value": {"kind": "function", "name": "os.system"}}
    with pytest.raises(ValueError, match=r"function = 'os\.system'"):
        rebuild(described)


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Network(softmax(4, 2), jnp.tanh, 3), "module = '"),
        (lambda: Network(softmax(4, 2), linear(3, 5), 3), "must return a vector of 4 numbers"),
        (
            lambda: Network(softmax(4, 2), linear(2, 4), 3),
            "module = Linear: must be a module that can be called with a vector of 3 numbers",
        ),
        (lambda: Network(linear(3, 4), linear(3, 4), 3), "pool = 'Linear'"),
        (lambda: MultilayerPerceptron(hidden=()), "hidden = (): must be at least one layer"),
        (lambda: MultilayerPerceptron(hidden=(3, 0)), "hidden[1] = 0"),
        (lambda: MultilayerPerceptron(sparsity=1.0), "sparsity = 1.0: must be in [0, 1)"),
        (lambda: MultilayerPerceptron(activation="rely"), "unknown activation 'rely': did you mean 'relu'"),
        (lambda: hyperplanes(3, 2, network=(5, 5)), "network = (5, 5): must be an Architecture"),
        (lambda: MAKE["bounded"](network=SMALL, deviation=-1.0), "deviation = -1.0: must be a finite number above 0"),
    ],
)
def test_what_is_impossible_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)


def small_network(inputs, seed=0):
    """A softmax policy behind four hidden units, with parameters that are not near a symmetry."""
    return moved(started(softmax(inputs, 2, network=MultilayerPerceptron(hidden=(4,), sparsity=0.0)), seed))


@pytest.mark.ci
@pytest.mark.parametrize("name", ["three states", "chain"])
def test_the_mean_estimate_of_a_network_over_seeds_is_the_exact_gradient(name):
    task = {"three states": ThreeState(), "chain": Chain(length=4)}[name]
    policy = small_network(task.observation_size)
    exact = oracle.flat(oracle.biased_gradient(task.dynamics, policy, 0.8))
    stepper = stepper_for(task, Agent(policy, gpomdp(0.8)), range(400))
    stepper.advance(4_800)
    mean = stepper.state["cycle"].agent.gradient.mean
    per_seed = np.concatenate([np.asarray(leaf, float).reshape(400, -1) for leaf in jax.tree.leaves(mean)], axis=1)
    error = per_seed.std(0) / np.sqrt(len(per_seed))
    assert np.linalg.norm(error) < 0.1 * np.linalg.norm(exact)  # sharp enough for a bias to show
    np.testing.assert_array_less(np.abs(per_seed.mean(0) - exact), 4.5 * error + 2e-3 * np.linalg.norm(exact))
    layers = sum(leaf.size for leaf in jax.tree.leaves(trainable(policy).module))
    assert np.linalg.norm(exact[-layers:]) > 0.05 * np.linalg.norm(exact)  # the layers have a share in it
