"""The figures of a comparison: small panels as SVG that take their colours from the page."""

import html
import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from motorgrad._labels import drawable, literal
from motorgrad.studies.comparison._plan import ComparisonPlan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
else:
    Axes = Any

# inches: a panel fits a telephone
WIDTH = 4.4
HEIGHT = 3.0
INK = "#010203"
SOFT = "#040506"
LINE = "#070809"
"""Colours that stand for those of the page."""
VARIABLES = {INK: "var(--ink)", SOFT: "var(--soft)", LINE: "var(--line)"}
COLOURS = 7  # of the theme, var(--c0) …
THEME = """
:root { --c0: #0072b2; --c1: #d55e00; --c2: #009e73; --c3: #cc79a7; --c4: #b8860b; --c5: #56b4e9; --c6: #5b5f66;
  --good: #009e73; --bad: #d55e00; --card: #f7f8fa; }
@media (prefers-color-scheme: dark) { :root { --c0: #4fb0e5; --c1: #f2894a; --c2: #3cc79b; --c3: #e39bc4; --c4: #e0b54a;
  --c5: #8ccbf0; --c6: #a9afb8; --good: #3cc79b; --bad: #f2894a; --card: #1d2025; } }
"""
"""The colours of methods and cards, in the light and in the dark."""
ALONE = """
.key { font: 9.5px system-ui, sans-serif; fill: var(--ink); }
:root { --ink: #1c1f23; --line: #d6dae0; --soft: #667; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8eb; --line: #3a3f47; --soft: #9aa3ad; } }
"""
"""What a page has besides: for figures that stand alone."""
KEY = 14  # height of a line of the key, in points
AXES = {"decision": "decisions", "simulated_time": "simulated time (s)", "cpu_time": "processor time (s)"}
LOOK: dict[Any, Any] = {
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": LINE,
    "axes.labelcolor": SOFT,
    "axes.titlecolor": INK,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LINE,
    "grid.linewidth": 0.5,
    "text.color": INK,
    "xtick.color": LINE,
    "ytick.color": LINE,
    "xtick.labelcolor": SOFT,
    "ytick.labelcolor": SOFT,
    "svg.fonttype": "none",
    "svg.hashsalt": "motorgrad",
}
STYLES = {"solid": "", "dashed": "5 3", "dotted": "1.5 3", "dashdot": "6 2 1.5 2"}
"""Styles of lines, and their dashes in a key."""
MARKERS = "osD^vPX*"

Row = dict[str, Any]


def colour(place: int) -> str:
    """The colour of a method, which stands for one of the page."""
    return f"#0a0b{place % COLOURS:02x}"


def style(place: int) -> str:
    """The style of a method's line: one more for every round of the colours."""
    return list(STYLES)[place // COLOURS % len(STYLES)]


def standing_alone(
    comparison: ComparisonPlan, tables: Mapping[str, pa.Table], ranking: Sequence[Row]
) -> dict[str, str]:
    """The figures by name, each as the text of an SVG file that follows the reader's light or dark theme and has a key
    of the methods."""
    rows = {name: table.to_pylist() for name, table in tables.items()}
    if "summary" not in rows:
        return {}
    methods = list(comparison.methods)
    ranked = [row["method"] for row in ranking]
    found = {
        "ranking": intervals(ranking, methods, ranked, "Interquartile mean over all tasks"),
        "profiles": profiles(rows.get("profiles", ()), methods),
        "plane": plane(rows.get("sensitivity", ()), methods),
        "tuning": tuning(rows["tuning"], methods),
    }
    for task in comparison.tasks:
        if own := [row for row in rows.get("curves", ()) if row["task"] == task]:
            words = comparison.metric_of(task).replace("_", " ")
            found[f"curves-{task}"] = curves(own, methods, task, "decision", AXES["decision"], words)
    if judged := [row for row in rows.get("sensitivity", ()) if row["scores"]]:
        found["dimension"] = dimensions(judged, methods)
    return {name: _with_key(svg, methods) for name, svg in found.items()}


def _with_key(svg: str, methods: Sequence[str]) -> str:
    """A panel as a file of its own, with a key of the methods below."""
    box = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg)
    assert box is not None
    width = float(box[1])
    height = float(box[2])
    key = "".join(
        f'<line x1="12" x2="34" y1="{height + KEY * place + 8}" y2="{height + KEY * place + 8}" stroke-width="2" '
        f'stroke-dasharray="{STYLES[style(place)]}" style="stroke: var(--c{place % COLOURS})"/>'
        f'<text x="40" y="{height + KEY * place + 11}" class="key">{html.escape(drawable(name))}</text>'
        for place, name in enumerate(methods)
    )
    whole = height + KEY * len(methods) + 8
    svg = svg.replace(box[0], f'width="{width}pt" height="{whole}pt" viewBox="0 0 {width} {whole}"', 1)
    start = svg.index(">") + 1
    return f"{svg[:start]}<style>{ALONE}{THEME}</style>{svg[start:].replace('</svg>', key + '</svg>')}"


