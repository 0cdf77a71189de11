"""Section 4.4: pools that grow one unit at a time."""

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from motorgrad.schema import count
from motorgrad.statistics import exact, median_of, share_of
from motorgrad.tasks import LinearRecruitment, spacing_error
from motorgrad.training import Run, agent_for
from motorgrad_thesis._claims import Claim, below, more_than_half, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, draw_intervals, subplots
from motorgrad_thesis.chapter_4._pools import (
    NORMAL,
    SPACED,
    equally_spaced_from,
    parameter_history,
    spacing_deviation,
    thresholds_and_gains,
    with_new_unit,
)

BETTER = "It is a suitable strategy to begin with few units and to add a unit once the others have converged."
POINTS = 25  # points of a curve in each phase


class Way(NamedTuple):
    """A way to learn: output of the task, settings of the learner, final number of units, decisions per number."""

    words: str
    output: Any
    changes: Mapping[str, Any]
    units: int
    phase: int


@experiment("sec-4.4-growth", "a pool that grows", "section 4.4")
class Growth(Experiment):
    """A pool starts with one unit and receives another after a fixed number of decisions, with gain 0 and a random
    threshold, until it is complete. It is compared with a pool that has all units from the start, for as many decisions
    in all. With the natural step, a phase is more than twice as long as a complete pool takes to converge; with the
    plain gradient it is shorter than that.
    """

    reading: ClassVar[str] = "The linear mapping is 1.2 x − 0.1, its coefficients swapped, as for figure 4.3."

    units: int = count(8, 3, 64, help="number of units in the complete pools that learn by the natural step")
    phase: int = count(
        100_000,
        200,
        10**8,
        unit="decisions",
        help="length of the practice with each number of units, by the natural step",
    )
    plain_units: int = count(4, 3, 64, help="number of units in the complete pools that learn by the plain gradient")
    plain_phase: int = count(
        800_000,
        200,
        10**8,
        unit="decisions",
        help="length of the practice with each number of units, by the plain gradient",
    )
    seeds: int = count(24, 2, 10_000, help="number of pools of each kind")

    quick = smoke(units=3, phase=400, plain_units=3, plain_phase=400, seeds=3)

    @property
    def ways(self) -> dict[str, Way]:
        """All ways to learn, by name."""
        return {
            "ratio": Way("natural step, force as a ratio", "ratio", NORMAL, self.units, self.phase),
            "count": Way("natural step, force as a count", "count", NORMAL, self.units, self.phase),
            "plain": Way("plain gradient, force as a count", "count", {}, self.plain_units, self.plain_phase),
        }

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, way in self.ways.items():
            found |= {f"{name} {key}": value for key, value in self._compared(work, way).items()}
        return found

    def _compared(self, work: Workspace, way: Way) -> Values:
        task = LinearRecruitment(units=way.units, output=way.output)
        whole = work.train(task, agent_for(task, **way.changes), way.units * way.phase, self.seeds)
        phases = self._grown(work, way)
        decision, error = whole.curve("error")
        pairs = [run.curve("error") for run in phases]
        offs = [_off(run) for run in phases]
        thresholds = [thresholds_and_gains(run.policies)[0] for run in phases]
        starts = [thresholds_and_gains(run.initial)[0] for run in phases[1:]]
        spacings = [spacing_error(y, run.task) for y, run in zip(thresholds, phases, strict=True)]  # type: ignore[arg-type]
        return {
            "start decision": decision,
            "start error": error,
            "start spacing": spacing_error(thresholds_and_gains(whole.policies)[0], task),
            "start from": equally_spaced_from(decision, _off(whole)),
            "grown decision": np.concatenate([n * way.phase + pair[0] for n, pair in enumerate(pairs)]),
            "grown error": np.concatenate([pair[1] for pair in pairs], axis=1),
            "grown spacing": np.stack(spacings),
            "grown spaced": np.stack([off[:, -1] < SPACED for off in offs]),
            "grown from": np.stack([equally_spaced_from(pair[0], off) for pair, off in zip(pairs, offs, strict=True)]),
            "grown gain": thresholds_and_gains(phases[-1].policies)[1],
            "move": np.stack(
                [np.abs(y - x)[:, :-1].mean(1) * task.slope for x, y in zip(starts, thresholds[1:], strict=True)]
            ),
        }

    def _grown(self, work: Workspace, way: Way) -> list[Run]:
        runs: list[Run] = []
        for size in range(1, way.units + 1):
            task = LinearRecruitment(units=size, output=way.output)
            initial = with_new_unit(runs[-1].policies, new_thresholds(size, self.seeds)) if runs else None
            runs.append(work.train(task, agent_for(task, **way.changes), way.phase, self.seeds, initial))
        return runs

    def figure(self, values: Values) -> Figure:
        """For every way to learn: the error of the force over decisions, and the final deviation from equal spacing."""
        words = {name: way.words for name, way in self.ways.items()}
        figure, axes = subplots(9, 6, 2, len(words), sharey="row", height_ratios=[1.5, 1])
        for column, (name, title) in enumerate(words.items()):
            phases = len(values[f"{name} grown spacing"])
            for kind, colour, label in (
                ("start", "C1", "complete from the start"),
                ("grown", "C0", "grown unit by unit"),
            ):
                decision, error = _thinned(values[f"{name} {kind} decision"], values[f"{name} {kind} error"], phases)
                draw_band(axes[0, column], decision / 1e6, error, colour, label)
            phase = values[f"{name} grown decision"][-1] / phases / 1e6
            for size in range(1, phases):
                axes[0, column].axvline(size * phase, color="0.85", linewidth=0.7, zorder=0)
            axes[0, column].set(title=title, xlabel="million decisions")
            axes[0, column].title.set_fontsize(9)
            for found, shift, colour in (
                (values[f"{name} grown spacing"], 0, "C0"),
                (values[f"{name} start spacing"][None], phases - 1, "C1"),
            ):
                place = np.arange(1, len(found) + 1) + shift + (0.2 if shift else 0)
                style = {"fmt": "o-", "markersize": 4, "color": colour, "linewidth": 0.8}
                draw_intervals(axes[1, column], place, [median_of(row) for row in found], **style)
            axes[1, column].axhline(SPACED, color="0.6", linewidth=0.8, linestyle="--")
            axes[1, column].set(xlabel="units", yscale="log")
        axes[0, 0].set(ylabel="mean error of the force", ylim=(0, None))
        axes[0, 0].legend(fontsize=8)
        axes[1, 0].set_ylabel("greatest deviation (spacings)")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for name, way in self.ways.items():
            yield below(
                1,
                f"Growing is the better strategy: less error during learning ({way.words}).",
                median_of(values[f"{name} grown error"].mean(1) / values[f"{name} start error"].mean(1)),
                "mean error over all decisions, relative to a pool complete from the start,",
                note=f"{way.units} units, {way.units * way.phase:,} decisions.",
                of=BETTER,
                **_tests(name),
            )
            yield below(
                1,
                f"Growing is the better strategy: closer to equal spacing in the end ({way.words}).",
                median_of(values[f"{name} grown spacing"][-1] / values[f"{name} start spacing"]),
                "spacing error, relative to a pool complete from the start,",
                of=BETTER,
                **_tests(name),
            )
            yield _converged_claim(values, name, way)
            yield _sooner_claim(values, name, way)
        moves = values["ratio move"]
        counts = np.arange(1, moves.shape[0] + 1)
        ideal = [ideal_move(int(count)) * count * (count + 1) for count in counts]
        note = "For ideal thresholds: " + ", ".join(
            f"{count} → {count + 1}: {move:.2f}" for count, move in zip(counts, ideal, strict=True)
        )
        yield below(
            1,
            "Each additional unit forces the older thresholds to move less than the one before (force as a ratio).",
            median_of(moves[-1] / moves[0]),
            "mean move with the last unit, relative to the second,",
        )
        yield within(
            0.75,
            1.25,
            "To make room for another unit, each of N thresholds moves by 1/(N(N + 1)) of the input range.",
            exact(ideal[-1]),
            f"mean move of equally spaced thresholds for N = {counts[-1]}, in that unit,",
            "1/(N(N + 1))",
            note="That is the change of the spacing; thresholds in the middle accumulate several such changes. "
            f"{note}.",
        )


