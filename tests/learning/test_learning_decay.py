"""Decaying parameters: what they lose at a step, beneath any rule, and in a run that is stopped."""

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

import motorgrad as mg
from motorgrad.learning import Agent, Estimator, FisherMetric, Olgarb, Olpomdp, adam, decayed, sgd
from motorgrad.policies import Factored, Hyperplanes, Motoneurons, trainable
from motorgrad.training import RunDirectoryError, settings_for

PLANES = Hyperplanes([[1.0, -2.0], [4.0, 0.5]], [0.25, -8.0])
RULES = {
    "sgd": sgd(0.25),
    "sgd, by group": sgd({"weights": 0.25, "bias": 0.5}),
    "adam": adam(0.05),
    "a chain": optax.chain(optax.clip_by_global_norm(1.0), sgd(0.25)),
    "optax.sgd with momentum": optax.sgd(0.01, momentum=0.9),
}


def steps(rule, gradients, policy=PLANES):
    """The policy after some gradients."""
    parameters = trainable(policy)
    state = rule.init(parameters)
    for gradient in gradients:
        moves, state = rule.update(
            jax.tree.map(lambda p, g=gradient: jnp.full_like(p, -g), parameters), state, parameters
        )
        parameters = optax.apply_updates(parameters, moves)
    return parameters


def test_parameters_lose_a_part_of_what_they_were_before_the_move():
    after = steps(decayed(sgd(0.25), {"weights": 0.5, "bias": 0.125}), [2.0])
    np.testing.assert_array_equal(after.weights, 0.5 * PLANES.weights + 0.5)
    np.testing.assert_array_equal(after.bias, 0.875 * PLANES.bias + 0.5)


def test_one_decay_is_that_of_all_and_a_group_left_out_has_none():
    assert jax.tree.all(jax.tree.map(np.array_equal, steps(decayed(sgd(0.0), 0.5), [1.0]), _times(0.5, PLANES)))
    after = steps(decayed(sgd(0.0), {"bias": 0.5}), [1.0])
    np.testing.assert_array_equal(after.weights, PLANES.weights)
    np.testing.assert_array_equal(after.bias, 0.5 * PLANES.bias)


def test_a_decay_may_be_an_array_over_units_and_names_a_field_in_every_pool():
    after = steps(decayed(sgd(0.0), {"weights": [[0.5], [0.0]]}), [1.0])
    np.testing.assert_array_equal(after.weights, [[0.5, -1.0], [4.0, 0.5]])
    pools = Factored([Hyperplanes([[2.0]], [2.0]), Motoneurons([2.0], [2.0])])
    planes, neurons = steps(decayed(sgd(0.0), {"weights": 0.5, "gain": 0.25}), [1.0], pools).pools
    assert (planes.weights, planes.bias, neurons.threshold, neurons.gain) == (1.0, 2.0, 2.0, 1.5)


@pytest.mark.parametrize("name", RULES)
def test_a_rule_s_own_moves_and_state_stay_as_they_are(name):
    rule, parameters = RULES[name], trainable(PLANES)
    plain, decaying = rule.init(parameters), decayed(rule, {"weights": 0.5}).init(parameters)
    for gradient in (1.0, -3.0, 0.5):
        descent = jax.tree.map(lambda p, g=gradient: jnp.full_like(p, -g), parameters)
        own, plain = rule.update(descent, plain, parameters)
        moves, decaying = decayed(rule, {"weights": 0.5}).update(descent, decaying, parameters)
        np.testing.assert_array_equal(moves.weights, own.weights - 0.5 * parameters.weights)
        np.testing.assert_array_equal(moves.bias, own.bias)
        assert jax.tree.all(jax.tree.map(np.array_equal, decaying.rule, plain))


def test_it_goes_where_an_optax_transformation_goes():
    chained = optax.chain(optax.clip(1.0), decayed(sgd(0.25), 0.5))
    after, own = steps(chained, [8.0, -8.0]), steps(decayed(sgd(0.25), 0.5), [1.0, -1.0])
    assert jax.tree.all(jax.tree.map(np.array_equal, after, own))


def test_decays_are_data_in_the_state():
    parameters = trainable(PLANES)
    rule = decayed(sgd(0.0), 0.25)
    state = rule.init(parameters)
    state = state._replace(decays=jax.tree.map(lambda decay: 2 * decay, state.decays))
    moves, _ = rule.update(parameters, state, parameters)
    np.testing.assert_array_equal(moves.weights, -0.5 * PLANES.weights)


def learner(estimator, metric=None, decay=0.25):
    return Agent(PLANES, estimator, decayed(sgd(0.1), decay), metric)


def practice(agent, rewards, diverged=False):
    state, observation = agent.init(jax.random.key(0)), jnp.asarray([1.0, 0.5])
    for reward in rewards:
        state, _ = agent.act(state, observation, jnp.asarray([0.3, 0.6]))
        state = agent.improve(
            agent.reinforce(state, jnp.float32(reward), observation, diverged=diverged), diverged=diverged
        )
    return state.policy


