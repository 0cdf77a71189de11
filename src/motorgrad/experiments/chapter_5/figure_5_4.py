"""Figure 5.4: the hopper's dynamics after learning, as a phase portrait of the knee with the flexor's firing."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import jax
import numpy as np

from motorgrad.experiments._claim import Claim, mean_of
from motorgrad.experiments._experiment import Values
from motorgrad.experiments._workspace import Workspace
from motorgrad.experiments.chapter_5._hopper_study import HopperStudy, middle_seed
from motorgrad.experiments.chapter_5._phase_portrait import draw_portrait
from motorgrad.training import Evaluation, Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GRID = 61
FLEXOR, EXTENSOR = 0, 1


@dataclasses.dataclass(frozen=True)
class HopperDynamics(HopperStudy):
    """The knee's angle and its rate while a hopper hops that has learnt to, red where its foot is on the ground. The
    background is the probability that the flexor fires in the air. Below, the hopper at the numbered points of one hop,
    its muscles red where they fire and blue where they are silent.
    """

    name: ClassVar[str] = "fig-5.4"
    title: ClassVar[str] = "the hopper's dynamics"
    source: ClassVar[str] = "figure 5.4"

    def run(self, work: Workspace) -> Values:
        run = self.trained(work)
        outcome = self.watch(work, run)
        return {**self._trajectory(run, outcome), **firing_shares(outcome)}

    def _trajectory(self, run: Run, outcome: Evaluation) -> Values:
        """Of the seed in the middle: what was observed, and the action that was chosen on it."""
        assert outcome.sensors is not None
        assert outcome.position is not None
        assert outcome.activation is not None
        seed = middle_seed(run, outcome)
        row = run.seeds.index(seed)
        sensed = {name: values[row, :-1].astype(float) for name, values in outcome.sensors.items()}
        angle, rate = sensed["knee_angle"], sensed["knee_velocity"]
        x, y = (np.linspace(*_span(values), GRID) for values in (angle, rate))
        flexor = self._in_the_air(run.policy(seed), x, y)[:, :, FLEXOR]
        return {
            "angle": 90 + np.rad2deg(angle),
            "rate": np.rad2deg(rate),
            "contact": sensed["foot_contact"] > 0,
            "height": sensed["foot_height"],
            "firing": outcome.activation[row, 1:] > 0.5,
            "position": outcome.position[row, :-1],
            "grid_angle": 90 + np.rad2deg(x),
            "grid_rate": np.rad2deg(y),
            "flexor": flexor,
            "seed": np.array(seed),
        }

    def _in_the_air(self, policy: Any, angle: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Firing probabilities `(rates, angles, units)` where the foot has no contact."""
        task = self.task
        angles, rates = np.meshgrid(angle + np.deg2rad(90.0 - task.centre), task.velocity_scale * rate)
        seen = np.stack([np.full_like(angles, -1.0), angles, rates], axis=-1).astype(np.float32)
        return np.asarray(jax.vmap(jax.vmap(policy.prob))(seen))

    def figure(self, values: Values) -> "Figure":
        return draw_portrait(values, self.task)

    def claims(self, values: Values) -> Sequence[Claim]:
        ground, air = values["ground"], values["air"]
        tied = mean_of(ground[:, EXTENSOR] - air[:, EXTENSOR])
        inhibited = mean_of(air[:, FLEXOR] - ground[:, FLEXOR])
        agrees, silent = mean_of(values["agrees"]), mean_of(ground[:, FLEXOR])
        rising = mean_of(values["rising"][:, FLEXOR] - ground[:, FLEXOR])
        on, off = mean_of(ground[:, EXTENSOR]).value, mean_of(air[:, EXTENSOR]).value
        return (
            Claim(
                "The extensor's firing is tied to foot contact: it fires more often on the ground than in the air.",
                "figure 5.4",
                "a difference of more than 0",
                tied,
                tied.low > 0,
                note=f"It fires at {on:.0%} of the decisions on the ground, and at {off:.0%} of those in the air.",
            ),
            Claim(
                "The extensor's firing follows foot contact directly: it fires on the ground and is silent in the air.",
                "figure 5.4",
                "at most decisions: a share above 0.5, and 1 if nothing else counted",
                agrees,
                agrees.low > 0.5,
                note="The mean of the share of decisions on the ground at which it fires and of the share in the air "
                "at which it does not, so that chance gives 0.5.",
            ),
            Claim(
                "The flexor is inhibited by foot contact: it fires less often on the ground than in the air.",
                "figure 5.4",
                "a difference of more than 0",
                inhibited,
                inhibited.low > 0,
            ),
            Claim(
                "With the foot on the ground the flexor is mostly silent.",
                "figure 5.4",
                "fires at less than half of the decisions",
                silent,
                silent.high < 0.5,
            ),
            Claim(
                "The push is followed by flexion: the flexor fires more often on the way up than on the ground.",
                "section 5.2.2",
                "a difference of more than 0",
                rising,
                rising.low > 0,
            ),
        )


def firing_shares(outcome: Evaluation) -> Values:
    """At which share of its decisions each seed's muscles fire.

    **Returns** `ground`, `air` and `rising` (in the air, the load on its way up), each `(seeds, groups)`; `agrees`
    `(seeds,)`, the mean of how often the extensor fires on the ground and how often it is silent in the air. A share of
    no decisions is one half, as before learning.
    """
    assert outcome.sensors is not None
    assert outcome.activation is not None
    firing = outcome.activation[:, 1:] > 0.5
    contact = outcome.sensors["foot_contact"][:, :-1] > 0
    upwards = np.diff(outcome.sensors["load_height"], axis=1) > 0

    def share(where: np.ndarray) -> np.ndarray:
        count = where.sum(axis=1)[:, None]
        fired = np.sum(firing & where[:, :, None], axis=1)
        return np.where(count > 0, fired / np.maximum(count, 1), 0.5)

    ground, air = share(contact), share(~contact)
    return {
        "ground": ground,
        "air": air,
        "rising": share(~contact & upwards),
        "agrees": (ground[:, EXTENSOR] + 1 - air[:, EXTENSOR]) / 2,
    }


def _span(values: np.ndarray) -> tuple[float, float]:
    """What nearly all values lie in, and a little more: a knee that hits its stop is very fast for a moment."""
    low, high = np.percentile(values, [0.5, 99.5])
    margin = 0.12 * max(float(high - low), 1e-3)
    return float(low) - margin, float(high) + margin
