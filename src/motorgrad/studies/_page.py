"""The page of a study: one HTML file, written again while the study runs."""

import base64
import html
import json
import time
from collections import Counter
from collections.abc import Mapping
from typing import Any

from motorgrad._errors import counted
from motorgrad._files import write_atomically
from motorgrad.studies._folder import StudyFolder
from motorgrad.studies._results import Best, Results
from motorgrad.training import Run, RunDirectoryError, learning_curves

CURVES = 6  # in the figure
BEST = 5  # settings in a table
REFRESH = 5  # seconds after which a browser reads the page of a running study again
FAILURES = 50


def write_page(folder: StudyFolder, metric: str, learned: float | None) -> None:
    """Write `index.html`, and `curves.svg`, which it shows.

    **Arguments:** `metric`: by which settings are the best; `learned`: the seconds of learning in this session, while
    the study runs.
    """
    folder.read_begun()
    results = Results(folder)
    tables = [(task, _best(results, metric, task)) for task in results.tasks]
    drawn = _curves(results, metric, tables)
    write_atomically(
        folder.path / "index.html", _page(results, metric, tables, drawn, learned).encode(errors="backslashreplace")
    )


def settings_text(settings: Mapping[str, Any], leave_out: Mapping[str, Any] | None = None) -> str:
    """Settings in words, without those that appear elsewhere."""
    kept = {path: value for path, value in settings.items() if path not in (leave_out or {})}
    words = (
        _value(value) if path == "task.name" else f"{path.partition('.')[2] or path} = {_value(value)}"
        for path, value in kept.items()
    )
    return ", ".join(words) or "the only setting"


def _best(results: Results, metric: str, task: Mapping[str, Any]) -> list[Best]:
    return results.best(metric, BEST, where=task, so_far=True) if metric in results.metrics else []