def test_an_online_learner_decays_at_every_decision_and_a_batch_learner_once_a_batch():
    each = practice(learner(Olpomdp(0.0)), [0.0] * 6)
    np.testing.assert_array_equal(each.weights, 0.75**6 * PLANES.weights)
    batch = practice(learner(Estimator(improve=3)), [0.0] * 6)
    np.testing.assert_array_equal(batch.weights, 0.75**2 * PLANES.weights)


def test_a_metric_does_not_change_the_decay():
    metric = FisherMetric(0.1, damping=0.5)
    moved, plain = practice(learner(Olpomdp(0.0), metric), [1.0]), practice(learner(Olpomdp(0.0), metric, 0.0), [1.0])
    assert not np.array_equal(plain.weights, PLANES.weights)
    np.testing.assert_allclose(plain.weights - moved.weights, 0.25 * PLANES.weights, rtol=1e-6)


def test_nothing_decays_where_the_simulation_broke():
    still = practice(learner(Olpomdp(0.0)), [1.0], diverged=jnp.asarray(True))
    assert jax.tree.all(jax.tree.map(np.array_equal, still, PLANES))


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: decayed(sgd(0.1), -0.1), "weight decay of all = -0.1: must be a finite number of at least 0"),
        (lambda: decayed(sgd(0.1), float("nan")), "weight decay of all = nan"),
        (lambda: decayed(sgd(0.1), 1.5), "weight decay of all = 1.5: must be at most 1"),
        (lambda: decayed(sgd(0.1), {"gain": [0.5, 2.0]}), "weight decay gain = .*: must be at most 1"),
        (lambda: decayed(0.1, 0.1), "rule = 0.1: must be an optax transformation"),
        (
            lambda: learner(Olgarb(0.0), decay={"wieghts": 0.1}).init(jax.random.key(0)),
            "group of parameters in the weight decays: 'wieghts': did you mean 'weights'",
        ),
        (
            lambda: learner(Olgarb(0.0), decay={"weights": [0.1] * 3}).init(jax.random.key(0)),
            r"weight decay weights = \(3,\): must be one number or of a shape that broadcasts to \(2, 2\)",
        ),
        (lambda: settings_for("chain", weight_decay=-0.1), "agent: weight decay of all = -0.1"),
        (
            lambda: settings_for("chain", weight_decays={"weights": 2.0}),
            "weight decay weights = 2.0: must be at most 1",
        ),
        (
            lambda: mg.train("chain", settings_for("chain", weight_decays={"gain": 0.1}), 10, progress=False),
            "group of parameters in the weight decays: 'gain'",
        ),
    ],
)
def test_impossible_decays_are_refused_by_name(make, names):
    with pytest.raises(ValueError, match=names):
        make()


def test_settings_make_the_decay_and_the_plain_rule_has_none():
    assert settings_for("chain", rate=0.5).rule() == sgd(0.5)
    assert settings_for("chain", rate=0.5, weight_decay=0.1).rule() == decayed(sgd(0.5), 0.1)
    by_group = settings_for("chain", ascent="adam", rate=0.5, weight_decay=0.1, weight_decays={"weights": 0.2})
    assert by_group.rule() == decayed(adam(0.5), {"weights": 0.2})


@pytest.mark.slow
@pytest.mark.parametrize("improve", [1, 7])
def test_a_run_that_was_stopped_goes_on_bit_for_bit(improve, tmp_path):
    def run(out, steps, **changes):
        settings = settings_for("linear-recruitment", improve=improve, **{"weight_decays": {"gain": 1e-3}, **changes})
        return mg.train("linear-recruitment", settings, steps, 3, tmp_path / out, window=100, progress=False)

    whole = run("whole", 600)
    run("parts", 300)
    parts = run("parts", 600)
    assert jax.tree.all(jax.tree.map(np.array_equal, parts.policies, whole.policies))
    assert mg.load(tmp_path / "parts").config["agent"]["weight_decays"] == {"gain": 1e-3}
    plain = run("plain", 600, weight_decays=None)
    assert not np.array_equal(plain.policies.gain, whole.policies.gain)
    with pytest.raises(RunDirectoryError, match=r"agent\.ascent\.weight_decay\.gain was 0\.001 and is now 0\.002"):
        run("parts", 900, weight_decays={"gain": 2e-3})


def test_a_directory_tells_two_agents_by_their_decays(tmp_path):
    def run(decay):
        agent = Agent(mg.policies.softmax(mg.make("chain")), Olgarb(0.9), decayed(adam(0.1), decay))
        return mg.train("chain", agent, 200, 2, tmp_path, progress=False)

    assert run(1e-7).config["agent"]["ascent"]["weight_decay"] == 1e-7
    with pytest.raises(RunDirectoryError, match=r"agent\.ascent\.weight_decay was 1e-07 and is now 2e-07"):
        run(2e-7)


def _times(factor, policy):
    return jax.tree.map(lambda leaf: factor * leaf, trainable(policy))
