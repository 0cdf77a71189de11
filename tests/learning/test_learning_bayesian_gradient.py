"""The posterior of a gradient: against dense Gaussian processes, sums over all episodes, and the exact gradient."""

import itertools

import numpy as np
import pytest

import motorgrad.learning._bayesian_gradient as room
from motorgrad.learning import bayesian_gradient
from motorgrad.policies import Softmax
from motorgrad.worlds import episodes, oracle, three_state

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])
STEPS = 3


def all_episodes():
    """Chance, return and score of every episode of three decisions in the three-state world."""
    world = three_state()
    chances = oracle.action_probabilities(world, POINT)
    found = []
    for draws in itertools.product(range(2), range(3), repeat=STEPS):
        state, chance, earned, score = world.start, 1.0, 0.0, np.zeros((2, 2))
        for action, after in zip(draws[::2], draws[1::2], strict=True):
            chance *= chances[state, action] * world.transitions[action, state, after]
            score = score + (np.eye(2)[action] - chances[state])[:, None] * world.observations[state]
            earned += world.rewards[after]
            state = after
        if chance > 0:
            found.append((chance, earned, score.ravel()))
    chance, earned, score = (np.array(each) for each in zip(*found, strict=True))
    return chance, earned, score


def exact():
    world = episodes(three_state(), STEPS)
    gradient = STEPS * oracle.flat(oracle.gradient(world, POINT))
    return gradient, STEPS * oracle.fisher(world, POINT)


def sampled(count, seed=0):
    chance, earned, score = all_episodes()
    drawn = np.random.default_rng(seed).choice(len(chance), count, p=chance / chance.sum())
    return earned[drawn], score[drawn]


def test_episodes_have_the_gradient_and_the_fisher_matrix_of_the_sum_over_all_of_them():
    chance, earned, score = all_episodes()
    gradient, fisher = exact()
    assert chance.sum() == pytest.approx(1)
    assert STEPS * oracle.average_reward(episodes(three_state(), STEPS), POINT) == pytest.approx(chance @ earned)
    np.testing.assert_allclose(gradient, (chance * earned) @ score, atol=1e-6)
    np.testing.assert_allclose(fisher, (score.T * chance) @ score, atol=1e-6)
    with pytest.raises(ValueError, match="steps = 0"):
        episodes(three_state(), 0)


@pytest.mark.parametrize("of", ["return", "integrand"])
def test_it_is_the_integral_of_a_dense_process(of, monkeypatch):
    """The kernel's integrals as sums over all episodes, and the constant as a kernel of a great variance."""
    share = 0.6
    monkeypatch.setattr(room, "SHARES", np.array([share]))
    returns, scores = sampled(9)
    fisher = exact()[1]
    inverse = np.linalg.pinv(fisher, rcond=1e-10, hermitian=True)
    chance, _, score = all_episodes()
    found = bayesian_gradient(returns, scores, fisher, of)
    seen = scores @ inverse @ scores.T
    if of == "return":
        signal = share * returns.var(ddof=1) / 2  # of two dimensions
        process = 1e6 + signal * seen + (1 - share) * returns.var(ddof=1) * np.eye(9)
        across = signal * (score.T * chance) @ (score @ inverse @ scores.T)  # the integral of u k(ξ, ξᵢ)
        whole = signal * (score.T * chance) @ (score @ inverse @ score.T) @ (score.T * chance).T
        mean = across @ np.linalg.solve(process, returns)
        covariance = whole - across @ np.linalg.solve(process, across.T)
    else:
        values = returns[:, None] * scores
        variance = np.sum(inverse * (values.T @ values)) / (9 * 2)  # in coordinates in which the matrix is the identity
        signal = share * variance / np.mean((1 + np.diag(seen)) ** 2)
        process = signal * (1 + seen) ** 2 + (1 - share) * variance * np.eye(9)
        across = signal * chance @ (1 + score @ inverse @ scores.T) ** 2
        whole = signal * chance @ (1 + score @ inverse @ score.T) ** 2 @ chance
        mean = across @ np.linalg.solve(process, values)
        covariance = (whole - across @ np.linalg.solve(process, across)) * fisher
    np.testing.assert_allclose(found.mean, mean, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("of", ["return", "integrand"])
def test_it_tends_to_the_exact_gradient_and_knows_how_far_away_it_is(of):
    gradient, fisher = exact()
    length = np.linalg.norm(gradient)
    for count, most in ((20, 1.0), (500, 0.25)):
        posteriors = [bayesian_gradient(*sampled(count, seed), fisher, of) for seed in range(30)]
        errors = [np.sum((each.mean - gradient) ** 2) for each in posteriors]
        assert np.sqrt(np.mean(errors)) < most * length
        expected = np.mean([np.trace(each.covariance) for each in posteriors])
        assert 0.3 < expected / np.mean(errors) < 2.5


def test_other_coordinates_give_the_same_gradient_in_them():
    returns, scores = sampled(12)
    fisher = exact()[1]
    turn = np.random.default_rng(0).normal(size=(4, 4))
    one = bayesian_gradient(returns, scores, fisher)
    other = bayesian_gradient(returns, scores @ turn, turn.T @ fisher @ turn)
    np.testing.assert_allclose(other.mean, one.mean @ turn, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose(other.covariance, turn.T @ one.covariance @ turn, rtol=1e-5, atol=1e-8)


def test_a_constant_in_the_return_changes_nothing():
    returns, scores = sampled(12)
    fisher = exact()[1]
    np.testing.assert_allclose(
        bayesian_gradient(returns + 100.0, scores, fisher).mean, bayesian_gradient(returns, scores, fisher).mean
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"of": "reward"}, "unknown of 'reward': .*known are integrand, return"),
        ({"scores": np.ones((2, 2))}, r"scores.shape = \(2, 2\)"),
        ({"returns": np.arange(4.0)}, r"returns.shape = \(4,\): must be \(5,\)"),
        ({"returns": np.ones(5)}, "returns = 1.0: must be not all the same"),
        ({"returns": np.array([0, 1, 2, 3, np.nan])}, "returns = .*: must be finite numbers"),
        ({"fisher": np.eye(3)}, r"fisher.shape = \(3, 3\): must be \(2, 2\)"),
        ({"fisher": np.array([[1.0, 1.0], [0.0, 1.0]])}, "fisher = .*: must be symmetric"),
        ({"fisher": np.diag([1.0, -1.0])}, "fisher = .*: must be of eigenvalues of at least 0"),
        ({"fisher": np.diag([1.0, 0.0])}, "scores outside the range of fisher = .*: must be 0"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(changes, message):
    given = {"returns": np.arange(5.0), "scores": np.random.default_rng(0).normal(size=(5, 2)), "fisher": np.eye(2)}
    with pytest.raises(ValueError, match=message):
        bayesian_gradient(**given | changes)
