"""Eligibility filters against the sums that define them."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from motorgrad.learning import Agent, Episodic, Exponential, LaggedGaussian, Window, olgarb
from motorgrad.policies import Softmax
from motorgrad.tasks import ThreeState
from motorgrad.training import stepper_for

# name: (the filter, the weight it gives to a score from `age` decisions ago, an array)
TRACES = {
    "exponential": (Exponential(0.7), lambda age: 0.7**age),
    "exponential, no memory": (Exponential(0.0), lambda age: 1.0 * (age == 0)),
    "exponential, long": (Exponential(0.99), lambda age: 0.99**age),
    "episodic": (Episodic(), lambda age: np.ones(age.shape)),
    "window of one": (Window(1), lambda age: 1.0 * (age == 0)),
    "window": (Window(7), lambda age: 1.0 * (age < 7)),
    "window longer than life": (Window(100), lambda age: np.ones(age.shape)),
    # cut at the first whole age beyond four widths from the lag
    "lagged": (LaggedGaussian(5.0, 2.0), lambda age: np.exp(-0.5 * ((age - 5) / 2) ** 2) * (age <= 13)),
    "lagged, fractional": (LaggedGaussian(1.5, 0.6), lambda age: np.exp(-0.5 * ((age - 1.5) / 0.6) ** 2) * (age <= 4)),
    "lag of nothing": (LaggedGaussian(0.0, 1.0), lambda age: np.exp(-0.5 * age**2) * (age <= 4)),
}


@partial(jax.jit, static_argnums=0)
def run(trace, scores):
    """The eligibility after each of `scores`, a mapping of arrays whose leading axis is time."""

    def step(state, score):
        state = trace.update(state, score)
        return state, trace.value(state)

    like = {name: jnp.zeros(x.shape[1:], x.dtype) for name, x in scores.items()}
    return jax.lax.scan(step, trace.init(like), scores)[1]


@pytest.mark.ci
@pytest.mark.representatives("exponential", "episodic", "window longer than life")
@pytest.mark.parametrize("name", TRACES)
@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**31))
def test_eligibility_is_the_weighted_sum_of_past_scores_at_every_length(name, seed):
    trace, weight = TRACES[name]
    length = 30
    rng = np.random.default_rng(seed)
    scores = {"a": rng.normal(size=(length, 3)), "b": rng.normal(size=(length, 2, 2))}
    with jax.enable_x64(True):
        got = run(trace, jax.tree.map(jnp.asarray, scores))
        got = jax.tree.map(np.asarray, got)
    age = np.arange(length)[:, None] - np.arange(length)[None, :]
    weights = np.where(age >= 0, weight(np.maximum(age, 0)), 0.0)
    for key, values in scores.items():
        explicit = np.tensordot(weights, values, axes=1)
        # A recursion of at most 30 additions against a sum in one go. The kernels' weights are computed in double
        # precision under x64, so nothing worse than 1e-14 of a few units is lost.
        np.testing.assert_allclose(got[key], explicit, rtol=1e-12, atol=1e-12)


@pytest.mark.ci
@pytest.mark.representatives("exponential", "episodic", "window longer than life")
@pytest.mark.parametrize("name", TRACES)
def test_eligibility_has_the_parameters_structure_shape_and_type(name):
    trace, _ = TRACES[name]
    parameters = {"a": jnp.zeros(3), "b": (jnp.zeros((2, 2)),)}
    state = trace.update(trace.init(parameters), jax.tree.map(jnp.ones_like, parameters))
    value = trace.value(state)
    assert jax.tree.structure(value) == jax.tree.structure(parameters)
    for a, b in zip(jax.tree.leaves(value), jax.tree.leaves(parameters), strict=True):
        assert (a.shape, a.dtype) == (b.shape, b.dtype)


@pytest.mark.parametrize("name", TRACES)
def test_a_trace_begins_empty_and_zeros_are_its_beginning(name):
    # Learners restart a trace by zeroing its state, whatever it holds.
    trace, _ = TRACES[name]
    begin = trace.init({"a": jnp.ones(3)})
    for leaf in jax.tree.leaves((begin, trace.value(begin))):
        np.testing.assert_array_equal(leaf, 0)


def test_the_lagged_filter_credits_most_the_score_from_its_lag_ago():
    scores = {"a": jnp.zeros(20).at[3].set(1.0)}
    assert int(jnp.argmax(run(LaggedGaussian(6.0, 2.0), scores)["a"])) == 3 + 6


def test_the_lagged_filter_is_cut_where_its_weight_is_negligible():
    weights = np.asarray(LaggedGaussian(5.0, 2.0).weights())
    assert weights.max() == 1
    assert weights[-1] < 4e-4


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: Exponential(1.5), r"decay = 1.5: must be in \[0, 1\]"),
        (lambda: Exponential(-0.1), "decay = -0.1"),
        (lambda: Exponential(float("nan")), "decay = nan"),
        (lambda: Window(0), "length = 0"),
        (lambda: LaggedGaussian(-1.0), "lag = -1.0"),
        (lambda: LaggedGaussian(1.0, 0.0), "width = 0.0"),
        (lambda: LaggedGaussian("5"), r"lag = '5': must be in \[0, 100000\], in decisions"),
        (
            lambda: stepper_for(ThreeState(), Agent(Softmax([[1.0, 1.0], [-1.0, -1.0]]), olgarb(1.0)), [0]),
            r"estimator\.trace\.decay = 1: needs episodes",
        ),
    ],
)
def test_impossible_settings_are_refused_by_name(make, names):
    with pytest.raises(ValueError, match=names):
        make()
