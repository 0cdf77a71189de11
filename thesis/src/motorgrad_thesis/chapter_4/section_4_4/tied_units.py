"""Section 4.4: a fixed number of units whose activation is correlated, in groups that fire as one."""

from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import Posture
from motorgrad.policies import Policy, Tied
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import exact, mean_of, share_of
from motorgrad.tasks import ArmRecruitment
from motorgrad.training import Run, agent_for
from motorgrad_thesis._claims import Claim, above, at_most, below, more_than_half, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, SubFigure
from motorgrad_thesis.chapter_4._pools import firing_probability
from motorgrad_thesis.chapter_4._postures import BothPostures
from motorgrad_thesis.chapter_4.section_4_4.large_loads import REWARD_TYPES, SILENT, TITLES, LargeLoads

START = {"kind": "tied-motoneurons", "low": 0.0, "high": 10.0}
"""The task's own units, in groups."""


@experiment("sec-4.4-tied", "units whose activation is correlated", "section 4.4")
class TiedUnits(BothPostures):
    """Pools of a fixed size, whose units are tied into groups that fire as one, learn to lift only large loads, as in
    `sec-4.4-large-loads`: independent units fall silent there, because the number that fires at first is always near
    one half. Few groups draw every force from none to all. Groups may also be halved in the course of learning, until
    every unit is independent. For comparison, as many independent units as there are groups, whose force is a ratio.
    """

    units: int = count(32, 2, 1024, help="number of units in each pool")
    groups: tuple[int, ...] = static(
        (2, 4, 8, 32), allowed=Range(1, 1024, kind="int"), help="numbers of groups, rising; the last that of the units"
    )
    seeds: int = count(24, 2, 10_000, help="number of pools of each kind")
    steps: int = count(150_000, 200, 10**9, unit="decisions", help="length of the practice of each pool")
    least: float = number(
        12.0, 0, 14, open_low=True, open_high=True, unit="kg", help="the smallest of the loads; the greatest is 14"
    )

    def validate(self) -> None:
        super().validate()
        self.check_rising("groups", 2)
        check(self.groups[-1] == self.units, "groups", self.groups, f"rising to {self.units}, the number of units")

    quick = smoke(units=4, groups=(2, 4), seeds=3, steps=2_000)
    size = (8, 4.7)

    @property
    def phases(self) -> int:
        """The number of phases in which groups are halved, from the first number of groups to single units."""
        return 1 + int(np.ceil(np.log2(self.units / self.groups[0])))

    def measure(self, work: Workspace, posture: Posture) -> Values:
        large = LargeLoads(least=self.least)
        loads = np.linspace(self.least, 14.0, 41)
        found: Values = {"groups": np.array(self.groups), "units": np.array(self.units)}
        found["sampled"] = np.array([sampled(groups, self.least / 14.0) for groups in self.groups])
        for reward_type in REWARD_TYPES:
            task = large.task(reward_type, "large", self.units, posture)
            runs = [self._train(work, task, groups, self.steps) for groups in self.groups]
            found[f"{reward_type} tied"] = np.array([_active(run.policies, loads) for run in runs])
            few = large.task(reward_type, "large", self.groups[0], posture)
            alone = work.train(few, agent_for(few), self.steps, self.seeds)
            found[f"{reward_type} few"] = _active(alone.policies, loads)
            found[f"{reward_type} halved"] = np.array(
                [_active(run.policies, loads) for run in self._halved(work, task)]
            )
        return found

    def _halved(self, work: Workspace, task: ArmRecruitment) -> Iterator[Run]:
        """Runs one after the other, in equal parts of the practice, each with twice the groups of the one before."""
        steps = self.steps // self.phases
        run = self._train(work, task, self.groups[0], steps)
        yield run
        for phase in range(1, self.phases):
            pools: Any = run.policies
            finer = jax.vmap(Tied.halved)(pools)
            run = self._train(work, task, min(self.groups[0] * 2**phase, self.units), steps, finer)
            yield run

    def _train(
        self, work: Workspace, task: ArmRecruitment, groups: int, steps: int, initial: Policy | None = None
    ) -> Run:
        agent = agent_for(task, policy={**START, "groups": groups})
        return work.train(task, agent, steps, self.seeds, initial)

    def draw(self, figure: SubFigure, values: Values, posture: Posture) -> None:
        """Above: how much of each pool fires at the loads after learning. Below: the same while groups are halved."""
        axes = figure.subplots(2, len(TITLES), sharey=True)
        for column, (reward_type, title) in enumerate(TITLES.items()):
            _dots(axes[0, column], values["groups"], values[f"{reward_type} tied"])
            grown = values[f"{reward_type} halved"]
            counts = np.minimum(values["groups"][0] * 2 ** np.arange(len(grown)), values["units"])
            _dots(axes[1, column], counts, grown)
            axes[0, column].set_title(title, fontsize=11)
            axes[0, column].set_xlabel("groups, fixed")
            axes[1, column].set_xlabel("groups, halved from phase to phase")
        for row in axes:
            row[0].set_ylabel("fraction\nthat fires")

    def judge(self, values: Values, posture: Posture) -> Iterator[Claim]:
        groups = values["groups"]
        units = int(values["units"])
        part = self.least / 14.0
        yield above(
            float(values["sampled"][-1]),
            f"{groups[0]} groups draw the force that the loads need from the start, independent units do not.",
            exact(values["sampled"][0]),
            f"probability that {part:.0%} of the pool fires or more, each unit with probability ½,",
            note="By number of groups: "
            + ", ".join(f"{g}: {p:.2g}" for g, p in zip(groups, values["sampled"], strict=True)),
            kind="extension",
        )
        for reward_type, words in TITLES.items():
            tied = values[f"{reward_type} tied"]
            silent = tied < SILENT
            yield at_most(
                1e-3,
                f"A fixed number of units in {groups[0]} groups learns as {groups[0]} units whose force is a ratio "
                f"({words}).",
                exact(np.abs(tied[0] - values[f"{reward_type} few"]).max()),
                "greatest difference, over all seeds, of the fraction that fires after learning",
                of="Few units whose force is a ratio are equivalent to a fixed number of units whose activation is "
                "correlated.",
            )
            yield positive(
                f"Units in {groups[0]} groups fall silent less often than {units} independent ones ({words}).",
                mean_of(silent[-1] * 1.0 - silent[0]),
                "difference of the shares of silent pools",
                note=f"Silent: less than {SILENT:.0%} fires. By number of groups: "
                + ", ".join(f"{g}: {share_of(s)}" for g, s in zip(groups, silent, strict=True)),
                kind="extension",
            )
            grown = values[f"{reward_type} halved"]
            yield below(
                0.5,
                f"Groups that are halved until all units are independent do not fall silent ({words}).",
                share_of(grown[-1] < SILENT),
                "share of silent pools",
                note="In the mean fires after each phase: " + ", ".join(f"{row.mean():.2f}" for row in grown),
                kind="extension",
                source="our own expectation, after section 4.4",
            )
            yield more_than_half(
                f"Halved groups fire more at large loads than units that are independent from the start ({words}).",
                share_of(grown[-1] > tied[-1] + SILENT),
                "share of seeds",
                kind="extension",
                source="our own expectation, after section 4.4",
            )


def sampled(groups: int, part: float) -> float:
    """The probability that this part of equal groups fires, or more, each with probability ½."""
    from scipy import stats

    return float(stats.binom.sf(np.ceil(part * groups - 1e-9) - 1, groups, 0.5))


def _active(policies: Policy, loads: np.ndarray) -> np.ndarray:
    """The fraction of each pool that fires at the loads, `(seeds,)`."""
    return firing_probability(policies, loads).mean(axis=(1, 2))


def _dots(axes: Axes, counts: np.ndarray, active: np.ndarray) -> None:
    """Every seed's pool, in columns by the number of groups, and the number of silent ones."""
    spread = np.linspace(-0.25, 0.25, active.shape[1])
    for place, row in enumerate(active):
        axes.plot(place + spread, np.sort(row), ".", color=f"C{place}", markersize=4)
        axes.text(place, 1.05, f"{np.sum(row < SILENT)} of {len(row)}\nsilent", ha="center", va="bottom", fontsize=7.5)
    axes.set_xticks(range(len(counts)), [str(each) for each in counts])
    axes.set(ylim=(-0.04, 1.22), yticks=np.linspace(0, 1, 6))
