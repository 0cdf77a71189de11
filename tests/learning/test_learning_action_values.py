"""The gradient of an action's value: exact on bandits, its critic by the formulas, and policies that it leads up."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decision, started, told

import motorgrad as mg
from motorgrad.learning import (
    ActionValueGradient,
    ActionValues,
    Adam,
    ConjugateAscent,
    RewardScaling,
    Transition,
)
from motorgrad.policies import (
    Architecture,
    BoundedHyperplanes,
    GradedHyperplanes,
    MultilayerPerceptron,
    Softmax,
    split,
)

CENTRE = 0.7
TINY = MultilayerPerceptron((4,), layer_norm=False, sparsity=0.0, unit_length=True)


def unit() -> Any:
    return GradedHyperplanes(weights=jnp.array([[0.2]]), bias=jnp.array([-0.1]), log_deviation=jnp.array([-1.0]))


class Bowl(eqx.Module):
    """A single feature, −(a − 0.7 y)²."""

    def __call__(self, x):
        return -jnp.square(x[1:] - CENTRE * x[:1])


class Bowls(Architecture):
    """Layers whose output is that of `Bowl`."""

    def build(self, inputs, key):
        return Bowl()


def values_known(policy):
    """Action values and their state, where $Q = -(a - 0.7 y)^2$."""
    values: Any = ActionValues(network=Bowls())
    state = values.init(policy, jnp.float64, jax.random.key(0))
    return values, state._replace(weights=eqx.tree_at(lambda w: w.weights, state.weights, jnp.ones(1)))


def grid(count):
    return (np.arange(count) + 0.5) / count


@pytest.mark.ci
def test_of_normal_units_it_is_the_exact_gradient_of_a_quadratic_bandit():
    """E Q = −((m − c)² + s²), and a nat of entropy log s is worth 0.3."""
    with jax.enable_x64(True):
        policy = unit()
        values, state = values_known(policy)
        look = jnp.array([1.5])

        def sample(u):
            return values.gradient(state, policy, look, jnp.array([u]), 0.3)

        found = jax.tree.map(lambda g: g.mean(0), jax.vmap(sample)(jnp.asarray(grid(20_000))))
        m, s = 0.2 * 1.5 - 0.1, 0.02 + math.exp(-1.0)
        of_m, of_s = -2 * (m - CENTRE * 1.5), (-2 * s + 0.3 / s) * math.exp(-1.0)
        np.testing.assert_allclose(found.bias[0], of_m, rtol=1e-4)
        np.testing.assert_allclose(found.weights[0, 0], 1.5 * of_m, rtol=1e-4)
        np.testing.assert_allclose(found.log_deviation[0], of_s, atol=1e-4)  # near 0


@pytest.mark.ci
@pytest.mark.representatives("squashed")
@pytest.mark.parametrize("density", ["squashed", "clipped", "truncated"])
def test_of_bounded_units_it_is_the_slope_of_the_mean_value(density):
    """Against finite differences of the mean over the random numbers."""
    with jax.enable_x64(True):
        look, uniforms = np.array([1.0]), grid(4_000)

        def units(theta):
            level, noise = theta
            noise, zero = jnp.array([noise]), jnp.array([[0.0]])
            low, high = jnp.array(-1.0), jnp.array(2.0)
            return BoundedHyperplanes(
                weights=zero,
                bias=jnp.array([level]),
                log_deviation=noise,
                low=low,
                high=high,
                density=density,
            )

        @jax.jit
        def mean(theta):
            policy = units(theta)
            actions = jax.vmap(lambda u: policy.sample(look, u[None]))(uniforms)
            return jnp.mean(-jnp.square(actions - CENTRE)) + 0.2 * policy.entropy(look)

        @jax.jit
        def sampled():
            policy = units((0.3, -0.8))
            values, state = values_known(policy)

            def sample(u):
                return values.gradient(state, policy, look, u[None], 0.2)

            return jax.tree.map(jnp.mean, jax.vmap(sample)(uniforms))

        found = sampled()
        step = 1e-4
        slopes = [
            (mean((0.3 + step, -0.8)) - mean((0.3 - step, -0.8))) / (2 * step),
            (mean((0.3, -0.8 + step)) - mean((0.3, -0.8 - step))) / (2 * step),
        ]
        np.testing.assert_allclose([found.bias, found.log_deviation], slopes, rtol=0.02, atol=1e-3)


def test_a_decision_of_the_critic_is_that_of_the_formulas():
    policy: Any = unit()
    values = ActionValues(0.9, 0.01, network=TINY)

    @eqx.filter_jit
    def first(key):
        state = values.init(policy, jnp.float32, key)
        return state._replace(weights=eqx.tree_at(lambda w: w.weights, state.weights, jnp.arange(4.0)))

    @eqx.filter_jit
    def taught(state, transition, key):
        """The value and its slope, the value that follows, and the state after a decision."""
        learned, settings = split(state.weights)

        def value(weights):
            return values.value(eqx.combine(weights, settings), transition.observation, transition.action)

        following = policy.sample(transition.next_observation, jax.random.uniform(key, (1,), jnp.float32))
        later = values.value(state.weights, transition.next_observation, following)
        return *jax.value_and_grad(value)(learned), later, values.update(state, policy, transition, worth)

    state = first(jax.random.key(0))
    squares: Any = 0.0
    looks, worth, bonuses = np.array([[0.5], [-1.0], [0.3]], np.float32), 0.1, []
    entropy = float(policy.entropy(looks[0]))
    for t, (reward, ends) in enumerate([(1.0, False), (-0.5, True)]):
        action = np.array([0.3 - t], np.float32)
        key = jax.random.fold_in(jax.random.wrap_key_data(state.key), 0)
        transition = Transition(looks[t], action, np.float32(reward), looks[t + 1], np.bool_(ends))
        value, slope, later, after = taught(state, transition, key)
        later = float(later) + worth * entropy
        bonuses.append(reward + worth * entropy)
        gammas = [0.9, 0.0][: t + 1]
        variance = np.var(bonuses) + np.var(gammas) * (np.sum(bonuses) ** 2 if ends else 0)
        sigma = np.sqrt(variance) if variance > 0 else 1.0
        error, slope = (reward + 0.9 * (not ends) * later - float(value)) / sigma, flat(slope)
        squares = 0.999 * squares + 0.001 * (error * slope) ** 2
        wanted = 0.01 * error * slope / (np.sqrt(squares / (1 - 0.999 ** (t + 1))) + 1e-8)
        moved = flat(split(after.weights)[0]) - flat(split(state.weights)[0])
        np.testing.assert_allclose(moved, wanted, rtol=2e-3, atol=1e-6)
        state = after


def flat(tree):
    return np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(tree)])


@pytest.mark.ci
def test_the_last_layer_may_have_unit_length():
    several = MultilayerPerceptron((8, 5), sparsity=0.0, unit_length=True)
    flat = MultilayerPerceptron((8,), "relu", layer_norm=False, sparsity=0.0, unit_length=True)

    @jax.jit
    def both(key, look):
        return jnp.linalg.norm(several.build(3, key)(look)), flat.build(3, key)(jnp.zeros(3))

    length, nothing = both(jax.random.key(0), np.array([0.5, -2.0, 1.0], np.float32))
    assert float(length) == pytest.approx(1, rel=1e-5)
    np.testing.assert_array_equal(nothing, 0)


def bandit(seeds, steps):
    """The mean error of the mean action of learners on the bandit −(a − 0.7 y)² with noise, before and after."""
    network = MultilayerPerceptron((32,), "tanh", layer_norm=False, sparsity=0.0)
    policy = BoundedHyperplanes(weights=jnp.zeros((1, 1)), bias=jnp.zeros(1), log_deviation=-jnp.ones(1))
    values = ActionValues(0.0, 3e-3, network=network)
    agent = ActionValueGradient(policy, values, entropy=0.01, optimizer=Adam(3e-3, b1=0.0))

    def live(key):
        def decide(carry, key):
            state, look = carry
            draw, noise, following = jax.random.split(key, 3)
            after = jax.random.uniform(following, (1,), minval=-1, maxval=1)

            def reward(action):
                return -jnp.square(action[0] - CENTRE * look[0]) + 0.3 * jax.random.normal(noise)

            state = decision(agent, state, look, jax.random.uniform(draw, (1,)), reward, after).state
            return (state, after), None

        first = agent.init(key)
        (state, _), _ = jax.lax.scan(decide, (first, jnp.zeros(1)), jax.random.split(key, steps))
        looks = jnp.linspace(-1, 1, 21)[:, None]
        return [jnp.abs(jax.vmap(each.policy.mode)(looks) - CENTRE * looks).mean() for each in (first, state)]

    return np.array(jax.jit(jax.vmap(live))(jax.random.split(jax.random.key(1), seeds)))


@pytest.mark.ci
def test_it_learns_a_bandit():
    before, after = bandit(8, 4_000)
    assert before.min() > 0.3
    assert after.max() < 0.15


@pytest.mark.parametrize("name", ["baseline", "normalization", "bound", "entropy_in", "trace", "metric", "growth"])
def test_settings_of_the_policy_gradient_alone_are_unknown(name):
    with pytest.raises(ValueError, match=f"unknown setting of agent '{name}'"):
        mg.agent_for("hopper", {"kind": "action-value-gradient", name: "none"})


def test_optimizers_that_do_not_step_from_every_gradient_are_refused():
    with pytest.raises(ValueError, match="optimizer = 'ConjugateAscent': must be one that makes a step of every"):
        ActionValueGradient(unit(), optimizer=ConjugateAscent())


def test_densities_that_have_no_slope_in_jax_are_refused():
    policy = BoundedHyperplanes(jnp.zeros((1, 1)), jnp.zeros(1), jnp.zeros(1), density="beta")
    with pytest.raises(ValueError, match="must be one whose actions JAX can differentiate, such as of the densities"):
        eqx.filter_eval_shape(ActionValueGradient(policy).init, jax.random.key(0))


def test_policies_that_draw_no_real_numbers_are_refused():
    with pytest.raises(ValueError, match="policy = 'Softmax': must be one with real-valued actions"):
        ActionValueGradient(Softmax(np.zeros((2, 2)))).init(jax.random.key(0))


@pytest.mark.ci
def test_what_diverged_and_the_scale_of_rewards():
    values, scaling = ActionValues(network=TINY), RewardScaling(0.9)
    agent = ActionValueGradient(unit(), values, reward_scaling=scaling, optimizer=Adam(1e-3, b1=0.0))
    state: Any
    broken: Any
    paid: Any
    begun = started(agent)
    state, _, broken = told(agent, begun, np.ones(1), [0.3], np.nan, [np.nan], diverged=True)
    kept, was = broken.values, state.values
    jax.tree.map(np.testing.assert_array_equal, split(kept.weights)[0], split(was.weights)[0])
    assert float(broken.sample.bias[0]) == 0
    paid = told(agent, begun, np.ones(1), [0.3], 1.0, terminated=True)[2]
    assert float(paid.values.scale.earned) == 0
    assert int(paid.values.scale.squares.count) == 1


@pytest.mark.slow
def test_the_preset_is_for_real_valued_actions():
    task = mg.tasks.from_gymnasium("Pendulum-v1")
    agent: Any = mg.presets.avg(task, changes={"policy.network.hidden": [8], "values.network.hidden": [8]})
    assert (agent.optimizer.b1, agent.values.network.unit_length) == (0.0, True)
    run = mg.train(task, agent, steps=20, progress=False)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(split(run.policies)[0]))
    with pytest.raises(ValueError, match="must be one with real-valued actions"):
        mg.train("chain", mg.presets.avg("chain"), steps=5, progress=False)
