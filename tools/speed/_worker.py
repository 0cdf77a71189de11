"""One row in a process of its own, with the library of a given checkout: `_worker.py CHECKOUT ROW PAIRS`, as JSON.

It is run as a file, and imports what `PYTHONPATH` has; of a row that needs a missing package it says so.
"""

import dataclasses
import json
import sys
from pathlib import Path

import motorgrad
from motorgrad._extras import MissingExtra
from motorgrad.benchmarks import speed_table
from motorgrad.training import provenance


def main(checkout: str, row_id: str, pairs: str) -> None:
    """Measure, and print the figures, their costs and the machine."""
    place = Path(motorgrad.__file__)
    assert place.is_relative_to(checkout), f"{place} is not of {checkout}"
    row = next(row for row in speed_table() if row.id == row_id)
    try:
        figures = row.measure(False, int(pairs))
    except MissingExtra as missing:
        print(json.dumps({"missing": str(missing)}))
        return
    machine = {name: value for name, value in provenance().items() if name not in ("command", "started")}
    print(json.dumps({"figures": dataclasses.asdict(figures), "costs": figures.costs, "machine": machine}))


if __name__ == "__main__":
    main(*sys.argv[1:])
