"""Sections 5.3.3 and 5.4.1: a search for a body of the hexapod that is fast under the fixed controller."""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from motorgrad._errors import check
from motorgrad.bodies import compile_model
from motorgrad.schema import count, number
from motorgrad.search import Boltzmann, CmaEs, Method, Uniform, search
from motorgrad.statistics import mean_of
from motorgrad_thesis._claims import Claim, negative, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_intervals, new_figure
from motorgrad_thesis.chapter_5.extensions._body_space import (
    DIMENSION_LABELS,
    HEAVIER,
    PAIRS,
    PITCH,
    SETTLING,
    SPACE,
    WIDER,
    YAW,
    body_of,
    differences,
    jittered,
    random_bodies,
    usual_bodies,
    usual_numbers,
    walk_in_batches,
    walk_measures,
    walk_variants,
)
from timsim import draw

SEARCH_METHODS = ("cma-es", "boltzmann", "uniform")
COLOURS = {"cma-es": "C0", "boltzmann": "C1", "uniform": "0.5"}
METHODS = {"cma-es": "CMA-ES", "boltzmann": "Boltzmann selection", "uniform": "random sampling"}
COMPARED = {
    "base": "wide and heavy vs.\nslim and light",
    "width": "wide vs. slim",
    "mass": "heavy vs. light",
    "joints": "vertical vs. lateral\njoints between sections",
}
MEASURED = {"speed": "m/s faster", "duty": "feet longer on the ground\n(fraction of the time)", "tilt": "° more tilt"}
BODIES = {"usual": ("standard body", "C0", 0.12), "chance": ("random bodies", "C1", -0.12)}
SOURCE = "section 5.3.3"
BODY_LABELS = {"usual": "standard body", "chance": "random bodies"}
UNTESTED = {"usual": "", "chance": "Random bodies are ours: the thesis adjusted one body by hand."}


