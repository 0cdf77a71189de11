"""Weight decay: what parameters lose at a step, beneath any direction, and in a run that is stopped."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from compiled_learner import decided, started, updates_of

import motorgrad as mg
from motorgrad.learning import SGD, Adam, Agent, Estimator, FisherMetric, olgarb, olpomdp
from motorgrad.policies import Factored, Hyperplanes, Motoneurons, trainable
from motorgrad.training import RunDirectoryError, agent_for

PLANES = Hyperplanes([[1.0, -2.0], [4.0, 0.5]], [0.25, -8.0])
# name: (the optimizer, which decays; what goes before it)
CHAINS = {
    "sgd": (SGD(0.25), None),
    "sgd, by group": (SGD({"weights": 0.25, "bias": 0.5}), None),
    "adam": (Adam(0.05), None),
    "clipped": (SGD(0.25), optax.clip_by_global_norm(1.0)),
    "momentum": (SGD(0.01), optax.trace(0.9)),
}


def agent_of(last, first=None, policy=PLANES):
    return Agent(policy, optimizer=last) if first is None else Agent(policy, optimizer=first, transformations=(last,))


def steps(agent, gradients):
    """The parameters after some gradients."""
    policy, chain = agent.policy, agent.chain
    state = chain.init(policy)
    for gradient in gradients:
        ones = jax.tree.map(lambda p, g=gradient: jnp.full_like(p, g), trainable(policy))
        moves, state = updates_of(chain, ones, state, policy)
        policy = optax.apply_updates(trainable(policy), moves)
    return policy


def decayed(optimizer, decay):
    return dataclasses.replace(optimizer, weight_decay=decay)


def test_parameters_lose_a_part_of_what_they_were_before_the_move():
    after = steps(agent_of(SGD(0.25, {"weights": 0.5, "bias": 0.125})), [2.0])
    np.testing.assert_array_equal(after.weights, 0.5 * PLANES.weights + 0.5)
    np.testing.assert_array_equal(after.bias, 0.875 * PLANES.bias + 0.5)


def test_one_decay_is_that_of_all_and_a_group_left_out_has_none():
    after = steps(agent_of(SGD(0.0, 0.5)), [1.0])
    assert jax.tree.all(jax.tree.map(np.array_equal, after, _times(0.5, PLANES)))
    after = steps(agent_of(SGD(0.0, {"bias": 0.5})), [1.0])
    np.testing.assert_array_equal(after.weights, PLANES.weights)
    np.testing.assert_array_equal(after.bias, 0.5 * PLANES.bias)


def test_a_decay_may_be_an_array_over_units_and_names_a_field_in_every_pool():
    after = steps(agent_of(SGD(0.0, {"weights": [[0.5], [0.0]]})), [1.0])
    np.testing.assert_array_equal(after.weights, [[0.5, -1.0], [4.0, 0.5]])
    pools = Factored([Hyperplanes([[2.0]], [2.0]), Motoneurons([2.0], [2.0])])
    planes, neurons = steps(agent_of(SGD(0.0, {"weights": 0.5, "gain": 0.25}), policy=pools), [1.0]).pools
    assert (planes.weights, planes.bias, neurons.threshold, neurons.gain) == (1.0, 2.0, 2.0, 1.5)


@pytest.mark.parametrize("name", CHAINS)
def test_the_chains_own_moves_and_state_stay_as_they_are(name):
    last, first = CHAINS[name]
    plain, decaying = agent_of(last, first).chain, agent_of(decayed(last, {"weights": 0.5}), first).chain
    own_state, state = plain.init(PLANES), decaying.init(PLANES)
    for gradient in (1.0, -3.0, 0.5):
        ascent = jax.tree.map(lambda p, g=gradient: jnp.full_like(p, g), trainable(PLANES))
        own, own_state = updates_of(plain, ascent, own_state, PLANES)
        moves, state = updates_of(decaying, ascent, state, PLANES)
        np.testing.assert_array_equal(moves.weights, own.weights - 0.5 * PLANES.weights)
        np.testing.assert_array_equal(moves.bias, own.bias)
        assert jax.tree.all(jax.tree.map(np.array_equal, state, own_state))


def test_it_goes_after_an_optax_transformation():
    after = steps(agent_of(SGD(0.25, 0.5), optax.clip(1.0)), [8.0, -8.0])
    own = steps(agent_of(SGD(0.25, 0.5)), [1.0, -1.0])
    assert jax.tree.all(jax.tree.map(np.array_equal, after, own))


def test_decays_are_leaves():
    optimizer = jax.tree.map(lambda number: 2 * number, SGD(0.0, 0.25))
    np.testing.assert_array_equal(steps(agent_of(optimizer), [0.0]).weights, 0.5 * PLANES.weights)


def learner(estimator, metric=None, decay=0.25):
    return Agent(PLANES, estimator, SGD(0.1, decay), metric)


def practice(agent, rewards, diverged=False):
    state = started(agent)
    for reward in rewards:
        state = decided(agent, state, [1.0, 0.5], [0.3, 0.6], reward, diverged=diverged).state
    return jax.tree.map(np.asarray, state.policy)


def test_an_online_learner_decays_at_every_decision_and_a_batch_learner_once_a_batch():
    each = practice(learner(olpomdp(0.0)), [0.0] * 6)
    np.testing.assert_array_equal(each.weights, 0.75**6 * PLANES.weights)
    batch = practice(learner(Estimator(update_every=3)), [0.0] * 6)
    np.testing.assert_array_equal(batch.weights, 0.75**2 * PLANES.weights)


@pytest.mark.ci
def test_a_metric_does_not_change_the_decay():
    metric = FisherMetric(0.1, damping=0.5)
    moved, plain = practice(learner(olpomdp(0.0), metric), [1.0]), practice(learner(olpomdp(0.0), metric, 0.0), [1.0])
    assert not np.array_equal(plain.weights, PLANES.weights)
    np.testing.assert_allclose(plain.weights - moved.weights, 0.25 * PLANES.weights, rtol=1e-6)


def test_nothing_decays_where_the_simulation_broke():
    still = practice(learner(olpomdp(0.0)), [1.0], diverged=jnp.asarray(True))
    assert jax.tree.all(jax.tree.map(np.array_equal, still, PLANES))


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: SGD(0.1, -0.1), r"weight_decay = -0.1: must be None or in \[0, 1\]"),
        (lambda: SGD(0.1, float("nan")), "weight_decay = nan"),
        (lambda: SGD(0.1, 1.5), r"weight_decay = 1.5: must be None or in \[0, 1\]"),
        (lambda: SGD(0.1, {"gain": [0.5, 2.0]}), r"weight_decay.gain = .*: must be in \[0, 1\]"),
        (lambda: Agent(PLANES, optimizer=0.1), "optimizer = 0.1: must be an Optimizer"),
        (
            lambda: learner(olgarb(0.0), decay={"wieghts": 0.1}).init(jax.random.key(0)),
            "group of parameters in the weight decays: 'wieghts': did you mean 'weights'",
        ),
        (
            lambda: learner(olgarb(0.0), decay={"weights": [0.1] * 3}).init(jax.random.key(0)),
            r"weight decay weights = \(3,\): must be one number or of a shape that broadcasts to \(2, 2\)",
        ),
        (lambda: agent_for("chain", weight_decay=-0.1), r"agent\.optimizer\.weight_decay = -0\.1"),
        (
            lambda: agent_for("chain", weight_decay={"weights": 2.0}),
            r"weight_decay\.weights = 2\.0: must be in \[0, 1\]",
        ),
        (
            lambda: mg.train("chain", agent_for("chain", weight_decay={"gain": 0.1}), 10, progress=False),
            "group of parameters in the weight decays: 'gain'",
        ),
    ],
)
def test_impossible_decays_are_refused_by_name(make, names):
    with pytest.raises(ValueError, match=names):
        make()


def test_settings_make_the_decay_and_the_plain_optimizer_has_none():
    assert agent_for("chain", learning_rate=0.5).optimizer == SGD(0.5)
    assert agent_for("chain", learning_rate=0.5, weight_decay=0.1).optimizer == SGD(0.5, 0.1)
    by_group = agent_for("chain", optimizer="adam", learning_rate=0.5, weight_decay={"weights": 0.2})
    assert by_group.optimizer == Adam(0.5, {"weights": 0.2})


@pytest.mark.slow
@pytest.mark.parametrize("update_every", [1, 7])
def test_a_run_that_was_stopped_goes_on_bit_for_bit(update_every, tmp_path):
    def run(out, steps, **changes):
        settings = agent_for(
            "linear-recruitment", update_every=update_every, **{"weight_decay": {"gain": 1e-3}, **changes}
        )
        return mg.train("linear-recruitment", settings, steps, 3, tmp_path / out, window=100, progress=False)

    whole = run("whole", 600)
    run("parts", 300)
    parts = run("parts", 600)
    assert jax.tree.all(jax.tree.map(np.array_equal, parts.policies, whole.policies))
    assert mg.load(tmp_path / "parts").config["agent"]["optimizer"]["weight_decay"] == {"gain": 1e-3}
    plain = run("plain", 600, weight_decay=None)
    assert not np.array_equal(plain.policies.gain, whole.policies.gain)
    with pytest.raises(RunDirectoryError, match=r"agent\.optimizer\.weight_decay\.gain was 0\.001 and is now 0\.002"):
        run("parts", 900, weight_decay={"gain": 2e-3})


@pytest.mark.ci
def test_a_directory_tells_two_agents_by_their_decays(tmp_path):
    def run(decay):
        agent = Agent(mg.policies.softmax(mg.make("chain")), olgarb(0.9), Adam(0.1, decay))
        return mg.train("chain", agent, 200, 2, tmp_path, progress=False)

    assert run(1e-7).config["agent"]["optimizer"]["weight_decay"] == 1e-7
    with pytest.raises(RunDirectoryError, match=r"agent\.optimizer\.weight_decay was 1e-07 and is now 2e-07"):
        run(2e-7)


def _times(factor, policy):
    return jax.tree.map(lambda leaf: factor * leaf, trainable(policy))
