"""Sub-policies behind gates: what is possible, the scores of what is open, and exact Fisher matrices."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import Compiled, compiled, observation_of, policy_of

from motorgrad.policies import (
    Factored,
    Gated,
    Hyperplanes,
    LocalGaussians,
    Motoneurons,
    Softmax,
    abilities,
    gated,
    tiles,
    trainable,
)
from motorgrad.tasks import FallingParticle

NAMES = ("gated", "gated-nested", "factored-gated")


def simple(gate=0.3, below=0.8):
    """One gate and one unit behind it, with these probabilities at 0."""
    odds = [[np.log(p / (1 - p))] for p in (gate, below)]
    return Gated(Hyperplanes([[1.0]], odds[0]), [Hyperplanes([[2.0]], odds[1])])


def test_the_three_possible_actions_have_the_products_of_the_parts():
    policy, y = Compiled(simple()), np.zeros(1)
    found = {tuple(map(int, a)): np.exp(policy.log_prob(y, a)) for a in abilities.enumerate(policy)}
    assert found == pytest.approx({(0, 0): 0.7, (1, 0): 0.3 * 0.2, (1, 1): 0.3 * 0.8}, rel=1e-6)
    assert policy.log_prob(y, np.float32([0.0, 1.0])) == -np.inf
    np.testing.assert_allclose(policy.prob(y), [0.3, 0.24], rtol=1e-6)


def test_the_mode_is_the_likeliest_joint_action_and_not_that_of_each_unit():
    y = np.zeros(1)
    # the gate fires with .55, but then two actions share that: silence, .45, is likelier than .55 × .6
    np.testing.assert_array_equal(Compiled(simple(0.55, 0.6)).mode(y), [0, 0])
    np.testing.assert_array_equal(Compiled(simple(0.55, 0.9)).mode(y), [1, 1])
    np.testing.assert_array_equal(Compiled(simple(0.9, 0.1)).mode(y), [1, 0])


def test_a_sub_policy_has_a_score_only_where_its_gate_fired():
    policy, y = simple(), np.array([0.4])
    closed, opened = (Compiled(policy).score(y, np.array([gate, 0.0])) for gate in (0.0, 1.0))
    np.testing.assert_array_equal(closed.branches[0].weights, 0)
    below = Compiled(policy.branches[0]).score(y, np.zeros(1))
    np.testing.assert_array_equal(opened.branches[0].weights, below.weights)
    assert (np.asarray(opened.branches[0].weights) != 0).all()
    for gate, score in ((0.0, closed), (1.0, opened)):
        np.testing.assert_array_equal(score.gate.weights, Compiled(policy.gate).score(y, np.array([gate])).weights)


def test_nothing_below_a_closed_gate_fires_however_deep():
    inner = Gated(Hyperplanes([[0.0]], [50.0]), [Hyperplanes([[0.0]], [50.0])])
    sure, never = (Gated(Hyperplanes([[0.0]], [bias]), [inner]) for bias in (50.0, -50.0))
    half = np.full(3, 0.5)
    np.testing.assert_array_equal(Compiled(sure).sample(np.zeros(1), half), [1, 1, 1])
    np.testing.assert_array_equal(Compiled(never).sample(np.zeros(1), half), [0, 0, 0])


@compiled
def _exactly(policy, y):
    def one(action):
        blocks = abilities.blocks(policy, policy.score(y, action))
        return jnp.exp(policy.log_prob(y, action)), blocks, abilities.fisher(policy, y, action)

    return jax.vmap(one)(abilities.enumerate(policy))


def exactly(policy, y):
    """Of every action its probability, the blocks of its score and the Fisher matrices, in NumPy."""
    return jax.tree.map(np.asarray, _exactly(policy, y))


@pytest.mark.representatives("gated")
@pytest.mark.parametrize("name", NAMES)
def test_the_fisher_matrices_are_the_blocks_of_the_exact_one_which_has_no_others(name):
    with jax.enable_x64(True):
        policy = policy_of(name)
        y = observation_of(policy)
        weight, rows, matrices = exactly(policy, y)
        flat = np.concatenate([np.reshape(block, (len(weight), -1)) for block in rows], axis=1)
        matrices = [matrix[0] for matrix in matrices]
    exact, start = np.einsum("a,ai,aj->ij", weight, flat, flat), 0
    rest = exact.copy()
    for matrix in matrices:
        for own in np.asarray(matrix):
            end = start + len(own)
            np.testing.assert_allclose(own, exact[start:end, start:end], rtol=1e-9, atol=1e-12)
            rest[start:end, start:end] = 0
            start = end
    assert start == len(exact)
    np.testing.assert_allclose(rest, 0, atol=1e-12 * (1 + np.abs(exact).max()))


@pytest.mark.ci
def test_where_units_share_parameters_the_fisher_matrix_is_the_sample_and_right_in_the_mean():
    with jax.enable_x64(True):
        shared = policy_of("admission-thresholds")
        policy = Gated(Hyperplanes([[0.2, 0.0, 0.0, 0.1]], [0.3]), [Factored([shared, shared])])
        y = jnp.array([0.0, 1.0, 0.0, 2.0])
        weight, blocks, matrices = exactly(policy, y)
    mean = np.einsum("a,auij->uij", weight, matrices[1])
    exact = np.einsum("a,aui,auj->uij", weight, blocks[1], blocks[1])
    np.testing.assert_allclose(mean, exact, rtol=1e-9, atol=1e-12)


@pytest.mark.representatives("gated")
@pytest.mark.parametrize("name", NAMES)
def test_blocks_are_taken_apart_and_joined_again(name):
    policy = policy_of(name)
    ask = Compiled(policy)
    score = ask.score(observation_of(policy), ask.enumerate()[-1])
    joined = ask.from_blocks(ask.blocks(score))
    assert jax.tree.structure(joined) == jax.tree.structure(trainable(policy))
    for found, wanted in zip(jax.tree.leaves(joined), jax.tree.leaves(score), strict=True):
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Gated(Hyperplanes([[1.0]], [0.0]), []), "branches = []: must be as many as the gate has units, 1"),
        (lambda: Gated(Softmax([[1.0]]), []), "gate = 'Softmax': must be a pool of binary units"),
        (lambda: Gated(simple(), [simple()] * 2), "gate = 'Gated': must be a pool of independent units"),
        (lambda: Gated(Hyperplanes([[1.0]], [0.0]), [Softmax([[1.0]])]), "branches = ['Softmax']"),
        (lambda: Gated(Hyperplanes([[1.0, 1.0]], [0.0]), [Motoneurons([0.0], [0.0])]), "branches = [1]"),
    ],
)
def test_impossible_hierarchies_are_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)


def test_gates_and_their_units_are_learned_together():
    """A reward for the gate on the right and, there, for the unit behind it: both must find it."""
    from motorgrad.learning import SGD, Agent, Transition, olgarb

    policy = Gated(
        LocalGaussians([[0.0]], [[1.0]], 0.9), [Gated(Hyperplanes([[0.0]], [0.0]), [Hyperplanes([[0.0]], [0.0])])]
    )
    agent = Agent(policy, olgarb(0.0), SGD(0.05))

    def decide(state, numbers):
        y = 2 * numbers[:1] - 1
        state, action = agent.act(state, y, numbers[1:])
        reward = jnp.where(y[0] > 0, action[2] - 0.5 * action[0] * (1 - action[2]), -action[0])
        return agent.update(agent.observe(state, Transition(y, action, reward, y))), reward

    numbers = np.random.default_rng(1).random((20_000, 4), np.float32)
    state, rewards = jax.jit(lambda key: jax.lax.scan(decide, agent.init(key), numbers))(jax.random.key(1))
    rewards = np.asarray(rewards)
    # At most .5 can be had, where the whole right half fires; a Gaussian cannot end at 0 without losing on one side.
    assert rewards[:500].mean() < 0
    assert rewards[-5_000:].mean() > 0.2
    left, right = (Compiled(state.policy).prob(np.array([y]))[2] for y in (-0.7, 0.7))
    assert left < 0.1 < 0.5 < right  # before: 0.22 on either side


def test_gates_stand_as_tiles_do_and_deeper_ones_within_a_width_of_them():
    policy = gated(FallingParticle(units=14), gates=2, levels=2, width=0.2)
    np.testing.assert_allclose(policy.gate.centre, tiles(2, 2).centre)
    np.testing.assert_allclose(np.exp(policy.gate.log_width), 0.2, rtol=1e-6)
    below = policy.branches[0]
    np.testing.assert_allclose(below.gate.centre, [[0.5, 0.15], [0.5, 0.35]], atol=1e-6)
    np.testing.assert_allclose(np.exp(below.gate.log_width), 0.08, rtol=1e-6)
    assert [type(branch) for branch in below.branches] == [Hyperplanes] * 2
    assert [branch.outputs for branch in below.branches] == [2, 2]


def test_units_that_do_not_go_evenly_behind_gates_are_dealt_out_all_the_same():
    policy = gated(2, 8, gates=3)
    assert [branch.outputs for branch in policy.branches] == [2, 2, 1]
    with pytest.raises(ValueError, match="outputs = 5"):
        gated(2, 5, gates=3)
