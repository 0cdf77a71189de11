"""Motor primitives: a distribution over what begins and how it moves; only choices that count have scores."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import Compiled

from motorgrad.policies import (
    Factored,
    GradedHyperplanes,
    Hyperplanes,
    Primitives,
    abilities,
    describe,
    graded_hyperplanes,
    primitives,
    rebuild,
    trainable,
)

READY = np.array([1.0, 1.0, 0.3, -0.7, 0.2])
BUSY = np.array([0.0, 1.0, 0.3, -0.7, 0.2])


def policy_of(seed, each=2):
    """Two primitives with `each` movement parameters, over three inputs."""
    rng = np.random.default_rng(seed)
    when = Hyperplanes(rng.normal(size=(2, 3)), rng.normal(size=2))
    how = GradedHyperplanes(rng.normal(size=(2 * each, 3)), rng.normal(size=2 * each), rng.normal(size=2 * each) - 1)
    return Primitives(when, how)


def drawn(policy, y, count, seed=0):
    return Compiled(policy).samples(y, np.random.default_rng(seed).random((count, policy.uniforms)))


@pytest.mark.ci
def test_it_begins_as_its_preconditions_say_and_moves_as_its_movement_does():
    policy = policy_of(1)
    actions, p = drawn(policy, READY, 40_000), Compiled(policy).prob(READY)
    assert actions.shape[1] == policy.outputs == len(p) == 6
    np.testing.assert_allclose(actions[:, :2].mean(0), p[:2], atol=0.012)
    np.testing.assert_allclose(p[:2], Compiled(policy.precondition).prob(READY[2:]), rtol=1e-6)
    for primitive in range(2):
        begun = actions[:, primitive] == 1
        moves = actions[begun][:, 2 + 2 * primitive : 4 + 2 * primitive]
        error = np.asarray(policy.movement.deviation)[2 * primitive : 2 * primitive + 2] / np.sqrt(begun.sum())
        assert (np.abs(moves.mean(0) - p[2 + 2 * primitive : 4 + 2 * primitive]) < 5 * error).all()
        np.testing.assert_array_equal(actions[~begun][:, 2 + 2 * primitive : 4 + 2 * primitive], 0)


def test_what_cannot_begin_never_does_and_has_no_score():
    policy = policy_of(2)
    ask, actions = Compiled(policy), drawn(policy, BUSY, 2_000)
    assert not actions[:, 0].any()
    assert actions[:, 1].any()
    assert ask.prob(BUSY)[0] == ask.mode(BUSY)[0] == 0
    begun = actions[actions[:, 1] == 1][0]
    score = ask.score(BUSY, begun)
    for part in (score.precondition.weights, score.precondition.bias):
        np.testing.assert_array_equal(part[0], 0)
        assert np.abs(part[1]).max() > 0
    for part in (score.movement.weights, score.movement.bias, score.movement.log_deviation):
        np.testing.assert_array_equal(part[:2], 0)
        assert np.abs(part[2:]).max() > 0
    silent = ask.score(READY, np.zeros(6, np.float32))
    assert not any(np.abs(leaf).max() for leaf in jax.tree.leaves(silent.movement))
    assert np.abs(silent.precondition.bias).min() > 0


@pytest.mark.parametrize("observation", [READY, BUSY])
def test_what_begins_and_how_it_moves_make_up_a_distribution(observation):
    policy = policy_of(3, each=1)
    spots, step = np.linspace(-15, 15, 601, retstep=True)
    total = 0.0
    for begins in np.ndindex(2, 2):
        if begins[0] > observation[0]:
            continue
        # a parameter of what does not begin is 0, and counts once
        sides = [spots if begun else np.zeros(1) for begun in begins]
        moves = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
        actions = np.concatenate([np.broadcast_to(begins, moves.shape), moves], axis=1)
        log = Compiled(policy).over("log_prob", observation, actions)
        total += np.exp(log.astype(float)).sum() * step ** sum(begins)
    assert total == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("observation", [READY, BUSY])
def test_the_score_is_the_gradient_of_the_log_probability(seed, observation):
    with jax.enable_x64(True):
        policy = policy_of(seed)
        ask, actions = Compiled(policy), drawn(policy, observation, 6, seed)
        assert jax.tree.structure(ask.score(observation, actions[0])) == jax.tree.structure(trainable(policy))
        analytic, automatic = ask.scores(observation, actions), ask.derivatives(observation, actions)
    assert analytic.dtype == np.float64
    np.testing.assert_allclose(analytic, automatic, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("observation", [READY, BUSY])
def test_fisher_and_entropy_are_means_over_actions(observation):
    policy = policy_of(5)
    actions = drawn(policy, observation, 200_000, 3)
    exact = abilities.fisher(policy, observation, np.zeros(6))
    scores = jax.vmap(lambda action: abilities.blocks(policy, policy.score(observation, action)))(actions)
    for rows, matrix in zip(scores, exact, strict=True):
        sampled = jnp.einsum("nui,nuj->uij", rows, rows) / len(rows)
        scale = jnp.sqrt(jnp.einsum("uii,ujj->uij", matrix, matrix)) + 1e-6
        np.testing.assert_allclose(sampled / scale, matrix / scale, atol=0.06)
    surprise = -jax.vmap(lambda action: policy.log_prob(observation, action))(actions)
    error = float(surprise.std()) / np.sqrt(len(actions))
    assert abs(float(surprise.mean()) - float(policy.entropy(observation))) < 5 * error


def test_blocks_are_undone_and_a_stored_policy_is_rebuilt():
    policy = policy_of(2)
    gradient = Compiled(policy).score(READY, drawn(policy, READY, 1)[0])
    again = Compiled(policy).from_blocks(Compiled(policy).blocks(gradient))
    assert jax.tree.structure(again) == jax.tree.structure(trainable(policy))
    for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(gradient), strict=True):
        np.testing.assert_array_equal(a, b)
    shapes = rebuild(describe(policy))
    assert jax.tree.structure(shapes) == jax.tree.structure(policy)
    assert shapes.movement.weights.shape == (4, 3)


def test_the_first_policy_begins_half_of_the_times_and_moves_as_it_is_told():
    start = primitives(8, 6, count=2, deviation=0.25)
    np.testing.assert_allclose(Compiled(start).prob(np.ones(8)), [0.5, 0.5, 0, 0, 0, 0])
    np.testing.assert_allclose(start.movement.deviation, 0.25, rtol=1e-6)
    assert (start.inputs, start.outputs, start.actions) == (8, 6, "continuous")


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: primitives(8, 6, count=4), "count = 4: must be a divisor of 6"),
        (lambda: primitives(8, 6, count=6), "count = 6: must be a divisor of 6, below it"),
        (lambda: primitives(2, 6, count=2), "inputs = 2: must be more than the 2 flags"),
        (lambda: Primitives(policy_of(0).movement, policy_of(0).movement), "precondition = 'GradedHyperplanes'"),
        (lambda: Primitives(policy_of(0).precondition, policy_of(0).precondition), "movement = 'Hyperplanes'"),
        (
            lambda: Primitives(Factored([policy_of(0).precondition]), policy_of(0).movement),
            "precondition = 'Factored': must be",
        ),
        (
            lambda: Primitives(policy_of(0).precondition, graded_hyperplanes(3, 3)),
            "movement.outputs = 3: must be a multiple of the 2",
        ),
        (
            lambda: Primitives(policy_of(0).precondition, graded_hyperplanes(2, 4)),
            "movement.inputs = 2: must be 3",
        ),
        (lambda: abilities.enumerate(policy_of(0)), "Primitives: has infinitely many actions"),
    ],
)
def test_what_is_impossible_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
