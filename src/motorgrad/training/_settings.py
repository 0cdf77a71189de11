"""The learner's settings as one flat table: what configuration files and the command line speak."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, Literal, get_type_hints

from motorgrad import policies
from motorgrad._errors import check, choice, unknown
from motorgrad._settings import as_hinted, build
from motorgrad.learning import Agent, Estimator, FisherMetric, Growth, IndexedAgent, SpatialIndex, WeightAverage
from motorgrad.tasks import Task, make
from motorgrad.training._settings_parts import (
    ESTIMATORS,
    average_of,
    estimator_of,
    growth_of,
    index_of,
    metric_of,
    rule_of,
)

LARGEST = 100_000_000  # weights of a policy


@dataclasses.dataclass(frozen=True)
class AgentSettings:
    """A learner in plain values.

    **Arguments:**

    - `policy`: the initial policy's name (`motorgrad.policies.INITIAL`).
    - `policy_settings`: further settings of that initial policy, by name, such as the `width` of Gaussians.
    - `units`: number of units; by default one for each of the task's actions.
    - `estimator`: what `baseline` and `improve` are unless they are given.
    - `trace`: the eligibility filter.
    - `decay`: of the exponential trace, per decision.
    - `length` (decisions): of the window trace.
    - `lag` (decisions): of the lagged-gaussian trace.
    - `width` (decisions): of the lagged-gaussian trace.
    - `baseline`: what rewards are compared with; `"default"` for the estimator's own.
    - `baseline_rate`: of the fixed-step, linear and binned baselines.
    - `baseline_level`: of the constant baseline, in units of reward.
    - `baseline_input`: which observed number the binned baseline depends on, from 0.
    - `baseline_low`: the lower bound of the binned baseline, in units of the observed number.
    - `baseline_high`: the upper bound of the binned baseline, in units of the observed number.
    - `baseline_bins`: number of bins of the binned baseline.
    - `critic`: none; or a linear critic, learnt by TD(λ) or by recursive least squares, whose temporal differences take
      the place of rewards above the baseline.
    - `critic_discount`: none for the differential values of the average reward, or the γ of discounted ones. For
      generalised advantages the trace's `decay` is γλ.
    - `critic_decay`: the λ of the critic's own trace.
    - `critic_squares`: whether the critic sees the squares of the inputs too.
    - `critic_actions`: whether the critic sees the previous action too.
    - `critic_bias`: whether the critic has a constant too.
    - `critic_rate`: the step of TD(λ); of least squares, one over its memory in decisions; by default 0.01 and 0.001.
    - `critic_level_rate`: of the mean of rewards with TD(λ), one over its memory in rewards.
    - `critic_initial`: what the diagonal of the least squares starts from.
    - `critic_damping`: what is added to that diagonal.
    - `critic_interval` (decisions): from one solution of the least squares to the next.
    - `advantages`: rewards above the baseline as they are, or divided by their running root mean square.
    - `advantage_rate`: of that running mean, per reward.
    - `discount`: none for the average reward, or γ for the discounted return of an episode.
    - `improve`: samples per step, `"episode"` or `"never"`; by default the estimator's own.
    - `batch`: whether a step of several samples uses their mean or their sum.
    - `entropy`: what a nat of the policy's entropy is worth in reward, or in normalised advantages.
    - `entropy_end`: what it is worth in the end, if that is another.
    - `entropy_steps` (steps of the parameters): after how many it is.
    - `ascent`: how a gradient sample moves the parameters.
    - `rate`: the step size of all parameters.
    - `rates`: the step size of each group of parameters, by name, in place of `rate`.
    - `weight_decay`: the share of themselves that all parameters lose at every step of the parameters.
    - `weight_decays`: that of each group of parameters, by name, in place of `weight_decay`; those left out lose none.
    - `metric`: the plain gradient, or the natural gradient of each unit by a running Fisher matrix.
    - `metric_rate`: of the running Fisher matrix, per decision.
    - `metric_initial`: what the Fisher matrix's diagonal starts from.
    - `damping`: what is added to the diagonal of every Fisher matrix.
    - `dampings`: the damping of each group of parameters, by name, in place of `damping`; those left out have none.
    - `metric_kl` (nats): how far one step of the parameters may take the policy, all units together, if not any way.
    - `metric_kl_end` (nats): how far in the end, if that is another.
    - `metric_kl_steps` (steps of the parameters): after how many.
    - `average`: whether the policy that is kept has the mean of the last parameters, in place of the last.
    - `average_start` (steps of the parameters): how many are left out of that mean.
    - `average_rate`: one over its memory in steps of the parameters; 0 forgets none.
    - `growth`: a policy of one size, or units that are added one by one, by the clock or where the reward is flat.
    - `growth_units`: with how many units growth is complete; by default all of the policy's.
    - `growth_interval` (decisions): from one unit to the next, by the clock.
    - `growth_window` (decisions): over which rewards are averaged to see whether they still rise.
    - `growth_confidence`: of the interval in which a rise counts as none.
    - `growth_patience`: after how many units in a row that brought nothing none is added any more.
    - `growth_placement`: whether a unit starts at `growth_centre`, or where the learner has been of late.
    - `growth_centre`: where a unit starts, in every input.
    - `growth_width`: its width then, in the units of the inputs.
    - `growth_cutoff`: the width down to which it shrinks in its adding phase.
    - `growth_shrink`: what its width is multiplied by at every decision of that phase.
    - `growth_boost`: what its steps are multiplied by meanwhile.
    - `growth_damp`: what those of the other units are multiplied by meanwhile.
    - `index`: whether a decision touches only the local units that can fire there, by a table of where they can.
    - `index_neglect`: the greatest probability of firing that is neglected.
    - `index_margin`: how far units move, in widths, before the table is made anew.

    **Raises** `ValueError` for what is unknown or impossible, by name; from `agent` for what does not go with the task.
    """

    policy: str = dataclasses.field(default="hyperplanes", metadata={"choices": policies.INITIAL})
    policy_settings: Mapping[str, bool | int | float | str] | None = None
    units: int | None = None
    estimator: Literal["olgarb", "olpomdp", "gpomdp"] = "olgarb"
    trace: Literal["exponential", "episodic", "window", "lagged-gaussian"] = "exponential"
    decay: float = 0.9
    length: int = 10
    lag: float = 5.0
    width: float = 2.0
    baseline: Literal["default", "mean", "fixed-step", "constant", "none", "linear", "binned"] = "default"
    baseline_rate: float = 0.01
    baseline_level: float = 0.0
    baseline_input: int = 0
    baseline_low: float = 0.0
    baseline_high: float = 1.0
    baseline_bins: int = 10
    critic: Literal["none", "td", "least-squares"] = "none"
    critic_discount: float | None = None
    critic_decay: float = 0.9
    critic_squares: bool = False
    critic_actions: bool = False
    critic_bias: bool = True
    critic_rate: float | None = None
    critic_level_rate: float = 1e-3
    critic_initial: float = 1.0
    critic_damping: float = 1e-3
    critic_interval: int = 100
    advantages: Literal["plain", "normalised"] = "plain"
    advantage_rate: float = 1e-3
    discount: float | None = None
    improve: int | Literal["episode", "never"] | None = None
    batch: Literal["mean", "sum"] = "mean"
    entropy: float = 0.0
    entropy_end: float | None = None
    entropy_steps: int = 1000
    ascent: Literal["sgd", "adam"] = "sgd"
    rate: float = 1e-3
    rates: Mapping[str, float] | None = None
    weight_decay: float = 0.0
    weight_decays: Mapping[str, float] | None = None
    metric: Literal["euclidean", "fisher"] = "euclidean"
    metric_rate: float = 1e-3
    metric_initial: float = 1.0
    damping: float = 0.01
    dampings: Mapping[str, float] | None = None
    metric_kl: float | None = None
    metric_kl_end: float | None = None
    metric_kl_steps: int = 1000
    average: bool = False
    average_start: int = 0
    average_rate: float = 0.0
    growth: Literal["none", "clock", "plateau"] = "none"
    growth_units: int | None = None
    growth_interval: int = 10_000
    growth_window: int = 4_000
    growth_confidence: float = 0.95
    growth_patience: int = 3
    growth_placement: Literal["centre", "visited"] = "centre"
    growth_centre: float = 0.5
    growth_width: float = 1.0
    growth_cutoff: float = 0.15
    growth_shrink: float = 0.99975
    growth_boost: float = 8.0
    growth_damp: float = 0.5
    index: bool = False
    index_neglect: float = 1e-3
    index_margin: float = 1.0

    def __post_init__(self) -> None:
        choice("policy", self.policy, policies.INITIAL)
        choice("estimator", self.estimator, ESTIMATORS)
        choice("trace", self.trace, ("exponential", "episodic", "window", "lagged-gaussian"))
        choice("baseline", self.baseline, ("default", "mean", "fixed-step", "constant", "none", "linear", "binned"))
        choice("critic", self.critic, ("none", "td", "least-squares"))
        choice("advantages", self.advantages, ("plain", "normalised"))
        choice("ascent", self.ascent, ("sgd", "adam"))
        choice("metric", self.metric, ("euclidean", "fisher"))
        choice("growth", self.growth, ("none", "clock", "plateau"))
        choice("growth_placement", self.growth_placement, ("centre", "visited"))
        alone = self.critic == "none" or self.baseline == "default"
        check(alone, "baseline", self.baseline, "'default' beside a critic, which takes its place")
        limited = self.metric_kl is None or self.metric != "euclidean"
        check(limited, "metric_kl", self.metric_kl, "none unless metric = 'fisher'")
        self._start()
        # making them refuses impossible numbers at once
        self.estimate()
        self.rule()
        self.measure()
        self.mean()
        self._check_growth()
        self.look_up()

    def estimate(self) -> Estimator:
        """The estimator that the settings stand for."""
        return estimator_of(self)

    def rule(self) -> Any:
        """The ascent rule that the settings stand for."""
        return rule_of(self)

    def measure(self) -> FisherMetric | None:
        """The metric that the settings stand for."""
        return metric_of(self)

    def mean(self) -> WeightAverage | None:
        """The average of the parameters that the settings stand for."""
        return average_of(self)

    def grow(self) -> Growth | None:
        """The schedule of growth that the settings stand for."""
        return growth_of(self)

    def look_up(self) -> SpatialIndex | None:
        """The spatial index that the settings stand for."""
        return index_of(self)

    def agent(self, task: Task) -> Agent:
        """The agent for `task`."""
        units = {} if self.units is None else {"units": self.units}
        inputs = task.observation_size
        check((self.units or 1) * inputs <= LARGEST, "units", self.units, f"at most {LARGEST // inputs} here")
        size = self.units or task.action_size
        check(
            (self.growth_units or 1) <= size, "growth_units", self.growth_units, f"at most the policy's units, {size}"
        )
        parts = (self._policy(task, units), self.estimate(), self.rule(), self.measure(), self.grow(), self.mean())
        index = self.look_up()
        return Agent(*parts) if index is None else IndexedAgent(*parts, index=index)

    def _check_growth(self) -> None:
        """Refuse, by the settings' own names, what is impossible, and growth without the policy for it."""
        if self.policy == "growing":
            check(self.growth != "none", "growth", self.growth, "'clock' or 'plateau' where policy = 'growing'")
        elif self.growth != "none":
            check(False, "policy", self.policy, f"'growing' where growth = {self.growth!r}")
        try:
            self.grow()
        except ValueError as error:
            raise ValueError(f"growth_{error}") from None
        moves = self.growth == "none" or self.estimate().improve != "never"
        check(moves, "growth", self.growth, "'none' where parameters never move")

    def _policy(self, task: Task, units: dict[str, int]) -> policies.Policy | Callable[..., policies.Policy]:
        """The initial policy; what it refuses of its settings is named as they are."""
        settings = self._start()
        try:
            return policies.initial(self.policy, task, **units, **settings)
        except ValueError as error:
            known = str(error).split()[0].strip(",") in settings
            raise ValueError(f"policy_settings.{error}" if known else str(error)) from None

    def _start(self) -> dict[str, Any]:
        """`policy_settings` as the initial policy's function takes them."""
        make = policies.INITIAL[self.policy]
        hints = {name: hint for name, hint in get_type_hints(make).items() if name not in ("task", "units", "return")}
        for name in self.policy_settings or {}:
            if name not in hints:
                raise unknown(f"setting of policy {self.policy!r}:", name, hints)
        return {
            name: as_hinted(hints[name], value, f"policy_settings.{name}")
            for name, value in (self.policy_settings or {}).items()
        }


