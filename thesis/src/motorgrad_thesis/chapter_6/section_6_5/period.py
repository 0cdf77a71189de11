"""Section 6.5.1: what the period of decisions makes of the probability of acting, and of a learned policy."""

import math
from collections.abc import Iterator
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.policies import LocalGaussians, Policy
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import difference_of, exact, mean_of, share_of
from motorgrad.tasks import FallingParticle
from motorgrad.training import Run, agent_for
from motorgrad.worlds import ParticlePhysics, ParticleStart
from motorgrad_thesis._claims import Claim, above, at_least, below, positive, within
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_intervals, subplots
from motorgrad_thesis.chapter_6._local_study import LAYOUTS, LayoutStudy
from motorgrad_thesis.chapter_6.section_6_5._falls import Falls, falls

TIMESTEP = 0.0125  # s, the shortest period; the integration of longer ones has at least the thesis's time step
HOLDS = (1, 2, 4, 8, 16, 32, 64)  # time steps for which an action is held
PERIODS = tuple(hold * TIMESTEP for hold in HOLDS)
USUAL = 0.2  # s, the thesis's period
COARSE = 0.1  # s, its time step
RELEARNED = (0.05, 0.4)  # s, other periods at which policies learn
WIDTH = 0.16
WEAK = 0.01  # a force that hardly bends the path, so that impulses add up along a straight line
ALMOST = 0.99
GRAZED = (0.02, 0.1)  # peak probabilities of units that a fall passes at some distance
DIFFERS = 0.005  # change of reward per decision that counts
COLOURS = ("C0", "C1", "C2", "C3", "C4", "C5")


