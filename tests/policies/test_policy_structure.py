"""What is learned and what is fixed, storing a policy's structure, refusing wrong shapes, and the initial policies."""

import inspect
import json
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import (
    EXAMPLES,
    KNOWN,
    Compiled,
    from_initial,
    observation_of,
    policy_of,
    started,
    unlisted,
    without_task,
)

from motorgrad import policies
from motorgrad.policies import (
    INITIAL,
    Factored,
    FreeGaussians,
    Hyperplanes,
    InitialPolicy,
    LocalGaussians,
    Mirrored,
    Motoneurons,
    Softmax,
    abilities,
    describe,
    initial,
    rebuild,
    split,
    trainable,
)
from motorgrad.schema import as_hinted, fields_of, table
from motorgrad.worlds import AdmissionThresholds

FIXED = {"p_max", "steepness", "active"}


def test_every_argument_of_a_public_function_is_explained():
    functions = {
        name: getattr(policies, name) for name in policies.__all__ if inspect.isfunction(getattr(policies, name))
    }
    assert set(functions) >= {"hyperplanes", "initial", "prune", "sizes"}
    for name, function in functions.items():
        explained = function.__doc__.partition("**Arguments:**")[2]
        assert not [each for each in inspect.signature(function).parameters if f"`{each}`" not in explained], name


@pytest.mark.representatives(
    *("local-gaussians-p-max", "factored-nested", "masked", "mirrored", "gated", "network", "controller"),
    "admission-thresholds",
)
@pytest.mark.parametrize("name", EXAMPLES)
def test_trainable_and_fixed_parts_join_to_the_policy(name):
    policy = policy_of(name)
    learned, rest = split(policy)
    assert len(jax.tree.leaves(learned)) + len(jax.tree.leaves(rest)) == len(jax.tree.leaves(policy))
    assert eqx.tree_equal(eqx.combine(learned, rest), policy)


@pytest.mark.representatives("local-gaussians-p-max", "factored-nested", "masked", "admission-thresholds")
@pytest.mark.parametrize("name", EXAMPLES)
def test_fixed_arrays_are_none_in_the_trainable_part_and_in_scores(name):
    policy = policy_of(name)
    score = jax.eval_shape(lambda: policy.score(observation_of(policy), abilities.enumerate(policy)[0]))
    for tree in (trainable(policy), score):
        names = {path[-1].name for path, _ in jax.tree_util.tree_leaves_with_path(tree)}
        assert names
        assert not names & FIXED


@pytest.mark.parametrize(
    ("policy", "field"),
    [(LocalGaussians([[0.0]], [[0.0]], 0.5), "p_max"), (AdmissionThresholds([1.0, 2.0]), "steepness")],
)
def test_a_fixed_field_is_in_the_fixed_part_alone(policy, field):
    learned, rest = split(policy)
    assert getattr(learned, field) is None
    assert getattr(rest, field) is not None


def test_integer_arrays_are_not_trainable():
    class Masked(Softmax):
        mask: jax.Array = eqx.field(converter=jnp.asarray, default=0)

    assert trainable(Masked([[1.0]], [3])).mask is None


@pytest.mark.representatives(*[f"{name}-False" for name in EXAMPLES], "factored-nested-True", "recurrent-True")
@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("name", EXAMPLES)
def test_a_described_policy_is_rebuilt_through_json(name, double):
    with jax.enable_x64(double):
        policy = policy_of(name)
        shapes = rebuild(json.loads(json.dumps(describe(policy))))
        assert jax.tree.structure(shapes) == jax.tree.structure(policy)
        for shape, leaf in zip(jax.tree.leaves(shapes), jax.tree.leaves(policy), strict=True):
            assert (shape.shape, shape.dtype) == (leaf.shape, leaf.dtype)


@pytest.mark.representatives("factored-nested-True", "network-False", "softmax-5-False")
@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("name", EXAMPLES)
def test_a_rebuilt_policy_acts_alike(name, double):
    with jax.enable_x64(double):
        policy = policy_of(name)
        structure = jax.tree.structure(rebuild(json.loads(json.dumps(describe(policy)))))
        filled = jax.tree.unflatten(structure, jax.tree.leaves(policy))
        observation = observation_of(policy)
        np.testing.assert_array_equal(Compiled(filled).prob(observation), Compiled(policy).prob(observation))


