"""The natural gradient of each unit: against automatic differentiation, the exact oracle, and itself."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decided, decision, started
from hypothesis import given, settings
from hypothesis import strategies as st
from jax.flatten_util import ravel_pytree

from motorgrad.learning import (
    SGD,
    Adam,
    Agent,
    Estimator,
    Exponential,
    FisherMetric,
    MeanReward,
    Transition,
    gpomdp,
    olgarb,
)
from motorgrad.policies import (
    BinaryUnits,
    Factored,
    Hyperplanes,
    LocalGaussians,
    Mirrored,
    Motoneurons,
    Softmax,
    abilities,
    fixed,
    split,
    trainable,
)
from motorgrad.policies._parameters import in_structure
from motorgrad.tasks import CallAdmission, ThreeState
from motorgrad.training import stepper_for
from motorgrad.worlds import AdmissionThresholds, FiniteMDP, oracle
from motorgrad.worlds.oracle import to_float64 as double

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
few = settings(max_examples=10, deadline=None, derandomize=True)


class Coupled(BinaryUnits):
    """Two units with a gain in common, which no row of parameters can be cut from."""

    bias: jax.Array = eqx.field(converter=jnp.asarray)
    gain: jax.Array = eqx.field(converter=jnp.asarray)
    sign: jax.Array = fixed(converter=jnp.asarray, default=1.0)
    inputs, outputs = 1, 2

    def prob(self, observation):
        return jax.nn.sigmoid(self.sign * self.gain * observation[0] + self.bias)

    def score(self, observation, action):
        surprise = action - self.prob(observation)
        return in_structure(self, bias=surprise, gain=jnp.sum(surprise) * self.sign * observation[0])


def rng_policies(seed):
    """Policies over one input of every kind that has its own way to its Fisher matrix."""
    rng = np.random.default_rng(seed)
    pool = Motoneurons(rng.normal(size=2), rng.normal(size=2))
    local = LocalGaussians(rng.normal(size=(1, 1)), [[0.3]], 0.8)
    return {
        "motoneurons": pool,
        "gaussians": local,
        "factored": Factored([pool, Factored([local])]),
        "mirrored": Mirrored(pool, (0,), (-1,), (0, 3), (1, 2)),
        "softmax": Softmax(rng.normal(size=(3, 1))),
        "thresholds": AdmissionThresholds(rng.normal(size=1)),
        "coupled": Coupled(rng.normal(size=2), rng.normal()),
    }


def places(policy):
    """For every unit, where its parameters are in the vector of all."""
    vector, build = ravel_pytree(trainable(policy))
    numbers = build(np.arange(vector.size, dtype=vector.dtype))
    blocks = eqx.filter_jit(abilities.blocks)(policy, numbers)
    return [row.astype(int) for block in blocks for row in np.asarray(block)]


@eqx.filter_jit
def _everything(policy, y):
    parameters, rest = split(policy)
    vector, build = ravel_pytree(parameters)

    def one(action):
        def log_prob(v):
            return eqx.combine(build(v), rest).log_prob(y, action)

        log_p, score = jax.value_and_grad(log_prob)(vector)
        return jnp.exp(log_p), score, abilities.fisher(policy, y, action)

    return jax.vmap(one)(abilities.enumerate(policy))


def everything(policy, y):
    """Of every action its probability, its score by automatic differentiation and the Fisher matrices, in NumPy."""
    return jax.tree.map(np.asarray, _everything(policy, y))


def each_of(tree, count):
    """The trees along the leading axis of a tree's arrays."""
    return [jax.tree.map(lambda leaf, n=n: leaf[n], tree) for n in range(count)]


def whole(policy, blocks):
    """The blocks as one matrix, in the order of the vector of all parameters."""
    rows = places(policy)
    matrix = np.zeros((sum(map(len, rows)),) * 2)
    for row, block in zip(rows, [unit for pool in blocks for unit in np.asarray(pool)], strict=True):
        matrix[np.ix_(row, row)] = block
    return matrix


