"""Section 3.2.2: a step of the parameters whenever the gradient is accurate."""

from collections.abc import Iterator, Mapping

import numpy as np

from motorgrad.learning import SGD, Accuracy, Agent, Estimator, Exponential, MeanReward
from motorgrad.schema import count, number
from motorgrad.statistics import mean_of, ratio_of
from motorgrad_thesis._claims import Claim, above, in_every, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, subplots
from motorgrad_thesis.chapter_3._curves import BEST, decided, earned

RECORDS = 25
GOOD = 0.27  # of 0.275
LONGEST = 10_000  # decisions of a batch that does not get accurate
BLOCK = 25  # decisions, five times the reach of the trace
RATES = {"online": 0.03, "100": 3.0, "1,000": 8.0, "accurate, 1": 6.0, "accurate, ½": 6.0}
"""The learning rate of each learner: of rates that differ by about a factor of 2 or 3, the one with the greatest mean
over the records on seeds 100 to 105."""


@experiment("sec-3.2.2-accurate", "an update whenever the gradient is accurate", "section 3.2.2")
class AccurateUpdates(Experiment):
    """Three ways to decide when the parameters move, at two hidden switches: at every decision; after batches of one
    length; or once the relative standard error of the mean gradient, by the sample's own variance, is small enough.
    Policies are judged by their exact average reward.
    """

    seeds: int = count(20, 2, 10_000, help="number of learners of each kind")
    first_seed: int = count(0, help="the first of the seeds, which are successive")
    steps: int = count(200_000, 1_000, 10**9, unit="decisions", help="length of the practice of each learner")
    decay: float = number(0.8, 0, 1, open_high=True, help=r"decay of the trace $\beta$, per decision")

    quick = smoke(seeds=3, steps=3_000)

    def learners(self) -> Mapping[str, Estimator]:
        """The estimator of each line of the figure."""
        base = Estimator(Exponential(self.decay), MeanReward())
        batches = {
            "online": (1, None),
            "100": (100, None),
            "1,000": (1_000, None),
            "accurate, 1": (LONGEST, Accuracy(1.0, BLOCK)),
            "accurate, ½": (LONGEST, Accuracy(0.5, BLOCK)),
        }
        return {
            name: Estimator(base.trace, base.baseline, update_every=every, accuracy=accuracy)
            for name, (every, accuracy) in batches.items()
        }

    def run(self, work: Workspace) -> Values:
        decisions = np.unique(np.geomspace(self.steps / 400, self.steps, RECORDS).astype(int))
        found: Values = {"decision": decisions, "line": np.array(list(self.learners()))}
        for name, estimator in self.learners().items():
            found |= work.part(name, lambda name=name, each=estimator: self._learned(name, each, decisions))
        return found

    def _learned(self, name: str, estimator: Estimator, decisions: np.ndarray, rate: float | None = None) -> Values:
        agent = Agent(decided(), estimator, SGD(RATES[name] if rate is None else rate))
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        read = (
            None
            if estimator.accuracy is None
            else lambda state: np.stack([state.accuracy.steps, state.accuracy.unsure])
        )
        made = earned(agent, seeds, decisions, read)
        found = {f"earned {name}": made["earned"]}
        if "read" in made:  # (seeds, counts, records)
            found |= {f"steps {name}": made["read"][:, 0], f"unsure {name}": made["read"][:, 1]}
        return found

    def figure(self, values: Values) -> Figure:
        """Two panels: the distance from the best average reward, and the lengths of batches."""
        figure, (learning, lengths) = subplots(10, 4, 1, 2)
        decision = values["decision"]
        for row, name in enumerate(values["line"]):
            draw_band(learning, decision, BEST - values[f"earned {name}"], f"C{row}", _label(str(name)))
        learning.set(xscale="log", yscale="log", xlabel="decisions", ylabel=r"distance from the best average reward")
        learning.set_title(f"median of {self.seeds} seeds", loc="left")
        learning.legend(fontsize=8)
        for row, name in enumerate(values["line"]):
            if f"steps {name}" in values:
                length = batch_lengths(decision, values[f"steps {name}"])
                draw_band(lengths, decision, length, f"C{row}", _label(str(name)))
        lengths.set(xscale="log", yscale="log", xlabel="decisions", ylabel="decisions of a batch")
        lengths.set_title("batches that end when accurate", loc="left")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        means = {str(name): values[f"earned {name}"].mean(1) for name in values["line"]}
        for name in ("accurate, 1", "accurate, ½"):
            least = values[f"earned {name}"][:, -1].min()
            unsure = values[f"unsure {name}"][:, -1].sum() / max(values[f"steps {name}"][:, -1].sum(), 1)
            yield in_every(
                f"Updates whenever the gradient is accurate ({_error(name)}) reach an average reward of {GOOD}.",
                values[f"earned {name}"][:, -1] >= GOOD,
                f"share of these seeds after {int(values['decision'][-1]):,} decisions",
                note=f"The least is {least:.4f}, of the best policy {BEST:g}. {unsure:.2g} of the steps were made at "
                f"the greatest length, {LONGEST:,} decisions.",
                of="The parameters may be updated whenever the gradient is accurate.",
            )
            length = batch_lengths(values["decision"], values[f"steps {name}"])
            yield above(
                1,
                f"Batches grow while learning ({_error(name)}).",
                ratio_of(length[:, -1], length[:, 0]),
                "decisions of the last batches over those of the first",
                note=f"{length[:, 0].mean():.0f} decisions at first, {length[:, -1].mean():.0f} in the end.",
                kind="extension",
            )
        fixed = max(("100", "1,000"), key=lambda name: means[name].mean())
        for other, words in ((fixed, f"batches of {fixed}, the better length"), ("online", "one at every decision")):
            yield positive(
                f"Updates whenever the gradient is accurate ({_error('accurate, 1')}) learn faster than {words}.",
                mean_of(means["accurate, 1"] - means[other]),
                "mean over the records of the average reward, minus that of the other",
                note=f"{means['accurate, 1'].mean():.4f} and {means[other].mean():.4f}, records evenly spaced in the "
                "logarithm of decisions.",
                kind="extension",
            )


def batch_lengths(decision: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """The mean length of the batches that ended since the record before, `(seeds, records)`, in decisions. Records
    between which none ended are taken together with those up to the next end, or to the last."""
    found = np.zeros(steps.shape)
    for lengths, made in zip(found, steps, strict=True):
        since = 0
        for row in range(len(decision)):
            before = made[since - 1] if since else 0
            ended = made[row] - before
            if ended or row == len(decision) - 1:
                passed = decision[row] - (decision[since - 1] if since else 0)
                lengths[since : row + 1] = passed / max(ended, 1)
                since = row + 1
    return found


def _label(name: str) -> str:
    return {"online": "every decision", "100": "every 100", "1,000": "every 1,000"}.get(name, f"when {name}")


def _error(name: str) -> str:
    return f"ε = {name.removeprefix('accurate, ')}"
