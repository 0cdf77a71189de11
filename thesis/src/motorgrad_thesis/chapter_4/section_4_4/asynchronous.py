"""Section 4.4: units that learn in turn, and the gradient that they follow."""

from collections.abc import Iterator
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from motorgrad.policies import Alternating, Motoneurons, Policy, abilities
from motorgrad.schema import Range, count, static
from motorgrad.statistics import exact, mean_of, median_of
from motorgrad.tasks import LinearRecruitment
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, at_least, below
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, draw_intervals, subplots
from motorgrad_thesis.chapter_4._pools import LOADS, RATE, force_error, parameter_history

RESTS: tuple[Any, ...] = ("noisy", "quiet")
WORDS = {
    "together": "all together",
    "together-large": "all together, larger step",
    "noisy": "in turn, the others noisy",
    "quiet": "in turn, the others quiet",
    "quiet-long": "in long turns, the others quiet",
}
COLOURS = {"together": "0.3", "together-large": "0.65", "noisy": "C1", "quiet": "C0", "quiet-long": "C4"}
TRUE = 0.999  # cosine from which a direction counts as that of the true gradient


@experiment("sec-4.4-asynchronous", "units that learn in turn", "section 4.4")
class Asynchronous(Experiment):
    """Pools learn the linear mapping with all units together or in turn: at every decision it is one unit's turn to
    learn, and the others rest. Resting units fire as ever, or they are quiet: each does what is more probable. A step
    is as many times larger as there are units, so that each moves as far on average. Computed exactly along the way of
    pools that learn together: the direction to which turns add up, against the true gradient, and the noise of a unit's
    gradient samples.
    """

    reading: ClassVar[str] = (
        "The linear mapping is 1.2 x − 0.1, its coefficients swapped, as for figure 4.3; the force is the number of "
        "active units. The thesis does not say how units would take turns."
    )

    units: int = count(4, 2, 10, help="number of units in each pool, and of turns")
    hold: int = count(1_000, 2, 10**6, unit="decisions", help="length of a long turn; the others last one decision")
    seeds: int = count(20, 2, 10_000, help="number of pools of each kind")
    steps: int = count(1_500_000, 1_000, 10**9, unit="decisions", help="length of the practice of every pool")
    shares: tuple[float, ...] = static(
        (0.02, 0.2, 1.0),
        allowed=Range(0, 1, open_low=True),
        help="where on the way directions are compared, as shares of the practice, rising",
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("shares")

    quick = smoke(units=2, seeds=3, steps=2_000, hold=10)

    def settings(self) -> dict[str, dict[str, Any]]:
        """What differs from the task's own learner, for every way to learn."""
        turn = {"kind": "alternating-motoneurons", "turns": self.units}
        large = {"learning_rate": self.units * RATE}
        return {
            "together": {},
            "together-large": large,
            "noisy": {"policy": turn, **large},
            "quiet": {"policy": {**turn, "rest": "quiet"}, **large},
            "quiet-long": {"policy": {**turn, "rest": "quiet", "hold": self.hold}, **large},
        }

    def run(self, work: Workspace) -> Values:
        task = LinearRecruitment(units=self.units)
        found: Values = {"share": np.array(self.shares)}
        for name, changes in self.settings().items():
            run = work.train(task, agent_for(task, **changes), self.steps, self.seeds)
            threshold, gain = parameter_history(run)
            found["decision"] = run.curve("error")[0]
            found[f"{name} error"] = force_error(threshold, gain, task)
            if name == "together":
                places = [round(share * (threshold.shape[1] - 1)) for share in self.shares]
                pools = [_pools(threshold[:, place], gain[:, place]) for place in places]
                found |= _stacked([compared(task, each) for each in pools])
        return found

    def figure(self, values: Values) -> Figure:
        """The error of the force over decisions; then, along the way of pools that learn together, the cosine of the
        direction in turns and the true gradient, and the variance of a unit's sample relative to that without rest."""
        figure, (learning, direction, noise) = subplots(9.5, 3.3, 1, 3, width_ratios=[1.6, 1, 1])
        records = max(1, len(values["decision"]) // 50)
        for name, words in WORDS.items():
            error = values[f"{name} error"]
            draw_band(learning, values["decision"] / 1e6, error, COLOURS[name], words, records=records)
        learning.set(xlabel="million decisions", ylabel="error of the force (root mean square)", ylim=(0, None))
        learning.legend(fontsize=7.5)
        places = np.arange(len(values["share"]))
        for rest in RESTS:
            style = {"fmt": "o-", "markersize": 4, "color": COLOURS[rest], "label": f"the others {rest}"}
            draw_intervals(direction, places, [mean_of(row) for row in values[f"{rest} cosine"]], **style)
            draw_intervals(noise, places, [mean_of(row) for row in values[f"{rest} variance"]], **style)
        direction.set(ylabel="cosine with the true gradient")
        direction.axhline(0, color="0.8", linewidth=0.8, zorder=0)
        noise.set(ylabel="variance of a unit's sample", ylim=(0, None))
        noise.axhline(1, color="0.8", linewidth=0.8, zorder=0)
        noise.legend(fontsize=7.5, loc="upper left", bbox_to_anchor=(0, 0.92))
        for axes in (direction, noise):
            axes.set_xticks(places, [f"{share:.0%}" for share in values["share"]])
            axes.set_xlabel("share of the practice")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for share, cosine in zip(values["share"], values["quiet cosine"], strict=True):
            yield below(
                TRUE,
                f"Asynchronous learning does not follow the true gradient, the others quiet (after {share:.0%}).",
                mean_of(cosine),
                "cosine of the directions of all turns, added up, with the true gradient",
                of="If units update asynchronously, they do not follow the true gradient.",
            )
        yield at_least(
            TRUE,
            "It does if the others remain noisy.",
            exact(values["noisy cosine"].min()),
            "least cosine over all pools and times",
            kind="extension",
            source="our own expectation: the gradient of a factored policy is made of its units' gradients",
        )
        for share, ratio in zip(values["share"], values["quiet variance"], strict=True):
            yield below(
                1,
                f"The activation of the others corrupts a unit's gradient estimate (after {share:.0%}).",
                mean_of(ratio),
                "variance of a unit's gradient sample while the others are quiet, relative to that while they are not,",
                of="A unit's gradient estimate is corrupted by the noise of the others.",
            )
        for name in ("noisy", "quiet", "quiet-long"):
            yield below(
                1,
                f"Learning in turn is faster ({WORDS[name]}).",
                median_of(values[f"{name} error"].mean(1) / values["together error"].mean(1)),
                "mean error over all decisions, relative to learning together,",
                note=f"In the end: {_end(values, name)}; together: {_end(values, 'together')}; together with the "
                f"larger step: {_end(values, 'together-large')}.",
                kind="extension",
                source="section 4.4, which does not say how units would take turns",
            )


def compared(task: LinearRecruitment, pools: Motoneurons) -> Values:
    """Learning in turn compared with learning together, for pools along a leading axis, exactly: for both ways to rest
    the `cosine` of the sum of all turns' mean gradients with the true gradient, and the `variance` of a unit's sample
    at its own turn relative to that of pools that learn together, `(pools,)` each."""
    whole, noise = moments(task, pools)
    found: Values = {}
    for rest in RESTS:
        turns = [_turns(pools, clock, rest) for clock in range(task.units)]
        parts = [moments(task, turn) for turn in turns]
        added = np.sum([part[0] for part in parts], axis=0)
        lengths = np.linalg.norm(added, axis=1) * np.linalg.norm(whole, axis=1)
        found[f"{rest} cosine"] = (added * whole).sum(1) / lengths
        found[f"{rest} variance"] = np.sum([part[1] for part in parts], axis=0) / noise
    return found


def _pools(threshold: np.ndarray, gain: np.ndarray) -> Motoneurons:
    """Pools along a leading axis, in single precision."""
    return jax.vmap(Motoneurons)(jnp.asarray(threshold, jnp.float32), jnp.asarray(gain, jnp.float32))


def _turns(pools: Motoneurons, clock: int, rest: Any) -> Policy:
    """Pools along a leading axis at the turn of one of their units."""
    turns = pools.threshold.shape[1]

    def at(pool: Motoneurons) -> Alternating:
        return Alternating(pool, turns, rest=rest, clock=jnp.asarray(clock))

    return jax.vmap(at)(pools)


@eqx.filter_jit
def _moments(task: LinearRecruitment, policies: Policy) -> tuple[jax.Array, jax.Array]:
    loads = task.low + (task.high - task.low) * (jnp.arange(LOADS) + 0.5) / LOADS

    def of(policy: Policy) -> tuple[jax.Array, jax.Array]:
        actions = abilities.enumerate(policy)

        def at(load: jax.Array, action: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
            chance = jnp.exp(policy.log_prob(load[None], action)) / LOADS
            return chance, task.immediate(load[None], action), ravel_pytree(policy.score(load[None], action))[0]

        chance, reward, score = jax.vmap(jax.vmap(at, (None, 0)), (0, None))(loads, actions)
        samples = (reward - jnp.sum(chance * reward))[..., None] * score
        mean = jnp.sum(chance[..., None] * samples, (0, 1))
        return mean, jnp.sum(chance[..., None] * samples**2) - jnp.sum(mean**2)

    return jax.vmap(of)(policies)


def moments(task: LinearRecruitment, policies: Policy) -> tuple[np.ndarray, np.ndarray]:
    """The mean of the gradient samples of policies along a leading axis, with the mean reward as the baseline,
    `(policies, parameters)`; and their variance, added up over the parameters, `(policies,)`. Exact: by all actions at
    evenly spaced loads."""
    mean, variance = _moments(task, policies)
    return np.asarray(mean, float), np.asarray(variance, float)


def _stacked(rows: list[Values]) -> Values:
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def _end(values: Values, name: str) -> str:
    return f"{np.median(values[f'{name} error'][:, -1]):.3f}"
