"""The page of a comparison: one HTML file with its figures and tables."""

import html
import math
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from motorgrad._errors import counted
from motorgrad._files import write_atomically
from motorgrad.studies._page import failures_text, html_page
from motorgrad.studies.comparison import _figures as figures
from motorgrad.studies.comparison._plan import SCORED
from motorgrad.studies.comparison._results import ComparisonResults
from motorgrad.studies.comparison._scores import CHOICES

Row = dict[str, Any]
DOING = {
    "pilot": "measuring how many decisions each method makes in a second",
    "tuning": "choosing settings",
    "judging": "judging the chosen settings on other seeds",
}


def write_page(results: ComparisonResults, running: str = "") -> None:
    """Write `index.html` of the folder. `running`: the stage that runs now."""
    write_atomically(results.path / "index.html", page(results, running).encode(errors="backslashreplace"))


def page(results: ComparisonResults, running: str = "") -> str:
    """The page as HTML."""
    comparison = results.comparison
    name = _text(results.path.absolute().name)
    state = "running" if running else "done" if results.complete else "not finished"
    tables = {} if running else {name: table.to_pylist() for name, table in results.tables.items()}
    methods = list(comparison.methods)
    tasks = list(comparison.tasks)
    seeds = comparison.seeds
    budget = (
        f"{comparison.seconds:g} processor seconds a run"
        if comparison.seconds is not None
        else " to ".join(f"{n:,}" for n in sorted({min(results.steps.values()), max(results.steps.values())}))
        + " decisions a run"
    )
    parts = [
        f'<h1>{name} <small class="state">{state}</small></h1>',
        f"<p>{counted(len(methods), 'method')} on {counted(len(tasks), 'task')}, {budget}. "
        f"{counted(len(seeds.tuning), 'seed')} chose the settings of every method; {len(seeds.judging)} judged it. "
        f"Written at {time.strftime('%H:%M on %d %B %Y')}.</p>",
    ]
    if running:
        parts.append(f'<p>Now {DOING[running]}: <a href="{running}/index.html">its page</a>.</p>')
    parts.append(failures_text([] if running else results.failures))
    if "summary" in tables:
        parts += _found(results, tables)
    elif not running:
        parts.append("<p>Nothing is judged on all tasks yet. The same command continues.</p>")
    if tables:
        parts.append(_details(results, tables))
        parts.append(DEFINITIONS)
    return html_page(f"{name}: {state}", "\n".join(parts), running=bool(running), style=STYLE)


def _found(results: ComparisonResults, tables: Mapping[str, list[Row]]) -> list[str]:
    comparison, scored = results.comparison, results.comparison.choose_by
    methods = list(comparison.methods)
    summary = [row for row in tables["summary"] if row["statistic"] == "interquartile mean"]
    tuned = [row for row in summary if row["chosen"] == "tuned"]
    missing = [method for method in methods if method not in results.methods]
    left_out = (
        f"<p>Not judged on all tasks, and so not in this table: {_text(', '.join(missing))}.</p>" if missing else ""
    )
    ranked = [row["method"] for row in results.ranking]
    four = [
        figures.intervals([r for r in tuned if r["scored"] == kind], methods, ranked, words[0].upper() + words[1:])
        for kind, words in SCORED.items()
        if any(r["scored"] == kind for r in tuned)
    ]
    felt = tables.get("sensitivity", [])
    judged = [row for row in felt if row["scores"]]
    return [
        "<h2>Ranking</h2>",
        f"<p>Scores of the judging seeds, {SCORED[scored]}, with settings tuned for each task. 0 and 1 are the ends of "
        "each task's scale; intervals are at 95 %.</p>",
        _ranking(results, tables, ranked),
        left_out,
        _legend(methods),
        "<h2>Four ways to score</h2><p>Interquartile means over all tasks.</p>",
        _grid(four),
        "<h2>Run by run</h2>",
        '<div class="grid halves">',
        f"<figure>{figures.profiles(tables.get('profiles', []), methods)}</figure>",
        "<div><h3>Probability of improvement</h3><p>How probable it is that a run of the row's method scores "
        "higher than a run of the column's, on a task taken at random. Bold: the interval leaves out one half.</p>",
        _improvement(tables.get("improvement", []), ranked),
        "</div></div>",
        "<h2>What tuning does</h2>",
        _grid(
            [
                figures.plane(felt, methods),
                figures.tuning(tables["tuning"], methods),
                *([figures.dimensions(judged, methods)] if judged else []),
            ]
        ),
        _cost(tables["cost"]),
        "<h2>Learning curves</h2><p>Interquartile means while learning, settings tuned for each task.</p>",
        _curves(results, tables["curves"]),
    ]


