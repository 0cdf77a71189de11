"""`motorgrad bench`: the speed table."""

import dataclasses
from pathlib import Path
from typing import Any

from rich.console import Console

from motorgrad._applications import entries
from motorgrad._extras import MissingExtra, install
from motorgrad._processes import environment
from motorgrad._program_store import NOTHING_KEPT
from motorgrad.benchmarks import PAIRS, QUICK_PAIRS, ROWS, Figures, Row, chosen, speed_table
from motorgrad.options import finite_table, json_help, parse, write_json
from motorgrad.schema import Settings, static
from motorgrad.training import provenance


@dataclasses.dataclass(frozen=True)
class Bench(Settings):
    """Compare the speed of this library, and of the applications that are installed, with bare physics and hand-written
    loops, on this machine."""

    rows: tuple[str, ...] = static((), help='Only these rows, by `id` or pattern, such as "hopper-*"')
    list: bool = static(False, help="Only list the rows")
    quick: bool = static(False, help="A smoke test: small sizes, meaningless numbers")
    json: Path | None = static(None, help=json_help("the table"))


def run(arguments: list[str]) -> int:
    options = parse(Bench, arguments, "bench")
    console = Console(stderr=str(options.json) == "-")
    rows = chosen(speed_table(), options.rows)
    if options.list:
        for row in rows:
            print(f"{row.id:<32} {row.name}{f'   wanted {row.goal}' if row.goal else ''}")
        return 0
    where = provenance()
    console.print(
        f"{where['processor']}, {where['cores']} cores; medians, ratios of pairs run in turn [least … greatest], by "
        "wall time and by processor time",
        markup=False,
    )
    for extra in ("sim", "lab"):
        if extra not in entries(ROWS):
            console.print(f"left out, the rows of the extra {extra}: {install(extra)}", markup=False)
    found = []
    for row in rows:
        if options.quick and not row.quick:
            console.print(f"left out of a smoke test, as it takes long: {row.id}", markup=False)
            continue
        try:
            with environment(NOTHING_KEPT):  # or a row with compilation would find what the last bench compiled
                figures = row.measure(options.quick, QUICK_PAIRS if options.quick else PAIRS)
        except MissingExtra as missing:
            console.print(f"left out, {row.id}: {missing}", markup=False)
            continue
        found.append(row_table(row, figures))
        console.print(row_text(row, figures), highlight=False, soft_wrap=True, markup=False)
    write_json(options.json, {"machine": where, "rows": found})
    return 0


def row_table(row: Row, figures: Figures) -> dict[str, Any]:
    """A row with its figures as JSON has it."""
    wanted = None if row.goal is None else str(row.goal)
    return finite_table({"id": row.id, "name": row.name, "wanted": wanted, **dataclasses.asdict(figures)})


def row_text(row: Row, figures: Figures) -> str:
    """A row with its figures as text."""
    text = f"{row.id:<32} {row.name:<56} {figures.ours:>14,.4g}"
    text += "" if figures.other is None else f" {'÷' if figures.ratio else '|'} {figures.other:>12,.4g}"
    text += f" {figures.unit}"
    for ratio, spread, by in (
        (figures.ratio, figures.spread, ""),
        (figures.cpu_ratio, figures.cpu_spread, " by processor time"),
    ):
        text += "" if ratio is None or spread is None else f"  = {ratio:.2f} [{spread[0]:.2f} … {spread[1]:.2f}]{by}"
    text += f"   ({figures.also})" if figures.also else ""
    return text + (f"   wanted {row.goal}" if row.goal else "")
