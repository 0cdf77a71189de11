"""What bounds, spreads and averages the steps of a learner: divergence, entropy, averages of parameters."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from compiled_learner import decided, started
from jax.flatten_util import ravel_pytree

from motorgrad.learning import (
    SGD,
    ActionValueEnsemble,
    Agent,
    Annealed,
    Clock,
    Estimator,
    Exponential,
    FisherMetric,
    Growth,
    LeastSquares,
    LinearCritic,
    MeanReward,
    PolyakAveraging,
    SparseLearner,
    entropy_gradient,
    gae,
    gpomdp,
    olgarb,
)
from motorgrad.learning._replay import Drawn
from motorgrad.learning._schedules import at
from motorgrad.policies import (
    Factored,
    Gated,
    Hyperplanes,
    LocalGaussians,
    Masked,
    Mirrored,
    Motoneurons,
    MultilayerPerceptron,
    SoftBoxes,
    Softmax,
    abilities,
    split,
    trainable,
)
from motorgrad.tasks import Chain, ThreeState
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import oracle
from motorgrad.worlds.oracle import to_float64 as double

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point


def pools():
    rng = np.random.default_rng(3)
    motoneurons = Motoneurons(rng.normal(size=3), rng.normal(size=3))
    gaussians = LocalGaussians(rng.normal(size=(2, 1)), [[0.3], [0.1]], 0.8)
    return {
        "hyperplanes": Hyperplanes(rng.normal(size=(4, 2)), rng.normal(size=4)),
        "motoneurons": motoneurons,
        "factored": Factored([motoneurons, gaussians]),
        "softmax": Softmax(rng.normal(size=(3, 2))),
        "mirrored": Mirrored(
            Hyperplanes(rng.normal(size=(2, 2)), rng.normal(size=2)), (1, 0), (-1, -1), (0, 3), (2, 1)
        ),
    }


def divergence(before, after, seen):
    r"""The mean over what is seen of the exact Kullback-Leibler divergence, in double precision."""
    with jax.enable_x64(True):
        log_p, log_q = (np.asarray(_log_probs(double(policy), seen)) for policy in (before, after))
    return np.mean(np.sum(np.exp(log_p) * (log_p - log_q), axis=1))


@eqx.filter_jit
def _log_probs(policy, seen):
    return jax.vmap(lambda y: jax.vmap(policy.log_prob, (None, 0))(y, abilities.enumerate(policy)))(seen)


@eqx.filter_jit
def _bounded(state, policy, step, limit):
    return FisherMetric().bounded(state, policy, step, limit)


def bounded(*arguments):
    return jax.tree.map(np.asarray, _bounded(*arguments))


def measured(policy, seen):
    """The exact Fisher matrices of a policy over what is seen, as a metric has them."""
    fisher = tuple(np.mean(block, axis=0) for block in _fisher(policy, np.asarray(seen, np.float32)))
    return fisher


@eqx.filter_jit
def _fisher(policy, seen):
    return jax.vmap(lambda y: abilities.fisher(policy, y, policy.mode(y)))(seen)


@pytest.mark.ci
@pytest.mark.representatives("softmax")
@pytest.mark.parametrize("name", pools())
def test_a_long_step_is_cut_to_the_divergence_that_policies_then_have(name):
    policy, limit = pools()[name], 1e-4
    seen = np.random.default_rng(0).normal(size=(20, policy.inputs))
    vector, build = ravel_pytree(trainable(policy))
    step = build(np.random.default_rng(1).normal(size=vector.size).astype(np.float32))
    cut = bounded(measured(policy, seen), policy, step, np.float32(limit))
    moved = jax.tree.map(lambda p, d: p + d, trainable(policy), cut)
    moved = eqx.combine(jax.tree.map(np.asarray, moved), split(policy)[1])
    # third order in a step of root 2e-4: some per cent
    assert divergence(policy, moved, seen) == pytest.approx(limit, rel=0.1)
    whole, part = (np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(tree)]) for tree in (step, cut))
    np.testing.assert_allclose(part / np.linalg.norm(part), whole / np.linalg.norm(whole), atol=1e-6)


@pytest.mark.ci
def test_a_step_within_the_limit_is_left_as_it_is():
    policy = pools()["factored"]
    seen = np.random.default_rng(0).normal(size=(20, policy.inputs))
    step = jax.tree.map(lambda p: np.full_like(p, 1e-4), trainable(policy))
    left = bounded(measured(policy, seen), policy, step, np.float32(0.01))
    jax.tree.map(np.testing.assert_array_equal, left, step)


@pytest.mark.parametrize("size", [0.0, 1e30])
def test_steps_of_any_size_are_cut_without_overflow(size):
    policy = pools()["hyperplanes"]
    seen = np.random.default_rng(0).normal(size=(20, policy.inputs))
    step = jax.tree.map(lambda p: np.full_like(p, size), trainable(policy))
    state = measured(policy, seen)
    cut = bounded(state, policy, step, np.float32(0.02))
    (fisher,), (block,) = state, abilities.blocks(policy, cut)
    worth = 0.5 * np.einsum("ui,uij,uj->", block, fisher, block)
    assert worth == pytest.approx(0.02 if size else 0.0, rel=1e-4)
    none = bounded(state, policy, step, np.float32(0.0))
    assert np.abs(ravel_pytree(none)[0]).max() == 0


@pytest.mark.ci
def test_no_step_of_a_learner_is_longer_than_its_limit_and_the_limit_is_annealed():
    limit, batch = Annealed(1e-3, 1e-4, 4), 40
    metric = FisherMetric(rate=0.01, damping=0.01, initial=1.0, kl=limit)
    agent = Agent(Softmax(jnp.zeros((2, 2))), gae(LinearCritic(), 0.5, batch), SGD(1e3), metric)
    stepper = stepper_for(ThreeState(), agent, range(3))
    for n in range(6):
        before = stepper.policies()
        stepper.advance(batch)
        after, state = stepper.policies(), stepper.state["cycle"].agent
        steps = (after.weights - before.weights).reshape(3, -1)
        fisher = state.chain[0][0][:, 0]
        worth = 0.5 * np.einsum("si,sij,sj->s", steps, fisher, steps)
        np.testing.assert_allclose(worth, 1e-3 + (1e-4 - 1e-3) * min(n / 4, 1), rtol=1e-3)
    assert state.steps.tolist() == [6] * 3


@pytest.mark.ci
@pytest.mark.representatives("hyperplanes", "softmax")
@pytest.mark.parametrize("name", [*pools(), "gated", "masked", "boxes"])
def test_the_entropys_gradient_is_that_of_finite_differences(name):
    rng = np.random.default_rng(5)
    unit = Hyperplanes(rng.normal(size=(1, 2)), rng.normal(size=1))
    more = {
        "gated": Gated(unit, [unit]),
        "masked": Masked(LocalGaussians(rng.normal(size=(2, 2)), np.zeros((2, 2)), 0.5), [True, False]),
        "boxes": SoftBoxes(rng.normal(size=(2, 2)), np.zeros((2, 2)), np.zeros(2)),
    }
    with jax.enable_x64(True):
        policy = double({**pools(), **more}[name])
        y = jnp.asarray(rng.normal(size=policy.inputs))
        parameters, settings = split(policy)
        vector, build = ravel_pytree(parameters)
        found = np.asarray(ravel_pytree(eqx.filter_jit(entropy_gradient)(policy, y))[0])

        @jax.jit
        def log_probs(v):
            return jax.vmap(lambda a: eqx.combine(build(v), settings).log_prob(y, a))(abilities.enumerate(policy))

        def entropy(v):
            log_p = np.asarray(log_probs(v))
            log_p = log_p[np.isfinite(log_p)]
            return -np.sum(np.exp(log_p) * log_p)

        vector, shifts = np.asarray(vector), 1e-6 * np.eye(vector.size)
        wanted = [(entropy(vector + d) - entropy(vector - d)) / 2e-6 for d in shifts]
    assert np.abs(wanted).max() > 1e-3
    np.testing.assert_allclose(found, wanted, atol=1e-7)


def test_units_that_are_sure_have_no_slope():
    far = LocalGaussians([[0.0], [100.0]], [[0.0], [0.0]], 1.0)
    y = jnp.zeros(1)
    slope_of = eqx.filter_jit(lambda policy: (policy.prob(y), policy.entropy(y), entropy_gradient(policy, y)))
    prob, _, slope = slope_of(far)
    assert prob[1] == 0
    slope = jax.tree.map(np.asarray, slope)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(slope))
    assert np.abs(slope.centre[1]).max() == np.abs(slope.log_width[1]).max() == 0
    _, entropy, _ = slope_of(LocalGaussians([[100.0]], [[0.0]], 1.0))
    assert entropy == 0


@pytest.mark.ci
def test_the_bonus_adds_the_mean_slope_of_the_entropy():
    mdp, bonus = ThreeState().dynamics, 0.3
    estimator = dataclasses.replace(gpomdp(0.5), entropy=bonus)
    found = [stepper_for(ThreeState(), Agent(POINT, e), range(100)) for e in (estimator, gpomdp(0.5))]
    for stepper in found:
        stepper.advance(2_000)
    with_it, without = (np.asarray(s.state["cycle"].agent.gradient.mean.weights, float) for s in found)
    pi = oracle.stationary_distribution(mdp, POINT)
    slope_at = eqx.filter_jit(entropy_gradient)
    slopes = [np.asarray(slope_at(POINT, np.float32(y)).weights) for y in mdp.observations]
    wanted = bonus * np.einsum("s,sij->ij", pi, np.stack(slopes))
    np.testing.assert_allclose((with_it - without).mean(0), wanted, atol=0.01 * np.abs(wanted).max())


def test_the_bonus_is_annealed_with_the_steps_and_leaves_diverged_samples_out():
    estimator = Estimator(Exponential(0.0), None, entropy=Annealed(1.0, 0.5, 2))
    agent = Agent(POINT, estimator, SGD(0.1))
    state, slope_at = started(agent), eqx.filter_jit(entropy_gradient)
    y = np.array([0.3, 0.6], np.float32)
    for share in (1.0, 0.75, 0.5, 0.5):
        slope = np.asarray(slope_at(state.policy, y).weights)
        _, _, told, state = decided(agent, state, y, [0.3], 0.0)
        np.testing.assert_allclose(told.gradient.weights, share * slope, rtol=1e-6)
    broken = decided(agent, state, y, [0.3], 0.0, diverged=True)
    assert np.abs(broken.observed.gradient.weights).max() == 0
    assert int(broken.state.steps) == 4


@pytest.mark.ci
def test_a_bonus_beside_which_rewards_are_small_makes_units_undecided():
    estimator = dataclasses.replace(olgarb(0.0), entropy=20.0)
    agent = Agent(POINT, estimator, SGD(0.005))
    stepper = stepper_for(ThreeState(), agent, range(4))
    before = oracle.action_probabilities(ThreeState().dynamics, POINT)
    stepper.advance(10_000)
    for weights in stepper.policies().weights:
        after = oracle.action_probabilities(ThreeState().dynamics, Softmax(weights))
        assert np.abs(after - 0.5).max() < 0.5 * np.abs(before - 0.5).max()


AVERAGES = {"all": PolyakAveraging(), "late": PolyakAveraging(start=7), "forgetting": PolyakAveraging(2, 0.5)}


@pytest.mark.ci
@pytest.mark.representatives("late-5")
@pytest.mark.parametrize("update_every", [1, 5])
@pytest.mark.parametrize("name", AVERAGES)
def test_the_average_is_that_of_the_parameters_after_each_step(name, update_every):
    average = AVERAGES[name]
    estimator = dataclasses.replace(olgarb(0.5), update_every=update_every)
    plain, agent = (Agent(POINT, estimator, SGD(0.1), averaging=a) for a in (None, average))
    steppers = [stepper_for(ThreeState(), a, range(3)) for a in (plain, agent)]
    mean, n = steppers[0].policies().weights.astype(float), 0
    for made in range(1, 13):
        for stepper in steppers:
            stepper.advance(update_every)
        theta = steppers[0].policies().weights.astype(float)
        np.testing.assert_array_equal(steppers[1].state["cycle"].agent.policy.weights, theta)
        n = max(made - average.start, 0)
        mean = theta if n == 0 else mean + max(1 / n, average.rate) * (theta - mean)
        np.testing.assert_allclose(steppers[1].policies().weights, mean, rtol=1e-5)
    assert np.abs(mean - theta).max() > 1e-3


@pytest.mark.ci
def test_averages_of_many_seeds_lie_closer_together_than_their_last_parameters():
    """With a bonus the optimum is at finite weights, about which a constant step size makes a cloud."""
    estimator = Estimator(Exponential(0.0), MeanReward(), entropy=1.0)
    agent = Agent(Softmax(jnp.zeros((2, 4))), estimator, SGD(0.1), averaging=PolyakAveraging(2_000))
    stepper = stepper_for(Chain(length=4), agent, range(50))
    stepper.advance(20_000)
    cloud, mean = stepper.state["cycle"].agent.policy.weights, stepper.policies().weights
    assert mean.std(0).max() < 0.5 * cloud.std(0).min()


def test_annealed_numbers_end_at_their_end():
    line = Annealed(2.0, 1.0, 4)
    found = [float(at(line, jnp.int32(n))) for n in (0, 1, 4, 9)]
    assert found == [2.0, 1.75, 1.0, 1.0]
    assert float(at(0.5, None)) == 0.5
    assert float(at(line, None)) == 2.0


def test_learning_rates_are_annealed_with_the_steps():
    rates = [0.1, 0.075, 0.05, 0.05]
    agent = Agent(POINT, Estimator(Exponential(0.0), None), SGD(Annealed(0.1, 0.05, 2)))
    state = started(agent)
    for rate in rates:
        before = np.asarray(state.policy.weights)
        _, _, observed, state = decided(agent, state, [0.3, 0.6], [0.3], 1.0)
        np.testing.assert_allclose(
            state.policy.weights - before, rate * np.asarray(observed.gradient.weights), rtol=1e-4
        )
    rate = _annealed(0.1, end=0.05, steps=2)
    assert agent_for("three-state", learning_rate=rate).optimizer == agent.optimizer
    groups = {"centre": 0.1, "log_width": 0.2}
    local = {"policy": "gaussians", "learning_rate": groups}
    assert agent_for("particle", local).optimizer.learning_rate == groups


@pytest.mark.ci
def test_the_values_of_an_ensemble_follow_an_annealed_learning_rate():
    """Adam's steps are as long as its learning rate: with one that has ended at 0, nothing moves."""
    column, row = np.ones((4, 1), np.float32), np.ones(4, np.float32)
    drawn = Drawn(column, 0.1 * column, row, column, row < 0, row)
    network = MultilayerPerceptron((4,), layer_norm=False, sparsity=0.0)
    values = ActionValueEnsemble(learning_rate=Annealed(1e-3, 0.0, 2), members=1, network=network)

    @eqx.filter_jit
    def first(key):
        return values.init(2, jnp.float32, key)

    @eqx.filter_jit
    def update(state, steps):
        return values.update(state, drawn, values.later(state, column, 0.1 * column), steps)

    state, moved = first(jax.random.key(0)), []
    for steps in range(4):
        after = update(state, np.int32(steps))
        heads = (np.asarray(each.weights[0].weights) for each in (after, state))
        moved.append(float(np.abs(np.subtract(*heads)).max()))
        state = after
    assert moved == pytest.approx([1e-3, 5e-4, 0, 0], rel=1e-2)


