"""Rollouts in files: Parquet, CSV, and OpenSim's tables (.sto)."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from motorgrad._errors import check
from motorgrad._files import check_writable, replacing

FORMATS = (".parquet", ".csv", ".sto")
OPENSIM = {
    "joint angle": "/jointset/{0}/{0}/value",
    "joint position": "/jointset/{0}/{0}/value",
    "joint velocity": "/jointset/{0}/{0}/speed",
    "muscle activation": "/forceset/{0}/activation",
}
"""OpenSim's names for what it knows as states, of the form that it has them in since version 4."""
AT_ONCE = 4096  # rows of text in memory


def check_table(path: Path, name: str = "path") -> None:
    """Refuse a path whose ending names no format, or where no file can be written. **Raises** `ValueError`."""
    check(path.suffix.lower() in FORMATS, name, str(path), f"a path that ends in {', '.join(FORMATS)}")
    check_writable(name, path)


def save(
    table: pa.Table, path: Path, units: Mapping[str, str], about: Mapping[str, str], episodes: Sequence[tuple[int, int]]
) -> Path:
    """Write a table to a file, whose ending says in which format. Missing folders are made."""
    check_table(path)
    kind = path.suffix.lower()
    if kind == ".sto":
        allowed = "one, as time has to grow from row to row: save table.of(seed=…, episode=…) of each"
        check(len(episodes) == 1, "episodes in a .sto file", len(episodes), allowed)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as file:
        if kind == ".parquet":
            import pyarrow.parquet as pq

            repeats = [field.name for field in table.schema if not pa.types.is_floating(field.type)]
            pq.write_table(table, file, use_dictionary=repeats)  # type: ignore[arg-type]
        elif kind == ".csv":
            from pyarrow import csv

            csv.write_csv(table, file)
        else:
            for part in _opensim(table, units, about):
                file.write(part.encode())
    return path


def _opensim(table: pa.Table, units: Mapping[str, str], about: Mapping[str, str]) -> Iterator[str]:
    """The parts of a table as OpenSim reads it: a header, the names of the columns, then a row for each moment."""
    kept = ["time", *(name for name in table.column_names if name not in ("time", "seed", "episode"))]
    labels = []
    for name in kept:
        family, _, part = name.partition(": ")
        labels.append(OPENSIM[family].format(part) if family in OPENSIM else name)
    said = {label: units[name] for label, name in zip(labels, kept, strict=True)}
    head = {"version": "3", "DataType": "double", "nRows": table.num_rows, "nColumns": len(kept), "inDegrees": "no"}
    head |= {name: each for name, each in about.items() if "=" not in each and "\n" not in each}
    head |= {name: table[name][0].as_py() for name in ("seed", "episode")}
    yield "\n".join(
        [
            "motorgrad rollout",
            *(f"{name}={value}" for name, value in head.items()),
            f"units={json.dumps(said, ensure_ascii=False)}",
            "Units are S.I. units (second, meters, Newtons, ...); angles are in radians.",
            "endheader",
            "\t".join(labels),
            "",
        ]
    )
    for first in range(0, table.num_rows, AT_ONCE):
        part = table.slice(first, AT_ONCE)
        numbers = np.column_stack([np.asarray(part[name].to_numpy(), float) for name in kept])
        yield "".join("\t".join(map(repr, row)) + "\n" for row in numbers.tolist())
