"""The pair of probability and score that the thesis prints for local units: its bias, and where it is refused."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import Agent, ProximalPolicyOptimization, check_scores, olgarb
from motorgrad.policies import LocalGaussians, Masked, PrintedGaussians, abilities, tiles
from motorgrad.policies._grow_and_prune import growing

CENTRE, LOG_WIDTH, P_MAX = [[0.3, -0.2], [0.1, 0.4]], [[-0.7, 0.2], [0.1, -0.3]], [0.9, 0.6]
SEEN = [0.5, 0.1]
PAYS = np.array([0.3, -1.0, 2.0, 0.7])  # for each action of two units


def objective(unit, log_height):
    raised = eqx.tree_at(lambda each: each.p_max, unit, unit.p_max * jnp.exp(log_height))
    actions = abilities.enumerate(unit)
    chances = jnp.exp(jax.vmap(lambda action: raised.log_prob(jnp.array(SEEN), action))(actions))
    return chances @ PAYS


@eqx.filter_jit
def measured(printed, exact):
    """Mean gradient samples by the printed pair; exact derivatives by the parameters, and by the logarithms of heights;
    the mean score; and both Fisher matrices."""
    seen, actions = jnp.array(SEEN), abilities.enumerate(printed)
    chances = jnp.exp(jax.vmap(lambda action: printed.log_prob(seen, action))(actions))
    scores = jax.vmap(lambda action: printed.score(seen, action))(actions)
    sample, mean = (jax.tree.map(lambda s, w=w: jnp.tensordot(w, s, 1), scores) for w in (chances * PAYS, chances))
    slope, by_height = jax.grad(objective, (0, 1))(exact, jnp.zeros(2))
    return sample, slope, by_height, mean, [abilities.fisher(each, seen, actions[0])[0] for each in (printed, exact)]


@pytest.fixture(scope="module")
def found():
    with jax.enable_x64(True):
        return measured(*(kind(CENTRE, LOG_WIDTH, P_MAX) for kind in (PrintedGaussians, LocalGaussians)))


def test_the_printed_pair_is_biased_by_the_derivative_by_the_log_height(found):
    sample, slope, by_height, *_ = found
    np.testing.assert_allclose(sample.centre, slope.centre, rtol=1e-12)
    np.testing.assert_allclose(sample.log_width, slope.log_width - by_height[:, None], rtol=1e-12)
    assert np.abs(by_height).min() > 0.1  # of the same size as the gradient itself
    assert (np.sign(sample.log_width) != np.sign(slope.log_width)).any()


def test_the_bias_is_the_chance_to_fire_times_what_firing_pays(found):
    p = np.array(P_MAX) * np.exp(-0.5 * (((np.array(SEEN) - CENTRE) / np.exp(LOG_WIDTH)) ** 2).sum(1))
    pays = PAYS.reshape(2, 2)  # by the first unit, by the second
    more = np.array([(pays[1] - pays[0]) @ [1 - p[1], p[1]], (pays[:, 1] - pays[:, 0]) @ [1 - p[0], p[0]]])
    np.testing.assert_allclose(found[2], p * more, rtol=1e-12)


def test_its_score_has_mean_zero_and_its_fisher_matrix_is_that_of_the_probability(found):
    *_, mean, (printed, exact) = found
    np.testing.assert_allclose(np.concatenate([mean.centre, mean.log_width]), 0, atol=1e-14)
    np.testing.assert_array_equal(printed, exact)


def test_policies_can_be_laid_out_or_grown_with_the_printed_pair():
    assert type(tiles(2, 8, copies=2, pair="printed")) is PrintedGaussians
    assert type(tiles(2, 8, copies=2)) is LocalGaussians
    assert type(growing(2, 4, pair="printed").pool) is PrintedGaussians
    with pytest.raises(ValueError, match="pair = 'printed': must be exact for soft-boxes"):
        growing(2, 4, shape="soft-boxes", pair="printed")
    with pytest.raises(ValueError, match="pair"):
        tiles(2, 8, pair="misprinted")


def test_a_learner_that_asks_for_no_scores_is_refused():
    printed, exact = Masked(PrintedGaussians(CENTRE, LOG_WIDTH)), LocalGaussians(CENTRE, LOG_WIDTH)
    for agent in (Agent(printed, olgarb()), ProximalPolicyOptimization(exact, update_every=64)):
        check_scores(agent, eqx.filter_eval_shape(agent.init, jax.random.key(0)).policy)
    refused = "pair = 'printed': must be exact for ProximalPolicyOptimization, which asks for no scores"
    with pytest.raises(ValueError, match=refused):
        check_scores(ProximalPolicyOptimization(printed, update_every=64), printed)