def profiles(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """Performance profiles."""

    def draw(axes: Axes) -> None:
        for method, found in _by(rows, "method", methods):
            _line(axes, found, "threshold", "share", methods.index(method))
        axes.set(xlabel="normalized score τ", ylabel="share of runs above τ", ylim=(-0.02, 1.02))
        axes.margins(x=0.01)

    return panel(draw, "Performance profiles", height=3.4)


def intervals(rows: Sequence[Row], methods: Sequence[str], ranked: Sequence[str], title: str) -> str:
    """The score of each method with its interval, the first of those `ranked` at the top."""

    def draw(axes: Axes) -> None:
        for row in rows:
            place = methods.index(row["method"])
            line = ranked.index(row["method"])
            line_style = {"color": colour(place), "linewidth": 2.2, "solid_capstyle": "round"}
            axes.plot([row["low"], row["high"]], [line, line], **line_style)
            axes.plot(row["value"], line, marker="o", color=colour(place), markersize=6)
        axes.set_yticks(range(len(ranked)), [literal(name) for name in ranked])
        axes.set(xlabel="normalized score", ylim=(len(ranked) - 0.5, -0.5))
        axes.tick_params(axis="y", length=0)
        axes.grid(visible=False, axis="y")

    return panel(draw, title, height=0.95 + 0.27 * len(ranked))


def curves(rows: Sequence[Row], methods: Sequence[str], title: str, x: str, label: str, y: str) -> str:
    """Learning curves of every method: interquartile means with their intervals."""

    def draw(axes: Axes) -> None:
        for method, found in _by(rows, "method", methods):
            _line(axes, found, x, "interquartile_mean", methods.index(method))
        axes.set(xlabel=literal(label), ylabel=literal(y))
        axes.set_xlim(left=0)
        axes.margins(x=0.01)
        axes.locator_params(axis="x", nbins=5)

    return panel(draw, title)


def plane(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """The plane of performance and sensitivity: up is better, left needs less tuning."""

    def draw(axes: Axes) -> None:
        for row in rows:
            place = methods.index(row["method"])
            line_style = {"color": colour(place), "alpha": 0.75, "linewidth": 1.3}
            axes.plot([row["sensitivity_low"], row["sensitivity_high"]], [row["tuned"]] * 2, **line_style)
            axes.plot([row["sensitivity"]] * 2, [row["tuned_low"], row["tuned_high"]], **line_style)
            axes.plot(
                row["sensitivity"],
                row["tuned"],
                MARKERS[place // COLOURS % len(MARKERS)],
                color=colour(place),
                markersize=7,
            )
        axes.axvline(0, color=SOFT, linewidth=0.8)
        axes.set(xlabel="sensitivity Φ: what tuning for each task adds", ylabel="score, tuned for each task")
        axes.margins(0.12)

    return panel(draw, "Performance and sensitivity", height=3.4)


def dimensions(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """The score with 0, 1, 2 … settings tuned for each task; a ring marks the effective dimension."""

    def draw(axes: Axes) -> None:
        most = 1
        for row in rows:
            scores = [float(score) for score in row["scores"].split()]
            place = methods.index(row["method"])
            most = max(most, len(scores) - 1)
            axes.plot(scores, color=colour(place), linestyle=style(place), marker="o", markersize=3.5, linewidth=1.6)
            axes.plot(
                row["dimension"], scores[row["dimension"]], "o", color=colour(place), markersize=10, fillstyle="none"
            )
        axes.set(xlabel="settings tuned for each task", ylabel="score in tuning")
        axes.set_xticks(range(most + 1))
        axes.margins(0.08)

    return panel(draw, "Effective dimension", height=3.4)


def tuning(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """What the best of some settings scores, against the decisions that trying them takes."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    def draw(axes: Axes) -> None:
        for method, found in _by(rows, "method", methods):
            place = methods.index(method)
            x, y = ([row[name] for row in found] for name in ("decisions", "score"))
            line_style = {"color": colour(place), "linestyle": style(place), "linewidth": 1.8}
            axes.plot(x, y, marker="o" if len(x) < 3 else "", markersize=4, **line_style)
        axes.set(xlabel="decisions spent on tuning, all tasks", ylabel="expected score", xscale="log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=9))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: _short(value)))
        axes.xaxis.set_minor_locator(NullLocator())

    return panel(draw, "The cost of tuning", height=3.4)


def panel(draw: Callable[[Axes], None], title: str, height: float = HEIGHT) -> str:
    """A panel as SVG, with the colours of the page."""
    import matplotlib
    from matplotlib.figure import Figure

    content = io.StringIO()
    with matplotlib.rc_context(LOOK):
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        axes = figure.subplots()
        axes.set_title(literal(title))
        draw(axes)
        figure.savefig(content, format="svg", transparent=True, metadata={"Date": None})
    return _themed(content.getvalue(), title)


def _themed(svg: str, title: str) -> str:
    """The SVG as part of a page: its colours are variables, its text is the page's, its size follows the page."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'<g id="[^"]*">', "<g>", svg)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r"'DejaVu Sans'[^;\"]*", "system-ui, sans-serif", svg)
    for place in range(COLOURS):
        svg = svg.replace(colour(place), f"var(--c{place})")
    for code, variable in VARIABLES.items():
        svg = svg.replace(code, variable)
    return svg.replace("<svg", f'<svg role="img" aria-label="{html.escape(drawable(title))}"', 1)


def _short(number: float) -> str:
    """A great round number in few characters."""
    for size, letter in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if number >= size:
            return f"{number / size:g}{letter}"
    return f"{number:g}"


def _line(axes: Axes, rows: Sequence[Row], x: str, y: str, place: int) -> None:
    across, values, low, high = (np.array([row[name] for row in rows], float) for name in (x, y, "low", "high"))
    axes.fill_between(across, low, high, color=colour(place), alpha=0.15, linewidth=0)
    axes.plot(across, values, color=colour(place), linestyle=style(place), linewidth=1.8)


def _by(rows: Sequence[Row], name: str, values: Iterable[str]) -> Iterable[tuple[str, list[Row]]]:
    """The rows of each value that occurs."""
    for value in values:
        if found := [row for row in rows if row[name] == value]:
            yield value, found