def test_nothing_is_kept_that_nothing_asks_for():
    state = Agent(POINT, olgarb(0.5)).init(jax.random.key(0))
    assert (state.steps, state.chain, state.decision) == (None, (optax.EmptyState(),), None)
    fixed = Agent(POINT, dataclasses.replace(olgarb(0.5), entropy=0.1)).init(jax.random.key(0))
    assert fixed.steps is None


GROWTH = Growth(Clock(10_000))


def _annealed(start=0.1, **more):
    return {"kind": "annealed", "start": start, **more}


@pytest.mark.parametrize(
    ("make_it", "said"),
    [
        (
            lambda: FisherMetric(kl=-1.0),
            "kl = -1.0: must be None or a finite number of at least 0, in nats, or an Annealed",
        ),
        (
            lambda: Estimator(entropy=float("nan")),
            "entropy = nan: must be None or a finite number of at least 0, or an Annealed",
        ),
        (lambda: Annealed(-1.0), "start = -1.0"),
        (lambda: Annealed(1.0, float("inf")), "end = inf"),
        (lambda: Annealed(1.0, steps=0), "steps = 0: must be an integer of at least 1"),
        (lambda: SGD(-1.0), "learning_rate = -1.0: must be a finite number of at least 0, or an Annealed"),
        (
            lambda: SparseLearner(LocalGaussians([[0.5]], [[0.0]]), learning_rate=Annealed(0.1)),
            "learning_rate = .*: must be a finite number of at least 0, or a mapping",
        ),
        (lambda: PolyakAveraging(start=-1), "start = -1"),
        (lambda: PolyakAveraging(rate=1.5), "rate = 1.5"),
        (lambda: Agent(POINT, averaging=0.5), "averaging = 0.5: must be None or a PolyakAveraging"),
        (
            lambda: Agent(POINT, gpomdp(0.5), averaging=PolyakAveraging()),
            "averaging = .*: must be None where parameters",
        ),
        (
            lambda: Agent(POINT, growth=GROWTH, averaging=PolyakAveraging()),
            "averaging = .*: must be None where a policy",
        ),
        (lambda: agent_for("particle", kind="sparse", entropy=0.1), "unknown setting of agent 'entropy'"),
        (lambda: agent_for("particle", kind="sparse", averaging="polyak"), "unknown setting of agent 'averaging'"),
        (lambda: agent_for("three-state", metric={"kind": "fisher", "kl": -0.1}), r"agent\.metric\.kl = -0\.1"),
        (lambda: agent_for("three-state", {"metric": "fisher", "metric.kl.end": 0.1}), "kl.start: must be given"),
        (lambda: agent_for("three-state", entropy=_annealed(end=-1.0)), r"entropy\.end = -1\.0"),
        (lambda: agent_for("three-state", entropy=_annealed(end=0.0, steps=0)), r"entropy\.steps = 0"),
        (lambda: agent_for("three-state", entropy=_annealed(start=-0.1)), r"entropy\.start = -0\.1"),
        (lambda: agent_for("three-state", averaging={"start": -1}), r"agent\.averaging\.start = -1"),
    ],
)
def test_what_is_impossible_is_refused_by_name(make_it, said):
    with pytest.raises(ValueError, match=said):
        make_it()


def test_settings_stand_for_the_parts():
    critic = {"kind": "critic", "discount": 0.97, "features": {"actions": True}}
    agent = agent_for(
        "three-state",
        baseline=critic,
        decay=0.873,
        update_every=160,
        entropy=_annealed(0.02, end=0.0, steps=300),
        metric={"kind": "fisher", "kl": 0.03},
        averaging={"start": 150},
    )
    critic = agent.estimator.baseline
    assert (critic.discount, critic.features.actions, critic.fit) == (0.97, True, LeastSquares())
    assert agent.estimator.trace == Exponential(0.873)
    assert agent.estimator.entropy == Annealed(0.02, 0.0, 300)
    assert (agent.metric.kl, agent.averaging) == (0.03, PolyakAveraging(150))
