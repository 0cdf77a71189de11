"""Imitation: the likelihood against closed forms, what is copied, what is refused, and what is said."""

import jax
import numpy as np
import pytest
import scipy.optimize
from jax.flatten_util import ravel_pytree

import motorgrad.learning._imitation as room
from motorgrad.learning import Demonstrations, imitate
from motorgrad.policies import (
    Autoregressive,
    BoundedHyperplanes,
    GradedHyperplanes,
    Hyperplanes,
    Layered,
    Mixed,
    Mosaic,
    MultilayerPerceptron,
    Recurrent,
    Softmax,
    abilities,
    initial,
    split,
    trainable,
)

DEMONSTRATOR = Hyperplanes([[2.0, -1.0], [0.5, 1.5]], [0.3, -0.8])


def zero(units=2, inputs=2):
    return Hyperplanes(np.zeros((units, inputs)), np.zeros(units))


def shown_by(policy, decisions=2000, episodes=20, seed=0):
    """What a policy without a memory does at random observations."""
    seen = np.random.default_rng(seed).normal(size=(decisions, policy.inputs))
    numbers = np.arange(decisions) * episodes // decisions
    return Demonstrations(seen, np.zeros((decisions, 1)), numbers).answered_by(policy, seed)


def acted_by(policy, episodes=30, length=40, seed=0):
    """What a policy with a memory does at random observations; episodes differ in length."""
    rng = np.random.default_rng(seed)
    decide = jax.jit(lambda memory, y, u: _decided(policy, memory, y, u))
    rows = []
    for number in range(episodes):
        memory = abilities.initial_memory(policy)
        for _ in range(length - number % 3):
            shown = rng.normal(size=policy.observation_size)
            memory, action = decide(memory, shown, rng.uniform(size=policy.uniforms))
            rows.append((shown, action, number))
    return Demonstrations(*(np.array(each) for each in zip(*rows, strict=True)))


def _decided(policy, memory, shown, uniforms):
    seen = abilities.observation_with_memory(policy, memory, shown)
    action = policy.sample(seen, uniforms)
    return abilities.remember(policy, seen, action), action


def gradient(policy, rows):
    parameters, rest = split(policy)
    likelihood = lambda each: room._log_likelihood(room.eqx.combine(each, rest), rows)  # noqa: E731
    return ravel_pytree(jax.grad(likelihood)(parameters))[0]


def test_the_gradient_of_a_unit_is_that_of_logistic_regression_and_the_sum_of_scores():
    with jax.enable_x64(True):
        unit = Hyperplanes([[0.4, -0.7]], [0.2])
        shown = shown_by(Hyperplanes([[2.0, -1.0]], [0.3]), 50)
        rows = room._sequences(shown.by_episode(), False)
        potential = shown.observations @ [0.4, -0.7] + 0.2
        missing = shown.actions[:, 0] - 1 / (1 + np.exp(-potential))
        closed = np.append(missing @ shown.observations, missing.sum())
        found = np.asarray(gradient(unit, rows))
        np.testing.assert_allclose(found, closed, rtol=1e-9)
        scores = jax.vmap(lambda y, a: ravel_pytree(unit.score(y, a))[0])(shown.observations, shown.actions)
        np.testing.assert_allclose(found, np.sum(scores, axis=0), rtol=1e-9)


def test_the_fit_is_that_of_logistic_regression():
    shown = shown_by(Hyperplanes([[2.0, -1.0]], [0.3]), 1000)
    found = imitate(zero(1), shown, batch=1000, patience=50, held_out=0.2, seed=3)
    order = np.random.default_rng(3).permutation(20)
    taught = np.isin(shown.episodes, order[4:])
    x = np.column_stack([shown.observations, np.ones(len(shown))])[taught]
    done = shown.actions[taught, 0]

    def loss(weights):
        return np.mean(np.logaddexp(0, x @ weights) - done * (x @ weights))

    wanted = scipy.optimize.minimize(loss, np.zeros(3)).x
    # the likelihood of what is held out ends it a little before, or it is as flat as a rise that counts
    reached = np.append(found.policy.weights, found.policy.bias)
    assert loss(reached) == pytest.approx(loss(wanted), abs=1e-3)
    np.testing.assert_allclose(reached, wanted, atol=0.15)


