"""Gradient estimators: a trace, a baseline, a reward criterion, and when the estimate is used."""

import dataclasses
from typing import Literal

from motorgrad._errors import check
from motorgrad.learning._baselines import Baseline, MeanReward, NoBaseline
from motorgrad.learning._critic import LinearCritic
from motorgrad.learning._input_baselines import InputBaseline
from motorgrad.learning._scale import RootMeanSquare
from motorgrad.learning._schedule import Annealed, check_schedule
from motorgrad.learning._traces import Episodic, Exponential, Trace


@dataclasses.dataclass(frozen=True)
class Estimator:
    r"""How rewards and scores become gradient samples $g = \delta z$, and how many make up a step.

    **Arguments:**

    - `trace`: the eligibility filter.
    - `baseline`: what rewards are compared with; an `InputBaseline` sees the observation; a `LinearCritic` puts its
      temporal differences in their place.
    - `discount`: `None` for the average reward; $\gamma \in (0, 1]$ for the discounted return of an episode,
      $\sum_t \gamma^t r_{t+1}$ from its start (section 2.5), whose samples are $\gamma^t \delta z$.
    - `improve`: after how many samples the parameters move; `"episode"` for once at each episode's end, `"never"` for
      an estimate at fixed parameters.
    - `batch`: whether a step of several samples uses their `"mean"` or their `"sum"`.
    - `scale`: `None` for advantages $\delta$ as they are; `RootMeanSquare` to normalise them.
    - `entropy` $\kappa \ge 0$: what a nat of entropy is worth in reward, or in normalised advantages. Every sample has
      $\kappa\,\nabla H(\pi(\cdot \mid y_t))$ added (Williams & Peng, 1991). A number, or one that is `Annealed`.
    """

    trace: Trace = dataclasses.field(default_factory=Exponential)
    baseline: Baseline | InputBaseline | LinearCritic = dataclasses.field(default_factory=MeanReward)
    discount: float | None = None
    improve: int | Literal["episode", "never"] = 1
    batch: Literal["mean", "sum"] = "mean"
    scale: RootMeanSquare | None = None
    entropy: float | Annealed = 0.0

    def __post_init__(self) -> None:
        for name, kind in (("trace", Trace), ("baseline", Baseline | InputBaseline | LinearCritic)):
            part = getattr(self, name)
            right = isinstance(part, kind) and dataclasses.is_dataclass(part)
            check(right, name, part, f"a {name.capitalize()} that is a dataclass of its settings")
        valid = self.improve in ("episode", "never") or (isinstance(self.improve, int) and 1 <= self.improve < 2**31)
        check(valid, "improve", self.improve, "a positive number of samples, 'episode' or 'never'")
        check(self.discount is None or 0 < self.discount <= 1, "discount", self.discount, "None or in (0, 1]")
        check(self.batch in ("mean", "sum"), "batch", self.batch, "'mean' or 'sum'")
        known = self.scale is None or isinstance(self.scale, RootMeanSquare)
        check(known, "scale", self.scale, "None or a RootMeanSquare, such as RootMeanSquare(1e-3)")
        check_schedule("entropy", self.entropy)

    @property
    def online(self) -> bool:
        """Whether every sample moves the parameters at once."""
        return self.improve == 1


def Olgarb(decay: float = 0.9, baseline: Baseline | InputBaseline | None = None) -> Estimator:
    """OLGARB: online, exponential trace, average reward as the baseline (Weaver & Tao, 2001)."""
    return Estimator(Exponential(decay), baseline or MeanReward())


def Olpomdp(decay: float = 0.9) -> Estimator:
    """OLPOMDP: online, exponential trace, no baseline (Baxter & Bartlett, 1999)."""
    return Estimator(Exponential(decay), NoBaseline())


def Gpomdp(decay: float = 0.9, baseline: Baseline | InputBaseline | None = None) -> Estimator:
    r"""GPOMDP: the mean of $\delta z$ at fixed parameters, by default without a baseline (Baxter & Bartlett, 2001)."""
    return Estimator(Exponential(decay), baseline or NoBaseline(), improve="never")


def Gae(critic: LinearCritic, decay: float = 0.9, improve: int | Literal["episode", "never"] = 160) -> Estimator:
    r"""Generalised advantages (Schulman et al., 2016): a critic's temporal differences, each credited to the action of
    $k$ decisions before by $(\gamma\lambda)^k$, with the critic's $\gamma$ and `decay` $\lambda \in [0, 1]$; a step is
    the mean of `improve` samples. With $\gamma\lambda = 1$ the trace is `Episodic`."""
    check(0 <= decay <= 1, "decay", decay, "in [0, 1]")
    total = critic.ahead * decay
    return Estimator(Exponential(total) if total < 1 else Episodic(), critic, improve=improve)
