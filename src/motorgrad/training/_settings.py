"""The learner's settings as one flat table: what configuration files and the command line speak."""

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from motorgrad import policies
from motorgrad._errors import choice
from motorgrad._settings import build, table
from motorgrad.learning import (
    Agent,
    Baseline,
    Episodic,
    Estimator,
    Exponential,
    FixedStep,
    LaggedGaussian,
    MeanReward,
    NoBaseline,
    Trace,
    Window,
    adam,
    sgd,
)
from motorgrad.tasks import Task

ESTIMATORS: dict[str, dict[str, Any]] = {
    "olgarb": {"baseline": "mean", "improve": 1},
    "olpomdp": {"baseline": "none", "improve": 1},
    "gpomdp": {"baseline": "none", "improve": "never"},
}
"""The named estimators, and what their names stand for."""


@dataclasses.dataclass(frozen=True)
class AgentSettings:
    """A learner in plain values.

    **Arguments:**

    - `policy`: the initial policy's name (`motorgrad.policies.INITIAL`).
    - `units`: number of units; by default one for each of the task's actions.
    - `estimator`: `"olgarb"`, `"olpomdp"` or `"gpomdp"`: sets `baseline` and `improve` unless they are given.
    - `trace`: the eligibility filter; `decay` belongs to `"exponential"`, `length` to `"window"`, `lag` and `width` (in
      decisions) to `"lagged-gaussian"`.
    - `baseline`: `"default"` for the estimator's own, `"mean"`, `"fixed-step"` (with `baseline_rate`) or `"none"`.
    - `discount`: none for the average reward, or γ for the discounted return of an episode.
    - `improve`: samples per step, `"episode"` or `"never"`; `batch`: whether a step uses their mean or sum.
    - `ascent`: `"sgd"` or `"adam"`, with the step size `rate`, or `rates` by group of parameters.
    """

    policy: str = "hyperplanes"
    units: int | None = None
    estimator: Literal["olgarb", "olpomdp", "gpomdp"] = "olgarb"
    trace: Literal["exponential", "episodic", "window", "lagged-gaussian"] = "exponential"
    decay: float = 0.9
    length: int = 10
    lag: float = 5.0
    width: float = 2.0
    baseline: Literal["default", "mean", "fixed-step", "none"] = "default"
    baseline_rate: float = 0.01
    discount: float | None = None
    improve: int | Literal["episode", "never"] | None = None
    batch: Literal["mean", "sum"] = "mean"
    ascent: Literal["sgd", "adam"] = "sgd"
    rate: float = 1e-3
    rates: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        choice("policy", self.policy, policies.INITIAL)
        choice("estimator", self.estimator, ESTIMATORS)
        choice("trace", self.trace, ("exponential", "episodic", "window", "lagged-gaussian"))
        choice("baseline", self.baseline, ("default", "mean", "fixed-step", "none"))
        choice("ascent", self.ascent, ("sgd", "adam"))
        # making them refuses impossible numbers at once
        self.estimate()
        self.rule()

    def estimate(self) -> Estimator:
        """The estimator that the settings stand for."""
        named = ESTIMATORS[self.estimator]
        traces: dict[str, Any] = {
            "exponential": lambda: Exponential(self.decay),
            "episodic": Episodic,
            "window": lambda: Window(self.length),
            "lagged-gaussian": lambda: LaggedGaussian(self.lag, self.width),
        }
        baselines: dict[str, Any] = {
            "mean": MeanReward,
            "fixed-step": lambda: FixedStep(self.baseline_rate),
            "none": NoBaseline,
        }
        trace: Trace = traces[self.trace]()
        baseline: Baseline = baselines[named["baseline"] if self.baseline == "default" else self.baseline]()
        improve = named["improve"] if self.improve is None else self.improve
        return Estimator(trace, baseline, self.discount, improve, self.batch)

    def rule(self) -> Any:
        """The ascent rule that the settings stand for."""
        return {"sgd": sgd, "adam": adam}[self.ascent](self.rate if self.rates is None else self.rates)

    def agent(self, task: Task) -> Agent:
        """The agent for `task`."""
        initial = policies.initial(self.policy, task, **({} if self.units is None else {"units": self.units}))
        return Agent(initial, self.estimate(), self.rule())


def settings_for(task: Task, **changes: Any) -> AgentSettings:
    """The settings that go with a task, some of them changed."""
    return build(AgentSettings, {**task.learner, **changes}, "agent")


def describe_agent(agent: Agent, policy: policies.Policy) -> dict[str, Any]:
    """An agent as a table: enough to tell two apart, and to rebuild the policy's structure."""
    rule = agent.ascent
    if isinstance(rule, sgd | adam):
        fields = {field.name: _numbers(getattr(rule, field.name)) for field in dataclasses.fields(rule)}
        ascent: dict[str, Any] = {"kind": type(rule).__name__, **fields}
    else:
        ascent = {"kind": "optax", "state": str(_shape_of(rule, policy))}
    estimator = table(agent.estimator)
    for part in ("trace", "baseline"):
        estimator[part] = {"kind": type(getattr(agent.estimator, part)).__name__, **estimator[part]}
    return {"policy": policies.describe(policy), "estimator": estimator, "ascent": ascent}


def _numbers(rate: Any) -> Any:
    return {name: _numbers(value) for name, value in rate.items()} if isinstance(rate, Mapping) else _listed(rate)


def _listed(value: Any) -> Any:
    return np.asarray(value).tolist()


def _shape_of(rule: Any, policy: policies.Policy) -> Any:
    import jax

    return jax.tree.structure(jax.eval_shape(rule.init, policies.trainable(policy)))