def test_a_stored_kind_names_the_public_place_of_the_class():
    assert describe(Softmax([[1.0]]))["kind"] == "motorgrad.policies.Softmax"
    assert describe(AdmissionThresholds([1.0]))["kind"] == "motorgrad.worlds.AdmissionThresholds"


def test_rebuilding_an_unknown_kind_is_refused_with_the_nearest():
    with pytest.raises(ValueError, match=r"did you mean 'motorgrad\.policies\.Softmax'"):
        rebuild({"kind": "motorgrad.policies.Softmaxx", "weights": "float32[2,2]"})


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda p: p.mode([0.1, 0.2]), r"observation = \[0\.1, 0\.2\]: must be 3 numbers, what the task shows"),
        (
            lambda p: p.prob(np.zeros((5, 3))),
            r"observation = an array of shape \(5, 3\): must be 3 numbers.*batches need jax\.vmap",
        ),
        (lambda p: p.score(jnp.zeros((5, 3)), 0), r"observation = an array of shape \(5, 3\): must be 3 numbers"),
        (lambda p: jax.eval_shape(p.entropy, jnp.zeros(4)), r"observation = an array of shape \(4,\): must be 3"),
        (lambda p: p.log_prob("none", 0), "observation = 'none': must be 3 numbers"),
        (
            lambda p: p.sample([0, 0, 0], [0.5, 0.5]),
            r"uniforms = \[0\.5, 0\.5\]: must be 1 number, drawn from U\[0, 1\)",
        ),
    ],
)
def test_an_observation_of_another_size_is_refused(call, words):
    with pytest.raises(ValueError, match=words):
        call(policies.Softmax(np.zeros((2, 3))))


def test_a_policy_with_a_memory_says_what_its_units_see():
    policy = started(policies.recurrent(3, 2))
    ask = Compiled(policy)
    remembered = r"must be 51 numbers, 3 observed and 48 remembered, from policy\.observation_with_memory\("
    with pytest.raises(ValueError, match=remembered):
        ask.mode([0.0, 1.0, 0.0])
    with pytest.raises(ValueError, match=r"observation = .*must be 3 numbers, what the task shows"):
        ask.observation_with_memory(abilities.initial_memory(policy), [0.0, 1.0])
    seen = ask.observation_with_memory(abilities.initial_memory(policy), np.array([0, 1, 0]))
    assert seen.dtype == policy.bias.dtype  # whole numbers do not round the memory
    assert ask.mode(seen).shape == (2,)


def test_a_list_acts_as_an_array():
    policy, y, action = policies.Hyperplanes([[1.0, -2.0]], [0.5]), [0.3, 0.1], [1.0]
    for name, others in (("prob", []), ("mode", []), ("sample", [[0.2]]), ("log_prob", [action]), ("score", [action])):
        listed = getattr(policy, name)(y, *others)
        arrays = getattr(policy, name)(jnp.array(y), *map(jnp.array, others))
        jax.tree.map(np.testing.assert_array_equal, listed, arrays)


def test_rebuilding_runs_no_code_outside_the_known_policies():
    with pytest.raises(ValueError, match=r"unknown kind of policy 'os\.system'"):
        rebuild({"kind": "os.system", "weights": "float32[2,2]"})


SIDES = ((1, 0), (1, 1), (0, 1), (2, 3))


def mirror_of(order=(1, 0, 2), signs=(1, 1, -1), left=(0, 1), right=(2, 3)):
    return Mirrored(Hyperplanes(np.zeros((2, 3)), two), order, signs, left, right)


