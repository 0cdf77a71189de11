"""Section 6.2.3: stochastic real-valued units, whose noise depends on the reward that they expect."""

from collections.abc import Iterator
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad.policies import GradedHyperplanes
from motorgrad.schema import count, number
from motorgrad.statistics import first_time, mean_of, ratio_of
from motorgrad_thesis._claims import Claim, Kind, below
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, subplots

FLOOR = 1e-3
START = 0.3
"""The noise's least standard deviation, and that before learning."""
RECORDS = 200
LAST = 0.1  # share of the records, the last, that counts as the end

UNITS: dict[str, tuple[str, str, dict[str, float]]] = {
    "expected": ("by the expected reward (SRV)", "#3b6fb6", {"mean": 0.03, "reward": 0.1}),
    "learned": ("learned by the gradient", "#5b9c51", {"mean": 0.03, "reward": 0.1, "noise": 0.1}),
    "fixed": ("constant", "#c8452f", {"mean": 0.01, "reward": 0.1}),
}
"""Kinds of noise by name: label, colour, and step sizes, those of the least error at the end on seeds 100 to 119."""
NEAR = 0.01  # error of the mean action at which a unit has learned


class Learning(NamedTuple):
    """A unit, and the weights of its prediction of the reward: of the input, and a constant."""

    unit: GradedHyperplanes
    expected: Float[Array, " 2"]


