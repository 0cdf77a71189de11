"""The tables of a comparison, as rows."""

import itertools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from jaxtyping import Float

from motorgrad.statistics import (
    MAX_DIMENSIONS,
    EffectiveDimension,
    Measured,
    effective_dimension,
    expected_best,
    improvement_of,
    interquartile_mean,
    interquartile_mean_of,
    mean_over_tasks,
    median_of,
    median_over_tasks,
    performance_profile,
    sensitivity_of,
    stratified_bootstrap,
)
from motorgrad.studies._page import settings_text
from motorgrad.studies.comparison._plan import SCORED
from motorgrad.studies.comparison._scores import ComparisonScores

STATISTICS = {"interquartile mean": interquartile_mean, "median": median_over_tasks, "mean": mean_over_tasks}
THRESHOLDS = 101  # of a performance profile
FEWER = 500  # resamples of a curve, which has an interval at every record
MAX_TUNING_COUNTS = 24  # numbers of settings at which the cost of tuning is told

Rows = list[dict[str, Any]]


def tables_of(results: ComparisonScores) -> dict[str, Rows]:
    """The rows of all tables, as far as the comparison has come."""
    found: dict[str, Rows] = {}
    if "tuning" in results.stages and results.stages["tuning"].complete:
        found |= {"chosen": list(_chosen(results)), "tuning": list(_tuning(results)), "cost": list(_cost(results))}
    if results.methods or any(map(results.is_judged, results.comparison.pairs)):
        found |= {
            "summary": list(_summary(results)),
            "tasks": list(_tasks(results)),
            "improvement": list(_improvement(results)),
            "profiles": list(_profiles(results)),
            "curves": list(_curves(results)),
            "sensitivity": list(_sensitivity(results)),
        }
    return found


def dimension_of(results: ComparisonScores, method: str) -> EffectiveDimension | None:
    """The effective dimension of a method's settings; `None` where they were drawn from ranges, where more of them
    differ than it is found for, or where none has a score on every task."""
    varied = results.comparison.varied(method)
    names = {name for setting in varied for name in setting}
    if results.comparison.is_drawn(method) or len(names) > MAX_DIMENSIONS:
        return None
    tried = [results.normalized(task, results.tried((method, task)).mean(axis=1)) for task in results.tasks_of(method)]
    scores = np.array(tried)
    return effective_dimension(varied, scores) if np.isfinite(scores).all(axis=0).any() else None


def _summary(results: ComparisonScores) -> Iterator[dict[str, Any]]:
    for method in results.methods:
        for chosen in ("tuned", "shared"):
            for scored in SCORED:
                scores = results.scores(method, scored, chosen)
                broken = results.broken(method, chosen)
                if not (np.isfinite(scores).all() or broken):
                    continue
                for name, statistic in STATISTICS.items():
                    about = {"method": method, "chosen": chosen, "scored": scored, "statistic": name}
                    yield {**about, **_interval(statistic, scores), "broken": broken}
        about = {"method": method, "chosen": "benchmark", "scored": results.comparison.choose_by, "statistic": "share"}
        broken = results.broken(method, "benchmark")
        yield {**about, **_interval(mean_over_tasks, results.shares(method)), "broken": broken}


def _interval(statistic: Callable[..., Any], scores: Float[np.ndarray, "tasks seeds"]) -> dict[str, float]:
    """A statistic with its interval; NaN where a score is."""
    known = bool(np.isfinite(scores).all())
    value, low, high = map(float, stratified_bootstrap(statistic, scores)) if known else [np.nan] * 3
    return {"value": value, "low": low, "high": high, "runs": scores.size}


def _scores(results: ComparisonScores) -> dict[str, Float[np.ndarray, "tasks seeds"]]:
    """The scores by which methods are ranked, of those that have one for every run."""
    scores = {method: results.scores(method, results.comparison.choose_by) for method in results.methods}
    return {method: each for method, each in scores.items() if np.isfinite(each).all()}


def _tasks(results: ComparisonScores) -> Iterator[dict[str, Any]]:
    for pair in results.comparison.pairs:
        if not results.is_judged(pair):
            continue
        for chosen in ("tuned", "shared", "benchmark"):
            for scored in SCORED:
                earned = results.earned(pair, scored, chosen)
                if not np.isfinite(earned).all():
                    continue
                about = {"method": pair[0], "task": pair[1], "chosen": chosen, "scored": scored}
                middle = _measured("interquartile_mean", interquartile_mean_of(earned))
                yield {**about, **middle, **_measured("median", median_of(earned))}


def _improvement(results: ComparisonScores) -> Iterator[dict[str, Any]]:
    scores = _scores(results)
    for one, other in itertools.combinations(scores, 2):
        found = improvement_of(scores[one], scores[other])
        yield {"method": one, "over": other, "probability": found.value, "low": found.low, "high": found.high}
        back = (1 - found.value, 1 - found.high, 1 - found.low)
        yield {"method": other, "over": one, **dict(zip(("probability", "low", "high"), back, strict=True))}


