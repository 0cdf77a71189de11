"""The stored figures of rows, one file each in `benchmarks`, and the table of docs/performance.md that shows them."""

import datetime
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from motorgrad._files import write_atomically
from motorgrad.benchmarks import Figures, Row
from tools.speed._processes import ROOT, present
from tools.streaming import in_three_digits

FOLDER = ROOT / "benchmarks"
PAGE = ROOT / "docs" / "performance.md"
BETWEEN = re.compile(r"(<!-- table -->\n).*?(<!-- end -->)", re.DOTALL)
TITLES = ("row", "ours", "reference", "ratio, wall time", "ratio, processor time", "goal", "commit")
NOT_MEASURED = "not measured yet"


def store(row: Row, found: Mapping[str, Any]) -> None:
    """Keep what was measured of a row, with commit, date and machine."""
    commit, changed = present()
    when = {"commit": commit, "changed": changed, "date": datetime.datetime.now(datetime.UTC).date().isoformat()}
    entry = {"id": row.id, "name": row.name, **when, "figures": found["figures"], "machine": found["machine"]}
    FOLDER.mkdir(exist_ok=True)
    text = json.dumps(entry, indent=1, ensure_ascii=False)
    write_atomically(FOLDER / f"{row.id}.json", f"{text}\n".encode())


def stored() -> dict[str, dict[str, Any]]:
    """What was measured, by id."""
    return {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(FOLDER.glob("*.json"))}


def table(rows: Sequence[Row]) -> str:
    """The rows with what is stored of them, in Markdown. A row counts as not measured if nothing is stored of it, or
    figures under other words, as what it compares has changed then. Figures of former rows are listed below."""
    known = stored()
    machines: dict[str, str] = {}
    lines = [f"| {' | '.join(TITLES)} |", "|---" * len(TITLES) + "|"]
    for row in rows:
        entry = known.pop(row.id, None)
        cells = [f"`{row.id}`: {row.name}"]
        if entry is None or entry["name"] != row.name:
            cells += [NOT_MEASURED, "", "", "", str(row.goal or ""), ""]
        else:
            machine = machines.setdefault(_machine(entry["machine"]), chr(ord("A") + len(machines)))
            cells += _measured(row, Figures(**entry["figures"]))
            cells.append(f"{_commit(entry)}, {machine}")
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", *(f"{letter}: {machine}." for machine, letter in machines.items())]
    lines += ["", *(f"`{gone}` is stored, but is no longer a row." for gone in known)] if known else []
    return "\n".join(lines)


def page(rows: Sequence[Row]) -> str:
    """The page with the table of these rows."""
    written = PAGE.read_text(encoding="utf-8")
    return BETWEEN.sub(lambda at: f"{at[1]}{table(rows)}\n{at[2]}", written)


def _measured(row: Row, found: Figures) -> Iterator[str]:
    """The cells of the figures, up to the goal."""
    also = f" ({found.also})" if found.also else ""
    yield f"{in_words(found.ours)} {found.unit}{also}"
    yield "" if found.other is None else in_words(found.other)
    for ratio, spread in ((found.ratio, found.spread), (found.cpu_ratio, found.cpu_spread)):
        if ratio is None or spread is None:
            yield ""
        else:
            low, high = map(_short, spread)
            yield f"{_short(ratio)} [{low} … {high}]"
    missed = row.goal is not None and not row.goal.met(found)
    yield f"{row.goal or ''}{', missed' * missed}"


def in_words(number: float) -> str:
    """A figure in three digits, such as "287,000" or "16.9 million"."""
    if 1e6 <= number < math.inf:
        return f"{number / 1e6:.3g} million"
    return in_three_digits(float(f"{number:.3g}"))


def _short(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 10 else f"{ratio:.2f}"


def _commit(entry: Mapping[str, Any]) -> str:
    if entry["commit"] is None:
        return "unknown"
    return f"`{entry['commit']}`{' with changes' * entry['changed']}, {entry['date']}"


def _machine(machine: Mapping[str, Any]) -> str:
    """Processor, cores and versions in words."""
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items())
    return f"{machine['processor']}, {machine['cores']} cores; {versions}"
