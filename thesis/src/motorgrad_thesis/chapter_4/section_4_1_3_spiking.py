"""Section 4.1.3: policy gradients of integrate-and-fire neurons as a Hebbian rule, and pools of them that learn."""

from collections.abc import Iterator
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.policies import Policy, SpikingUnits
from motorgrad.schema import count, number
from motorgrad.statistics import mean_of, median_of, ratio_of
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, above, below, positive, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, draw_intervals, subplots
from motorgrad_thesis.chapter_4._spikes import ACTIVE, TwitchingMuscle, pairings, responses

LEARNER: dict[str, Any] = {
    "decay": 0.9,
    "normalization": "root-mean-square",
    "baseline": {"kind": "binned", "bins": 32, "rate": 0.02},
}
NATURAL: dict[str, Any] = {"metric": {"kind": "fisher", "rate": 1e-3, "damping": 1e-3}}
LEARNERS: dict[str, tuple[str, str, float, dict[str, Any]]] = {
    "hebbian": ("spiking, Hebbian step", "#3b6fb6", 4.0, {"learning_rate": 1e-3}),
    "natural": ("spiking, natural step", "#5b9c51", 4.0, {**NATURAL, "learning_rate": 3e-4}),
    "sigmoid": ("without memory,\nnatural step", "#c8452f", 0.0, {**NATURAL, "learning_rate": 2e-4}),
}
"""The pools by name: label, colour, time constant of the membrane in decisions, and the learner. Step sizes were chosen
on seeds 100 to 105."""

INPUTS = 100
RATE = 0.01
WEIGHT = 0.25
THRESHOLD = 4.5
"""A neuron with many inputs, each of which fires once in a hundred decisions on average."""
CONSTANT = 10
REACH = 4 * CONSTANT
"""Its membrane's time constant, and the longest time between spikes that are looked at, in decisions."""

DRIVES = np.linspace(0.05, 0.95, 7)
WEAK = 0
MEDIUM = 3
STRONG = 6
"""Places among the drives."""
LAST = 0.1  # share of the records, the last, that counts as the end
MATCHED = 1.1