one, two, square = np.zeros(1), np.zeros(2), np.zeros((2, 2))


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Motoneurons(square, square), "threshold = (2, 2)"),
        (lambda: Motoneurons(two, one), "gain = (1,): must be of shape (2,)"),
        (lambda: Hyperplanes(two, two), "weights = (2,)"),
        (lambda: Hyperplanes(square, one), "bias = (1,): must be of shape (2,)"),
        (lambda: Softmax(two), "weights = (2,)"),
        (lambda: LocalGaussians(two, two), "centre = (2,)"),
        (lambda: LocalGaussians(square, two), "log_width = (2,): must be of shape (2, 2)"),
        (lambda: LocalGaussians(square, square, np.ones(3)), "p_max = (3,)"),
        (lambda: LocalGaussians(square, square, 0.0), "p_max = 0.0: must be in (0, 1]"),
        (lambda: LocalGaussians(square, square, [0.5, 1.5]), "p_max = [0.5, 1.5]: must be in (0, 1]"),
        (lambda: LocalGaussians(square, square, np.nan), "p_max = nan"),
        (lambda: LocalGaussians(square, square, 1.0, (1.0, 1.0)), "log_width_limits = (1.0, 1.0)"),
        (lambda: FreeGaussians(square, square, one), "log_mass = (1,): must be of shape (2,)"),
        (lambda: Factored([]), "pools = (): must be at least one"),
        (lambda: Factored([Motoneurons(two, two), Hyperplanes(square, two)]), "pools = [1, 2]"),
        (lambda: Mirrored(Softmax(square), *SIDES), "pool = 'Softmax': must be a pool of binary units"),
        (lambda: Mirrored(policy_of("gated"), *SIDES), "pool = 'Gated': must be a pool of independent units"),
        (lambda: mirror_of(order=(0,)), "order = (0,): must be a permutation of the 3 inputs"),
        (
            lambda: mirror_of(order=(0, 1, 1)),
            "order = (0, 1, 1): must be a permutation of the 3 inputs, each of 0 to 2",
        ),
        (lambda: mirror_of(order=(0, 1, 1.5)), "order = (0, 1, 1.5): must be a permutation"),
        (lambda: mirror_of(order=(1, 2, 0)), "order = (1, 2, 0): must be pairs"),
        (lambda: mirror_of(signs=(1, 1)), "signs = (1, 1): must be 1 or -1 for each of the 3 inputs"),
        (lambda: mirror_of(signs=(1, 1, 0)), "signs = (1, 1, 0): must be 1 or -1"),
        (lambda: mirror_of(signs=(1, 1, np.nan)), "signs = (1, 1, nan): must be 1 or -1"),
        (lambda: mirror_of(signs=(1, -1, 1)), "signs = (1, -1, 1): must be the same for an input and its mirror"),
        (lambda: mirror_of(left=(0,)), "left = (0,): must be an output of each of 2 units"),
        (lambda: mirror_of(right=(1, 2, 3)), "right = (1, 2, 3): must be an output of each of 2 units"),
        (lambda: mirror_of(right=(0, 3)), "left, right = ((0, 1), (0, 3)): must be each of 0 to 3 once"),
        (lambda: mirror_of(right=(2, 4)), "left, right = ((0, 1), (2, 4)): must be each of 0 to 3 once"),
        (lambda: AdmissionThresholds(square), "threshold = (2, 2)"),
        (lambda: AdmissionThresholds(two, two), "steepness = (2,)"),
    ],
)
def test_wrong_shapes_and_values_are_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)


SIZES = {"primitives": (3, 6)}
"""Of those that one input will not do for."""


def shapes_of(start):
    """An initial policy as `jax.eval_shape` makes it."""
    return start if isinstance(start, policies.Policy) else eqx.filter_eval_shape(start, jax.random.key(0))


@pytest.mark.parametrize("name", INITIAL)
def test_initial_policies_fit_the_task(name):
    inputs, outputs = SIZES.get(name, (1, 4))
    mirror = SimpleNamespace(inputs=(0,), signs=(-1,), outputs=(1, 0, 3, 2))
    task = SimpleNamespace(observation_size=inputs, action_size=outputs, mirror=mirror)
    policy = shapes_of(initial(name, task))
    assert (policy.observation_size, policy.outputs) == (inputs, outputs)


