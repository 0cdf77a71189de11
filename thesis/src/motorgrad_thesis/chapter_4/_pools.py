"""Pools of motoneurons: their exact statistics, the study of the linear mapping, and drawings."""

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from motorgrad.policies import Motoneurons, Policy, grow, trainable
from motorgrad.schema import Range, count, number, static
from motorgrad.tasks import LinearRecruitment, spacing_error
from motorgrad.training import Run, agent_for
from motorgrad_thesis._claims import Kind
from motorgrad_thesis._experiment import Experiment, Workspace, smoke
from motorgrad_thesis._figures import Axes

NATURAL: dict[str, Any] = {
    "metric": {"kind": "fisher", "rate": 3e-4, "damping": {"threshold": 0.05}},
    "learning_rate": 1e-4,
}
"""The natural gradient for loads from 0 to 1, for studies in which the plain gradient would take too long."""

NORMAL: dict[str, Any] = {
    "metric": {"kind": "fisher", "rate": 3e-4, "damping": {"threshold": 0.05, "gain": 1e-6}},
    "baseline": {"kind": "binned", "bins": 64, "rate": 0.02},
    "normalization": "root-mean-square",
    "learning_rate": 1e-3,
}
"""The learner for pools of any size: the natural step, a baseline that sees the load, normalised advantages, and a
little damping of the gain."""

LOADS = 200  # cells of the load; the force is evaluated at their midpoints
RATE = 2e-4
"""The thesis's step size."""

SPACED = 0.25
"""A pool counts as equally spaced if every threshold is within this many spacings of its ideal place."""

WITHIN_REACH = 4
"""The largest pool whose convergence the practice suffices for. How large the thesis's pools were, and how long they
practised, is not known; the six million decisions are ours, and eight units need 31 million in the mean field."""

THRESHOLD = "#c0392b"
EXPECTED = "black"
IDEAL = "#1b6b3a"
# light enough for lines of any colour
NEVER = "#ffffff"
ALWAYS = "#5a9bd4"


def whose(units: int) -> Kind:
    """Whose statement a claim about a pool of the linear mapping is: about larger pools than can converge, our own."""
    return "thesis" if units <= WITHIN_REACH else "extension"


def firing_probability(policies: Policy, loads: Any) -> np.ndarray:
    """Firing probability of each unit at each load, `(seeds, loads, units)`, for policies along a leading axis."""
    seen = jnp.asarray(loads, jnp.float32)[:, None]
    return np.asarray(jax.vmap(lambda policy: jax.vmap(policy.prob)(seen))(policies))


def entropy(threshold: Any, gain: Any, loads: Any) -> np.ndarray:
    """Entropy of the action in bits per unit, averaged over the loads: 1 if units fire purely by chance.

    **Arguments:** `threshold` and `gain`, `(…, units)`; `loads`. **Returns:** `(…)`.
    """
    seen = jnp.asarray(loads, jnp.float32)[:, None]

    def of(pool: Motoneurons) -> jax.Array:
        return jax.vmap(pool.entropy)(seen).mean() / (pool.outputs * jnp.log(2.0))

    return _of_each(of, threshold, gain)


def force_error(threshold: Any, gain: Any, task: LinearRecruitment) -> np.ndarray:
    """Root mean square error of the force, as a ratio, over uniformly distributed loads. Exact: no action is drawn.

    **Arguments:** `threshold` and `gain`, `(…, units)`; the task. **Returns:** `(…)`.
    """
    loads = task.low + (task.high - task.low) * (jnp.arange(LOADS) + 0.5) / LOADS
    sizes = jnp.asarray(task.sizes, jnp.float32)

    def of(pool: Motoneurons) -> jax.Array:
        fires = jax.vmap(pool.prob)(loads[:, None])
        bias = (fires * sizes).sum(-1) - task.target(loads)
        noise = (fires * (1 - fires) * sizes**2).sum(-1)
        return jnp.sqrt(jnp.mean(bias**2 + noise))

    return _of_each(of, threshold, gain)


