"""Figure 6.6: where a learned policy acts."""

from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.policies import Policy
from motorgrad.schema import count
from motorgrad.statistics import exact, share_of
from motorgrad.tasks import FallingParticle
from motorgrad_thesis._claims import Claim, below, more_than_half
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, new_figure
from motorgrad_thesis.chapter_6._local_study import LocalStudy, late_reward, median_row, policy_at, visited
from motorgrad_thesis.chapter_6._pairs import BothPairs, Pair, settings_of

DRAWS = 2_000  # samples of the action at each place, to check the probability
SILENT = 0.05
SURE = 0.9
QUIET_SHARE = 0.1  # fraction of the box


@experiment("fig-6.6", "where a learned policy acts", "figure 6.6")
class AnyUnitFires(BothPairs, LocalStudy):
    """The probability that at least one unit fires, over the box, for the policy of the median seed in R2: a landscape
    of the places where it acts.
    """

    looks: int = count(200, 1, 10**6, help="number of episodes of every seed, for the places that its particle visits")
    cells: int = count(60, 10, 1_000, help="number of cells along each side of the box")

    quick = smoke(decisions=2_000, seeds=3, looks=20, cells=20)

    def measure(self, work: Workspace, pair: Pair) -> Values:
        task = FallingParticle(layout="R2")
        run = self.learned(work, "R2", **settings_of(pair))
        sides = (np.arange(self.cells) + 0.5) / self.cells
        places = np.stack(np.meshgrid(sides, sides), axis=-1).reshape(-1, 2)
        policies = [policy_at(run.policies, row) for row in range(self.seeds)]
        row = median_row(late_reward(run))
        return {
            "sides": sides,
            "row": np.array(row),
            "any": np.stack([any_fires(policy, places) for policy in policies]).reshape(-1, self.cells, self.cells),
            "any where it is": np.array([any_fires(each, visited(task, each, self.looks)).mean() for each in policies]),
            "any before learning": any_fires(policy_at(run.initial, 0), places).reshape(self.cells, self.cells),
            "drawn": sampled_firing(policies[row], places).reshape(self.cells, self.cells),
        }

    def draw(self, values: Values) -> Figure:
        figure = new_figure(9.4, 4.6)
        x, y = np.meshgrid(values["sides"], values["sides"])
        before = values["any before learning"]
        learned = values["any"][int(values["row"])]
        for column, (surface, title) in enumerate(((before, "before learning"), (learned, "learned in R2")), 1):
            axes: Any = figure.add_subplot(1, 2, column, projection="3d")
            axes.plot_surface(
                x, y, surface, cmap="viridis", vmin=0, vmax=1, rcount=60, ccount=60, linewidth=0, antialiased=True
            )
            axes.set(xlim=(0, 1), ylim=(0, 1), zlim=(0, 1), xticks=(0, 0.5, 1), yticks=(0, 0.5, 1), zticks=(0, 0.5, 1))
            axes.set(xlabel="x", ylabel="y")
            axes.set_title(title, fontsize=10)
            axes.view_init(elev=38, azim=-62)
            axes.set_box_aspect((1, 1, 0.55), zoom=0.95)
        figure.suptitle("probability that at least one unit fires", fontsize=11)
        return figure

    def judge(self, values: Values, pair: Pair) -> Iterator[Claim]:
        found = values["any"]
        row = int(values["row"])
        error = float(np.abs(found[row] - values["drawn"]).max())
        # six standard deviations of a share of one half
        bound = 6 * 0.5 / np.sqrt(DRAWS)
        yield below(
            bound,
            "The surface is 1 − Π(1 − p), the probability that some unit fires.",
            exact(error),
            f"greatest difference from the share in {DRAWS:,} samples, against six standard deviations,",
            kind="extension",
        )
        yield more_than_half(
            "The response is local: in part of the box, the policy does not act.",
            share_of((found < SILENT).mean((1, 2)) >= QUIET_SHARE),
            f"share of seeds with a probability below {SILENT:g} on at least {QUIET_SHARE:.0%} of the box",
            note=f"On average on {(found < SILENT).mean():.0%} of it; before learning on "
            f"{(values['any before learning'] < SILENT).mean():.0%}.",
            source="section 6.1",
        )
        yield more_than_half(
            "Somewhere, the policy is certain to act.",
            share_of(found.max((1, 2)) > SURE),
            f"share of seeds with a probability above {SURE:g} somewhere",
        )
        yield more_than_half(
            "It acts where the particle passes.",
            share_of(values["any where it is"] > found.mean((1, 2))),
            "share of seeds that act more probably along the particle's paths than over the whole box",
            note=f"{values['any where it is'].mean():.2f} along the paths, {found.mean():.2f} over the box.",
            kind="extension",
            source="our own expectation, from section 6.5.4: local units only have an effect near the dynamics",
        )


def any_fires(policy: Policy, places: np.ndarray) -> np.ndarray:
    """Probability that at least one unit fires at each place, `(places,)`."""
    fires = jax.vmap(policy.prob)(jnp.asarray(places, jnp.float32))
    return np.asarray(1 - jnp.prod(1 - fires, axis=-1))


def sampled_firing(policy: Policy, places: np.ndarray) -> np.ndarray:
    """Share of samples of the action at each place in which some unit fires, `(places,)`."""
    at = jnp.asarray(places, jnp.float32)

    def draw(key: jax.Array) -> jax.Array:
        uniforms = jax.random.uniform(key, (len(places), policy.uniforms))
        return jax.vmap(policy.sample)(at, uniforms).any(axis=-1).astype(jnp.float32)

    return np.asarray(jax.lax.map(draw, jax.random.split(jax.random.key(0), DRAWS)).mean(0))