@experiment("sec-6.5.1-period", "the response and the period of decisions", "section 6.5.1")
class Period(LayoutStudy):
    """A particle crosses the region of one local unit at a constant speed, and decides at several periods: the
    probability that the unit acts at least once, and its impulse. Then policies that learned R1 and R2 with the
    thesis's period of 0.2 s, frozen, decide at other periods; other learners have these periods from the start.
    """

    reading: ClassVar[str] = (
        "The thesis gives no numbers here; probabilities, speeds and periods are ours. Local units have the exact "
        "gradient."
    )

    seeds: int = 20
    peak: float = number(0.05, 0, 0.5, open_low=True, help="probability of firing at the centre of the crossed unit")
    speeds: tuple[float, ...] = static(
        (0.1, 0.2, 0.4), allowed=Range(0.02, 2.0), help="speeds at which a particle crosses it, box sides per s, rising"
    )
    crossings: int = count(4_000, 10, 10**6, help="number of crossings for each speed and period")
    looks: int = count(200, 10, 10**5, help="number of falls of every frozen policy at each period")

    def validate(self) -> None:
        super().validate()
        self.check_rising("speeds", 2)

    quick = smoke(decisions=2_000, seeds=3, layouts=LAYOUTS[:1], crossings=20, looks=10)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for speed in self.speeds:
            found |= work.part(f"speed {speed:g}", lambda speed=speed: self._crossed(speed))
        for layout in self.layouts:
            run = self.learned(work, layout)
            name = f"{layout} learned"
            made = work.part(name, lambda run=run, layout=layout: self._sampled(layout, run.policies))
            found |= {f"{name} {key}": value for key, value in made.items()}
            again = {period: self._relearned(work, layout, period).policies for period in RELEARNED}
            found |= work.part(
                f"{layout} again",
                lambda again=again, layout=layout: {
                    f"{layout} again {period:g}": self._fallen(layout, policies, period).reward.mean(1)
                    for period, policies in again.items()
                },
            )
        return found

    def _relearned(self, work: Workspace, layout: Any, period: float) -> Run:
        """Learners that decide with this period: the same time of practice, and the thesis's trace and steps per
        second. (With its steps per decision, shorter periods unlearn: over other seeds, 0.01 at 0.05 s in R1.)"""
        share = period / USUAL
        timestep = min(COARSE, period)
        physics = ParticlePhysics(timestep=timestep, substeps=round(period / timestep))
        task = FallingParticle(layout=layout, physics=physics)
        usual: Any = FallingParticle.learner
        rates = {name: rate * share for name, rate in usual["learning_rate"].items()}
        settings = agent_for(task, decay=usual["decay"] ** share, learning_rate=rates)
        return work.train(task, settings, round(self.decisions / share), self.seeds)

    def _crossed(self, speed: float) -> Values:
        """Whether the unit acted at least once, and for how long, in every crossing, `(periods, crossings)`; and the
        probability of the first by the closed form."""
        unit = LocalGaussians(jnp.full((1, 2), 0.5), jnp.full((1, 2), math.log(WIDTH)), p_max=jnp.full(1, self.peak))
        alone = jax.tree.map(lambda leaf: leaf[None], unit)
        task = FallingParticle(
            units=1,
            forces=((WEAK, 0.0),),
            physics=ParticlePhysics(gravity=(0.0, 0.0), drag=0.0, timestep=TIMESTEP, substeps=1),
            start=ParticleStart(x=(0.5, 0.5), y=(1.0, 1.0), velocity_y=(-speed, -speed)),
        )
        each = [falls(task, alone, hold, self.crossings) for hold in HOLDS]
        return {
            f"speed {speed:g} fired": np.stack([one.fired[0, :, 0] for one in each]),
            f"speed {speed:g} time": np.stack([one.pushes[0, :, 0] for one in each]),
            f"speed {speed:g} expected": np.array([self.at_least_once(speed, period) for period in PERIODS]),
        }

    def at_least_once(self, speed: float, period: float) -> float:
        r"""The probability $1 - \prod_t (1 - p(y_t))$ that the unit acts at least once, exact because nothing disturbs
        the path until it acts."""
        height = 1 - speed * period * np.arange(math.ceil(1 / (speed * period)))
        prob = self.peak * np.exp(-0.5 * ((height - 0.5) / WIDTH) ** 2)
        return float(1 - np.prod(1 - prob))

    def _fallen(self, layout: Any, policies: Policy, period: float) -> Falls:
        task = FallingParticle(layout=layout, physics=ParticlePhysics(timestep=TIMESTEP, substeps=1))
        return falls(task, policies, round(period / TIMESTEP), self.looks)

    def _sampled(self, layout: Any, policies: Policy) -> Values:
        """At every period: the reward, `(periods, policies)`; and for units that a fall only grazes, the share that
        acted and the mean of 1 − Π(1 − p) along the paths, which would be the same if pushes did not bend them,
        `(periods,)`."""
        each = [self._fallen(layout, policies, period) for period in PERIODS]
        grazed = [(GRAZED[0] < one.peak) & (one.peak < GRAZED[1]) for one in each]
        return {
            "reward": np.stack([one.reward.mean(1) for one in each]),
            "acted": np.array([one.fired[near].mean() for one, near in zip(each, grazed, strict=True)]),
            "expected": np.array([1 - one.silent[near].mean() for one, near in zip(each, grazed, strict=True)]),
        }

    def figure(self, values: Values) -> Figure:
        figure, panels = subplots(11, 6.6, 2, 2, sharex=True)
        (crossed, pushed), (grazed, paid) = panels
        for colour, speed in zip(COLOURS, self.speeds, strict=False):
            key = f"speed {speed:g}"
            crossed.plot(PERIODS, values[f"{key} expected"], color=colour, linewidth=1)
            shares = [share_of(each) for each in values[f"{key} fired"]]
            draw_intervals(
                crossed, PERIODS, shares, fmt="o", color=colour, markersize=4, label=f"{speed:g} sides per s"
            )
            time = values[f"{key} time"]
            middle = time.mean(1)
            pushed.fill_between(
                PERIODS, middle - time.std(1), middle + time.std(1), color=colour, alpha=0.15, linewidth=0
            )
            pushed.plot(PERIODS, middle, "o-", color=colour, markersize=4)
        crossed.set(ylim=(0, 1.03), ylabel="probability of acting at least once")
        crossed.set_title(f"crossing one unit of peak probability {self.peak:g}; lines: closed form", fontsize=9.5)
        crossed.legend(title="speed", fontsize=8.5)
        pushed.set(ylim=(0, None), ylabel="time of pushing in a crossing, s")
        pushed.set_title("mean and standard deviation over crossings", fontsize=9.5)
        for colour, layout in zip(COLOURS, self.layouts, strict=False):
            grazed.plot(PERIODS, values[f"{layout} learned expected"], color=colour, linewidth=1)
            acted = values[f"{layout} learned acted"]
            grazed.plot(PERIODS, acted, "o", color=colour, markersize=4, label=f"{layout}, learned at {USUAL:g} s")
            rewards = [mean_of(each) for each in values[f"{layout} learned reward"]]
            draw_intervals(
                paid, PERIODS, rewards, fmt="o-", color=colour, markersize=4, label=f"{layout}, learned at {USUAL:g} s"
            )
            again = [mean_of(values[f"{layout} again {period:g}"]) for period in RELEARNED]
            draw_intervals(
                paid,
                RELEARNED,
                again,
                fmt="s",
                color=colour,
                markerfacecolor="white",
                markersize=5,
                label=f"{layout}, learned at its own period",
            )
        grazed.set(ylim=(0, 1.03), ylabel="probability of acting at least once")
        grazed.set_title(
            f"units that fire at most with {GRAZED[0]:.0%} to {GRAZED[1]:.0%}; lines: 1 − Π(1 − p) along the paths",
            fontsize=9.5,
        )
        paid.set(ylim=(0, None), ylabel="mean reward along the fall")
        paid.axvline(USUAL, color="0.8", linewidth=0.8, zorder=0)
        for axes in (grazed, paid):
            axes.set(xscale="log", xlabel="period of decisions, s", xticks=PERIODS)
            axes.set_xticklabels([f"{period:g}" for period in PERIODS])
            axes.minorticks_off()
            axes.legend(fontsize=8.5)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        slow = self.speeds[0]
        fast = self.speeds[-1]
        fired = {speed: values[f"speed {speed:g} fired"].astype(float) for speed in self.speeds}
        yield at_least(
            ALMOST,
            "At short periods and low velocities even an improbable action is almost sure to be taken.",
            share_of(fired[slow][0]),
            f"share of crossings at {slow:g} sides per s, with decisions every {PERIODS[0]:g} s, in which a unit of "
            f"peak probability {self.peak:g} acts",
            note=f"{share_of(fired[slow][PERIODS.index(USUAL)]).value:.2f} at the thesis's period.",
        )
        yield positive(
            "Whether an action is taken depends on the period.",
            mean_of(fired[fast][0] - fired[fast][-1]),
            f"share of crossings at {fast:g} sides per s with an action, every {PERIODS[0]:g} s minus every "
            f"{PERIODS[-1]:g} s",
        )
        yield positive(
            "It depends on the velocity.",
            mean_of(fired[slow][PERIODS.index(USUAL)] - fired[fast][PERIODS.index(USUAL)]),
            f"share of crossings with an action every {USUAL:g} s, at {slow:g} minus at {fast:g} sides per s",
        )
        worst = max(
            np.abs(values[f"speed {speed:g} fired"].mean(1) - values[f"speed {speed:g} expected"]).max()
            for speed in self.speeds
        )
        yield below(
            4 * 0.5 / math.sqrt(self.crossings),
            "The probability is that of the closed form.",
            exact(worst),
            "greatest difference from 1 − Π(1 − p) over speeds and periods",
            note="The bound is four standard errors at a probability of ½.",
            kind="extension",
        )
        yield from self._impulses(values, slow)
        for layout in self.layouts:
            yield from self._policies(values, layout)

    def _impulses(self, values: Values, speed: float) -> Iterator[Claim]:
        """How long a unit pushes in a crossing."""
        time = values[f"speed {speed:g} time"]
        usual = PERIODS.index(USUAL)
        long = time[usual].mean()
        yield within(
            -0.1,
            0.1,
            "The mean impulse does not depend on the period: only the probability of any push does.",
            difference_of(time[0] / long, time[usual] / long),
            f"time of pushing with decisions every {PERIODS[0]:g} s minus that at {USUAL:g} s, relative to the latter",
            kind="extension",
        )
        fewer = PERIODS[0] / USUAL
        yield within(
            0.8 * fewer,
            1.2 * fewer,
            "Its variance falls as the period, so that short periods turn chance into a mean force.",
            mean_of((time[0] - time[0].mean()) ** 2 / time[usual].var()),
            f"variance with decisions every {PERIODS[0]:g} s relative to that at {USUAL:g} s",
            note=f"The ratio of the periods is {fewer:g}.",
            kind="extension",
        )

    def _policies(self, values: Values, layout: str) -> Iterator[Claim]:
        """How learned policies fare at other periods."""
        reward = values[f"{layout} learned reward"]
        usual = PERIODS.index(USUAL)
        for at, sign, change in ((0, 1, "gain"), (-1, -1, "loss")):
            yield above(
                DIFFERS,
                f"Stochasticity also determines the control: at another period the same policy earns another reward "
                f"({layout}, {PERIODS[at]:g} s).",
                mean_of(sign * (reward[at] - reward[usual])),
                f"{change} of reward along the fall relative to {USUAL:g} s",
                note=f"{reward[at].mean():.3f} and {reward[usual].mean():.3f}.",
                of="Stochasticity also determines the control.",
            )
        for period in RELEARNED:
            again = values[f"{layout} again {period:g}"]
            other = reward[PERIODS.index(period)]
            yield positive(
                f"It is better to learn with the period that is used ({layout}, {period:g} s).",
                difference_of(again, other),
                f"reward of policies that learned at {period:g} s minus that of policies that learned at {USUAL:g} s, "
                f"both at {period:g} s",
                note=f"{again.mean():.3f} and {other.mean():.3f}; learning rates and trace were scaled with "
                "the period, not chosen for it.",
                kind="extension",
                of="It is better to learn with the period that is used.",
            )