@experiment("sec-5.3.3-morphology", "a search for the hexapod's body", "section 5.3.3", needs=("evosax", "search"))
class Morphology(Experiment):
    """A search over 15 numbers of the hexapod's body for speed under the fixed controller: CMA-ES, the thesis's random
    search with Boltzmann selection, and random sampling, with equally many evaluations. The best body of each search is
    judged by further walks. Which of its numbers made the best body fast; and the thesis's observations: a wide heavy
    trunk compared with a slim light one, and vertical with lateral joints between the sections.
    """

    reading: ClassVar[str] = (
        '"Vertical" joints between the sections are read as joints that pitch. The thesis gives neither the '
        "steps of its random search nor its bodies; both are ours. "
        "The fixed controller is read as for figure 5.7: legs that wait count as supporting the body."
    )

    evaluations: int = count(240, 4, help="number of bodies that a search tries, a multiple of `batch`")
    searches: int = count(5, 2, 10_000, help="number of searches with each method")
    batch: int = count(12, 4, 10_000, help="number of bodies of a search that walk together")
    seconds: float = number(
        4.0, SETTLING + 1, 3600, unit="simulated s", help="length of every walk, the first of which does not count"
    )
    again: int = count(
        12, 2, 10_000, help="number of walks by which a body is judged, of copies with negligible differences"
    )
    bodies: int = count(40, 2, 10_000, help="number of random bodies of which variants are compared")
    temperature: float = number(
        Boltzmann.temperature,
        0,
        open_low=True,
        help="temperature of Boltzmann selection, in standard deviations of the scores",
    )
    changed: int = count(Boltzmann.changed, 1, help="how many numbers Boltzmann selection changes at a time")
    width: float = number(
        Boltzmann.width,
        0,
        open_low=True,
        help="standard deviation of the noise of Boltzmann selection, as a fraction of a number's range",
    )

    def validate(self) -> None:
        super().validate()
        whole = self.evaluations % self.batch == 0
        check(whole, "evaluations", self.evaluations, f"a multiple of batch = {self.batch}")

    quick = smoke(evaluations=12, searches=2, batch=6, seconds=2.0, again=2, bodies=2)

    def method(self, kind: str) -> Method:
        """A search method, with equally many candidates per round."""
        if kind == "cma-es":
            return CmaEs(population=self.batch)
        if kind == "boltzmann":
            return Boltzmann(self.batch, self.temperature, self.changed, self.width)
        return Uniform(candidates=self.batch)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for kind in SEARCH_METHODS:
            each = [
                work.part(f"{kind} {number}", lambda kind=kind, number=number: self._search(work, kind, number))
                for number in range(self.searches)
            ]
            found |= {f"{kind} {name}": np.stack([one[name] for one in each]) for name in each[0]}
        found |= {"usual": work.part("usual", lambda: self._often(work, [usual_numbers()], 0))["speed"][0]}
        best = int(np.argmax(found["cma-es again"].mean(axis=1)))
        numbers = dict(zip(SPACE.names, found["cma-es best"][best].tolist(), strict=True))
        found |= work.part("what helped", lambda: self._helped(work, numbers))
        for name, make in (("usual", usual_bodies), ("chance", random_bodies)):
            count = self.again if name == "usual" else self.bodies
            bodies = make(count, np.random.default_rng(2))
            seen = work.part(f"{name} bodies", lambda bodies=bodies: walk_variants(bodies, self.seconds, work.threads))
            found |= {f"{name} {measure}": values for measure, values in seen.items()}
        return found

    def _search(self, work: Workspace, kind: str, number: int) -> Values:
        """All candidates of a search, its best numbers, and the speeds of that body in further walks."""
        done = search(
            lambda candidates, random: walk_measures(candidates, self.seconds, work.threads)["speed"],
            SPACE,
            self.method(kind),
            evaluations=self.evaluations,
            seed=number,
            progress=work.progress,
        )
        best = done.best
        again = self._often(work, [best], number)
        return {
            "candidates": done.candidates,
            "scores": done.scores,
            "best": np.array(list(best.values())),
            "again": again["speed"][0],
            "duty": again["duty"][0],
        }

    def _often(self, work: Workspace, each: list[dict[str, float]], seed: int) -> Values:
        """Walks of copies of bodies with negligible changes: (bodies, again). A body that falls apart has speed 0."""
        random = np.random.default_rng([1, seed])
        bodies = [copy for numbers in each for copy in jittered(numbers, self.again, random)]
        found = walk_in_batches(bodies, self.seconds, work.threads)
        return {name: np.nan_to_num(values).reshape(len(each), self.again) for name, values in found.items()}

    def _helped(self, work: Workspace, best: dict[str, float]) -> Values:
        """The standard body with each number of the best one, and the best body with each number of
        the standard one."""
        usual = usual_numbers()
        best = {**best, "axis": YAW if best["axis"] > 0.5 else PITCH}
        changed = [{**usual, name: best[name]} for name in SPACE.names]
        undone = [{**best, name: usual[name]} for name in SPACE.names]
        speed = self._often(work, [usual, best, *changed, *undone], 1000)["speed"]
        size = SPACE.size
        return {
            "compared": speed[:2],
            "changed": speed[2 : 2 + size],
            "undone": speed[2 + size :],
            "found": np.array(list(best.values())),
        }

    def figure(self, values: Values) -> Figure:
        """The searches and the bodies (above), the numbers found and their effect (middle), the thesis's observations
        (below)."""
        figure = new_figure(10.5, 13.5)
        parts: Any = figure.subfigures(3, 1, height_ratios=[3.6, 4.8, 3.2])
        above = parts[0].subplots(2, 3, width_ratios=[2.6, 1.2, 1.2], height_ratios=[1, 1.6])
        grid = above[0, 0].get_gridspec()
        for axes in above[:, 0]:
            axes.remove()
        _searches(parts[0].add_subplot(grid[:, 0]), values, SEARCH_METHODS)
        _bodies(above[:, 1:], values)
        found, helped = parts[1].subplots(1, 2, sharey=True)
        _found(found, values, SEARCH_METHODS)
        _helped(helped, values)
        _observed(parts[2].subplots(1, len(MEASURED), sharey=True), values)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        yield from morphology_claims(values, self.evaluations)


def _searches(axes: Axes, values: Values, kinds: Sequence[str]) -> None:
    """The best score so far over the evaluations; at the right, speeds of the best bodies in further walks."""
    for row, kind in enumerate(kinds):
        curves = np.fmax.accumulate(values[f"{kind} scores"], axis=1)
        count = np.arange(1, curves.shape[1] + 1)
        colour = COLOURS[kind]
        axes.fill_between(count, curves.min(axis=0), curves.max(axis=0), color=colour, alpha=0.15, linewidth=0)
        axes.plot(count, np.median(curves, axis=0), color=colour, label=METHODS[kind])
        again = values[f"{kind} again"].mean(axis=1)
        place = np.full(len(again), count[-1] * (1.05 + 0.04 * row))
        axes.plot(place, again, "o", color=colour, markersize=4, clip_on=False)
    axes.axhline(values["usual"].mean(), color="0.25", linestyle="--", linewidth=1, label="the standard body")
    axes.set(xlabel="evaluations; dots: further walks of the best", ylabel="speed of the best body so far (m/s)")
    axes.set_ylim(0.9 * values["usual"].mean(), None)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=9)