def _ranking(results: ComparisonResults, tables: Mapping[str, list[Row]], ranked: Sequence[str]) -> str:
    scored = results.comparison.choose_by
    of = {
        (r["method"], r["statistic"]): r for r in tables["summary"] if r["chosen"] == "tuned" and r["scored"] == scored
    }
    share = {r["method"]: r for r in tables["summary"] if r["statistic"] == "share"}
    sensitivity, cost = ({r["method"]: r for r in tables.get(name, ())} for name in ("sensitivity", "cost"))
    rows = []
    for method in ranked:
        felt: Row = {
            "dimension": None,
            **dict.fromkeys(("sensitivity", "sensitivity_low", "sensitivity_high"), math.nan),
        }
        felt |= sensitivity.get(method, {})
        dimension = "–" if felt["dimension"] is None else f"{felt['dimension']} of {len(felt['scores'].split()) - 1}"
        row = of[method, "interquartile mean"]
        lost = f" <small>{row['broken']} of {counted(row['runs'], 'run')} not finite</small>" if row["broken"] else ""
        rows.append(
            [
                _swatch(list(results.comparison.methods).index(method), method) + lost,
                _interval(row),
                _interval(of[method, "median"]),
                _interval(share[method]),
                _interval(
                    {"value": felt["sensitivity"], "low": felt["sensitivity_low"], "high": felt["sensitivity_high"]}
                ),
                dimension,
                f"{cost[method]['tuning_decisions']:,}",
                f"{cost[method]['cpu_microseconds_per_decision']:.3g} µs",
            ]
        )
    head = ["method", "interquartile mean", "median", "one setting for all", "sensitivity", "effective dimension"]
    return _table([*head, "decisions of tuning", "processor time a decision"], rows)


def _improvement(rows: Sequence[Row], ranked: Sequence[str]) -> str:
    found = {(row["method"], row["over"]): row for row in rows}
    lines = []
    for one in ranked:
        cells = []
        for other in ranked:
            if (row := found.get((one, other))) is None:
                cells.append("<td>–</td>")
                continue
            sure = not row["low"] <= 0.5 <= row["high"]
            words = f"{row['probability']:.2f}"
            share = row["probability"]
            colour = "--good" if share > 0.5 else "--bad"
            tint = f"color-mix(in srgb, var({colour}) {abs(share - 0.5) * 90:.0f}%, transparent)"
            said = f"{row['low']:.2f} … {row['high']:.2f}"
            cells.append(f'<td style="background:{tint}" title="{said}">{f"<b>{words}</b>" if sure else words}</td>')
        lines.append(f"<tr><th scope='row'>{_text(one)}</th>{''.join(cells)}</tr>")
    head = "".join(f'<th scope="col"><span>{_text(method)}</span></th>' for method in ranked)
    return f'<table class="matrix"><thead><tr><th></th>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table>'


def _cost(rows: Sequence[Row]) -> str:
    def cell(row: Row, name: str) -> str:
        value = row.get(name)
        return (
            "–" if value is None else f"{value:,.0f}" if value >= 100 or float(value).is_integer() else f"{value:.3g}"
        )

    names = ["settings", "tuning_runs"]
    names += [f"{stage}_{what}" for stage in ("tuning", "judging") for what in ("decisions", "cpu_seconds")]
    head = ["method", "settings", "runs of tuning", "decisions of tuning", "seconds of tuning"]
    lines = [[_text(row["method"]), *(cell(row, name) for name in names)] for row in rows]
    return _table([*head, "decisions of judging", "seconds of judging"], lines)


