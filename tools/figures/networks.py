"""The figure of networks: a boundary that no hyperplane has, and the hidden units that make it."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from matplotlib.figure import Figure

from motorgrad.policies import MultilayerPerceptron, Network, Policy, abilities, hyperplanes, split
from tools.figures._style import inputs, over, panels, plane

REACH = 1.5
STEPS = 1_500
BATCH = 64


def network() -> Figure:
    """A unit that learned to fire in a ring, without and with hidden layers, and four of the last layer's units."""
    policy = taught(hyperplanes(2, 1, network=MultilayerPerceptron((32, 16), sparsity=0.5))(jax.random.key(0)))
    assert isinstance(policy, Network)
    x, y = plane(REACH, 81)
    figure, axes = panels(6, height=1.75, sharey=True)
    for panel, title, each in ((axes[0], "no layers", taught(hyperplanes(2, 1))), (axes[1], "two layers", policy)):
        fires = over(each.prob, x, y)[..., 0]
        panel.pcolormesh(x, y, fires, cmap="Blues", vmin=0, vmax=1.4, rasterized=True)
        panel.contour(x, y, fires, levels=[0.5], colors="black", linewidths=0.8)
        inputs(panel, title)
    last = over(lambda seen: abilities.hidden_activations(policy, seen)[-1], x, y)
    weights = np.asarray(policy.pool.weights)[0]  # type: ignore[attr-defined]
    for panel, unit in zip(axes[2:], np.argsort(-np.abs(weights))[:4], strict=True):
        shown = last[..., unit]
        most = np.abs(shown).max()
        panel.pcolormesh(x, y, shown, cmap="RdBu_r", vmin=-most, vmax=most, rasterized=True)
        inputs(panel, f"hidden, $w$ = ${weights[unit]:.1f}$")
    for panel in axes[1:]:
        panel.set(ylabel="")
    return figure


def taught(policy: Policy) -> Policy:
    """A unit after steps along its scores for the right actions: to fire where the input is in a ring."""
    learned, rest = split(policy)
    rule = optax.adam(0.01)

    def step(carry: Any, key: jax.Array) -> Any:
        parameters, state = carry
        seen = jax.random.uniform(key, (BATCH, 2), minval=-REACH, maxval=REACH)
        wanted = (jnp.abs(jnp.linalg.norm(seen, axis=1) - 0.9) < 0.35).astype(jnp.float32)[:, None]
        scores = jax.vmap(eqx.combine(parameters, rest).score)(seen, wanted)
        updates, state = rule.update(jax.tree.map(lambda s: -s.mean(0), scores), state)
        return (eqx.apply_updates(parameters, updates), state), None

    keys = jax.random.split(jax.random.key(1), STEPS)
    (learned, _), _ = jax.jit(lambda start: jax.lax.scan(step, start, keys))((learned, rule.init(learned)))
    return eqx.combine(learned, rest)