def _bodies(axes: Any, values: Values) -> None:
    """The standard body and the best one, from the side and from above, to the same scale."""
    best = dict(zip(SPACE.names, values["found"].tolist(), strict=True))
    for column, (numbers, title) in enumerate(((usual_numbers(), "the standard body"), (best, "the best body found"))):
        body = body_of(numbers)
        assert body is not None
        shown = dataclasses.replace(body, drive="muscles")
        model = compile_model(shown)
        for row, elevation in enumerate((0.0, -90.0)):
            place = axes[row, column]
            firing = np.zeros(len(shown.groups))
            draw(place, model, model.key(0).qpos, firing, elevation=elevation, linewidth=1.3, ground=not row)
            place.set_aspect("equal", adjustable="box")
            # limits that show both bodies and the floor
            place.set(xlim=(-0.7, 0.7), ylim=(-0.7, 0.7) if row else (-0.05, 0.4))
            place.set_axis_off()
        axes[0, column].set_title(title)


def _found(axes: Axes, values: Values, kinds: Sequence[str]) -> None:
    """The best numbers of each search, relative to the bounds."""
    rows = np.arange(SPACE.size)
    for line, kind in enumerate(kinds):
        places = SPACE.places(values[f"{kind} best"])
        height = rows[None] + 0.24 * (line - 1)
        axes.plot(places, np.broadcast_to(height, places.shape), "o", color=COLOURS[kind], markersize=4, alpha=0.8)
        axes.plot([], [], "o", color=COLOURS[kind], markersize=4, label=METHODS[kind])
    usual = SPACE.places(list(usual_numbers().values()))
    axes.plot(usual, rows, "|", color="0.1", markersize=20, markeredgewidth=1.6)
    axes.plot([], [], "|", color="0.1", markersize=9, markeredgewidth=1.6, label="the standard body")
    axes.set_yticks(rows, list(DIMENSION_LABELS.values()))
    axes.set(xlim=(-0.03, 1.03), ylim=(SPACE.size - 0.5, -0.5), xlabel="best of each search, relative to the bounds")
    bounds = [f"{each.low:g} … {each.high:g}" for each in SPACE.ranges.values()]
    bounds[-1] = ""
    for row, text in enumerate(bounds):
        axes.text(1.05, row, text, transform=axes.get_yaxis_transform(), va="center", fontsize=8, color="0.4")
        axes.axhline(row + 0.5, color="0.9", linewidth=0.7, zorder=0)
    axes.legend(loc="lower center", bbox_to_anchor=(0.4, 1.0), ncols=2, fontsize=9)


def _helped(axes: Axes, values: Values) -> None:
    """The effect of each number of the best body on the standard one, and of its removal from the best one."""
    usual, best = values["compared"]
    for name, words, colour, shift in (
        ("changed", "gain of the standard body with this number of the best", "C0", -0.14),
        ("undone", "loss of the best body with this number of the standard", "C3", 0.14),
    ):
        gained = values[name] - usual if name == "changed" else best - values[name]
        _intervals(axes, gained, np.arange(SPACE.size) + shift, colour, words)
    axes.axvline(0.0, color="0.6", linewidth=1, zorder=0)
    for row in range(SPACE.size):
        axes.axhline(row + 0.5, color="0.9", linewidth=0.7, zorder=0)
    axes.set_xlabel(f"m/s; standard body {usual.mean():.2f}, best body {best.mean():.2f}")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), fontsize=9)


def _observed(places: Any, values: Values) -> None:
    """Differences within each pair in speed, time on the ground and tilt."""
    rows = np.arange(len(PAIRS))
    for axes, (measure, words) in zip(places, MEASURED.items(), strict=True):
        for bodies, (label, colour, shift) in BODIES.items():
            found = [differences(values, bodies, pair, measure) for pair in PAIRS]
            _intervals(axes, found, rows - shift, colour, label)
        axes.axvline(0.0, color="0.6", linewidth=1, zorder=0)
        axes.set(xlabel=words, ylim=(len(PAIRS) - 0.5, -0.5))
        axes.locator_params(axis="x", nbins=5)  # so that the numbers do not touch
    places[0].set_yticks(rows, [COMPARED[pair] for pair in PAIRS])
    places[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=9)


