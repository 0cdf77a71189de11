"""The parts of a learner that settings in plain values stand for."""

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

from motorgrad._errors import check
from motorgrad.learning import (
    Annealed,
    Baseline,
    BinnedBaseline,
    Clock,
    Constant,
    Episodic,
    Estimator,
    Exponential,
    Features,
    FisherMetric,
    FixedStep,
    Growth,
    InputBaseline,
    LaggedGaussian,
    LeastSquares,
    LinearBaseline,
    LinearCritic,
    MeanReward,
    NoBaseline,
    Plateau,
    RootMeanSquare,
    SpatialIndex,
    TemporalDifference,
    Trace,
    Visited,
    WeightAverage,
    Window,
    adam,
    decayed,
    sgd,
)

if TYPE_CHECKING:
    from motorgrad.training._settings import AgentSettings

P = TypeVar("P")
ESTIMATORS: dict[str, dict[str, Any]] = {
    "olgarb": {"baseline": "mean", "improve": 1},
    "olpomdp": {"baseline": "none", "improve": 1},
    "gpomdp": {"baseline": "none", "improve": "never"},
}
"""The named estimators, and what their names stand for."""


def estimator_of(settings: "AgentSettings") -> Estimator:
    """The estimator that the settings stand for."""
    named = ESTIMATORS[settings.estimator]
    traces: dict[str, Any] = {
        "exponential": lambda: Exponential(settings.decay),
        "episodic": Episodic,
        "window": lambda: Window(settings.length),
        "lagged-gaussian": lambda: LaggedGaussian(settings.lag, settings.width),
    }
    baselines: dict[str, Any] = {
        "mean": MeanReward,
        "fixed-step": lambda: FixedStep(settings.baseline_rate),
        "constant": lambda: Constant(settings.baseline_level),
        "none": NoBaseline,
        "linear": lambda: LinearBaseline(settings.baseline_rate),
        "binned": lambda: BinnedBaseline(
            settings.baseline_low,
            settings.baseline_high,
            settings.baseline_bins,
            settings.baseline_input,
            settings.baseline_rate,
        ),
    }
    trace: Trace = traces[settings.trace]()
    kind = named["baseline"] if settings.baseline == "default" else settings.baseline
    critic = critic_of(settings)
    baseline: Baseline | InputBaseline | LinearCritic = critic or _named(settings, "baseline", baselines[kind])
    improve = named["improve"] if settings.improve is None else settings.improve
    normal = settings.advantages == "normalised"
    scale = _named(settings, "advantage", lambda: RootMeanSquare(settings.advantage_rate)) if normal else None
    entropy = _schedule("entropy", settings.entropy, settings.entropy_end, settings.entropy_steps)
    return Estimator(trace, baseline, settings.discount, improve, settings.batch, scale, entropy or 0.0)


def critic_of(settings: "AgentSettings") -> LinearCritic | None:
    """The critic that the settings stand for."""
    if settings.critic == "none":
        return None
    rate = {} if settings.critic_rate is None else {"rate": settings.critic_rate}

    def make() -> LinearCritic:
        fit: TemporalDifference | LeastSquares = TemporalDifference(**rate, level_rate=settings.critic_level_rate)
        if settings.critic == "least-squares":
            means = LeastSquares(**rate, interval=settings.critic_interval)
            fit = dataclasses.replace(means, initial=settings.critic_initial, damping=settings.critic_damping)
        features = Features(settings.critic_squares, settings.critic_actions, settings.critic_bias)
        return LinearCritic(features, settings.critic_discount, settings.critic_decay, fit)

    return _named(settings, "critic", make)


def rule_of(settings: "AgentSettings") -> Any:
    """The ascent rule that the settings stand for."""
    rule = {"sgd": sgd, "adam": adam}[settings.ascent](settings.rate if settings.rates is None else settings.rates)
    decay = settings.weight_decay if settings.weight_decays is None else settings.weight_decays
    return decayed(rule, decay) if decay else rule


def metric_of(settings: "AgentSettings") -> FisherMetric | None:
    """The metric that the settings stand for."""
    limit = _schedule("metric_kl", settings.metric_kl, settings.metric_kl_end, settings.metric_kl_steps)
    if settings.metric == "euclidean":
        return None
    damping = settings.damping if settings.dampings is None else settings.dampings
    return _named(
        settings, "metric", lambda: FisherMetric(settings.metric_rate, damping, settings.metric_initial, limit)
    )


def average_of(settings: "AgentSettings") -> WeightAverage | None:
    """The average of the parameters that the settings stand for."""
    return (
        _named(settings, "average", lambda: WeightAverage(settings.average_start, settings.average_rate))
        if settings.average
        else None
    )


def growth_of(settings: "AgentSettings") -> Growth | None:
    """The schedule of growth that the settings stand for."""
    if settings.growth == "none":
        return None
    criteria = {
        "clock": lambda: Clock(settings.growth_interval),
        "plateau": lambda: Plateau(settings.growth_window, settings.growth_confidence, settings.growth_patience),
    }
    return Growth(
        criteria[settings.growth](),
        settings.growth_units,
        settings.growth_centre,
        Visited() if settings.growth_placement == "visited" else None,
        settings.growth_width,
        settings.growth_cutoff,
        settings.growth_shrink,
        settings.growth_boost,
        settings.growth_damp,
    )


def index_of(settings: "AgentSettings") -> SpatialIndex | None:
    """The spatial index that the settings stand for."""
    return (
        _named(settings, "index", lambda: SpatialIndex(settings.index_neglect, settings.index_margin))
        if settings.index
        else None
    )


def _schedule(name: str, start: float | None, end: float | None, steps: int) -> float | Annealed | None:
    """The number that a setting, and those of its end, stand for."""
    if end is None or start is None:
        check(end is None, f"{name}_end", end, f"none where there is no {name}")
        return start
    try:
        return Annealed(start, end, steps)
    except ValueError as error:
        told = str(error)
        raise ValueError(name + told.removeprefix("start") if told.startswith("start") else f"{name}_{told}") from None


def _named(settings: "AgentSettings", prefix: str, make: Callable[[], P]) -> P:
    """Make a part of the learner; what it refuses is named as the setting that it comes from."""
    try:
        return make()
    except ValueError as error:
        told = str(error)
        setting = f"{prefix}_{told.split()[0].strip(',')}"
        raise ValueError(f"{prefix}_{told}" if hasattr(settings, setting) else told) from None