@pytest.mark.ci
@pytest.mark.representatives("motoneurons")
@pytest.mark.parametrize("name", rng_policies(0))
@few
@given(seed=st.integers(0, 2**31))
def test_the_blocks_are_the_mean_square_of_the_autodifferentiated_score(name, seed):
    with jax.enable_x64(True):
        policy = double(rng_policies(seed)[name])
        p, score, matrices = everything(policy, np.random.default_rng(seed).normal(size=policy.inputs))
        found = [whole(policy, each) for each in each_of(matrices, len(p))]
    exact = np.einsum("a,ai,aj->ij", p, score, score)
    mean = np.einsum("a,aij->ij", p, found)
    # the samples of units that share parameters have the matrix as their mean; the others are exact, every time
    np.testing.assert_allclose(mean, exact, rtol=1e-9, atol=1e-12)
    for each in found if name != "coupled" else ():
        np.testing.assert_allclose(each, exact, rtol=1e-9, atol=1e-12)


@pytest.mark.ci
@pytest.mark.representatives("motoneurons", "factored", "coupled")
@pytest.mark.parametrize("name", rng_policies(0))
def test_blocks_and_gradients_are_each_others_inverse(name):
    policy = rng_policies(1)[name]
    vector, build = ravel_pytree(trainable(policy))
    gradient = build(np.arange(vector.size, dtype=vector.dtype) + 1)
    assert eqx.tree_equal(
        eqx.filter_jit(lambda p, g: abilities.from_blocks(p, abilities.blocks(p, g)))(policy, gradient), gradient
    )
    assert sorted(np.concatenate(places(policy))) == list(range(vector.size))


def random_mdp(actions, inputs, seed=0, states=4):
    rng = np.random.default_rng(seed)
    transitions = rng.dirichlet(np.ones(states), (actions, states))
    transitions /= transitions.sum(-1, keepdims=True)
    return FiniteMDP(transitions, rng.normal(size=(actions, states)), rng.normal(size=(states, inputs)))


@pytest.mark.ci
@pytest.mark.representatives("coupled")
@pytest.mark.parametrize("name", ["motoneurons", "factored", "mirrored", "coupled", "softmax"])
def test_the_oracles_matrix_is_the_sum_over_states_and_zero_between_units(name):
    policy = rng_policies(2)[name]
    mdp = random_mdp(len(abilities.enumerate(policy)), 1)
    exact, pi = oracle.fisher(mdp, policy), oracle.stationary_distribution(mdp, policy)
    with jax.enable_x64(True):
        policy = double(policy)
        by_state = []
        for y in mdp.observations:
            p, _, matrices = everything(policy, y)
            each = [whole(policy, blocks) for blocks in each_of(matrices, len(p))]
            by_state.append(np.einsum("a,aij->ij", p, each))
    np.testing.assert_allclose(np.einsum("s,sij->ij", pi, by_state), exact, atol=1e-12)
    np.testing.assert_allclose(exact, exact.T, atol=1e-15)


@eqx.filter_jit
def preconditioned(metric, state, policy, gradient):
    return metric.precondition(state, policy, gradient)


def estimated(task, policy, rate, decisions, seeds=24, decay=0.95):
    """Exact and estimated Fisher matrices and directions at fixed parameters, of every seed."""
    metric = FisherMetric(rate, 1e-3)
    agent = Agent(policy, gpomdp(decay, MeanReward()), metric=metric)
    stepper = stepper_for(task, agent, range(seeds))
    stepper.advance(decisions)
    state = jax.tree.map(np.asarray, stepper.state["cycle"].agent)
    matrices, directions, plain = [], [], []
    for seed in range(seeds):
        mine = jax.tree.map(lambda leaf, seed=seed: leaf[seed], state)
        matrices.append(whole(policy, mine.chain[0]))
        gradient = mine.gradient.mean
        directions.append(oracle.flat(preconditioned(metric, mine.chain[0], policy, gradient)))
        plain.append(oracle.flat(gradient))
    return np.array(matrices), np.array(directions), np.array(plain)


def seen(observation, action):
    """The decision as a metric observes it."""
    return Transition(observation, action, jnp.float32(0.0), observation)


def angle(a, b):
    return np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))


CONVERGING = {
    "softmax": (ThreeState(), POINT),
    "hyperplanes": (CallAdmission(capacity=3), Hyperplanes(np.full((1, 4), 0.2), [0.5])),
}