def _tests(name: str) -> dict[str, Any]:
    """Whose statement the claims about a way to learn are: the natural gradient is ours; and with the thesis's plain
    one, the phases end before the pools have converged, which the rule requires."""
    if name != "plain":
        return {"kind": "extension"}
    return {"untested": "With the plain gradient, phases end before the pools have converged, as the rule requires."}


def _converged_claim(values: Values, name: str, way: Way) -> Claim:
    shares = [share_of(spaced) for spaced in values[f"{name} grown spaced"]]
    whole = values[f"{name} start from"]
    return more_than_half(
        f"Pools have converged when the next unit is added ({way.words}).",
        min(shares, key=lambda share: share.low),
        "share of grown pools that are equally spaced at the end of a phase, the least over phases,",
        note=f"From 1 unit to {len(shares)}: {', '.join(f'{share.value:.0%}' for share in shares)}. A phase has "
        f"{way.phase:,} decisions; complete pools take: {_middle(whole)}.",
        kind="extension",
        source="a condition of the rule for adding a unit, section 4.4",
    )


def _sooner_claim(values: Values, name: str, way: Way) -> Claim:
    grown = values[f"{name} grown from"]
    whole = values[f"{name} start from"]
    total = grown.sum(0)  # infinite if any phase ended too early
    there = np.isfinite(total) & np.isfinite(whole)
    ratio = f"{median_of(total[there] / whole[there]).words('of the decisions')}. " if there.any() else ""
    return more_than_half(
        f"Growing would be faster if each unit were added as soon as the others are equally spaced ({way.words}).",
        share_of(total < whole),
        "share of seeds in which the phases, until equally spaced for good, take fewer decisions than a complete pool",
        note=f"A pool that is not equally spaced at the end of every phase counts as slower. {ratio}Not equally "
        f"spaced at the end: {int(np.isinf(grown).sum())} of {grown.size} phases, "
        f"{int(np.isinf(whole).sum())} of {whole.size} complete pools. The last phase alone: "
        f"{_middle(grown[-1])}; complete pools: {_middle(whole)}.",
        of=BETTER,
        **_tests(name),
    )


