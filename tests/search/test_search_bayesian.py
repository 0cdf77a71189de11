"""The Gaussian process against dense algebra in NumPy, the improvement against integrals, and what the search finds."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm
from search_examples import SPACE, needs_tinygp, noisy_sphere, sphere

from motorgrad.search import BayesianOptimisation, Boltzmann, Range, Space, Uniform, WithGradients, search
from motorgrad.search._bayesian import _standard
from motorgrad.search._methods import Method

pytestmark = needs_tinygp
RNG = np.random.default_rng(3)
PLACES, TESTED = RNG.random((6, 2)), RNG.random((5, 2))
PLACES[4] = PLACES[1]  # observed twice
TESTED[0] = PLACES[2]
SCORES, GRADIENTS = RNG.standard_normal(6), RNG.standard_normal((6, 2))
VARIANCES = RNG.uniform(0.01, 0.2, (6, 2))
LENGTHS, SIGNAL, NOISE = np.array([0.3, 0.7]), 1.3, 0.2


def matern(d):
    """Of a difference in length scales: the covariance, its gradient and minus its second derivatives."""
    r = np.sqrt(5 * d @ d)
    slope = -5 / 3 * (1 + r) * np.exp(-r) * d
    return (1 + r + r**2 / 3) * np.exp(-r), slope, 5 / 3 * np.exp(-r) * ((1 + r) * np.eye(2) - 5 * np.outer(d, d))


def squared_exponential(d):
    value = np.exp(-0.5 * d @ d)
    return value, -value * d, value * (np.eye(2) - np.outer(d, d))


DENSE = {"matern": matern, "squared-exponential": squared_exponential}


def dense(kernel, left, right):
    """The covariances of scores and derivatives at some places with those at others: 3 by 3 for each pair."""
    blocks = []
    for one in left:
        row = []
        for two in right:
            value, slope, bend = DENSE[kernel]((one - two) / LENGTHS)
            slope, bend = slope / LENGTHS, bend / np.outer(LENGTHS, LENGTHS)
            row.append(SIGNAL**2 * np.block([[np.array([[value]]), -slope[None]], [slope[:, None], bend]]))
        blocks.append(row)
    return np.block(blocks)


def closed_form(kernel, known):
    """Posterior mean and standard deviation at the tested places, and the marginal likelihood, by a dense solve."""
    used = np.concatenate([np.ones((6, 1), bool), known], axis=1).ravel()
    noise = np.concatenate([np.full((6, 1), NOISE**2), VARIANCES], axis=1).ravel()
    covariance = (dense(kernel, PLACES, PLACES) + np.diag(noise))[np.ix_(used, used)]
    values = np.concatenate([SCORES[:, None], GRADIENTS], axis=1).ravel()[used]
    cross = dense(kernel, TESTED, PLACES)[::3, used]
    variance = SIGNAL**2 - np.einsum("ij,ji->i", cross, np.linalg.solve(covariance, cross.T))
    likelihood = multivariate_normal(cov=covariance).logpdf(values)
    return cross @ np.linalg.solve(covariance, values), np.sqrt(variance), likelihood


@pytest.mark.ci
@pytest.mark.representatives("some-matern")
@pytest.mark.parametrize("kernel", DENSE)
@pytest.mark.parametrize("gradients", ["none", "some"])
def test_the_posterior_is_that_of_a_dense_solve(kernel, gradients):
    """With places observed twice, noise of each derivative, and derivatives that are missing."""
    import jax

    from motorgrad.search._gaussian_process import Data, Posterior, process_of

    known = np.full((6, 2), gradients == "some")
    known[3, 0] = False
    mean, deviation, likelihood = closed_form(kernel, known)
    settings = np.log([*LENGTHS, SIGNAL, NOISE])
    data = Data.of(PLACES, SCORES, np.where(known, GRADIENTS, np.nan), VARIANCES, capacity=8)
    found = Posterior(kernel, settings, data)(TESTED)
    np.testing.assert_allclose(found[0], mean, atol=1e-6)
    np.testing.assert_allclose(found[1], deviation, atol=1e-6)
    with jax.enable_x64(True):
        likelihood_of = jax.jit(lambda data: process_of(kernel, settings, data).log_probability(data.values))
        exact = float(likelihood_of(data))
    empty = (len(data.values) - len(PLACES) - known.sum()) * norm.logpdf(0.0)
    assert exact - empty == pytest.approx(likelihood, rel=1e-6)  # JITTER moves it


@pytest.mark.ci
def test_without_noise_the_mean_has_the_observed_scores_and_gradients():
    method = BayesianOptimisation(noise=(1e-6, 1e-6), lengths=(0.2, 1.0))
    places = np.random.default_rng(0).random((6, 2))
    slopes = np.stack([np.cos(3 * places[:, 0]) * 3, -2 * places[:, 1]], axis=1)
    scores = np.sin(3 * places[:, 0]) - places[:, 1] ** 2
    state = method.tell(method.begin(np.full(2, 0.5)), places, scores)
    state = method.tell_gradients(state, places, slopes, np.zeros_like(slopes))
    np.testing.assert_allclose(method.posterior(state, places)[0], scores, atol=1e-4)
    step = 1e-3 * np.eye(2)
    ahead, behind = (method.posterior(state, places[:, None] + sign * step)[0] for sign in (1, -1))
    np.testing.assert_allclose((ahead - behind) / 2e-3, slopes, atol=1e-2)


def test_equal_scores_have_the_deviation_1():
    assert _standard(np.array([0.1, np.nan, 0.1, 0.1])) == (pytest.approx(0.1), 1.0)
    assert _standard(np.array([1.0, 3.0])) == (2.0, 1.0)
    assert _standard(np.array([1.0, 5.0])) == (3.0, 2.0)


def test_the_expected_improvement_is_that_of_numerical_integration():
    """Also where it is too small for a floating-point number."""
    import jax

    from motorgrad.search._acquisition import log_expected_improvement

    improvement = jax.jit(log_expected_improvement)
    for mean, deviation, best in ((0.3, 1.2, 0.1), (5.0, 1.0, 0.0), (0.0, 1.0, 1.0), (0.0, 1.0, 3.0), (0.0, 0.5, 20.0)):
        z = (mean - best) / deviation
        rest = quad(lambda t, z=z: t * np.exp(z * t - 0.5 * t * t), 0.0, 40.0 / max(1.0, -z))[0]
        with jax.enable_x64(True):
            found = float(improvement(*map(np.float64, (mean, deviation, best))))
        assert found == pytest.approx(np.log(deviation * rest) + norm.logpdf(z), abs=1e-5)


def with_gradients(candidates, random, noise=0.0):
    """The sphere, whose gradient is known, in the order in which the candidates name their numbers."""
    rows = np.array([list(each.values()) for each in candidates])
    gradients = -2 * (rows - 1) + noise * random.standard_normal(rows.shape)
    return WithGradients(sphere(candidates, random), gradients, np.full(rows.shape, noise**2))


SMALL = Space({name: SPACE.ranges[name] for name in "ab"})


def found(method, score, evaluations, seed=0, **more):
    return search(score, SMALL, method, evaluations=evaluations, seed=seed, progress=False, **more)


@pytest.mark.ci
def test_scores_lead_to_the_optimum_and_gradients_lead_there_sooner():
    plain = found(BayesianOptimisation(), sphere, 24)
    assert plain.curve[-1] > max(-0.1, found(Uniform(), sphere, 120).curve[-1])
    for noise in (0.0, 1.0):
        told = found(BayesianOptimisation(), lambda *given, noise=noise: with_gradients(*given, noise), 12)
        assert told.curve[-1] > max(-0.5, plain.curve[11])


@pytest.mark.ci
@pytest.mark.parametrize(
    "method",
    [BayesianOptimisation(acquisition="upper-confidence-bound"), BayesianOptimisation(kernel="squared-exponential")],
    ids=["upper-confidence-bound", "squared-exponential"],
)
def test_other_acquisitions_and_kernels_find_it_too(method):
    best = found(method, noisy_sphere, 28).best
    assert sphere([best], None)[0] > -1.0


@pytest.mark.ci
def test_candidates_of_a_round_differ():
    """Each is found as if the ones before had their expected scores; the first of all is the start."""
    result = found(BayesianOptimisation(initial=4), sphere, 8)
    np.testing.assert_allclose(result.candidates[0], SMALL.numbers(SMALL.start))
    for places in SMALL.places(result.candidates).reshape(2, 4, 2):
        apart = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(4, 1)]
        assert apart.min() > 0.01


@pytest.mark.ci
def test_a_search_with_gradients_goes_on_bit_for_bit(tmp_path):
    def noisy(*given):
        return with_gradients(*given, noise=1.0)

    file = tmp_path / "search.npz"
    found(BayesianOptimisation(), noisy, 12, out=file)
    resumed = found(BayesianOptimisation(), noisy, 16, out=file)
    np.testing.assert_array_equal(resumed.candidates, found(BayesianOptimisation(), noisy, 16).candidates)


def test_other_methods_do_not_notice_gradients():
    one, other = (found(Boltzmann(), score, 36) for score in (with_gradients, sphere))
    np.testing.assert_array_equal(one.candidates, other.candidates)


def test_gradients_are_told_by_the_places_and_without_those_of_failures():
    space = Space({"a": Range(-1.0, 3.0), "b": Range(0.1, 10.0, log=True)})
    places = np.random.default_rng(0).random((2, 2))
    told = []

    class Listens(Uniform):
        def ask(self, state, random) -> tuple:
            return places, state

        def tell_gradients(self, state, candidates, gradients, variances):
            told.extend([gradients, variances])
            return Method.tell_gradients(self, state, candidates, gradients, variances)

    def score(candidates, random):
        numbers = np.array([list(each.values()) for each in candidates])
        scores = np.where([True, False], numbers.prod(axis=1), np.nan)
        return WithGradients(scores, numbers[:, ::-1], np.full((2, 2), 0.25))

    search(score, space, Listens(candidates=2), evaluations=2, progress=False)
    gradients, variances = told
    step = 1e-6 * np.eye(2)
    exact = (space.numbers(places[0] + step).prod(axis=1) - space.numbers(places[0] - step).prod(axis=1)) / 2e-6
    np.testing.assert_allclose(gradients[0], exact, rtol=1e-6)
    slopes = exact / space.numbers(places[0])[::-1]
    np.testing.assert_allclose(variances[0], 0.25 * slopes**2, rtol=1e-6)
    assert np.isnan([gradients[1], variances[1]]).all()


@pytest.mark.parametrize(
    ("gradients", "variances", "message"),
    [
        (np.zeros((4, 1)), np.zeros((4, 2)), r"gradients.shape = \(4, 1\): must be \(4, 2\), a row for each candidate"),
        (np.zeros((4, 2)), np.zeros(4), r"variances.shape = \(4,\): must be \(4, 2\), a row for each candidate"),
        (np.zeros((4, 2)), np.full((4, 2), -1.0), r"variances = .*: must be finite and at least 0 where a gradient is"),
    ],
)
def test_wrong_gradients_are_refused_by_name(gradients, variances, message):
    with pytest.raises(ValueError, match=message):
        found(BayesianOptimisation(), lambda *given: WithGradients(sphere(*given), gradients, variances), 4)
    with pytest.raises(ValueError, match="scores of the state = 0: must be at least two"):
        BayesianOptimisation().posterior(BayesianOptimisation().begin(np.zeros(2)), np.zeros(2))
