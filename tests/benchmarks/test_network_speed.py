"""The networks of the speed table: the learner in torch is ours, and the row says what was measured."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.benchmarks import _networks as networks
from motorgrad.learning import Transition
from motorgrad.policies._graded import normal_of

STEPS = 6


@pytest.mark.ci
@pytest.mark.needs("motorgrad[peers]")
def test_the_learner_in_torch_takes_the_same_steps():
    import torch

    agent = networks.learner((16, 8))
    state = agent.init(jax.random.key(0))
    peer = networks.TorchLearner(state.policy, state.estimator.baseline.weights)
    start = [p.detach().numpy().copy() for p in (*peer.of_policy, *peer.of_critic)]
    rng = np.random.default_rng(0)
    looks = rng.uniform(-1, 1, (STEPS + 1, networks.OBSERVED)).astype(np.float32)
    uniforms = rng.uniform(size=(STEPS, networks.ACTED)).astype(np.float32)

    @jax.jit
    def decide(state, look, number, after):
        state, action = agent.act(state, look, number)
        return agent.update(agent.observe(state, Transition(look, action, -jnp.mean(action * action), after)))

    for t in range(STEPS):
        peer.step(*map(torch.tensor, (looks[t], np.array(normal_of(uniforms[t])), looks[t + 1])))
        state = decide(state, looks[t], uniforms[t], looks[t + 1])
    policy, critic = state.policy, state.estimator.baseline.weights
    wanted = []
    for module, *last in (
        (policy.module, policy.pool.weights, policy.pool.bias, policy.pool.log_deviation),
        (critic.layers, critic.weights[None], critic.bias[None]),
    ):
        wanted += [leaf for layer in module.layers[::3] for leaf in (layer.weight, layer.bias)] + last
    found = [p.detach().numpy().copy() for p in (*peer.of_policy, *peer.of_critic)]
    for one, other, begun in zip(found, wanted, start, strict=True):
        assert np.any(one != begun)
        np.testing.assert_allclose(one - begun, other - begun, rtol=1e-2, atol=1e-6)


@pytest.mark.slow
def test_the_row_has_the_learner_in_torch_or_says_that_it_is_missing(monkeypatch):
    monkeypatch.setattr(networks, "HIDDEN", (4, 4))
    found = networks.network(50, 20, 1)
    assert (found.other is None) == bool(found.also)
    monkeypatch.setattr(networks, "installed", lambda package: False)
    found = networks.network(50, 20, 1)
    assert (found.other, found.also) == (None, "torch is not installed: extra peers")
    assert found.ours > 0
