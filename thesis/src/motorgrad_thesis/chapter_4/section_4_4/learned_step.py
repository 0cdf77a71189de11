"""Section 4.4.1: a baseline that learns its own rate, for rewards that drift."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.learning import FixedStep, LearnedStep, MeanReward, ScalarBaseline
from motorgrad.policies import hyperplanes
from motorgrad.schema import Range, count, number, static
from motorgrad.statistics import mean_of
from motorgrad_thesis._claims import Claim, at_most, negative, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, draw_intervals, subplots

CLOSE = 0.2  # distance of the logarithms of two rates that count as the same
WORSE = 0.02  # of the squared error of the best rate
RECORDS = 100
SAYS = "The rate of the baseline can be optimised as a parameter."


def kalman_gain(ratio: float) -> float:
    r"""The gain of the Kalman filter in its steady state, $\frac12(\sqrt{s^2 + 4s} - s)$, for a random walk whose steps
    have $s$ times the variance of the noise that is added to it (Muth, 1960). It is the best rate of a fixed step."""
    return (np.sqrt(ratio**2 + 4 * ratio) - ratio) / 2


@experiment("sec-4.4.1-learned-step", "a baseline that learns its rate", "section 4.4.1")
class LearnedRate(Experiment):
    """Rewards whose mean is a random walk, under white noise. The best rate of the baseline then has a closed form, the
    gain of the Kalman filter. Does a baseline that learns its rate by meta-gradient find it, and how much worse are its
    forecasts than those of the best rate, of fixed ones and of the mean of all rewards?
    """

    reading: ClassVar[str] = (
        "The thesis proposes to treat the rate as a parameter to be optimised, and gives no rule: this one follows "
        "Sutton (1992), for the squared error of the baseline as a forecast of the next reward."
    )

    ratios: tuple[float, ...] = static(
        (1e-4, 1e-3, 1e-2, 1e-1, 1.0),
        allowed=Range(0, 1e6, open_low=True),
        help="variances of the steps of the mean, relative to that of the noise",
    )
    rates: tuple[float, ...] = static(
        (0.001, 0.01, 0.1), allowed=Range(0, 1, open_low=True), help="the fixed steps γ, per reward"
    )
    first: float = number(0.01, 0, 1, open_low=True, help="the rate from which the learned one starts")
    seeds: int = count(20, 2, 10_000, help="number of sequences of rewards for each drift")
    first_seed: int = count(0, help="the seed of the sequences")
    length: int = count(200_000, 2 * RECORDS, 10**7, unit="rewards", help="length of each sequence")

    def validate(self) -> None:
        super().validate()
        self.check_rising("ratios")
        self.check_rising("rates")

    quick = smoke(ratios=(1e-2, 1.0), rates=(0.01,), seeds=3, length=1_000)

    def baselines(self) -> Mapping[str, ScalarBaseline]:
        """The baselines that are compared, the learned one last."""
        fixed = {f"γ = {rate:g}": FixedStep(rate) for rate in self.rates}
        return {"mean of all": MeanReward(), **fixed, "learned": LearnedStep(self.first)}

    def run(self, work: Workspace) -> Values:
        found: Values = {
            "ratio": np.array(self.ratios),
            "gain": np.array([kalman_gain(ratio) for ratio in self.ratios]),
            "line": np.array(list(self.baselines())),
            "reward": np.linspace(0, self.length, RECORDS + 1)[1:],
        }
        kept = [work.part(f"drift-{ratio:g}", lambda ratio=ratio: self._followed(ratio)) for ratio in self.ratios]
        return found | {name: np.stack([each[name] for each in kept]) for name in kept[0]}

    def _followed(self, ratio: float) -> Values:
        """For one drift, by seed: the excess squared error of each baseline over that of the best rate in the second
        half, relative to it, `(lines, seeds)`; the learned rate, in every record, `(seeds, records)`, and as its
        geometric mean in the second half, `(seeds,)`."""
        rng = np.random.default_rng((self.first_seed, round(1e6 * ratio)))
        walk = np.cumsum(rng.normal(size=(self.seeds, self.length), scale=np.sqrt(ratio)), axis=1)
        rewards = (walk + rng.normal(size=walk.shape)).astype(np.float32)
        late = slice(self.length // 2, None)

        def square_errors(baseline: ScalarBaseline) -> np.ndarray:
            return np.square(rewards - _levels(baseline, rewards))[:, late].mean(1)

        best = square_errors(FixedStep(kalman_gain(ratio)))
        excess = np.stack([square_errors(each) for each in self.baselines().values()]) / best - 1
        log_rate = _log_rates(self.baselines()["learned"], rewards)
        record = np.linspace(0, self.length, RECORDS + 1).astype(int)[1:] - 1
        return {
            "excess": excess,
            "rates": np.exp(log_rate[:, record]),
            "off": log_rate[:, late].mean(1) - np.log(kalman_gain(ratio)),
        }

    def figure(self, values: Values) -> Figure:
        """The learned rates over rewards, and the excess error of every baseline over the speed of the drift."""
        figure, (rates, excess) = subplots(10, 4, 1, 2)
        _rates(rates, values)
        _excess(excess, values)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for row, ratio in enumerate(values["ratio"]):
            yield within(
                -CLOSE,
                CLOSE,
                f"The learned rate is the best one where the mean moves by {np.sqrt(ratio):.2g} of the noise a step.",
                mean_of(values["off"][row]),
                "logarithm of the learned rate over the Kalman gain",
                note=f"Kalman gain {values['gain'][row]:.4g}; started from {self.first:g}.",
                of=SAYS,
            )
        lines = list(values["line"])
        learned = values["excess"][:, lines.index("learned")].max(0)
        yield at_most(
            WORSE,
            "Forecasts with the learned rate are nearly as good as with the best one, for any drift.",
            mean_of(learned),
            "greatest excess of the squared error, by seed",
            kind="extension",
        )
        fixed = {line: values["excess"][:, row].max(0) for row, line in enumerate(lines) if line != "learned"}
        best = min(fixed, key=lambda line: fixed[line].mean())
        yield negative(
            "No fixed rate that was tried is as good for every drift.",
            mean_of(learned - fixed[best]),
            f"greatest excess minus that with {best}",
            note=f"{learned.mean():.3g} and {fixed[best].mean():.3g}.",
            kind="extension",
        )


def _levels(baseline: ScalarBaseline, rewards: np.ndarray) -> np.ndarray:
    """The level with which every reward is compared, `(seeds, rewards)`."""
    return _scanned(baseline, rewards, baseline.level)


def _log_rates(baseline: ScalarBaseline, rewards: np.ndarray) -> np.ndarray:
    """The logarithm of the learned rate before every reward, `(seeds, rewards)`."""
    return _scanned(baseline, rewards, lambda state: state.log_rate)


def _scanned(baseline: ScalarBaseline, rewards: np.ndarray, read: Callable[[Any], jax.Array]) -> np.ndarray:
    """What is read of the state before every reward."""
    start = baseline.init(hyperplanes(1, 1), jnp.float32)

    def one(sequence: jax.Array) -> jax.Array:
        return jax.lax.scan(lambda state, reward: (baseline.learn(state, reward), read(state)), start, sequence)[1]

    return np.asarray(jax.jit(jax.vmap(one))(rewards), float)


def _rates(axes: Axes, values: Values) -> None:
    for row, ratio in enumerate(values["ratio"]):
        draw_band(axes, values["reward"], values["rates"][row], f"C{row}", f"{np.sqrt(ratio):.2g}")
        axes.axhline(values["gain"][row], color=f"C{row}", linestyle=":", linewidth=1)
    axes.set(yscale="log", xlabel="rewards", ylabel=r"rate $\gamma$")
    axes.set_title("learned rates, median and quartiles\n(dotted: Kalman gains)", loc="left", fontsize=10)
    axes.legend(title="step of the mean / noise", fontsize=8, title_fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))


def _excess(axes: Axes, values: Values) -> None:
    speed = np.sqrt(values["ratio"])
    for row, line in enumerate(values["line"]):
        learned = str(line) == "learned"
        found = [mean_of(100 * each) for each in values["excess"][:, row]]
        style = {"color": "black" if learned else f"C{row}", "linewidth": 2 if learned else 1.2}
        draw_intervals(axes, speed, found, fmt="o-", markersize=4, label=str(line), **style)
    axes.set_yscale("symlog", linthresh=1)
    axes.set(xscale="log", xlabel="step of the mean / noise", ylabel="% above the best rate", ylim=(-0.5, None))
    axes.set_title("squared error of the forecasts", loc="left", fontsize=10)
    axes.legend(fontsize=8)