def settings_for(task: Task | str, **changes: Any) -> AgentSettings:
    """The settings that go with a task, or with the one of this name, some of them changed. One number for all, such as
    `rate`, takes the place of the task's own by group; the task's own `policy_settings` go with its own policy only.
    The policy `"growing"` grows by the clock, unless it is said how.

    **Raises** `ValueError` for an unknown name or setting, with the nearest known one, and for impossible values.
    """
    task = make(task) if isinstance(task, str) else task
    check(isinstance(task, Task), "task", task, "a task, or the name of one")
    own = {name: value for name, value in task.learner.items() if name.removesuffix("s") not in changes}
    if changes.get("policy", own.get("policy")) != own.get("policy"):
        own.pop("policy_settings", None)
    if changes.get("policy") == "growing":
        own["growth"] = "clock"
    return build(AgentSettings, {**own, **changes}, "agent")


def settled(settings: AgentSettings, own: AgentSettings) -> AgentSettings:
    """Settings that were made by changing a task's `own`. A number for all that was changed takes the place of numbers
    by group that were not, which would hide it."""
    dropped = {
        f"{one}s": None
        for one in ("rate", "damping", "weight_decay")
        if getattr(settings, one) != getattr(own, one) and getattr(settings, f"{one}s") == getattr(own, f"{one}s")
    }
    return dataclasses.replace(settings, **dropped)
