"""The report: one HTML file of all figures, claims and numbers in a folder, with the films beside it."""

import base64
import html
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from motorgrad._errors import shown
from motorgrad._files import write_atomically
from motorgrad_thesis._claims import MODEL, OURS, count_verdicts
from motorgrad_thesis._records import AGAIN, FAILURE, RECORD, read_record
from motorgrad_thesis._score import HEADS, Statement, score_rows, score_words, statements


def write_report(out: Path | str, order: Iterable[str]) -> Path:
    """Write `report.html` about all experiments in the folder `out`, those in `order` first, and return its path."""
    out = Path(out)
    names = list(order)
    found = {file.parent.name: _record(file) for file in sorted(out.glob("*/record.json"))}
    records = [found[name] for name in [*(n for n in names if n in found), *(n for n in found if n not in names)]]
    path = out / "report.html"
    failures = [read_record(file, FAILURE) for file in sorted(out.glob("failures/[!.]*.json"))]
    write_atomically(path, page(records, out, failures).encode())
    return path


def _record(file: Path) -> dict[str, Any]:
    """The record of an experiment, whose figure is beside it."""
    record = read_record(file, RECORD)
    figure = file.with_name("figure.svg")
    if record["name"] != file.parent.name:
        raise ValueError(f"{file}: name = {shown(record['name'])}, not that of its folder: {AGAIN}")
    if not figure.is_file():
        raise ValueError(f"{figure}: missing: reproduce the experiment again")
    return record


def page(records: list[dict[str, Any]], out: Path, failures: list[dict[str, Any]]) -> str:
    """The page about these records. Figures are read from their folders in `out` and embedded. Experiments that were
    set aside are listed with their reasons."""
    claims = [claim for record in records for claim in record["claims"]]
    found = statements(records)
    took = _time(sum(record["seconds"] for record in records))
    quick = any(record["quick"] for record in records)
    contents = "".join(f'<li><a href="#{_text(r["name"])}">{_heading(r)}</a> {_score(r)}</li>' for r in records)
    warning = '<p class="quick">A smoke test: everything has run, but the numbers mean nothing.</p>' if quick else ""
    missing = "".join(f"<li>{_text(each['job'])}: {_text(each['message'])}</li>" for each in failures)
    missing = f"<p>These experiments failed and were set aside:</p><ul>{missing}</ul>" if missing else ""
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>motorgrad: experiments reproduced</title>
<style>{STYLE}</style>
</head>
<body>
<main>
<h1>Experiments reproduced</h1>
<p>From <em>Policy-Gradient Learning for Motor Control</em> (Field), by motorgrad: {score_words(found)}.</p>
{_table(HEADS, score_rows(found), "score")}
<p>A statement that is tested in several variants (for each decay, pool or layout) counts once: it holds if all of them
hold, and is refuted if one is. It is not testable where no measurement follows the thesis's own settings. All claims,
those about extensions and about numbers of other implementations included: {_counts(claims)}. A claim holds if
the whole interval meets its criterion, is refuted if none of it does, and is undecided otherwise. Brackets hold 95 %
intervals over seeds, or over runs if there are no seeds. Total time: {took}.</p>
{warning}{missing}{_refuted(found)}
<nav aria-label="Experiments"><ol>{contents}</ol></nav>
{"".join(_section(record, out) for record in records)}
</main>
</body>
</html>
"""


def _section(record: dict[str, Any], out: Path) -> str:
    picture = base64.b64encode((out / record["name"] / "figure.svg").read_bytes()).decode()
    name = _text(record["name"])
    about = _heading(record)
    settings = ", ".join(f"{key} {value}" for key, value in record["settings"].items()) or "none"
    versions = ", ".join(f"{key} {value}" for key, value in record["versions"].items())
    return f"""