@experiment("sec-6.2.3-srv", "noise that depends on the expected reward", "section 6.2.3")
class ExpectedReward(Experiment):
    r"""Stochastic real-valued units (Gullapalli, 1990) learn a linear function of their input from an immediate reward.
    The standard deviation of their noise falls as the reward rises that they expect,
    $\sigma = k\,(1 - \hat r)$, and the mean takes steps of $\alpha\,(r - \hat r)(a - \mu)/\sigma$ times its gradient.
    Compared with the same unit with a constant deviation, and with one that is learned by the policy gradient.
    """

    reading: ClassVar[str] = (
        "The thesis describes these units and measures nothing. Gullapalli's reward is at most 1; here it is "
        "1 − |a − a*|, at least 0, for an input from U[0, 1] and the linear mapping a* = 1.2 x − 0.1 of section 4.3.1."
    )

    steps: int = count(20_000, 1_000, 10**7, unit="decisions", help="length of the practice")
    slope: float = number(1.0, 0, 1.2, open_low=True, help="$k$, of the deviation over the reward that is missing")
    seeds: int = count(20, 2, 10_000, help="number of units of each kind")

    quick = smoke(steps=1_000, seeds=3)

    def run(self, work: Workspace) -> Values:
        return {
            f"{name} {what}": values
            for name in UNITS
            for what, values in work.part(name, lambda name=name: self.learned(name, np.arange(self.seeds))).items()
        }

    def learned(self, name: str, seeds: np.ndarray) -> Values:
        """How units of a kind learn, `(seeds, records)`: `error`, the mean absolute difference between mean action and
        target; `deviation` of the noise; `step`, the mean length of the steps of the mean's parameters."""
        rates = UNITS[name][2]

        def decide(state: Learning, uniforms: Float[Array, " 2"]) -> tuple[Learning, Any]:
            seen = uniforms[:1]
            features = jnp.append(seen, 1.0)
            expected = jnp.clip(features @ state.expected, 0.0, 1.0)
            unit = state.unit
            if name == "expected":
                noise = jnp.maximum(self.slope * (1 - expected) - FLOOR, 1e-6)
                unit = GradedHyperplanes(unit.weights, unit.bias, jnp.log(noise)[None], FLOOR)
            action = unit.sample(seen, uniforms[1:])
            away = action[0] - target(seen[0])
            error = jnp.maximum(1 - jnp.abs(away), 0.0) - expected
            score = unit.score(seen, action)
            scale = rates["mean"] * error * unit.deviation[0]  # Gullapalli's step, which slows as the noise falls
            moved = GradedHyperplanes(
                unit.weights + scale * score.weights,
                unit.bias + scale * score.bias,
                unit.log_deviation + rates.get("noise", 0.0) * error * score.log_deviation,
                FLOOR,
            )
            length = jnp.abs(scale) * jnp.hypot(score.weights[0, 0], score.bias[0])
            predicted = state.expected + rates["reward"] * error * features
            found = {"error": jnp.abs(unit.mean(seen)[0] - target(seen[0])), "deviation": unit.deviation[0]}
            return Learning(moved, predicted), found | {"step": length}

        def learn(key: jax.Array) -> dict[str, Array]:
            unit = GradedHyperplanes(jnp.zeros((1, 1)), jnp.zeros(1), jnp.log(jnp.full(1, START - FLOOR)), FLOOR)
            # the reward that makes the noise of all kinds alike at first
            start = Learning(unit, jnp.array([0.0, 1 - START / self.slope]))
            _, found = jax.lax.scan(decide, start, jax.random.uniform(key, (self.steps, 2)))
            kept = min(RECORDS, self.steps)
            length = self.steps // kept
            return jax.tree.map(lambda x: x[: kept * length].reshape(kept, length).mean(1), found)

        keys = jax.vmap(jax.random.key)(jnp.asarray(seeds))
        return {what: np.asarray(values, float) for what, values in jax.jit(jax.vmap(learn))(keys).items()}

    def figure(self, values: Values) -> Figure:
        """Three panels over decisions: the error of the mean action, the deviation of the noise, and the length of the
        steps, each with its median and quartiles over seeds."""
        figure, panels = subplots(11, 3.4, 1, 3)
        titles = {
            "error": "error of the mean action",
            "deviation": "deviation of the noise",
            "step": "length of a step",
        }
        for axes, (what, title) in zip(panels, titles.items(), strict=True):
            for name, (label, colour, _) in UNITS.items():
                curves = values[f"{name} {what}"]
                decision = (np.arange(curves.shape[1]) + 1) * (self.steps / curves.shape[1]) / 1e3
                draw_band(axes, decision, curves, colour, label)
            axes.set(title=title, xlabel="thousand decisions", yscale="log")
        panels[1].legend(fontsize=8)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        end = {key: late(curves) for key, curves in values.items()}
        kinds: tuple[tuple[str, str, Kind], ...] = (
            ("expected", "whose noise depends on the expected reward", "thesis"),
            ("learned", "whose noise is learned by the policy gradient", "extension"),
        )
        for name, words, whose in kinds:
            yield below(
                0.05,
                f"As learning progresses, units {words} converge to a deterministic output.",
                mean_of(end[f"{name} deviation"]),
                "deviation of the noise in the last tenth",
                note=f"At first it is {START:g}; the least that is allowed is {FLOOR:g}.",
                kind=whose,
            )
        yield below(
            0.1,
            "A step size that falls with the variance slows learning as it reaches the point of convergence.",
            mean_of(end["expected step"] / values["expected step"][:, 0]),
            "length of the steps in the last tenth, relative to the first records,",
        )
        for name, words in (("fixed", "a constant deviation"), ("learned", "a deviation that is learned")):
            yield below(
                1,
                f"Units whose noise depends on the expected reward end with a smaller error than those with {words}.",
                ratio_of(end["expected error"], end[f"{name} error"]),
                "error of the mean action in the last tenth, relative to theirs,",
                kind="extension",
            )
        times = [self._learned_at(values[f"{name} error"]) for name in ("expected", "learned")]
        yield below(
            1,
            "They learn sooner than those with a deviation that is learned.",
            ratio_of(times[0], times[1]),
            f"decisions until the error is below {NEAR:g}, relative to theirs,",
            note=f"Medians {np.median(times[0]):,.0f} and {np.median(times[1]):,.0f}.",
            kind="extension",
        )

    def _learned_at(self, errors: np.ndarray) -> np.ndarray:
        """The decision at which the error of each seed first is small; the last one, if it never is."""
        decision = (np.arange(errors.shape[1]) + 1) * (self.steps / errors.shape[1])
        return first_time(decision, errors < NEAR, never=float(self.steps))


def target(seen: Any) -> Any:
    """The action of the greatest reward for an input."""
    return 1.2 * seen - 0.1


def late(curves: np.ndarray) -> np.ndarray:
    """The mean of the last records of each seed."""
    return curves[:, -max(1, round(LAST * curves.shape[1])) :].mean(1)