def _middle(times: np.ndarray) -> str:
    middle = np.median(times)
    return f"{middle:,.0f} decisions, the median" if np.isfinite(middle) else "most never get there"


def new_thresholds(salt: int, count: int) -> np.ndarray:
    """Thresholds from U[0, 1] for the new units of all seeds; `salt` selects the random numbers."""
    return np.random.default_rng([salt, count]).random(count)


def _off(run: Run) -> np.ndarray:
    """Deviation from equal spacing of the pools of a run at every record, `(seeds, records)`."""
    assert isinstance(run.task, LinearRecruitment)
    return spacing_deviation(*parameter_history(run), run.task)


def ideal_move(count: int) -> float:
    """Mean distance that equally spaced thresholds must move to make room for one more at the best place, as a fraction
    of the range: from (i − ½)/N to (i − ½)/(N + 1), or to (i + ½)/(N + 1) above the new one."""
    place = np.arange(1, count + 1)
    before = (place - 0.5) / count
    return min(float(np.abs((place - 0.5 + (place > new)) / (count + 1) - before).mean()) for new in range(count + 1))


def _thinned(decision: np.ndarray, values: np.ndarray, phases: int) -> tuple[np.ndarray, np.ndarray]:
    """Means over neighbouring records, so that a curve has `POINTS` in each phase; and the decisions at their ends."""
    size = max(1, len(decision) // (phases * POINTS))
    kept = len(decision) // size * size
    return decision[size - 1 : kept : size], values[:, :kept].reshape(len(values), -1, size).mean(2)