def _intervals(axes: Axes, found: Any, rows: np.ndarray, colour: str, label: str) -> None:
    """Means of rows of values, with their intervals."""
    style = {"fmt": "o", "color": colour, "markersize": 4, "capsize": 2, "label": label}
    draw_intervals(axes, rows, [mean_of(each) for each in found], across=True, **style)


def morphology_claims(values: Values, evaluations: int) -> Iterator[Claim]:
    """All claims, in the order of the thesis."""
    yield from _search_claims(values, evaluations)
    yield from _observation_claims(values)
    yield from _explanation_claims(values)


def _search_claims(values: Values, evaluations: int) -> Iterator[Claim]:
    usual = values["usual"].mean()
    cma, boltzmann, uniform = (values[f"{kind} again"].mean(axis=1) for kind in ("cma-es", "boltzmann", "uniform"))
    gain = mean_of(cma - usual)
    note = f"The standard body walks at {usual:.2f} m/s; the best body of a search is judged by further walks."
    yield positive(
        "An outer loop with a global optimiser finds a faster body.",
        gain,
        f"CMA-ES, {evaluations} evaluations: speed minus that of the standard body",
        "m/s",
        note=note,
        source="section 5.4.1",
    )
    yield negative(
        "Random search with Boltzmann selection is largely ineffective.",
        mean_of((boltzmann - usual) - 0.5 * (cma - usual)),
        "gain minus half the gain of CMA-ES with equally many evaluations",
        "m/s",
        note=f"It gains {(boltzmann - usual).mean():.2f} m/s, CMA-ES {gain.value:.2f} m/s.",
    )
    yield positive(
        "Selection and perturbation are better than random sampling.",
        mean_of(boltzmann - uniform),
        "Boltzmann selection minus random sampling, equally many evaluations,",
        "m/s",
        note=f"Random sampling gains {(uniform - usual).mean():.2f} m/s.",
        kind="extension",
    )


def _observation_claims(values: Values) -> Iterator[Claim]:
    for bodies, words in BODY_LABELS.items():
        base, width, mass = (mean_of(differences(values, bodies, pair, "speed")) for pair in ("base", "width", "mass"))
        yield positive(
            f"A wide heavy trunk is faster than a slim light one ({words}).",
            base,
            f"width × and ÷ {WIDER:.3g}, mass × and ÷ {HEAVIER:g}: difference",
            "m/s",
            note=f"Width alone: {width.words('m/s')}; mass alone: {mass.words('m/s')}.",
            of="A wide heavy trunk is faster than a slim light one.",
            untested=UNTESTED[bodies],
        )
    for bodies, words in BODY_LABELS.items():
        speeds = [np.nanmean(values[f"{bodies} {variant} speed"]) for variant in ("vertical", "lateral")]
        yield positive(
            f"Vertical joints between the sections make the hexapod faster than lateral ones ({words}).",
            mean_of(differences(values, bodies, "joints", "speed")),
            "the same body with either: difference",
            "m/s",
            note=f"{speeds[0]:.2f} m/s and {speeds[1]:.2f} m/s.",
            of="Vertical joints between the sections make the hexapod faster than lateral ones.",
            untested=UNTESTED[bodies],
        )


def _explanation_claims(values: Values) -> Iterator[Claim]:
    for pair, words in (("base", "wide heavy trunk than with a slim light one"), ("joints", None)):
        words = words or "vertical joint between sections than with a lateral one"
        for bodies, of in BODY_LABELS.items():
            yield positive(
                f"Feet are on the ground longer with a {words} ({of}).",
                mean_of(differences(values, bodies, pair, "duty")),
                "fraction of the time: difference",
                "of the time",
                of="It is faster because its feet are on the ground longer.",
                untested=UNTESTED[bodies],
            )
    for bodies, of in BODY_LABELS.items():
        yield positive(
            f"A wide heavy trunk tilts less than a slim light one ({of}).",
            mean_of(-differences(values, bodies, "base", "tilt")),
            "root mean square tilt against the ground: difference",
            "° less",
            of="A wide heavy trunk is more stable: it tilts less.",
            untested=UNTESTED[bodies],
        )