@pytest.mark.representatives("softmax")
@pytest.mark.ci
@pytest.mark.parametrize("name", CONVERGING)
def test_the_running_matrix_and_direction_are_the_oracles(name):
    task, policy = CONVERGING[name]
    rate, decisions = 1e-3, 20_000
    mdp = task.dynamics
    matrices, directions, plain = estimated(task, policy, rate, decisions)
    exact = oracle.fisher(mdp, policy)
    scale = np.linalg.norm(exact)
    error = matrices.std(0) / np.sqrt(len(matrices))
    assert np.linalg.norm(error) < 0.05 * scale  # sharp enough for a bias to show
    # the identity that it started from has come down to e⁻²⁰
    np.testing.assert_array_less(np.abs(matrices.mean(0) - exact), 4 * error + 1e-6 * scale)
    # what the mean direction of the seeds should be, damping included
    gradient = oracle.flat(oracle.biased_gradient(mdp, policy, 0.95))
    truth = np.linalg.solve(exact + 1e-3 * np.eye(len(exact)), gradient)
    found = directions.mean(0)
    spread = np.linalg.norm(directions.std(0)) / np.sqrt(len(directions)) / np.linalg.norm(found)
    # four standard errors, and of order rate for the inverse of a matrix that is itself estimated
    assert angle(found, truth) < 4 * spread + 0.02
    assert spread < 0.2
    # the test could fail: the plain gradient points elsewhere
    if name == "hyperplanes":
        assert angle(plain.mean(0), truth) > 4 * spread + 0.02


@pytest.mark.ci
def test_the_matrix_of_a_pool_is_the_oracles_without_what_is_between_units():
    policy = Factored([Motoneurons([0.2], [1.5]), Hyperplanes([[0.4]], [0.1])])
    mdp = random_mdp(4, 1)
    exact = oracle.fisher(mdp, policy)
    rows = places(policy)
    assert [len(row) for row in rows] == [2, 2]
    np.testing.assert_allclose(exact[np.ix_(rows[0], rows[1])], 0, atol=1e-15)
    assert np.abs(exact[np.ix_(rows[0], rows[0])]).max() > 0.01


def test_the_oracles_direction_solves_and_a_singular_matrix_moves_only_what_can_be_known():
    mdp = ThreeState().dynamics
    direction = oracle.flat(oracle.natural_gradient(mdp, POINT))
    gradient = oracle.flat(oracle.gradient(mdp, POINT))
    np.testing.assert_allclose(oracle.fisher(mdp, POINT) @ direction, gradient, atol=1e-12)
    assert np.linalg.matrix_rank(oracle.fisher(mdp, POINT)) == 2
    # our own softmax weights rise and fall together; their sum means nothing and stays
    np.testing.assert_allclose(direction[:2] + direction[2:], 0, atol=1e-10)
    metric = FisherMetric(1.0, 0.0)
    with jax.enable_x64(True):
        fisher = (oracle.fisher(mdp, POINT)[None],)
        found = oracle.flat(preconditioned(metric, fisher, double(POINT), oracle.gradient(mdp, POINT)))
    # it is the same step of the policy; rounding may add a little of what changes nothing
    np.testing.assert_allclose(found[:2] - found[2:], direction[:2] - direction[2:], rtol=1e-6)
    assert np.linalg.norm(found) < 1.1 * np.linalg.norm(direction)


def learn(policy, scale, metric, decisions=60, rule=None, estimator=None):
    """Learn on inputs in units of 1/`scale`; the path of the probabilities of firing at three inputs."""
    agent = Agent(policy, estimator or olgarb(0.5), rule or SGD(0.02), metric)
    rng = np.random.default_rng(3)
    inputs, uniforms = rng.normal(size=(decisions, 1)), rng.random((decisions, 2))

    def decide(state, now):
        y, u = now
        state = decision(agent, state, scale * y, u, lambda action: -((jnp.sum(action) - 1 - y[0]) ** 2)).state
        return state, jax.vmap(state.policy.prob)(scale * jnp.array([[-1.0], [0.2], [1.0]]))

    @jax.jit
    def whole(key):
        state = agent.init(key)
        if metric is not None:  # a first estimate that is not singular, in whatever parameters
            matrices = [abilities.fisher(policy, jnp.array([scale * y]), None) for y in (-1.0, 0.3, 1.2)]
            fisher = tuple(sum(each) / len(each) for each in zip(*matrices, strict=True))
            state = state._replace(chain=(fisher, *state.chain[1:]))
        return jax.lax.scan(decide, state, (inputs, uniforms))[1]

    return np.asarray(whole(jax.random.key(0)))