def _of_each(function: Callable[[Motoneurons], jax.Array], threshold: Any, gain: Any) -> np.ndarray:
    """A number for every pool, for any leading axes."""
    parts = [jnp.asarray(part, jnp.float32).reshape(-1, np.shape(part)[-1]) for part in (threshold, gain)]
    found = jax.jit(jax.vmap(lambda threshold, gain: function(Motoneurons(threshold, gain))))(*parts)
    return np.asarray(found).reshape(np.shape(threshold)[:-1])


def thresholds_and_gains(policies: Policy) -> tuple[np.ndarray, np.ndarray]:
    """Thresholds and gains of pools of motoneurons, `(seeds, units)` each."""
    assert isinstance(policies, Motoneurons)
    return np.asarray(policies.threshold), np.asarray(policies.gain)


def parameter_history(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Thresholds and gains at every record, `(seeds, records, units)` each."""
    threshold, gain = (np.asarray(leaf, float) for leaf in jax.tree.leaves(trainable(run.policies_at())))
    return threshold.swapaxes(0, 1), gain.swapaxes(0, 1)


def with_new_unit(pools: Policy, threshold: Any, gain: float = 0.0) -> Motoneurons:
    """The pools of all seeds with one more unit each; `threshold` is one number, or one per seed."""
    thresholds = jnp.broadcast_to(jnp.asarray(threshold, jnp.float32), jax.tree.leaves(pools)[0].shape[:1])
    grown = jax.vmap(lambda pool, at: grow(pool, Motoneurons(at[None], jnp.full(1, gain))))(pools, thresholds)
    assert isinstance(grown, Motoneurons)
    return grown


def least_error(task: LinearRecruitment, strength: float = 1.0) -> float:
    """The mean error of the force, as a ratio, of equal noiseless units with the best number of active units at each
    load; `strength` scales the muscle."""
    loads = task.low + (task.high - task.low) * (np.arange(20_000) + 0.5) / 20_000
    parts = np.arange(task.units + 1) / task.units
    return float(np.abs(strength * parts - task.target(loads)[:, None]).min(axis=1).mean())


SIZES = Range(2, 64, kind="int")
"""Sizes of pools that learn the linear mapping or to lift."""


@dataclasses.dataclass(frozen=True)
class LinearStudy(Experiment):
    """Base of experiments on pools that have learned the linear mapping, by default with the thesis's numbers."""

    reading: ClassVar[str] = (
        "The coefficients of the mapping are taken the other way round than printed, as 1.2 x − 0.1: as "
        "printed, the force would fall with the load. The force is the number of active units, not their "
        "ratio, which takes N² times as long. How long the thesis practised is not known."
    )

    units: tuple[int, ...] = static((2, 3, 4, 8), allowed=SIZES, help="sizes of the pools, each once")
    steps: int = count(6_000_000, 200, 10**9, unit="decisions", help="length of the practice of every pool")
    seeds: int = count(24, 1, 10_000, help="number of pools of each size")
    rate: float = number(RATE, 0, help="the step size of all parameters")

    def validate(self) -> None:
        super().validate()
        self.check_rising("units", 2)

    quick = smoke(units=(2, 4), steps=2_000, seeds=3)

    def task(self, units: int) -> LinearRecruitment:
        """The task with the force as a count: as a ratio, learning takes `units`² times as long."""
        return LinearRecruitment(units=units)

    def trained(self, work: Workspace, task: LinearRecruitment) -> Run:
        """Trained pools, shared with other experiments of the same settings."""
        return work.train(task, agent_for(task, learning_rate=self.rate), self.steps, self.seeds)


def equally_spaced_from(decision: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """The decision from which each pool is equally spaced up to the end of the run; infinity if it never is.

    **Arguments:** `decision` (records,); `errors` (pools, records), in spacings; NaN counts as not spaced.
    """
    wrong = ~(errors < SPACED)
    last = np.where(wrong.any(1), wrong.shape[1] - 1 - np.argmax(wrong[:, ::-1], axis=1), -1)
    return np.append(decision.astype(float), np.inf)[last + 1]


def spacing_deviation(threshold: np.ndarray, gain: np.ndarray, task: LinearRecruitment) -> np.ndarray:
    """Deviation of each pool from equal spacing, in spacings (`spacing_error`); infinite if a unit has a negative gain.

    **Arguments:** thresholds and gains `(..., units)`; the task. **Returns:** (...).
    """
    return np.where((gain > 0).all(-1), spacing_error(threshold, task), np.inf)


def fires_at(
    thresholds: npt.ArrayLike, gains: npt.ArrayLike, inputs: npt.ArrayLike
) -> Float[np.ndarray, "inputs units"]:
    """Firing probability of each unit of one pool at each input."""
    pool = Motoneurons(jnp.asarray(thresholds, jnp.float32), jnp.asarray(gains, jnp.float32))
    return firing_probability(jax.tree.map(lambda leaf: leaf[None], pool), inputs)[0].astype(float)


def count_chances(fires: npt.ArrayLike) -> Float[np.ndarray, "... counts"]:
    """Exact probabilities that 0, 1 … N of N independent units fire (the Poisson binomial distribution).

    **Arguments:** `fires` (..., units), the firing probability of each. **Returns:** (..., units + 1).
    """
    each = np.asarray(fires, float)
    chances = np.ones((*each.shape[:-1], 1))
    for p in np.moveaxis(each, -1, 0):
        p = p[..., None]
        silent = chances * (1 - p)
        active = chances * p
        nothing = np.zeros_like(p)
        chances = np.concatenate([silent, nothing], -1) + np.concatenate([nothing, active], -1)
    return chances


def draw_pool(axes: Axes, thresholds: npt.ArrayLike, gains: npt.ArrayLike, inputs: np.ndarray) -> Any:
    """A pool over evenly spaced inputs. Colour: the probability of each number of active units; black: its expectation;
    red lines: the thresholds (dashed for units of negative gain).

    **Returns:** the coloured mesh, for a colour bar.
    """
    from matplotlib.colors import LinearSegmentedColormap

    fires = fires_at(thresholds, gains, inputs)
    chances = count_chances(fires)
    units = chances.shape[1] - 1
    shades = LinearSegmentedColormap.from_list("chance", [NEVER, ALWAYS])
    mesh = axes.pcolormesh(inputs, np.arange(units + 1), chances.T, cmap=shades, vmin=0, vmax=1, shading="nearest")
    mesh.set_rasterized(True)
    for threshold, gain in zip(np.asarray(thresholds), np.asarray(gains), strict=True):
        axes.axvline(threshold, color=THRESHOLD, linewidth=1.1, linestyle="-" if gain > 0 else "--")
    axes.plot(inputs, fires.sum(1), color=EXPECTED, linewidth=1.8)
    axes.set(xlim=(inputs[0], inputs[-1]), ylim=(-0.5, units + 0.5), yticks=range(units + 1))
    return mesh


def draw_thresholds(
    axes: Axes, thresholds: np.ndarray, gains: np.ndarray, reach: tuple[float, float], order: np.ndarray
) -> None:
    """The thresholds of every seed's pool `(seeds, units)`, one row each, the first of `order` at the top.

    A cross is a unit of negative gain; an arrow head at the border is a threshold outside of `reach`.
    """
    places = thresholds[order]
    positive = gains[order] > 0
    row = np.broadcast_to(np.arange(len(order))[:, None], places.shape)
    left = places < reach[0]
    right = places > reach[1]
    for chosen, mark in ((left, "<"), (right, ">"), (~left & ~right, None)):
        for these, usual, colour in ((chosen & positive, "o", THRESHOLD), (chosen & ~positive, "x", "black")):
            if not these.any():
                continue
            style: dict[str, Any] = {"color": colour, "markersize": 3.2, "clip_on": False, "zorder": 3}
            axes.plot(np.clip(places[these], *reach), row[these], mark or usual, **style)
    axes.set(xlim=reach, ylim=(len(order) - 0.4, -0.6), yticks=[])
