"""`motorgrad plot RUN…`: learning curves."""

import dataclasses
from pathlib import Path

import tyro

from motorgrad._commands._shared import parse, write_json
from motorgrad.training import learning_curves, load


@dataclasses.dataclass(frozen=True)
class Plot:
    """Draw the learning curves of one run, or of several in one figure."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Run directories."""
    quantity: str = "reward"
    """A column of the metrics, such as reward, baseline or (hopper) apex."""
    out: Path | None = None
    """Where to draw to (.png, .svg, .pdf); by default figures/QUANTITY.png of the first run."""
    json: Path | None = None
    """Also write where the figure is to this file, for machines; - for the standard output."""


def run(arguments: list[str]) -> int:
    options = parse(Plot, arguments, "plot")
    if not options.runs:
        raise ValueError("runs = (): name at least one run directory")
    runs = [load(path) for path in options.runs]
    out = options.out or options.runs[0] / "figures" / f"{options.quantity}.png"
    learning_curves(runs, options.quantity, out)
    if str(options.json) != "-":
        print(f"drawn to {out}")
    write_json(options.json, {"figure": str(out), "runs": [str(path) for path in options.runs]})
    return 0
