"""Figure 6.4: the tiled policy before learning, and the particle's paths under it."""

import dataclasses
from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from motorgrad.plane import draw_occupancy, draw_paths, draw_regions, draw_units, occupancy, trajectories
from motorgrad.policies import LocalGaussians, tiles
from motorgrad.schema import count
from motorgrad.statistics import exact, mean_of
from motorgrad.tasks import FallingParticle
from motorgrad.worlds import ParticleStart
from motorgrad_thesis._claims import Claim, below, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, subplots
from motorgrad_thesis.chapter_6._local_study import gaussians

LENGTH = 24.5  # decisions in an episode, in an independent model
FALL = 2.0  # seconds
GRAVITY = 0.25
DRAG = 1.0
SHOVES = {"none": (0.0, 0.0), "left": (-0.4, 0.0)}
"""Force of all units, for comparison with the policy."""


@experiment("fig-6.4", "the initial tiled policy", "figure 6.4")
class InitialPolicy(Experiment):
    """Eight local units in four places, at each of which one pushes left and one right, before learning: paths of the
    falling particle, and its stationary distribution.
    """

    reading: ClassVar[str] = (
        "The stages of the integrator are halved and multiplied by the step, which the printed formulas of "
        "appendix A.3 leave out."
    )

    episodes: int = count(
        15_000, 10, 10**6, help="number of episodes over which the share of time in each place is sampled"
    )
    drawn: int = count(12, 1, 1_000, help="number of episodes whose paths are in the picture")
    seed: int = count(0, help="seed of the episodes")

    quick = smoke(episodes=200, drawn=4)

    def run(self, work: Workspace) -> Values:
        task = FallingParticle()
        policy = tiles(task, copies=2)
        work.say(f"{self.episodes:,} episodes")
        paths = trajectories(task, policy, self.drawn, self.seed)
        shoved = {name: FallingParticle(forces=(force,)) for name, force in SHOVES.items()}
        still = dataclasses.replace(shoved["none"], start=ParticleStart(x=(0.5, 0.5), y=(1.0, 1.0)))
        (fall,) = trajectories(still, policy, 1)
        return {
            "centre": np.asarray(policy.centre),
            "log width": np.asarray(policy.log_width),
            "forces": np.asarray(task.dynamics.forces),
            "paths": np.concatenate(paths),
            "ends": np.cumsum([len(path) for path in paths]),
            "occupancy": occupancy(task, policy, self.episodes, self.seed),
            "lengths": self._lengths(task, policy),
            **{f"lengths {name}": self._lengths(each, policy) for name, each in shoved.items()},
            "drop": fall[0, 1] - fall[round(FALL / task.period), 1],
        }

    def _lengths(self, task: FallingParticle, policy: LocalGaussians) -> np.ndarray:
        """Decisions in each episode."""
        return np.array([len(path) - 1 for path in trajectories(task, policy, self.episodes, self.seed)])

    def figure(self, values: Values) -> Figure:
        figure, (policy, stationary) = subplots(9, 4.6, 1, 2)
        draw_regions(policy, ())
        draw_paths(policy, np.split(values["paths"], values["ends"][:-1]))
        draw_units(policy, gaussians(values["centre"], values["log width"]), values["forces"])
        policy.set_title("units (one deviation) and sample paths", fontsize=10)
        draw_occupancy(stationary, values["occupancy"])
        stationary.set_title(f"share of time in each place, {len(values['lengths']):,} episodes", fontsize=10)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        length = mean_of(values["lengths"])
        shares = values["occupancy"]
        mirrored = 0.5 * float(np.abs(shares - shares[:, ::-1]).sum())
        drop = GRAVITY / DRAG * (FALL - (1 - np.exp(-DRAG * FALL)) / DRAG)
        yield within(
            LENGTH - 0.25,
            LENGTH + 0.25,
            "An episode takes about 24.5 decisions.",
            length,
            unit="decisions",
            kind="reference model",
            source="an independent model of section 6.3",
        )
        yield within(
            -0.25,
            0.25,
            "The length of an episode does not depend on the actions.",
            mean_of(values["lengths none"] - values["lengths left"].astype(float)),
            "no force minus all units pushing to one side, from the same starts,",
            "decisions",
            note=f"Against a wall, the particle is slowed by friction. Decisions without force "
            f"{values['lengths none'].mean():.2f}, all to the left {values['lengths left'].mean():.2f}, tiled "
            f"policy {length.value:.2f}.",
            source="section 6.3",
        )
        yield within(
            drop - 1e-6,
            drop + 1e-6,
            f"In free fall for {FALL:g} s the particle drops by g/k (t − (1 − exp(−kt))/k) = {drop:.6f}.",
            exact(float(values["drop"])),
            unit="of the box",
            note="The stages as printed, without the step, would yield 0.318765.",
            kind="extension",
            source="appendix A.3, with the step inside the stages",
        )
        yield below(
            0.05,
            "The stationary distribution is symmetric, as policy and starts are.",
            exact(mirrored),
            "total variation distance from its mirror image",
            note="From samples: the distance shrinks with more episodes.",
            kind="extension",
        )
