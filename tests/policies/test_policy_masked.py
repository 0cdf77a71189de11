"""Pools of fixed size of which some units are off: as the smaller pool, and the others do not exist."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from policy_examples import EXAMPLES, Compiled, compiled, observation_of, policy_of

from motorgrad.learning import SGD, Adam, Agent, FisherMetric, Transition, olpomdp
from motorgrad.policies import (
    Factored,
    Gated,
    Hyperplanes,
    LocalGaussians,
    Masked,
    Softmax,
    abilities,
    prune,
    trainable,
)

POOLS = (
    "motoneurons",
    "hyperplanes",
    "local-gaussians",
    "local-gaussians-p-max",
    "free-gaussians",
    "soft-spheres",
    "soft-boxes",
    "oriented-gaussians",
    "oriented-boxes",
)
ACTIVE = np.array([True, False, True])


def pair(name, seed=0):
    """A pool with its second unit off, and the pool without that unit."""
    pool = policy_of(name, seed)
    return Masked(pool, ACTIVE), prune(pool, ACTIVE), observation_of(pool, seed)


@compiled
def told(policy, y, actions):
    def over(method):
        return jax.vmap(lambda action: method(y, action))(actions)

    mode, fisher = policy.mode(y), abilities.fisher(policy, y, actions[0])
    return policy.prob(y), policy.entropy(y), mode, fisher, over(policy.log_prob), over(policy.score)


@pytest.mark.representatives("local-gaussians-p-max")
@pytest.mark.parametrize("name", POOLS)
def test_a_masked_pool_is_the_pool_without_the_units_that_are_off(name):
    few = np.array([[a, b] for a in (0.0, 1.0) for b in (0.0, 1.0)])
    actions, impossible = (np.insert(few, 1, off, axis=1) for off in (0.0, 1.0))
    with jax.enable_x64(True):
        masked, smaller, y = pair(name)
        own = jax.tree.map(np.asarray, told(masked, y, np.concatenate([actions, impossible])))
        wanted = jax.tree.map(np.asarray, told(smaller, y, few))
    np.testing.assert_allclose(own[0][ACTIVE], wanted[0], rtol=1e-12)
    assert own[0][1] == 0
    assert own[1] == pytest.approx(wanted[1], rel=1e-9)
    np.testing.assert_array_equal(own[2][ACTIVE], wanted[2])
    (fisher,), (exact,) = own[3], wanted[3]
    np.testing.assert_allclose(fisher[ACTIVE], exact, rtol=1e-9)
    np.testing.assert_array_equal(fisher[1], 0)
    np.testing.assert_allclose(own[4][:4], wanted[4], rtol=1e-12)
    np.testing.assert_array_equal(own[4][4:], -np.inf)
    for mine, theirs in zip(*map(jax.tree.leaves, (own[5], wanted[5])), strict=True):
        np.testing.assert_allclose(mine[:4, ACTIVE], theirs, rtol=1e-12)
        np.testing.assert_array_equal(mine[:4, 1], 0)


@pytest.mark.representatives("local-gaussians-p-max")
@pytest.mark.parametrize("name", POOLS)
def test_units_that_are_off_never_fire(name):
    masked, smaller, y = pair(name)
    uniforms = np.random.default_rng(2).random((512, 3), np.float32)
    uniforms[0] = 0
    taken = Compiled(masked).samples(y, uniforms)
    np.testing.assert_array_equal(taken[:, 1], 0)
    np.testing.assert_array_equal(taken[:, ACTIVE], Compiled(smaller).samples(y, uniforms[:, ACTIVE]))


RULES = {
    "sgd": (SGD(0.1), None),
    "adam": (Adam(0.1), None),
    "decay": (SGD(0.1, 0.1), None),
    "optax": (optax.chain(optax.add_decayed_weights(0.1), optax.sgd(0.1, momentum=0.9)), None),
    "natural": (SGD(0.1), FisherMetric(rate=0.1)),
}


@pytest.mark.representatives("False-optax", "True-adam")
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("wrapped", [False, True])
def test_parameters_of_units_that_are_off_do_not_move_by_any_rule(rule, wrapped):
    masked, _, y = pair("local-gaussians-p-max")
    policy = Factored([Gated(policy_of("hyperplanes"), [masked] * 3), masked]) if wrapped else masked
    optimizer, metric = RULES[rule]
    agent = Agent(policy, olpomdp(0.5), optimizer, metric)
    start = agent.init(jax.random.key(0))

    def decide(state, uniforms):
        state, action = agent.act(state, y, uniforms)
        return agent.update(agent.observe(state, Transition(y, action, jnp.float32(1.0), y))), None

    uniforms = np.random.default_rng(0).random((5, policy.uniforms), np.float32)
    state, _ = jax.jit(lambda state: jax.lax.scan(decide, state, uniforms))(start)
    inner = lambda policy: policy.pools[1] if wrapped else policy  # noqa: E731
    before, after = (inner(each.policy).pool for each in (start, state))
    for old, new in zip(jax.tree.leaves(trainable(before)), jax.tree.leaves(trainable(after)), strict=True):
        np.testing.assert_array_equal(new[1], old[1])
        assert (np.asarray(new)[ACTIVE] != np.asarray(old)[ACTIVE]).any()


def test_units_are_switched_on_within_one_compiled_program():
    pool, y, count = policy_of("hyperplanes"), observation_of(policy_of("hyperplanes")), 0

    @jax.jit
    def probability(active):
        nonlocal count
        count += 1
        return Masked(pool, active).prob(y)

    every = Compiled(pool).prob(y)
    for number in range(3):
        p = probability(np.arange(3) < number)
        np.testing.assert_allclose(p, np.where(np.arange(3) < number, every, 0), rtol=1e-6)
    assert count == 1


def test_the_mask_is_no_parameter_and_all_units_are_there_by_default():
    masked = Masked(policy_of("hyperplanes"))
    np.testing.assert_array_equal(masked.active, True)
    assert trainable(masked).active is None
    assert eqx.tree_equal(masked.pool, policy_of("hyperplanes"))


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Masked(Softmax([[1.0]])), "pool = 'Softmax': must be a pool of binary units"),
        (lambda: Masked(policy_of("gated")), "pool = 'Gated': must be a pool of independent units"),
        (lambda: Masked(policy_of("factored")), "pool = 'Factored'"),
        (lambda: Masked(policy_of("admission-thresholds")), "pool = 'AdmissionThresholds'"),
        (lambda: Masked(Hyperplanes([[1.0]], [0.0]), [True, False]), "active = (2,): must be of shape (1,)"),
        (lambda: Masked(Hyperplanes([[1.0]], [0.0]), [0.5]), "active = 'float32': must be true or false"),
    ],
)
def test_what_cannot_be_masked_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)


def test_every_kind_of_pool_that_can_be_masked_is_tried_here():
    for name in EXAMPLES:
        if name.removesuffix("-4") in POOLS or name == "masked":  # the same kind over four inputs
            continue
        with pytest.raises(ValueError, match="pool = "):
            Masked(policy_of(name))


def test_limits_hold_within_every_policy_that_wraps_a_pool():
    wide = LocalGaussians(np.zeros((2, 2)), np.full((2, 2), 3.0), log_width_limits=(-4.0, 2.0))
    gate = Hyperplanes(np.zeros((1, 2)), np.zeros(1))
    for policy, inner in (
        (Masked(wide), lambda p: p.pool),
        (Factored([gate, wide]), lambda p: p.pools[1]),
        (Gated(gate, [wide]), lambda p: p.branches[0]),
    ):
        np.testing.assert_array_equal(inner(abilities.limited(policy)).log_width, 2.0)