def _profiles(results: ComparisonScores) -> Iterator[dict[str, Any]]:
    scores = _scores(results)
    if not scores:
        return
    every = np.concatenate([each.ravel() for each in scores.values()])
    low, high = np.quantile(every, [0.005, 0.995])
    thresholds = np.linspace(low, high, THRESHOLDS)
    for method, each in scores.items():
        ends = stratified_bootstrap(lambda drawn: performance_profile(drawn, thresholds), each, resamples=FEWER)
        for threshold, share, low, high in zip(thresholds, *ends, strict=True):
            yield {"method": method, "threshold": threshold, "share": share, "low": low, "high": high}


def _curves(results: ComparisonScores) -> Iterator[dict[str, Any]]:
    """The metric while learning. A run counts with its latest value, from the first record that has one."""
    for pair in results.comparison.pairs:
        if not results.is_judged(pair):
            continue
        decisions, values = results.curve(pair)
        cost = results.cost("judging", results.judged_point(pair))
        period = results.period(pair[1])
        low, high = results.scales[pair[1]]
        for records, known in _recorded(values):
            ends = stratified_bootstrap(lambda x: interquartile_mean(x[..., None, :]), known, resamples=FEWER)
            for decision, value, bottom, top in zip(decisions[records], *ends, strict=True):
                yield {
                    "method": pair[0],
                    "task": pair[1],
                    "decision": int(decision),
                    "simulated_time": None if period is None else float(decision * period),
                    "cpu_time": float(decision * cost),
                    "interquartile_mean": float(results.sign * value),
                    "low": float(min(results.sign * bottom, results.sign * top)),
                    "high": float(max(results.sign * bottom, results.sign * top)),
                    "score": float((value - low) / (high - low)),
                    "runs": known.shape[1],
                }


def _recorded(values: Float[np.ndarray, "seeds records"]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """The records by the runs that have recorded the metric so far: the places of the records, and the latest value of
    each of these runs, `(records, runs)`. A record that no run has come to is left out."""
    own = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(values.shape[1]), -1), axis=1)
    latest = np.take_along_axis(values, np.maximum(own, 0), axis=1)
    runs = (own >= 0).sum(axis=0)
    for count in np.unique(runs[runs > 0]):
        records = np.flatnonzero(runs == count)
        yield records, latest[own[:, records[0]] >= 0][:, records].T


def _sensitivity(results: ComparisonScores) -> Iterator[dict[str, Any]]:
    scored = results.comparison.choose_by
    for method, tuned in _scores(results).items():
        shared = results.scores(method, scored, "shared")
        if not np.isfinite(shared).all():
            continue
        dimension = dimension_of(results, method)
        value, low, high = map(float, stratified_bootstrap(mean_over_tasks, tuned))
        yield {
            "method": method,
            "tuned": value,
            "tuned_low": low,
            "tuned_high": high,
            "shared": float(mean_over_tasks(shared)),
            **_measured("sensitivity", sensitivity_of(tuned, shared)),
            "dimension": None if dimension is None else dimension.dimension,
            "settings_tuned": None if dimension is None else ", ".join(dimension.tuned[dimension.dimension]),
            "scores": None if dimension is None else " ".join(f"{score:.4g}" for score in dimension.scores),
        }


def _tuning(results: ComparisonScores) -> Iterator[dict[str, Any]]:
    """What the best of k settings scores, against what trying k settings costs."""
    seeds = len(results.comparison.seeds.tuning)
    for method in results.comparison.methods:
        tasks = results.tasks_of(method)
        scores = []
        total = len(results.comparison.varied(method))
        counts = np.unique(np.geomspace(1, total, min(total, MAX_TUNING_COUNTS)).round().astype(int))
        for task in tasks:
            tried = results.normalized(task, results.tried((method, task)))
            choosing, reporting = results.stages["tuning"].choosing(tried)
            scores.append(expected_best(choosing.mean(axis=1), reporting.mean(axis=1), counts))
        decisions = sum(results.steps[method, task] for task in tasks) * seeds
        for count, score in zip(counts, np.mean(scores, axis=0), strict=True):
            yield {"method": method, "settings": int(count), "decisions": int(count * decisions), "score": float(score)}


def _cost(results: ComparisonScores) -> Iterator[dict[str, Any]]:
    stages = [stage for stage in ("tuning", "judging") if stage in results.stages]
    for method in results.comparison.methods:
        row: dict[str, Any] = {"method": method, "settings": len(results.comparison.varied(method))}
        for stage in stages:
            pairs = [(method, task) for task in results.tasks_of(method)]
            if stage == "judging" and not all(map(results.is_judged, pairs)):
                continue
            parts = [results.spent(stage, pair) for pair in pairs]
            for name, values in zip(("runs", "decisions", "cpu_seconds"), zip(*parts, strict=True), strict=True):
                row[f"{stage}_{name}"] = sum(values)
        costs = [results.cost("tuning", results.points("tuning", (method, t))[0]) for t in results.tasks_of(method)]
        yield {**row, "cpu_microseconds_per_decision": 1e6 * float(np.mean(costs))}


def _chosen(results: ComparisonScores) -> Iterator[dict[str, Any]]:
    for (method, task), each in results.chosen.items():
        varied = results.comparison.varied(method)
        for chosen, index in each.items():
            words = settings_text({f"agent.{name}": value for name, value in varied[index].items()})
            yield {"method": method, "task": task, "chosen": chosen, "setting": index, "settings": words}


def _measured(name: str, found: Measured) -> dict[str, float]:
    """A number with its interval as columns."""
    return {name: found.value, f"{name}_low": found.low, f"{name}_high": found.high}
