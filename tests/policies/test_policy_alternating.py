"""Units that learn in turn: whose turn it is, that resting ones do not learn, and the gradient that they follow."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from policy_examples import policy_of

import motorgrad as mg
from motorgrad.policies import (
    Alternating,
    Factored,
    Hyperplanes,
    LocalGaussians,
    Motoneurons,
    abilities,
    alternating_motoneurons,
    trainable,
)
from motorgrad.worlds import immediate_gradient

POOL = Motoneurons([0.2, 0.5, 0.7], [3.0, -8.0, 5.0])
SEEN = jnp.array([0.6])
LOADS = np.linspace(0.05, 0.95, 10)[:, None]
WEIGHTS = np.full(10, 0.1)


def reward(load, action):
    return -jnp.square(jnp.sum(action) - 3 * load[0])


def rounds(policy, decisions):
    """Whose turn it is at each of so many decisions."""
    found = []
    for _ in range(decisions):
        found.append(np.flatnonzero(np.asarray(policy.learning)).tolist())
        policy = policy.adapted(SEEN)
    return found


def test_units_take_turns():
    assert rounds(Alternating(POOL, turns=2), 4) == [[0, 2], [1], [0, 2], [1]]
    assert rounds(Alternating(POOL, turns=3, hold=2), 7) == [[0], [0], [1], [1], [2], [2], [0]]
    assert rounds(Alternating(POOL, turns=1), 2) == [[0, 1, 2]] * 2


@pytest.mark.parametrize("rest", ["noisy", "quiet"])
def test_only_those_whose_turn_it_is_have_a_score(rest):
    mixed = Factored([Hyperplanes([[2.0], [1.0]], [0.1, 0.2]), LocalGaussians([[0.4]], [[0.3]], 0.7)])
    policy = Alternating(mixed, turns=3, clock=2, rest=rest)
    action = policy.mode(SEEN)
    planes, gaussian = abilities.blocks(policy, policy.score(SEEN, action))
    whole = abilities.blocks(mixed, mixed.score(SEEN, action))
    assert not np.any(planes)
    np.testing.assert_array_equal(gaussian, whole[1])
    matrices = abilities.fisher(policy, SEEN, action)
    assert [bool(np.any(each)) for each in matrices] == [False, True]


def test_resting_units_fire_as_ever_or_do_what_is_more_probable():
    noisy = Alternating(POOL, turns=3)
    quiet = Alternating(POOL, turns=3, rest="quiet")
    p = POOL.prob(SEEN)
    np.testing.assert_array_equal(noisy.prob(SEEN), p)
    np.testing.assert_allclose(quiet.prob(SEEN), [p[0], 0.0, 0.0])
    np.testing.assert_allclose(quiet.log_prob(SEEN, jnp.array([1.0, 0, 0])), np.log(p[0]), rtol=1e-6)
    assert quiet.log_prob(SEEN, jnp.array([1.0, 1, 0])) == -np.inf
    np.testing.assert_array_equal(quiet.sample(SEEN, jnp.array([0.9999, 0.0, 0.0]))[1:], [0, 0])
    assert quiet.entropy(SEEN) == pytest.approx(float(Motoneurons([0.2], [3.0]).entropy(SEEN)), rel=1e-5)


def gradients(rest):
    """The exact gradient of every turn, and the pool's."""
    turns = [Alternating(POOL, turns=3, clock=clock, rest=rest) for clock in range(3)]
    each = [immediate_gradient(policy, LOADS, WEIGHTS, reward).pool for policy in turns]
    return [ravel_pytree(each)[0] for each in (*each, immediate_gradient(POOL, LOADS, WEIGHTS, reward))]


def test_turns_of_noisy_units_add_up_to_the_true_gradient():
    *each, whole = gradients("noisy")
    np.testing.assert_allclose(sum(each), whole, rtol=1e-9)


def test_turns_of_quiet_units_do_not_add_up_to_the_true_gradient():
    *each, whole = gradients("quiet")
    found = sum(each)
    cosine = found @ whole / np.linalg.norm(found) / np.linalg.norm(whole)
    assert 0 < cosine < 0.99


@pytest.mark.parametrize("rest", ["noisy", "quiet"])
def test_a_learner_moves_the_turns_on_and_a_resting_unit_stays(rest):
    task = mg.make("linear-recruitment", units=3)
    policy = {"kind": "alternating-motoneurons", "turns": 3, "hold": 40, "rest": rest}
    run = mg.train(task, mg.agent_for(task, policy=policy, learning_rate=0.1), 40, 2, progress=False)
    before, after = trainable(run.initial.pool), trainable(run.policies.pool)
    moved = jax.tree.map(lambda x, y: np.asarray(x != y), before, after)
    np.testing.assert_array_equal(moved.gain, [[True, False, False]] * 2)
    assert not moved.threshold[:, 1:].any()
    np.testing.assert_array_equal(run.policies.clock, [40, 40])


def test_a_learner_that_returns_to_past_decisions_refuses_units_that_take_turns():
    task = mg.make("linear-recruitment", units=3)
    agent = mg.learning.ProximalPolicyOptimization(alternating_motoneurons(task))
    with pytest.raises(ValueError, match="policy = 'Alternating': must be one whose units learn all at once"):
        mg.train(task, agent, 40, 2, progress=False)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Alternating(POOL, turns=4), "turns = 4"),
        (lambda: Alternating(POOL, hold=0), "hold = 0"),
        (lambda: Alternating(POOL, rest="deep"), "rest"),  # type: ignore[arg-type]
        (lambda: Alternating(policy_of("gated")), "pool = 'Gated': must be a pool of independent units"),
        (lambda: Alternating(policy_of("mirrored")), "pool = 'Mirrored'"),
        (lambda: alternating_motoneurons(1, units=3, turns=0), "turns = 0"),
    ],
)
def test_what_makes_no_sense_is_refused(make, named):
    with pytest.raises(ValueError, match=named):
        make()
