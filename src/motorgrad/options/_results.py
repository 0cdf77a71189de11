"""Results of commands: summaries over seeds, as text and as JSON."""

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from motorgrad import __version__
from motorgrad._errors import plain
from motorgrad._files import write_atomically
from motorgrad.options._outputs import MARK

if TYPE_CHECKING:
    from motorgrad.studies import ComparisonResults, Results, SearchResults


def summary(values: npt.ArrayLike) -> dict[str, Any]:
    """The median and quartiles of one number per seed, and the numbers themselves. NaN means never occurred."""
    values = np.asarray(values, float)
    seen = values[np.isfinite(values)]
    if not len(seen):
        return {"median": None, "quartiles": None, "per_seed": [None] * len(values)}
    low, median, high = np.percentile(seen, [25, 50, 75])
    each = [float(value) if np.isfinite(value) else None for value in values]
    return {"median": float(median), "quartiles": [float(low), float(high)], "per_seed": each}


def summary_text(name: str, found: dict[str, Any]) -> str:
    """A summary as one line."""
    if found["median"] is None:
        return f"{name}: {'unknown' if name == 'reward' else 'never occurred'}"
    low, high = found["quartiles"]
    seeds = len(found["per_seed"])
    seen = sum(value is not None for value in found["per_seed"])
    over = f"{seeds}" if seen == seeds else f"{seen} of {seeds}"
    return (
        f"{name}: median {found['median']:.4g} [quartiles {low:.4g} … {high:.4g}] over {over} seed{'s' * (seeds > 1)}"
    )


def write_json(path: Path | None, result: dict[str, Any]) -> None:
    """Write a command's result as JSON, with the version; the path `-` is the standard output."""
    if path is None:
        return
    text = json.dumps({MARK: __version__, **result}, indent=2, allow_nan=False) + "\n"
    if str(path) == "-":
        sys.stdout.write(text)
    else:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text.encode())


def json_help(what: str = "the result") -> str:
    """The help of the option `--json`, the file that `what` is also written to."""
    return f"Also write {what} to this file, as JSON; - for the standard output"


def finite_table(table: dict[str, Any]) -> dict[str, Any]:
    """A table as JSON has it: `None` for numbers that are not finite, also of lists and of tables within."""

    def finite(value: object) -> Any:
        if isinstance(value, dict):
            return {key: finite(item) for key, item in value.items()}
        if isinstance(value, list | tuple):
            return [finite(item) for item in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return finite(table)


def print_outcome(results: "Results | SearchResults | ComparisonResults") -> None:
    """Say whether a study or a comparison is done."""
    failures = results.failures
    print("done" if results.complete else f"{len(failures):,} jobs set aside" if failures else "stopped")


def print_place(results: "Results | SearchResults | ComparisonResults", files: str, kind: str) -> None:
    """Print which jobs were set aside, where the results and their further `files` are, and how to continue."""
    for failure in results.failures[:10]:
        print(failure_text(failure))
    print(plain(f"saved in {results.path}{files}"))
    if not results.complete:
        print(f"the same command continues this {kind}")


def failure_text(failure: dict[str, Any]) -> str:
    """Which job was set aside, and why, as one line."""
    return plain(f"set aside after {failure['attempts']} attempts: {failure['job']}: {failure['message']}")


def listed_failures(failures: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The jobs that were set aside, as JSON has them."""
    return [{key: failure[key] for key in ("job", "attempts", "message")} for failure in failures]