@experiment("sec-4.1.3-spiking", "spiking motoneurons that learn by a Hebbian rule", "section 4.1.3")
class Spiking(Experiment):
    """Leaky integrate-and-fire neurons whose weights follow the policy gradient. When does a weight change, relative to
    the spikes of its input and of the neuron? And do pools of such motoneurons learn to grade a force?
    """

    reading: ClassVar[str] = (
        "The thesis cites Bartlett and Baxter (1999) and runs no spiking neurons itself. Neuron, muscle and the wanted "
        "force, 0.4 x + 0.05 of the force of all units at once, are ours."
    )

    units: int = count(8, 1, 64, help="number of units in a pool")
    steps: int = count(500_000, 200, 10**9, unit="decisions", help="length of the practice of each pool")
    decisions: int = count(20_000, 1_000, 10**6, help="for which the neuron is watched, for each seed")
    held: int = count(2_000, 100, 10**6, unit="decisions", help="for which learned pools are watched at each drive")
    seeds: int = count(20, 2, 1000, help="number of neurons, and of pools of each kind")
    hold: float = number(200.0, 1, 1e6, unit="decisions", help="mean time for which a drive lasts")

    quick = smoke(steps=2_000, decisions=1_000, held=200, seeds=2)

    def run(self, work: Workspace) -> Values:
        found: Values = dict(work.part("neuron", self._neuron))
        task = TwitchingMuscle(units=self.units, hold=self.hold)
        for name, (_, _, constant, settings) in LEARNERS.items():
            policy = {"kind": "spiking", "time_constant": constant, "weight": 1.0, "low": 1.0, "high": 4.0}
            run = work.train(task, agent_for(task, policy=policy, **LEARNER, **settings), self.steps, self.seeds)
            found["decision"], found[f"{name} error"] = run.curve("error")
            found[f"{name} end"] = run.final("error", LAST)
            found |= work.part(f"{name} responses", lambda name=name, run=run: self._responses(name, run.policies))
        return found

    def _neuron(self) -> Values:
        """The mean step by the time between the spikes of an input and of the neuron, `(seeds, lags)`."""
        weights = jnp.full((1, INPUTS), WEIGHT)
        neuron = SpikingUnits(weights, jnp.array([THRESHOLD]), jnp.exp(-1 / CONSTANT))
        keys = [jax.random.key(seed) for seed in range(self.seeds)]
        return {"step": np.array([pairings(neuron, RATE, self.decisions, key, REACH) for key in keys])}

    def _responses(self, name: str, policies: Policy) -> Values:
        rates, variation = responses(policies, DRIVES, self.held)
        return {f"{name} rates": rates, f"{name} variation": variation}

    def figure(self, values: Values) -> Figure:
        """Four panels: the mean step of a weight by the time between spikes, for each seed and on average; the error of
        the force over decisions; the mean force of each pool over the drive; and how every unit of the first seed's
        pool with the natural step responds to the drive."""
        figure, axes = subplots(9.6, 6.6, 2, 2)
        window, error, force, units = axes.flat
        lags = np.arange(-REACH, REACH + 1)
        window.plot(lags, values["step"].T, color="#3b6fb6", linewidth=0.4, alpha=0.3)
        window.plot(lags, values["step"].mean(0), color="#3b6fb6", linewidth=1.8)
        window.axhline(0, color="0.5", linewidth=0.8, linestyle=":")
        window.axvline(0, color="0.5", linewidth=0.8, linestyle=":")
        window.set(
            title="a Hebbian rule", xlabel="spike of the neuron − spike of the input (decisions)",
            ylabel="mean score of the weight",
        )  # fmt: skip
        for name, (label, colour, _, _) in LEARNERS.items():
            draw_band(error, values["decision"] / 1e3, values[f"{name} error"], colour, label)
            means = values[f"{name} rates"].mean(2)
            draw_intervals(
                force, DRIVES, [mean_of(each) for each in means.T], color=colour, capsize=2, linewidth=1.2, fmt="o-",
                markersize=3,
            )  # fmt: skip
        error.set(title="error of the force", xlabel="thousand decisions", yscale="log")
        error.legend(fontsize=8)
        task = TwitchingMuscle()
        force.plot(DRIVES, task.wanted(DRIVES), color="0.3", linewidth=1, linestyle="--", label="wanted")
        force.set(title="spikes of a pool", xlabel="drive", ylabel="mean of all units, per decision", ylim=(0, None))
        force.legend(fontsize=8)
        units.plot(DRIVES, values["natural rates"][0], color="#5b9c51", linewidth=1.2)
        units.set(title="spikes of each unit, seed 0", xlabel="drive", ylabel="per decision", ylim=(-0.03, 1.03))
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        step = values["step"]
        chance = step[:, -CONSTANT:].mean(1)  # when the spikes have nothing to do with each other
        near = step[:, REACH + 1 : REACH + 1 + CONSTANT].mean(1) - chance
        yield positive(
            "A weight grows with the firing of its input and of its neuron after it: a positive correlational rule.",
            mean_of(near),
            "mean score of a weight whose input fired in the ten decisions before the neuron, beyond that of unrelated "
            "spikes,",
        )
        far = step[:, REACH + 2 * CONSTANT : REACH + 3 * CONSTANT].mean(1) - chance
        yield below(
            0.25,
            "The two must fire nearly at the same time.",
            mean_of(far / near),
            "the same after two to three time constants of the membrane, relative to the first,",
        )
        yield within(
            -0.05,
            0.05,
            "An input that fires after the neuron changes nothing on average.",
            mean_of(step[:, REACH - CONSTANT : REACH].mean(1) / near),
            "mean score of a weight whose input fired in the ten decisions after the neuron, relative to before it,",
            kind="extension",
        )
        task = TwitchingMuscle()
        constant = task.slope / 4  # of the best force that does not depend on the drive
        for name, words in (("hebbian", "Hebbian"), ("natural", "natural")):
            first = values[f"{name} error"][:, 0] / constant
            yield below(
                0.25,
                f"Pools of spiking motoneurons learn to grade the force, by the {words} step.",
                median_of(values[f"{name} end"] / constant),
                "error in the last tenth, relative to that of the best constant force,",
                note=f"In the first of {values['decision'].size} records {np.median(first):.2f}.",
                kind="extension",
            )
        yield below(
            MATCHED,
            "They grade it as well as the same units without a memory.",
            ratio_of(values["natural end"], values["sigmoid end"]),
            "error by the natural step, relative to units without a memory,",
            kind="extension",
        )
        rates = values["natural rates"]
        recruited = (rates > ACTIVE).sum(2)
        yield above(
            0,
            "A stronger drive recruits more of the spiking units.",
            mean_of(recruited[:, STRONG] - recruited[:, WEAK]),
            f"units that fire at a drive of {DRIVES[STRONG]:g} but not at {DRIVES[WEAK]:g}",
            "units",
            note=f"Of {self.units}, {recruited[:, WEAK].mean():.1f} fire at the weak drive, and "
            f"{recruited[:, STRONG].mean():.1f} at the strong one.",
            kind="extension",
        )
        yield above(
            1,
            "And those that fired already fire faster: the rate grades the force, too.",
            median_of(_speeding(rates)),
            f"rate at a drive of {DRIVES[STRONG]:g}, relative to {DRIVES[MEDIUM]:g}, of units that fire at both",
            "times as fast",
            kind="extension",
        )
        variation = [np.nanmean(values[f"{name} variation"][:, MEDIUM], axis=1) for name in ("natural", "sigmoid")]
        yield below(
            1,
            "Their spikes are more regular.",
            ratio_of(*variation),
            f"coefficient of variation of the intervals at a drive of {DRIVES[MEDIUM]:g}, relative to units without a "
            "memory,",
            note=f"Means {variation[0].mean():.2f} and {variation[1].mean():.2f}.",
            kind="extension",
        )


def _speeding(rates: np.ndarray) -> np.ndarray:
    """How much faster the units fire at the strong drive that fire at the medium one, on average for each pool."""
    active = rates[:, MEDIUM] > ACTIVE
    medium = np.where(active, rates[:, MEDIUM], 0).sum(1)
    strong = np.where(active, rates[:, STRONG], 0).sum(1)
    return strong / medium
