"""Section 6.5.2: stochastic and deterministic units when a unit is added and when the dynamics change."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.learning import Learner
from motorgrad.policies import LocalGaussians, SoftSpheres, grow, tiles
from motorgrad.schema import count, number
from motorgrad.statistics import difference_of, mean_of
from motorgrad.tasks import FallingParticle
from motorgrad.training import agent_for
from motorgrad.worlds import ParticlePhysics
from motorgrad_thesis._claims import Claim, at_least, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_intervals, subplots
from motorgrad_thesis.chapter_6._local_study import EXACT_READ, LocalStudy
from motorgrad_thesis.chapter_6.section_6_5._falls import falls

UNITS = 8
COARSE = 0.1  # s, time step of the thesis
HOLD = 2  # time steps for which an action is held
RADIUS = 0.19  # of spheres at first; they fire about as often as Gaussians 0.16 wide
WIDE = 0.3  # of an added unit
RECOVERED = 0.95  # share of the reward before a change that counts as recovered


class Kind(NamedTuple):
    """A kind of units: description, colour, and learning rates."""

    words: str
    colour: str
    rates: Mapping[str, float]


GAUSSIAN_RATES = {"centre": 2e-4, "log_width": 8e-4}
SOFT_RATES = {"centre": 8e-5, "log_radius": 4e-4, "log_hardness": 0.0}
HARD_RATES = {"centre": 1.6e-5, "log_radius": 8e-5, "log_hardness": 0.0}
"""Smaller, because the score grows with the hardness."""

KINDS = {
    "gaussian": Kind("Gaussians", "C0", GAUSSIAN_RATES),
    "soft": Kind("soft spheres", "C2", SOFT_RATES),
    "hard": Kind("hardened spheres", "C3", HARD_RATES),
}
STOCHASTIC = ("gaussian", "soft")


class Change(NamedTuple):
    """A change of the dynamics: description, and factors on gravity, drag and forces."""

    words: str
    gravity: float = 1.0
    drag: float = 1.0
    force: float = 1.0

    def task(self, units: int = UNITS, fine: bool = False) -> FallingParticle:
        """The layout R1 with these dynamics; `fine` for one time step per decision, as frozen falls need it."""
        usual = ParticlePhysics()
        physics = ParticlePhysics(
            gravity=(0.0, usual.gravity[1] * self.gravity),
            drag=usual.drag * self.drag,
            timestep=COARSE,
            substeps=1 if fine else HOLD,
        )
        forces = tuple((self.force * x, y) for x, y in FallingParticle().forces)
        return FallingParticle(units=units, forces=forces, physics=physics)


SAME = Change("as learned")
SMALL = {
    "less gravity": Change("gravity × 0.8", gravity=0.8),
    "more gravity": Change("gravity × 1.25", gravity=1.25),
    "less drag": Change("drag × 0.8", drag=0.8),
    "more drag": Change("drag × 1.25", drag=1.25),
    "weaker": Change("forces × 0.8", force=0.8),
    "stronger": Change("forces × 1.25", force=1.25),
}
LARGE = {
    "gravity": Change("gravity × 2", gravity=2.0),
    "drag": Change("drag × 2", drag=2.0),
    "force": Change("forces × 0.5", force=0.5),
}


@experiment("sec-6.5.2-robustness", "stochastic units and change", "section 6.5.2")
class Robustness(LocalStudy):
    """Gaussians, which stay stochastic, soft spheres of fixed hardness, and spheres that are hardened half way through
    their practice, which makes them all but deterministic, learn the layout R1. Then the dynamics change a little, and
    the frozen policies are evaluated; or they change much, or a wide unit is added, and the policies learn on.
    """

    reading: ClassVar[str] = (
        f"The thesis names no units to compare with, and no changes; ours are on the page. {EXACT_READ}"
    )

    seeds: int = 20
    again: int = count(25_000, 100, 10**8, help="number of decisions of learning after a change")
    looks: int = count(200, 1, 10**5, help="number of falls of every frozen policy")
    softness: float = number(25.0, 0, 1e4, open_low=True, help="hardness of soft spheres, per side of the box")
    hardness: float = number(200.0, 0, 1e4, open_low=True, help="hardness of hardened spheres")

    quick = smoke(decisions=2_000, seeds=3, again=500, looks=10)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name in KINDS:
            learned = self._policies(work, name)
            found |= self._rewards(work, f"{name} same", SAME, learned)
            for way, change in SMALL.items():
                found |= self._rewards(work, f"{name} {way}", change, learned)
            for way, change in LARGE.items():
                found |= self._rewards(work, f"{name} {way}", change, learned)
                after = work.train(change.task(), self._learner(name, change.task()), self.again, self.seeds, learned)
                found |= self._rewards(work, f"{name} {way} after", change, after.policies)
            more = jax.vmap(grow, in_axes=(0, None))(learned, self._added(name))
            found |= self._rewards(work, f"{name} unit", SAME, more)
            task = SAME.task(UNITS + 1)
            after = work.train(task, self._learner(name, task), self.again, self.seeds, more)
            found |= self._rewards(work, f"{name} unit after", SAME, after.policies)
        return found

    def _learner(self, name: str, task: FallingParticle) -> Learner:
        settings: dict[str, Any] = {"learning_rate": dict(KINDS[name].rates)}
        if name != "gaussian":
            settings["policy"] = "soft-spheres"
        return agent_for(task, settings)

    def _policies(self, work: Workspace, name: str) -> Any:
        """Policies of a kind that have learned, seeds leading."""
        task = SAME.task()
        learner = self._learner(name, task)
        if name == "gaussian":
            return work.train(task, learner, self.decisions, self.seeds).policies
        places = tiles(task, copies=2).centre
        one = SoftSpheres(places, jnp.full(UNITS, math.log(RADIUS)), jnp.full(UNITS, math.log(self.softness)))
        start = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (self.seeds, *leaf.shape)), one)
        soft = self._learner("soft", task)
        if name == "soft":
            return work.train(task, soft, self.decisions, self.seeds, start).policies
        half = self.decisions // 2
        learned = work.train(task, soft, half, self.seeds, start).policies
        hard = jax.vmap(lambda pool: pool.with_temperature(self.softness / self.hardness))(learned)
        return work.train(task, learner, half, self.seeds, hard).policies

    def _added(self, name: str) -> Any:
        """The new unit, wide and in the middle, stochastic in every pool."""
        centre = jnp.full((1, 2), 0.5)
        if name == "gaussian":
            like: Any = tiles(SAME.task(), copies=2)
            return LocalGaussians(
                centre, jnp.full((1, 2), math.log(WIDE)), p_max=like.p_max, log_width_limits=like.log_width_limits
            )
        return SoftSpheres(centre, jnp.full(1, math.log(WIDE)), jnp.full(1, math.log(self.softness)))

    def _rewards(self, work: Workspace, name: str, change: Change, policies: Any) -> Values:
        """Rewards of frozen policies after a change, `(seeds,)`, under this name."""
        units = jax.tree.leaves(policies)[0].shape[1]
        task = change.task(units, fine=True)
        made = work.part(name, lambda: {"reward": falls(task, policies, HOLD, self.looks).reward.mean(1)})
        return {name: made["reward"]}

    def figure(self, values: Values) -> Figure:
        figure, (small, large, unit) = subplots(12, 4.0, 1, 3, width_ratios=[1.2, 1.2, 0.8])
        for column, (name, kind) in enumerate(KINDS.items()):
            shift = 0.16 * (column - 1)
            style: dict[str, Any] = {"color": kind.colour, "markersize": 5, "linestyle": "none"}
            usual = values[f"{name} same"].mean()
            kept = [mean_of(values[f"{name} {way}"] / usual) for way in SMALL]
            draw_intervals(small, np.arange(len(SMALL)) + shift, kept, marker="o", label=kind.words, **style)
            for place, (axes, way) in enumerate([*((large, way) for way in LARGE), (unit, "unit")]):
                at = (place if axes is large else 0) + 0.22 * (column - 1)
                for offset, suffix, face in ((-0.04, "", "white"), (0.04, " after", kind.colour)):
                    reward = [mean_of(values[f"{name} {way}{suffix}"])]
                    draw_intervals(axes, [at + offset], reward, marker="o", markerfacecolor=face, **style)
                if axes is unit:
                    axes.plot([at - 0.1, at + 0.1], [usual, usual], color=kind.colour, linewidth=1.2)
        small.axhline(1, color="0.8", linewidth=0.8, zorder=0)
        small.set(ylabel="reward, relative to that as learned")
        small.set_title("small changes, frozen policies", fontsize=10)
        small.set_xticks(
            range(len(SMALL)), [change.words.replace(" ×", "\n×") for change in SMALL.values()], fontsize=8
        )
        small.legend(loc="lower right", fontsize=8.5)
        large.set(ylabel="reward along the fall")
        large.set_title("large changes; filled: after further learning", fontsize=10)
        large.set_xticks(range(len(LARGE)), [change.words for change in LARGE.values()])
        unit.set(ylabel="reward along the fall")
        unit.set_title("a unit is added; lines: before", fontsize=10)
        unit.set_xticks([])
        for axes in (large, unit):
            axes.set_ylim(min(0, axes.get_ylim()[0]), None)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for name in STOCHASTIC:
            words = KINDS[name].words
            usual = values[f"{name} same"].mean()
            yield at_least(
                RECOVERED,
                f"Stochastic units find a new optimum when a unit is added ({words}).",
                mean_of(values[f"{name} unit after"] / usual),
                "reward after further learning relative to that before the unit was added",
                note=f"Relative reward when it was added {(values[f'{name} unit'] / usual).mean():.2f}.",
                of="Stochastic units find a new optimum when a unit is added.",
            )
            yield positive(
                f"They recover better than deterministic ones ({words}).",
                difference_of(self._kept(values, name, "unit after"), self._kept(values, "hard", "unit after")),
                "difference of the rewards relative to those before",
                note=f"Hardened spheres have {self._kept(values, 'hard', 'unit after').mean():.2f} of their reward, "
                f"{self._kept(values, 'hard', 'unit').mean():.2f} when the unit was added.",
                of="They recover better than deterministic ones.",
            )
            for way, change in LARGE.items():
                yield positive(
                    f"Stochastic units react to a change of the dynamics ({words}, {change.words}).",
                    mean_of(values[f"{name} {way} after"] - values[f"{name} {way}"]),
                    "reward after further learning minus that before",
                    "along the fall",
                    of="Stochastic units react to a change of the dynamics.",
                )
            yield positive(
                f"They react more than deterministic ones ({words}).",
                difference_of(self._gain(values, name), self._gain(values, "hard")),
                "difference of the mean gains over the changes",
                "along the fall",
                note=f"{self._gain(values, name).mean():.3f} and {self._gain(values, 'hard').mean():.3f}.",
                of="They react more than deterministic ones.",
            )
            yield positive(
                f"Stochastic policies cope better with small deviations of the dynamics ({words}).",
                difference_of(self._small(values, name), self._small(values, "hard")),
                "difference from hardened spheres of the rewards relative to those as learned, mean of six deviations",
                note=f"{self._small(values, name).mean():.3f} and {self._small(values, 'hard').mean():.3f}; rewards as "
                f"learned {values[f'{name} same'].mean():.3f} and {values['hard same'].mean():.3f} along the fall.",
                of="Stochastic policies cope better with small deviations of the dynamics.",
            )

    @staticmethod
    def _kept(values: Values, name: str, when: str) -> np.ndarray:
        """Rewards relative to the mean of the kind before any change, `(seeds,)`."""
        return values[f"{name} {when}"] / values[f"{name} same"].mean()

    def _small(self, values: Values, name: str) -> np.ndarray:
        return np.mean([self._kept(values, name, way) for way in SMALL], axis=0)

    @staticmethod
    def _gain(values: Values, name: str) -> np.ndarray:
        """What further learning adds after large changes, the mean over them, `(seeds,)`."""
        return np.mean([values[f"{name} {way} after"] - values[f"{name} {way}"] for way in LARGE], axis=0)
