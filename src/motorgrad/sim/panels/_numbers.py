"""Numbers as text: tables for programs, values for people."""

from __future__ import annotations

import csv
import html
import io
import math
from collections.abc import Mapping, Sequence

import numpy as np

NOTHING = 1e-12
"""A number smaller than this is what rounding left of none."""


def csv_of(columns: Mapping[str, np.ndarray]) -> bytes:
    """Columns of one length as a CSV table with a header; a number that is not known leaves its place empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True):
        writer.writerow(["" if isinstance(value, float) and math.isnan(value) else value for value in row])
    return text.getvalue().encode()


def columns_of(name: str, names: Sequence[str], rows: np.ndarray) -> dict[str, np.ndarray]:
    """The columns of an array `(n, names)`, each called after what it is and whose."""
    return {f"{name} {each}": column for each, column in zip(names, np.asarray(rows).T, strict=True)}


def brief(value: float, digits: int = 3) -> str:
    """A number for people: so many significant digits, thousands set apart, a dash where it is not known."""
    if not math.isfinite(value):
        return "–" if math.isnan(value) else "∞" if value > 0 else "−∞"
    if abs(value) < NOTHING:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if -4 <= size < 6:
        return f"{value:,.{max(0, digits - 1 - size)}f}".replace("-", "−")
    return f"{value:.{digits - 1}e}".replace("-", "−")


def table(rows: Sequence[tuple[str, str]]) -> str:
    """Names and values as HTML, the values in line."""
    cells = "".join(
        f'<tr><td style="opacity:.7;padding:1px 10px 1px 0">{html.escape(name)}</td>'
        f'<td style="font-variant-numeric:tabular-nums">{html.escape(value)}</td></tr>'
        for name, value in rows
    )
    return f'<table style="font-size:12px;margin:0 10px 6px;line-height:1.35;border-spacing:0">{cells}</table>'