<section id="{name}">
<h2>{about}</h2>
<p>{_text(record["summary"])}</p>
<p class="reading">Reading: {_text(record["reading"] or "the text as it stands.")}</p>
<figure><img src="data:image/svg+xml;base64,{picture}" alt="{about}"></figure>
{_films(record)}{_claims(record)}
<details><summary>Settings, versions, time</summary>
<p>Settings: {_text(settings)}.</p>
<p>{_text(versions)}; {_text(record["processor"])}. {_text(_took(record))}</p>
<p>To run it again in another folder: <code>{_text(record["command"])} --out FOLDER</code></p>
</details>
</section>"""


def _table(heads: Iterable[str], rows: Iterable[Iterable[Any]], kind: str) -> str:
    head = "".join(f'<th scope="col">{_text(each)}</th>' for each in heads)
    body = "".join(f"<tr>{''.join(f'<td>{_text(each)}</td>' for each in row)}</tr>" for row in rows)
    return f'<table class="{kind}"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'


def _refuted(found: list[Statement]) -> str:
    """The statements that are refuted, each with what was found, and those that are not testable, with the reason."""
    parts = []
    for standing, title in (("refuted", "Refuted statements"), ("not testable", "Statements that are not testable")):
        rows = [each for each in found if each.standing == standing]
        items = "".join(
            f'<li><a href="#{_text(each.experiment)}">{_text(each.words)}</a> '
            f"<small>{_text(each.source)}: {_text('; '.join(each.reasons))}</small></li>"
            for each in rows
        )
        parts.append(f"<details><summary>{title}: {len(rows)}</summary><ul>{items}</ul></details>" if rows else "")
    return "".join(parts)


def _heading(record: dict[str, Any]) -> str:
    source = record["source"]
    return _text(f"{source[0].upper()}{source[1:]}: {record['title']}")


def _films(record: dict[str, Any]) -> str:
    """Films are too large to embed: the page plays them from their folder."""
    names = [f"{record['name']}/{Path(film).name}" for film in record.get("films", [])]
    return "".join(
        f'<figure><video controls muted loop preload="metadata" src="{_text(name)}"></video>'
        f'<figcaption>The course of learning: <a href="{_text(name)}">{_text(name)}</a></figcaption></figure>\n'
        for name in names
    )


def _claims(record: dict[str, Any]) -> str:
    if not record["claims"]:
        return ""
    rows = "".join(_row(claim, record["source"]) for claim in record["claims"])
    return (
        '<table><thead><tr><th scope="col">Claim</th><th scope="col">Expected</th>'
        f'<th scope="col">Measured</th><th scope="col">Verdict</th></tr></thead><tbody>{rows}</tbody></table>'
    )


def _row(claim: dict[str, Any], source: str) -> str:
    about = [] if claim["kind"] == "thesis" else [claim["kind"]]
    about += [claim["source"]] if claim["source"] not in (source, OURS, MODEL) else []
    about += [f"does not test the statement: {claim['untested']}"] if claim["untested"] else []
    about += [claim["note"]] if claim["note"] else []
    below = f"<small>{_text('; '.join(about))}</small>" if about else ""
    verdict = claim["verdict"]
    return (
        f'<tr><td>{_text(claim["statement"])}{below}</td><td data-label="Expected">{_text(claim["criterion"])}</td>'
        f'<td data-label="Measured">{_text(claim["finding"])}</td><td class="{verdict}">{verdict}</td></tr>'
    )


def _counts(claims: list[dict[str, Any]]) -> str:
    return count_verdicts(claim["verdict"] for claim in claims)


def _score(record: dict[str, Any]) -> str:
    return f"({_counts(record['claims'])})" if record["claims"] else ""


def _took(record: dict[str, Any]) -> str:
    trained = record["trained"]
    shared = f"; training, shared with other experiments: {_time(trained)}" if trained else ""
    return f"Time: {_time(record['seconds'])}{shared}."


def _time(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds < 90 else f"{seconds / 60:.1f} min"


def _text(value: Any) -> str:
    return html.escape(str(value))


STYLE = """
:root { color-scheme: light dark; --line: #8884; --soft: #888; --good: #1a7f37; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --good: #4cc26a; --bad: #ff8a80; } }
body { font: 16px/1.5 system-ui, sans-serif; margin: 0; }
main { max-width: 60rem; margin: 0 auto; padding: 1rem; }
section { border-top: 1px solid var(--line); margin-top: 2.5rem; }
figure { margin: 1rem 0; background: #fff; padding: .5rem; border: 1px solid var(--line); border-radius: 6px; }
img, video { max-width: 100%; height: auto; display: block; margin: 0 auto; }
figcaption { color: #555; text-align: center; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: .4rem .7rem .4rem 0; border-bottom: 1px solid var(--line); }
td:last-child { white-space: nowrap; }
.score td { font-variant-numeric: tabular-nums; } .score tr:last-child { font-weight: 600; }
.reading { color: var(--soft); }
small { display: block; color: var(--soft); }
.holds { color: var(--good); } .holds::before { content: "✓ "; }
.refuted { color: var(--bad); font-weight: 600; } .refuted::before { content: "✗ "; }
.undecided { color: var(--soft); } .undecided::before { content: "? "; }
.quick { border-left: 4px solid #c80; padding-left: .7rem; }
@media (max-width: 40rem) {
  thead { position: absolute; clip-path: inset(50%); }
  tr, td { display: block; border: 0; padding: .15rem 0; }
  tr { border-bottom: 1px solid var(--line); padding: .6rem 0; }
  td[data-label]::before { content: attr(data-label) ": "; color: var(--soft); }
}
details { margin-top: .7rem; overflow-wrap: anywhere; }
"""