def _curves(results: Results, metric: str, tables: list[tuple[dict[str, Any], list[Best]]]) -> bytes | None:
    """The learning curves of the best settings of each task as SVG."""
    each = max(1, CURVES // len(tables))
    runs: dict[str, Run] = {}
    for _, table in tables[:CURVES]:
        for best in table[:each]:
            try:
                runs[settings_text(best.settings)] = results.run(best.point)
            except RunDirectoryError:  # it has been begun again just now
                continue
    usable = {label: run for label, run in runs.items() if run.metrics.num_rows and metric in run.metrics.column_names}
    if not usable:
        return None
    file = results.path / "curves.svg"
    learning_curves(list(usable.values()), metric, file, labels=list(usable))
    return file.read_bytes()


def _page(
    results: Results,
    metric: str,
    tables: list[tuple[dict[str, Any], list[Best]]],
    drawn: bytes | None,
    learned: float | None,
) -> str:
    study, failures = results.study, results.failures
    rows = results.table["status"].to_pylist()
    status = Counter(dict(zip(results.table["job"].to_pylist(), rows, strict=True)).values())
    name = html.escape(results.path.absolute().name)
    done = status["done"]
    jobs = len(study.jobs)
    state = "running" if learned is not None else "done" if results.complete else "not running"
    counts = [f"{status[kind]:,} {word}" for kind, word in STATUS_LABELS.items() if status[kind]]
    size = " × ".join(
        counted(number, noun)
        for number, noun in ((len(study.points), "setting"), (len(study.seed_list), "seed"), (study.steps, "decision"))
    )
    figure = ""
    if drawn is not None:
        picture = base64.b64encode(drawn).decode()
        figure = f'<h2>Learning curves</h2><img alt="Learning curves" src="data:image/svg+xml;base64,{picture}">'
    parts = "".join(
        f'<span class="{kind}" style="width:{100 * status[kind] / jobs:.3f}%"></span>'
        for kind in STATUS_LABELS
        if status[kind]
    )
    said = "" if learned is None else f" Learning took {_time(learned)} in this session so far."
    body = f"""<h1>{name} <small class="state">{state}</small></h1>
<p>{size}, in {counted(jobs, "job")}. Written at {time.strftime("%H:%M:%S on %d %B %Y")}.{said}</p>
<div class="bar" role="progressbar" aria-label="jobs" aria-valuemin="0" aria-valuemax="{jobs}"
aria-valuenow="{done}">{parts}</div>
<p class="counts">{" · ".join(counts)}</p>
{failures_text(failures)}
<h2>Best settings by {html.escape(metric)}</h2>
<p>{_how(results)}{html.escape(broken_text(results))}</p>
{"".join(_table(results, task, table) for task, table in tables)}
{figure}"""
    return html_page(f"{done} of {jobs}: {name}", body, running=state == "running")


def html_page(title: str, body: str, *, running: bool = False, style: str = "") -> str:
    """A page of a study, as HTML.

    **Arguments:** `title` and `body`, already HTML; whether the study is `running`, so that a browser reads the page
    again; further `style`.
    """
    refresh = f'<meta http-equiv="refresh" content="{REFRESH}">' if running else ""
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
{refresh}
<title>{title}</title>
<style>{STYLE}{style}</style>
</head>
<body>
<main>
{body}
</main>
</body>
</html>
"""


def _how(results: Results) -> str:
    """How the best were chosen."""
    if len(results.study.seed_list) >= 4:
        return (
            "Means with 95 % intervals over every second seed; the other seeds chose the settings, as the best of many "
            "is partly the luckiest."
        )
    return (
        "Means with 95 % intervals over the seeds. With fewer than four seeds, the same seeds chose the settings, so "
        "the means are partly luck."
    )


def broken_text(results: Results) -> str:
    """How many settings rank last because a policy is not finite, in words; empty without any."""
    if not (broken := results.broken):
        return ""
    of = counted(len(results.study.points), "setting")
    return f" {len(broken):,} of {of} rank last, with seeds whose parameters are not finite: {sum(broken.values()):,}."


def _table(results: Results, task: Mapping[str, Any], table: list[Best]) -> str:
    heading = f"<h3>{html.escape(settings_text(task))}</h3>" if task else ""
    if not table:
        return f"{heading}<p>Nothing yet.</p>"
    paths = list(dict.fromkeys(path for best in table for path in best.settings if path not in task))
    head = "".join(f"<th>{html.escape(path.partition('.')[2] or path)}</th>" for path in paths)
    rows = []
    for best in table:
        cells = "".join(f"<td>{html.escape(_value(best.settings.get(path, '')))}</td>" for path in paths)
        note = "" if best.done else " <small>so far</small>"
        if best.broken:
            note += f" <small>{best.broken} of {counted(len(results.study.seed_list), 'seed')} not finite</small>"
        rows.append(f"<tr>{cells}<td>{html.escape(best.value.words())}{note}</td></tr>")
    return f"{heading}<table><thead><tr>{head}<th>mean</th></tr></thead><tbody>{''.join(rows)}</tbody></table>"


def failures_text(failures: list[dict[str, Any]]) -> str:
    """The jobs that were set aside, as HTML."""
    if not failures:
        return ""
    items = "".join(
        f"<details><summary><code>{html.escape(failure['job'])}</code> after {failure['attempts']} attempts: "
        f"{html.escape(failure['message'])}</summary><pre>{html.escape(failure['traceback'])}</pre></details>"
        for failure in failures[:FAILURES]
    )
    more = f"<p>… and {len(failures) - FAILURES:,} more</p>" if len(failures) > FAILURES else ""
    return f"<h2>Set aside</h2>{items}{more}<p>The same command tries them again.</p>"


def _value(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else value if isinstance(value, str) else json.dumps(value)


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min {rest} s"


STATUS_LABELS = {"done": "done", "begun": "begun", "failed": "set aside", "waiting": "waiting"}
STYLE = """
:root { color-scheme: light dark; --ink: #1c1f23; --paper: #fff; --line: #d6dae0; --soft: #667; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8eb; --paper: #16181c; --line: #3a3f47; --soft: #9aa3ad; } }
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.5 system-ui, sans-serif; }
main { max-width: 60rem; margin: 0 auto; padding: 1.5rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; } h3 { font-size: 1rem; }
.state { font-weight: normal; color: var(--soft); }
.bar { display: flex; height: 1rem; border: 1px solid var(--line); border-radius: .5rem; overflow: hidden; }
.bar .done { background: #009e73; } .bar .begun { background: #56b4e9; } .bar .failed { background: #d55e00; }
.counts { color: var(--soft); }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { text-align: left; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid var(--line); }
td { font-variant-numeric: tabular-nums; }
img { max-width: 100%; background: #fff; border-radius: .25rem; }
details { border-left: 3px solid #d55e00; padding-left: .75rem; margin: .5rem 0; }
summary { cursor: pointer; overflow-wrap: anywhere; } pre { overflow-x: auto; font-size: .8rem; }
"""