@pytest.mark.parametrize("name", INITIAL)
def test_the_settings_of_an_initial_policy_are_stored_and_read(name):
    plain = INITIAL[name]()
    assert table(plain) == {"kind": name}  # which says nothing that goes without saying
    hidden = 4 if name == "recurrent" else [4]
    changed = {"units": 5, "hidden": hidden, "floor": 0.01, "width": 0.3, "cells": 7, "binary": 2, "explore": 0.2}
    changed |= {"features": {"kind": "map", "squares": True}, "copies": 2}
    given = {key: value for key, value in changed.items() if key in fields_of(INITIAL[name])}
    policy = as_hinted(InitialPolicy, {"kind": name, **given}, "policy")
    assert type(policy) is INITIAL[name]
    assert as_hinted(InitialPolicy, table(policy), "policy") == policy != plain


def test_an_initial_policy_without_a_task_says_what_is_missing():
    with pytest.raises(ValueError, match=r"policy = InitialHyperplanes\(\): must be bound to a task first"):
        INITIAL["hyperplanes"]()(jax.random.key(0))


@pytest.mark.parametrize("name", sorted(without_task()))
def test_initial_policies_can_be_made_from_sizes_alone(name):
    inputs, outputs = SIZES.get(name, (1, 4))
    policy = shapes_of(initial(name, inputs, units=outputs))
    assert (policy.observation_size, policy.outputs) == (inputs, outputs)


@pytest.mark.parametrize("name", ["hyperplanes", "softmax"])
def test_zero_weights_are_the_policy_of_most_entropy(name):
    policy = started(initial(name, 2, units=3))
    log_count = np.log(len(Compiled(policy).enumerate()))
    assert Compiled(policy).entropy(np.array([0.3, -7.0])) == pytest.approx(log_count, rel=1e-6)  # float32


@pytest.mark.parametrize("name", ["gaussians", "motoneurons"])
def test_random_initial_policies_are_functions_of_the_key(name):
    make = initial(name, 1, units=5)
    assert eqx.tree_equal(make(jax.random.key(1)), make(jax.random.key(1)))
    assert not eqx.tree_equal(make(jax.random.key(1)), make(jax.random.key(2)))


def test_motoneurons_start_with_gain_zero_and_thresholds_in_the_interval():
    policy = started(initial("motoneurons", 1, units=1000, low=2.0, high=10.0))
    np.testing.assert_array_equal(policy.gain, 0)
    threshold = np.asarray(policy.threshold)
    assert 2 <= threshold.min() < 2.2 < 9.8 < threshold.max() <= 10


def test_gaussians_start_with_their_width_and_height_and_centres_in_the_interval():
    policy = started(initial("gaussians", 2, units=500, width=0.2, p_max=0.5, low=0.0, high=3.0))
    np.testing.assert_allclose(np.exp(policy.log_width), 0.2, rtol=1e-6)
    np.testing.assert_array_equal(policy.p_max, 0.5)
    centre = np.asarray(policy.centre)
    assert 0 <= centre.min() < 0.1 < 2.9 < centre.max() <= 3


@pytest.mark.parametrize(
    ("places", "inputs", "rows"), [(9, 2, 3), (16, 2, 4), (8, 2, 3), (5, 1, 5), (8, 3, 2), (1, 2, 1)]
)
def test_tiles_are_spread_evenly_over_the_range(places, inputs, rows):
    policy = policies.tiles(inputs, places, low=-1.0, high=3.0, width=0.1)
    centre = np.asarray(policy.centre)
    assert len({tuple(row) for row in centre}) == places
    np.testing.assert_allclose(np.unique(centre[:, 0]), -1 + 4 * (np.arange(rows) + 0.5) / rows, rtol=1e-6)
    np.testing.assert_allclose(centre.mean(0), 1.0, atol=0.2)
    np.testing.assert_allclose(np.exp(policy.log_width), 0.4, rtol=1e-6)


def test_a_task_whose_size_cannot_be_told_says_why():
    class Broken:
        action_size = 2

        @property
        def observation_size(self):
            return self.body.sensors

    with pytest.raises(ValueError, match=r"task = .*: must be a task.*; 'Broken' object has no attribute 'body'"):
        initial("hyperplanes", Broken())