def _curves(results: ComparisonResults, rows: Sequence[Row]) -> str:
    methods = list(results.comparison.methods)
    axes = [axis for axis in figures.AXES if any(row[axis] is not None for row in rows)]
    tabs = "".join(
        f'<input type="radio" name="axis" id="by-{axis}"{" checked" * (not place)}>'
        f'<label for="by-{axis}">{figures.AXES[axis]}</label>'
        for place, axis in enumerate(axes)
    )
    grids = []
    for axis in axes:
        panels = []
        for task in results.comparison.tasks:
            own = [row for row in rows if row["task"] == task and row[axis] is not None]
            if own:
                words = results.comparison.metric_of(task).replace("_", " ")
                panels.append(figures.curves(own, methods, task, axis, figures.AXES[axis], words))
        grids.append(f'<div class="by-{axis}">{_grid(panels)}</div>')
    return f'<div class="tabs">{tabs}{"".join(grids)}</div>'


def _details(results: ComparisonResults, tables: Mapping[str, list[Row]]) -> str:
    parts = ["<h2>In numbers</h2>"]
    for task in results.comparison.tasks if "tasks" in tables else ():
        lines = []
        rows = [row for row in tables["tasks"] if row["task"] == task and row["chosen"] == "tuned"]
        for method in dict.fromkeys(row["method"] for row in rows):
            own = {row["scored"]: row for row in rows if row["method"] == method}
            cells = [
                _interval(own[kind], "interquartile_mean", results.sign) if kind in own else "–" for kind in SCORED
            ]
            median = _interval(own[results.comparison.choose_by], "median", results.sign)
            lines.append([_text(method), *cells, median])
        low, high = (results.sign * end for end in results.scales[task])
        words = f"{results.comparison.metric_of(task)}; the scale is from {low:.4g} (0) to {high:.4g} (1)"
        head = ["method", *SCORED.values(), "median over the seeds"]
        parts.append(f"<details><summary>{_text(task)}: {_text(words)}</summary>{_table(head, lines)}</details>")
    same: dict[tuple[str, ...], list[str]] = {}
    for row in tables["chosen"]:
        same.setdefault((row["method"], row["task"], row["settings"]), []).append(row["chosen"])
    lines = [
        [_text(method), _text(task), ", ".join(each), _text(words)] for (method, task, words), each in same.items()
    ]
    about = "; ".join(f"{name}: {words}" for name, words in CHOICES.items())
    chosen = _table(["method", "task", "chosen", "settings"], lines)
    parts.append(f"<details><summary>The chosen settings</summary><p>{_text(about)}.</p>{chosen}</details>")
    return "".join(parts)


def _legend(methods: Sequence[str]) -> str:
    chips = "".join(_swatch(place, method) for place, method in enumerate(methods))
    return f'<p class="legend">{chips}</p>'


def _swatch(place: int, method: str) -> str:
    line = f'<line x1="1" x2="21" y1="5" y2="5" stroke-dasharray="{figures.STYLES[figures.style(place)]}"/>'
    colour = f"var(--c{place % figures.COLOURS})"
    return f'<span class="chip"><svg viewBox="0 0 22 10" style="stroke:{colour}">{line}</svg>{_text(method)}</span>'