EXAMPLES = {
    "binary": (DEMONSTRATOR, zero()),
    "softmax": (Softmax([[1.0, -1.0], [0.0, 2.0], [-1.0, 0.5]]), Softmax(np.zeros((3, 2)))),
    "graded": (
        GradedHyperplanes([[1.0, -0.5]], [0.3], [-1.0]),
        GradedHyperplanes([[0.0, 0.0]], [0.0], [0.0]),
    ),
    "bounded": (
        BoundedHyperplanes([[1.0, -0.5]], [0.3], [-1.0], low=0.0, high=2.0),
        BoundedHyperplanes([[0.0, 0.0]], [0.0], [0.0], low=0.0, high=2.0),
    ),
    "network": (DEMONSTRATOR, None),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_with_enough_decisions_the_clone_has_the_probabilities_of_its_demonstrator(name):
    demonstrator, start = EXAMPLES[name]
    if start is None:
        layers = MultilayerPerceptron(hidden=(16,), standardise=True)
        start = initial("hyperplanes", 2, units=2, network=layers)(jax.random.key(0))
    found = imitate(start, shown_by(demonstrator, 4000, 40), rate=0.03)
    new = np.random.default_rng(9).normal(size=(200, 2))
    wanted, copied = (np.asarray(jax.vmap(policy.prob)(new)) for policy in (demonstrator, found.policy))
    assert np.abs(copied - wanted).mean() < 0.04
    assert found.curve[found.best] == found.curve.max()
    assert len(found.curve) > found.best > 0


def test_a_memory_is_fitted_along_whole_episodes():
    output = Hyperplanes([[0.0, 4.0]], [0.0])
    demonstrator = Recurrent([-2.0], [[2.0]], [0.0], output)
    shown = acted_by(demonstrator)
    start = Recurrent([-2.0], [[1.0]], [0.0], Hyperplanes([[0.1, 0.1]], [0.0]))
    found = imitate(start, shown, rate=0.03, passes=80)
    alone = imitate(zero(1, 1), shown)
    assert found.curve[found.best] > alone.curve[alone.best] + 0.05
    rows = room._sequences(shown.by_episode(), True)
    assert rows.made.sum() == len(shown)
    by_hand = 0.0
    log_prob = jax.jit(lambda policy, memory, y, a: _likely(policy, memory, y, a))
    for seen, done in shown.by_episode()[:3]:
        memory = abilities.initial_memory(start)
        for observation, action in zip(seen, done, strict=True):
            memory, log = log_prob(start, memory, observation, action)
            by_hand += float(log)
    some = room._Sequences(*(each[:3] for each in rows))
    assert float(room._log_likelihood(start, some)) == pytest.approx(by_hand, rel=1e-4)


def _likely(policy, memory, shown, action):
    seen = abilities.observation_with_memory(policy, memory, shown)
    return abilities.remember(policy, seen, action), policy.log_prob(seen, action)


def test_noise_that_lasts_is_fitted_too():
    units = GradedHyperplanes([[1.0]], [0.5], [-1.0])
    shown = acted_by(Autoregressive(units, 0.8), 40, 60)
    start = Autoregressive(GradedHyperplanes([[0.0]], [0.0], [0.0]), 0.8)
    found = imitate(start, shown, rate=0.03).policy
    np.testing.assert_allclose(found.policy.weights, [[1.0]], atol=0.1)
    np.testing.assert_allclose(found.policy.deviation, units.deviation, atol=0.03)


def test_batches_make_every_decision_once_and_the_seed_decides():
    rows = room._sequences(shown_by(DEMONSTRATOR, 10, 1).by_episode(), False)
    parts = list(rows.batches(np.random.default_rng(0).permutation(10), 4))
    assert [int(part.made.sum()) for part in parts] == [4, 4, 2]
    seen = np.concatenate([part.observations[part.made] for part in parts])
    np.testing.assert_array_equal(np.sort(seen, axis=0), np.sort(rows.observations[:, 0], axis=0))
    shown = shown_by(DEMONSTRATOR, 200)
    with pytest.warns(UserWarning, match="still rose"):
        first, again, other = (imitate(zero(), shown, passes=3, seed=seed).policy.weights for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0


def test_what_is_held_out_is_whole_episodes_or_the_end_of_the_only_one():
    shown = shown_by(DEMONSTRATOR, 100, 10)
    numbered = Demonstrations(shown.episodes[:, None] + 0.0 * shown.observations, shown.actions, shown.episodes)
    taught, judged = room._parted(numbered, 0.3, False, np.random.default_rng(0))
    episodes = [set(part.observations[:, 0, 0].tolist()) for part in (taught, judged)]
    assert [len(each) for each in episodes] == [7, 3]
    assert not episodes[0] & episodes[1]
    _, judged = room._parted(Demonstrations(shown.observations, shown.actions), 0.2, False, np.random.default_rng(0))
    np.testing.assert_array_equal(judged.observations[:, 0], shown.observations[80:])


def test_demonstrations_are_joined_and_answered_by_another():
    one = shown_by(DEMONSTRATOR, 6, 2)
    both = one + one
    assert [len(each) for each, _ in both.by_episode()] == [3, 3, 3, 3]
    asked = one.answered_by(Hyperplanes(np.zeros((2, 2)), [100.0, -100.0]))
    np.testing.assert_array_equal(asked.actions, np.tile([1.0, 0.0], (6, 1)))
    np.testing.assert_array_equal(asked.observations, one.observations)
    assert repr(both) == "Demonstrations(12 decisions of 4 episodes)"
    with pytest.raises(ValueError, match="the same in both"):
        one + shown_by(Softmax(np.zeros((2, 2))), 5)


LOOKS = np.zeros((4, 2))
BOUNDED = BoundedHyperplanes(np.zeros((2, 2)), [0.0, 0.0], [0.0, 0.0], low=[0.0, -1.0], high=1.0)


@pytest.mark.parametrize(
    ("policy", "actions", "named"),
    [
        (zero(), np.full((4, 2), 0.5), r"actions\[0\] = \[0.5, 0.5\]: must be zeros and ones"),
        (zero(), np.zeros((4, 3)), r"actions.shape = \(4, 3\): must be \(decisions, 2\)"),
        (zero(), np.zeros(4), "actions.shape"),
        (zero(2, 3), np.zeros((4, 2)), "size of an observation = 2: must be 3"),
        (Softmax(np.zeros((3, 2))), [0, 1, 2, 3], r"actions\[3\] = 3: must be from 0 to 2"),
        (Softmax(np.zeros((3, 2))), np.zeros((4, 1)), "actions.shape"),
        (BOUNDED, [[0.5, -1], [0, 0], [-0.1, 0], [0, 0]], r"actions\[2\] = \[-0.1, 0.0\]: must be from \[0.0, -1.0\]"),
        (Autoregressive(BOUNDED), [[0.5, 2]] * 4, r"actions\[0\] = \[0.5, 2.0\]: must be from"),
        (Mixed([zero(1), BOUNDED]), [[0.5, 0.5, 0]] * 4, "must be zeros and ones"),
        (Mixed([zero(1), BOUNDED]), [[1, 0.5, 2]] * 4, "must be from"),
        (Layered([zero(2)], zero(1)), np.zeros((4, 1)), "policy = 'Layered': must be one without hidden units"),
        (Mosaic(zero(1, 6), np.zeros((2, 2, 4)), 0.5, 0.1), np.zeros((4, 1)), "'Mosaic': must be without a memory"),
        (Recurrent([0.0], [[0.0, 0.0]], [0.0], zero(1, 3)), np.zeros((4, 1)), "must be two episodes or more"),
    ],
)
def test_what_a_policy_cannot_imitate_is_refused_by_name(policy, actions, named):
    with pytest.raises(ValueError, match=named):
        imitate(policy, Demonstrations(LOOKS, np.array(actions)))


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"observations": np.zeros(4)}, "observations.shape"),
        ({"observations": np.zeros((0, 2))}, "at least one"),
        ({"actions": np.zeros((3, 2))}, "of the same length"),
        ({"episodes": np.array([0, 1, 0, 0])}, "each stands in one place only"),
        ({"observations": np.array([[0, 0], [0, np.nan], [0, 0], [0, 0]])}, r"observations\[1\] .*finite numbers"),
        ({"actions": np.array([0, 1, 0.5, 0])}, r"actions\[2\] = .*0.5.* whole number"),
        ({"actions": np.array([[0, 0], [0, 0], [np.inf, 0], [0, 0]])}, r"actions\[2\] .*finite numbers"),
    ],
)
def test_impossible_demonstrations_are_refused_by_name(given, named):
    with pytest.raises(ValueError, match=named):
        Demonstrations(**{"observations": LOOKS, "actions": np.zeros((4, 2)), **given})


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"rate": 0.0}, "rate = 0.0"),
        ({"batch": 0}, "batch = 0"),
        ({"passes": 0}, "passes = 0"),
        ({"held_out": 1.0}, "held_out = 1.0"),
        ({"demonstrations": LOOKS}, "demonstrations = "),
        ({"policy": "hyperplanes"}, "policy = 'hyperplanes'"),
        ({"demonstrations": Demonstrations(LOOKS[:1], LOOKS[:1])}, "two decisions or more"),
    ],
)
def test_impossible_settings_are_refused_by_name(given, named):
    given = {"policy": zero(), "demonstrations": Demonstrations(LOOKS, LOOKS), **given}
    with pytest.raises(ValueError, match=named):
        imitate(given.pop("policy"), given.pop("demonstrations"), **given)