@pytest.mark.ci
@pytest.mark.parametrize("scale", [0.01, 30.0])
def test_without_damping_learning_is_the_same_in_any_units_of_the_input(scale):
    with jax.enable_x64(True):
        w, b = np.array([[0.5], [-0.8]]), np.array([0.1, -0.3])
        # no start in these units; the rounding's worth of damping is in units of the diagonal
        metric = FisherMetric(0.05, 0.0, 0.0)
        natural = [learn(Hyperplanes(w / s, b), s, metric) for s in (1.0, scale)]
        plain = [learn(Hyperplanes(w / s, b), s, None) for s in (1.0, scale)]
    np.testing.assert_allclose(natural[0], natural[1], atol=1e-9)
    assert np.abs(natural[0][-1] - natural[0][0]).max() > 0.05  # something was learned
    assert np.abs(plain[0] - plain[1]).max() > 0.05


@pytest.mark.ci
def test_hyperplanes_and_motoneurons_that_are_one_policy_move_as_one():
    probes = jnp.array([[-1.0], [0.2], [1.0]])
    with jax.enable_x64(True):
        w, b = jnp.array([[0.5], [-0.8]]), jnp.array([0.1, -0.3])
        moved, length = {}, 1e-6  # so small that curvature, of order length, is not seen
        for kind, policy in (("w", Hyperplanes(w, b)), ("k", Motoneurons(-b / w[:, 0], w[:, 0]))):
            before = np.asarray(jax.jit(jax.vmap(policy.prob))(probes))
            for name, metric in (("natural", FisherMetric(0.05, 0.0, 0.0)), ("plain", None)):
                after = learn(policy, 1.0, metric, rule=SGD(length))[-1]
                moved[kind, name] = np.asarray(after - before) / length
    np.testing.assert_allclose(moved["w", "natural"], moved["k", "natural"], rtol=1e-3)
    assert np.abs(moved["w", "plain"] / moved["k", "plain"] - 1).max() > 0.1


@pytest.mark.representatives("True-1", "True-21", "False-3")
@pytest.mark.parametrize("size", [1, 2, 3, 21])
@pytest.mark.parametrize("x64", [True, False])
def test_the_direction_is_numpys_solution(size, x64):
    rng = np.random.default_rng(size)
    root = rng.normal(size=(5, size, 2 * size))
    matrices, damping, g = root @ root.transpose(0, 2, 1), rng.uniform(0, 2, size=(5, size)), rng.normal(size=(5, size))
    matrices *= (scale := 10 ** rng.uniform(-3, 3, size=(5, size)))[:, :, None] * scale[:, None, :]
    expected = np.linalg.solve(matrices + damping[:, :, None] * np.eye(size), g[:, :, None])[:, :, 0]
    with jax.enable_x64(x64):
        # hyperplanes of so many parameters lend their structure
        policy = Hyperplanes(jnp.zeros((5, size - 1)), jnp.zeros(5))
        damping = {"weights": damping[:, :-1], "bias": damping[:, -1]}
        metric, state = FisherMetric(1.0, damping), (jnp.asarray(matrices),)

        @jax.jit
        def direction(state, g):
            return abilities.blocks(policy, metric.precondition(state, policy, abilities.from_blocks(policy, (g,))))[0]

        found = np.asarray(direction(state, g))
    condition = max(np.linalg.cond(m / np.sqrt(np.outer(np.diag(m), np.diag(m)))) for m in matrices)
    eps = np.finfo(np.float64 if x64 else np.float32).eps
    tolerance = 100 * size * eps * condition
    assert tolerance < 0.2
    error = np.abs(found - expected) * np.sqrt(np.diagonal(matrices, axis1=1, axis2=2))
    assert error.max() < tolerance * np.abs(expected * np.sqrt(np.diagonal(matrices, axis1=1, axis2=2))).max()


