"""`motorgrad bench`: the speed table."""

import dataclasses
from pathlib import Path

from rich.console import Console

from motorgrad._applications import entries
from motorgrad._extras import install
from motorgrad.benchmarks import ROWS, Row, speed_table
from motorgrad.options import finite_table, json_help, parse, write_json
from motorgrad.schema import Settings, static
from motorgrad.training import provenance


@dataclasses.dataclass(frozen=True)
class Bench(Settings):
    """Compare the speed of this library, and of the applications that are installed, with bare physics and hand-written
    loops, on this machine."""

    quick: bool = static(False, help="A smoke test: small sizes, meaningless numbers")
    json: Path | None = static(None, help=json_help("the table"))


def run(arguments: list[str]) -> int:
    options = parse(Bench, arguments, "bench")
    console = Console(stderr=str(options.json) == "-")
    where = provenance()
    console.print(
        f"{where['processor']}, {where['cores']} cores; medians, ratios of pairs run in turn [least … greatest]"
    )
    for extra in ("sim", "lab"):
        if extra not in entries(ROWS):
            console.print(f"left out, the rows of the extra {extra}: {install(extra)}", markup=False)
    rows = []
    for row in speed_table(options.quick):
        rows.append(row)
        console.print(row_text(row), highlight=False, soft_wrap=True)
    write_json(options.json, {"machine": where, "rows": [finite_table(dataclasses.asdict(row)) for row in rows]})
    return 0


def row_text(row: Row) -> str:
    """A row of the table as text."""
    text = f"{row.name:<56} {row.ours:>14,.4g}"
    text += "" if row.other is None else f" {'÷' if row.ratio else '|'} {row.other:>12,.4g}"
    text += f" {row.unit}"
    text += "" if row.ratio is None else f"  = {row.ratio:.2f}"
    text += "" if row.spread is None else f" [{row.spread[0]:.2f} … {row.spread[1]:.2f}]"
    return text + (f"   wanted {row.wanted}" if row.wanted else "")