def test_nothing_is_silent():
    shown = shown_by(DEMONSTRATOR, 400)
    with pytest.warns(UserWarning, match="still rose when all 2 passes"):
        imitate(zero(), shown, passes=2)
    noise = Demonstrations(shown.observations, shown_by(zero(), 400, seed=5).actions, shown.episodes)
    with pytest.warns(UserWarning, match="never rose above -1.386 by 0.0001 or more"):
        found = imitate(zero(), noise, rate=0.3)
    assert found.best == 0
    assert len(found.curve) == 11  # patience
    np.testing.assert_array_equal(found.policy.weights, 0)
    with pytest.warns(UserWarning, match="is nan after pass 1: fitting ends, with the policy of pass 0"):
        imitate(zero(), shown, rate=3e38)


def test_only_parameters_change_and_within_their_limits():
    start = initial("tiles", 2, units=4, most_log_width=-1.0)
    shown = shown_by(Hyperplanes(np.zeros((4, 2)), [9.0, 9.0, -9.0, -9.0]), 400)
    with pytest.warns(UserWarning, match="still rose"):
        found = imitate(start, shown, rate=0.5, passes=20).policy
    np.testing.assert_array_equal(found.p_max, start.p_max)
    assert np.asarray(found.log_width).max() == -1.0
    assert np.abs(np.asarray(found.centre) - np.asarray(start.centre)).max() > 0.1
    assert jax.tree.structure(trainable(found)) == jax.tree.structure(trainable(start))
