"""Gradient estimates with graded units, against exact gradients of a world in which an action grades the transitions.

The world draws one of the three actions of a finite MDP, with probabilities that are polynomials of a real action. So
the exact probability of each is an integral over the continuous action, and the oracle does the rest.
"""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.learning import Agent, gpomdp
from motorgrad.policies import BoundedHyperplanes, Mixed, Policy
from motorgrad.tasks import FiniteTask
from motorgrad.training import stepper_for
from motorgrad.worlds import FiniteMDP, oracle

DECAY = 0.8
RNG = np.random.default_rng(3)
TRANSITIONS = RNG.dirichlet(np.full(3, 0.6), (3, 3))
FEATURES = np.array([[12, 6], [6, 12], [5, 5]]) / 18
NODES, WEIGHTS = np.polynomial.legendre.leggauss(100)


def chances(action):
    """The probability of each of the three actions: Bernstein's polynomials of an action in [−1, 1]."""
    x = (jnp.clip(action, -1, 1) + 1) / 2
    return jnp.stack([(1 - x) ** 2, 2 * x * (1 - x), x**2])


class GradedMDP(FiniteMDP):
    """A finite MDP, one of whose three actions is drawn with probabilities that a continuous action decides."""

    uniforms: ClassVar[int] = 2

    def step(self, state, action, uniforms):
        index = jnp.sum(uniforms[1] >= jnp.cumsum(chances(action[0]))[:-1], dtype=jnp.int32)
        return super().step(state, index, uniforms[:1])


MDP = GradedMDP(TRANSITIONS, [0.0, 0.3, 1.0], FEATURES)


@dataclasses.dataclass(frozen=True)
class GradedTask(FiniteTask):
    name: ClassVar[str] = "graded-mdp"
    actions: ClassVar[Any] = "continuous"
    action_size: ClassVar[int] = 1
    dynamics: ClassVar[FiniteMDP] = MDP


class Choosing(Policy):
    """The policy over the three actions that graded units amount to, by numerical integration over what they draw."""

    units: BoundedHyperplanes

    inputs, outputs = 2, 3
    prob = sample = mode = score = entropy = None

    def enumerate(self):
        return jnp.arange(3)

    @eqx.filter_jit
    def log_prob(self, observation, action):
        at = jax.vmap(lambda u: jnp.exp(self.units.log_prob(observation, u[None])))
        total = chances(jnp.asarray(NODES)) @ (WEIGHTS * at(jnp.asarray(NODES)))
        ends = jnp.array([-1.0, 1.0])
        if self.units._density.at_end(ends) is not False:
            total = total + chances(ends) @ at(ends)
        return jnp.log(total)[action]


SLOPE, LEVEL, NOISE = [[0.9, -0.4]], [-0.2], [-0.3]
UNITS = {
    name: BoundedHyperplanes(SLOPE, LEVEL, NOISE, density=name) for name in ("squashed", "clipped", "truncated", "beta")
}
UNITS["mixed"] = Mixed([UNITS["squashed"]])
NOISY = ("truncated", "beta")


def check_gradient(name, decisions, precision):
    policy = UNITS[name]
    units = policy.pools[0] if isinstance(policy, Mixed) else policy
    exact = oracle.flat(oracle.biased_gradient(MDP, Choosing(units), DECAY))
    assert np.abs(exact).min() > 1e-3  # every parameter counts
    stepper = stepper_for(GradedTask(), Agent(policy, gpomdp(DECAY)), range(400))
    stepper.advance(decisions)
    mean = stepper.state["cycle"].agent.gradient.mean
    units = mean.pools[0] if isinstance(policy, Mixed) else mean
    found = np.concatenate(
        [np.asarray(leaf, float).reshape(400, -1) for leaf in (units.weights, units.bias, units.log_deviation)], axis=1
    )
    error = found.std(0) / np.sqrt(len(found))
    assert np.linalg.norm(error) < precision * np.linalg.norm(exact)  # sharp enough for a bias to show
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error)


@pytest.mark.representatives("squashed")
@pytest.mark.parametrize("name", UNITS)
def test_the_mean_estimate_over_seeds_is_the_exact_gradient(name):
    check_gradient(name, 4_800 if name in NOISY else 2_400, 0.06)


@pytest.mark.slow
@pytest.mark.parametrize("name", UNITS)
def test_the_mean_estimate_over_long_runs_is_the_exact_gradient(name):
    check_gradient(name, 60_000, 0.015)