@pytest.mark.ci
def test_damping_bounds_the_step_of_a_threshold_that_has_no_gain_yet():
    policy = Motoneurons([0.2, 0.6], [0.0, 0.0])
    y = jnp.array([0.9])
    moved = {}
    for name, damping in (("damped", {"threshold": 0.05}), ("not damped", {})):
        agent = Agent(policy, olgarb(0.9), SGD(1e-4), FisherMetric(3e-4, damping))
        state = started(agent)
        # as after a long time at gain 0: the start is forgotten, and nothing known of the thresholds
        known = np.zeros((2, 2, 2), np.float32)
        known[:, 1, 1] = 0.02
        state = state._replace(chain=((known,), *state.chain[1:]))

        @jax.jit
        def decide(state, uniforms, agent=agent):
            return decision(agent, state, y, uniforms, jnp.sum).state

        for uniforms in np.random.default_rng(0).random((40, 2), np.float32):
            state = decide(state, uniforms)
        moved[name] = np.abs(np.asarray(state.policy.threshold) - np.asarray(policy.threshold)).max()
        assert np.isfinite(jax.tree.leaves(state.policy)).all()
    assert 0 < moved["damped"] < 1e-3
    assert moved["not damped"] > 10 * moved["damped"]


@pytest.mark.ci
@pytest.mark.representatives("gaussians")
@pytest.mark.parametrize("name", ["motoneurons", "factored", "mirrored", "gaussians", "softmax"])
def test_a_matrix_of_nothing_moves_nothing_and_a_singular_one_stays_finite(name):
    policy, metric = rng_policies(3)[name], FisherMetric(0.5, 0.0, 0.0)
    state = metric.init(policy)
    ones = jax.tree.map(np.ones_like, trainable(policy))
    for leaf in jax.tree.leaves(preconditioned(metric, state, policy, ones)):
        np.testing.assert_array_equal(leaf, 0)

    @eqx.filter_jit
    def observed(state, y):
        action = policy.mode(y)
        return metric.observe(state, policy, seen(y, action)), policy.score(y, action)

    state, score = observed(state, np.array([0.3], np.float32))  # of rank one
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(preconditioned(metric, state, policy, score)))


def test_it_starts_as_the_plain_gradient_and_forgets_that():
    policy, metric = Hyperplanes([[0.5], [0.1]], [0.0, 0.2]), FisherMetric(0.1, 0.0, 1.0)
    state = metric.init(policy)
    gradient = trainable(policy)
    found = preconditioned(metric, state, policy, gradient)
    np.testing.assert_allclose(oracle.flat(found), oracle.flat(gradient), rtol=1e-5)

    @eqx.filter_jit
    def observed(state, y, action):
        return metric.observe(state, policy, seen(y, action)), abilities.fisher(policy, y, action)[0]

    for _ in range(30):
        state, fisher = observed(state, np.array([0.7], np.float32), np.array([1.0, 0.0], np.float32))
    kept = 0.9**30
    expected = kept * np.eye(2) + (1 - kept) * np.asarray(fisher)
    np.testing.assert_allclose(state[0], expected, rtol=1e-5, atol=1e-7)


def test_a_batch_learner_solves_once_a_batch_and_steps_by_the_natural_gradient():
    policy, metric = Hyperplanes([[0.5], [0.1]], [0.0, 0.2]), FisherMetric(0.1, 0.02)
    agent = Agent(policy, Estimator(Exponential(0.5), update_every=5), SGD(0.1), metric)
    state, rng = started(agent), np.random.default_rng(0)
    for number in range(10):
        _, _, observed, after = decided(agent, state, [0.7], rng.random(2), rng.normal())
        direction = preconditioned(metric, observed.chain[0], observed.policy, observed.gradient.mean)
        if number % 5 == 4:
            expected = oracle.flat(trainable(state.policy)) + 0.1 * oracle.flat(direction)
            np.testing.assert_allclose(oracle.flat(trainable(after.policy)), expected, rtol=1e-5)
        else:
            jax.tree.map(np.testing.assert_array_equal, after.policy, state.policy)
        state = after


def test_it_goes_before_any_rule_and_keeps_fixed_fields():
    policy = LocalGaussians([[0.5]], [[0.0]], 0.6)
    agent = Agent(policy, olgarb(0.5), Adam(0.01), FisherMetric(0.1, {"centre": 0.1, "log_width": 0.01}))
    state, rng = started(agent), np.random.default_rng(0)
    blocks = jax.tree.map(np.zeros_like, state.chain[0])
    found = preconditioned(agent.metric, blocks, policy, trainable(policy))  # of no matrix but the damping
    np.testing.assert_allclose(found.centre, np.asarray(policy.centre) / 0.1, rtol=1e-4)
    for number in range(5):
        state = decided(agent, state, [0.7], rng.random(1), 1.0 + number).state
    assert float(state.policy.p_max) == pytest.approx(0.6)
    assert not np.array_equal(state.policy.centre, policy.centre)