def _grid(panels: Iterable[str]) -> str:
    inner = "".join(f"<figure>{each}</figure>" for each in panels)
    return f'<div class="grid">{inner}</div>'


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table whose cells are HTML already."""
    top = "".join(f'<th scope="col">{_text(each)}</th>' for each in head)
    lines = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f'<table class="numbers"><thead><tr>{top}</tr></thead><tbody>{lines}</tbody></table>'


def _interval(row: Row, name: str = "value", sign: int = 1) -> str:
    if math.isnan(row[name]):
        return "unknown"
    ends = ("low", "high") if name == "value" else (f"{name}_low", f"{name}_high")
    low, high = sorted(sign * row[end] for end in ends)
    return f"{_number(sign * row[name])} <small>[{_number(low)} … {_number(high)}]</small>"


def _number(value: float) -> str:
    """A number in few digits, with a true minus."""
    text = f"{value:.3f}" if 0.1 <= abs(value) < 100 else f"{value:.3g}"
    return text.replace("-", "−")


def _text(value: object) -> str:
    return html.escape(str(value))


DEFINITIONS = """
<h2>Definitions</h2>
<dl>
<dt>score</dt><dd>The metric on the task's scale: from its 5th to its 95th percentile over all settings of all
methods in tuning, unless the comparison gives a scale.</dd>
<dt>interquartile mean</dt><dd>The mean of the middle half of all runs of all tasks.</dd>
<dt>median</dt><dd>The median over the tasks of the means over their runs.</dd>
<dt>intervals</dt><dd>At 95 %, by a bootstrap that draws each task's runs again from themselves (stratified).</dd>
<dt>performance profile</dt><dd>The share of runs that score above τ.</dd>
<dt>one setting for all</dt><dd>With the one setting that is best for all tasks, the share of all runs of tuning that
a judging run is at least as good as.</dd>
<dt>sensitivity</dt><dd>How much higher the score is with settings tuned for each task than with one setting for
all.</dd>
<dt>effective dimension</dt><dd>The fewest settings that have to be tuned for each task to reach 95 % of the peak.</dd>
<dt>cost of tuning</dt><dd>The expected score of the best of k settings tried, against the decisions that trying them
takes. One half of the tuning seeds chooses, the other half is shown.</dd>
<dt>processor time</dt><dd>Of a compiled call in which runs learn side by side, divided by their number, without
compiling; the seconds of tuning and judging include it.</dd>
</dl>
<p>Agarwal et al. (2021), Deep reinforcement learning at the edge of the statistical precipice; Patterson et al. (2024),
The cross-environment hyperparameter setting benchmark; Adkins, Bowling and White (2024), A method for evaluating
hyperparameter sensitivity; Dodge et al. (2019), Show your work. The tables are in <code>tables/</code>.</p>
"""
STYLE = (
    figures.THEME
    + """main { max-width: 84rem; }
main > p, main > dl { max-width: 50rem; }
h2 { border-top: 1px solid var(--line); padding-top: 1.25rem; }
.grid { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 24rem), 1fr)); gap: 1rem; }
.grid.halves { grid-template-columns: repeat(auto-fit, minmax(min(100%, 24rem), 1fr)); align-items: start; }
.halves > figure { max-width: 34rem; }
.grid > div { min-width: 0; } .grid h3 { margin-top: 0; }
figure { margin: 0; padding: .75rem; background: var(--card); border: 1px solid var(--line); border-radius: .6rem; }
figure svg { display: block; width: 100%; height: auto; }
.legend { position: sticky; top: 0; z-index: 1; max-width: none !important; margin: 1rem 0; padding: .5rem 0;
  background: var(--paper); border-bottom: 1px solid var(--line); overflow-x: auto; white-space: nowrap; }
.chip { display: inline-flex; align-items: center; gap: .4rem; margin-right: 1rem; }
.chip svg { width: 22px; height: 10px; stroke-width: 2.5; flex: none; }
table.numbers, table.matrix { margin: .75rem 0; font-size: .92rem; }
th, td { white-space: nowrap; } thead th { vertical-align: bottom; font-weight: 600; color: var(--soft); }
.numbers td:first-child, .matrix th:first-child { position: sticky; left: 0; background: var(--paper); }
.numbers thead th { white-space: normal; min-width: 5.5rem; }
small { color: var(--soft); }
.matrix td { text-align: center; padding: .3rem .5rem; min-width: 2.6rem; border: 1px solid var(--paper); }
.matrix th[scope="col"] { vertical-align: bottom; padding: .3rem .2rem; }
.matrix th[scope="col"] span { writing-mode: vertical-rl; transform: rotate(180deg); }
.tabs > input { position: absolute; opacity: 0; }
.tabs > label { display: inline-block; margin: 0 .5rem .75rem 0; padding: .3rem .8rem; border: 1px solid var(--line);
  border-radius: 1rem; cursor: pointer; }
.tabs > input:checked + label { background: var(--ink); color: var(--paper); }
.tabs > input:focus-visible + label { outline: 2px solid var(--c0); outline-offset: 2px; }
.tabs > div { display: none; }
.tabs:has(#by-decision:checked) > .by-decision, .tabs:has(#by-simulated_time:checked) > .by-simulated_time,
.tabs:has(#by-cpu_time:checked) > .by-cpu_time { display: block; }
details { border-left-color: var(--line); } dt { font-weight: 600; margin-top: .5rem; } dd { margin: 0; }
@media (max-width: 40rem) { main { padding: 1rem; } figure { padding: .4rem; } }
"""
)