def test_tiles_take_the_range_of_the_task_and_share_places():
    task = SimpleNamespace(observation_size=2, action_size=5, observation_range=((0.0, 1.0), (-2.0, 2.0)))
    policy = initial("tiles", task, copies=2, p_max=0.5)
    np.testing.assert_allclose(policy.centre[::2], [[0.25, -1.0], [0.25, 1.0], [0.75, 0.0]])
    np.testing.assert_array_equal(policy.centre[0], policy.centre[1])
    np.testing.assert_allclose(np.exp(policy.log_width[0]), [0.16, 0.64], rtol=1e-6)
    assert policy.p_max == 0.5
    assert policies.tiles(2, 4).log_width_limits == (-4.0, 2.0)


@pytest.mark.parametrize("kind", [LocalGaussians, FreeGaussians])
def test_widths_are_put_back_within_their_limits(kind):
    third = 1.0 if kind is LocalGaussians else [0.0, 0.0]
    units = kind(np.zeros((2, 2)), np.array([[-5.0, 0.0], [1.0, 3.0]]), third, log_width_limits=(-4.0, 2.0))
    within = np.array([[-4.0, 0.0], [1.0, 2.0]])
    np.testing.assert_array_equal(abilities.limited(units).log_width, within)
    np.testing.assert_array_equal(
        abilities.limited(Factored([units, Hyperplanes(square, two)])).pools[0].log_width, within
    )
    free = kind(np.zeros((2, 2)), units.log_width, third)
    assert abilities.limited(free) is free
    shapes = rebuild(json.loads(json.dumps(describe(units))))
    assert shapes.log_width_limits == (-4.0, 2.0)


def test_an_unknown_initial_policy_is_refused_with_the_nearest():
    with pytest.raises(ValueError, match="unknown policy 'hyperplane': did you mean 'hyperplanes'"):
        initial("hyperplane", 2, units=1)


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: policies.hyperplanes(0, 2), "inputs = 0"),
        (lambda: policies.hyperplanes(2), "outputs = None"),
        (lambda: policies.softmax(2, 0), "units = 0"),
        (lambda: policies.motoneurons(2, 3), "inputs = 2: must be 1"),
        (lambda: policies.motoneurons(1, 3, low=1.0, high=1.0), "low, high = (1.0, 1.0)"),
        (lambda: policies.gaussians(2, 3, width=0.0), "width = 0.0"),
        (lambda: policies.gaussians(2, 3, low=1.0, high=0.0), "low, high = (1.0, 0.0)"),
        (lambda: policies.tiles(2, 3, copies=4), "copies = 4: must be from 1 to the 3 units"),
        (lambda: policies.tiles(2, 0), "units = 0"),
        (lambda: policies.tiles(2, 3, width=-0.1), "width = -0.1: must be a finite number above 0"),
        (lambda: policies.tiles(2, 3, p_max=0.0), "p_max = 0.0"),
        (lambda: policies.tiles(2, 3, low=2.0), "low, high = (2.0, None)"),
        (lambda: policies.tiles(2, 3, least_log_width=2.0), "least_log_width, most_log_width = (2.0, 2.0)"),
    ],
)
def test_impossible_initial_settings_are_refused_by_name(make, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        make()
    assert names in str(error.value)


@pytest.mark.representatives("gaussians", "hyperplanes", "primitives")
@pytest.mark.parametrize("name", sorted(without_task()))
def test_every_initial_policy_gives_examples_with_random_parameters(name):
    one, other = (split(from_initial(name, np.random.default_rng(seed))) for seed in (0, 1))
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one[0]), jax.tree.leaves(other[0]), strict=True):
        assert np.all(a != b)


def test_a_new_kind_of_policy_in_the_registry_is_tested_without_another_list(monkeypatch):
    class Steep(Hyperplanes):
        """A kind of units that no test names."""

    assert INITIAL.keys() >= KNOWN
    assert not unlisted(KNOWN)

    class InitialSteep(InitialPolicy):
        def start(self, task):
            return Steep(np.zeros((self.units, task)), np.zeros(self.units))

    monkeypatch.setitem(INITIAL, "steep", InitialSteep)
    assert without_task() - KNOWN == {"steep"}
    assert isinstance(unlisted(without_task() - KNOWN)["steep"](np.random.default_rng(0)), Steep)
