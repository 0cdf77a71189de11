"""The experiments of chapter 7: each from end to end at its smoke size, and the parts that they share with no other."""

import numpy as np
import pytest

from motorgrad.worlds import chain, episodes, oracle
from motorgrad_thesis import EXPERIMENTS, reproduce
from motorgrad_thesis.chapter_7.section_7_3_bayesian_monte_carlo import WORLDS, estimates, sample

NAMES = ("sec-7.1-imitation", "sec-7.3-models", "sec-7.3-bayesian-monte-carlo", "sec-7.3-forgetting")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the log-likelihood of the decisions held out")  # few are demonstrated
@pytest.mark.parametrize("name", NAMES)
def test_each_leaves_a_figure_and_claims(name, tmp_path):
    found = reproduce(EXPERIMENTS[name].quick(), tmp_path, quick=True, progress=False)
    assert (found.folder / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert found.claims


def test_they_stand_in_the_order_of_the_source():
    around = ("sec-6.5.4-hopper", *NAMES, "fig-a.1")
    assert [name for name in EXPERIMENTS if name in around] == list(around)


def test_sampled_episodes_have_the_mean_return_and_the_fisher_matrix_of_the_oracle():
    make, policy_for, steps = WORLDS["walk of 4"]
    policy = policy_for(make())
    whole = episodes(chain(4), steps)
    drawn = sample(chain(4), policy, steps, 50, 100, np.random.default_rng(0))
    assert drawn.returns.mean() == pytest.approx(steps * oracle.average_reward(whole, policy), rel=0.05)
    fisher = steps * oracle.fisher(whole, policy)
    np.testing.assert_allclose(drawn.fisher.mean((0, 1)), fisher, atol=0.05)
    outer = np.einsum("rei,rej->ij", drawn.scores, drawn.scores) / 5000
    np.testing.assert_allclose(outer, fisher, atol=0.15)


def test_equal_returns_say_nothing():
    means, posteriors = estimates(np.ones(5), np.eye(5)[:, :2], np.eye(2), np.eye(2))
    assert set(means) == {"classical", "baseline", "integrand", "return", "visited"}
    assert np.all(means["return"] == 0)
    assert np.all(np.isinf(np.diag(posteriors["return"].covariance)))


@pytest.mark.parametrize(
    ("name", "setting", "named"),
    [
        ("sec-7.1-imitation", {"episodes": (3, 1)}, "episodes = "),
        ("sec-7.1-imitation", {"rounds": 3}, "rounds = 3"),
        ("sec-7.3-forgetting", {"lengths": (28, 12)}, "lengths = "),
        ("sec-7.3-forgetting", {"memory": 3}, "memory = 3"),
        ("sec-7.3-bayesian-monte-carlo", {"numbers": (20, 5)}, "numbers = "),
        ("sec-7.3-models", {"decisions": 10}, "decisions = 10"),
    ],
)
def test_impossible_settings_are_refused_by_name(name, setting, named):
    with pytest.raises(ValueError, match=named):
        EXPERIMENTS[name](**setting)
