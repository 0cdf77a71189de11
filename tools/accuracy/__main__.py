"""Measure errors and costs, and write them into the page: `python -m tools.accuracy measure`, `… page`.

`measure` stores `docs/data/lab-accuracy.json`; `page` puts its table into `docs/lab/accuracy.md`.
"""

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np

from motorgrad import lab
from tools.accuracy._systems import SYSTEMS, System, noisy, spectrum_exact

ROOT = Path(__file__).parents[2]
DATA, PAGE = ROOT / "docs" / "data" / "lab-accuracy.json", ROOT / "docs" / "lab" / "accuracy.md"
MARKS = "<!-- table -->\n", "<!-- end of table -->\n"
TOLERANCES = (1e-6, 1e-9, 1e-12)
SEEDS = 1000


def ours(system: System, solver: str, tolerance: float, seeds: int = 1) -> dict[str, Any]:
    """The error and the processor seconds of a run of TimLab: the least of three, after compilation."""
    settings = {"relative_tolerance": tolerance, "absolute_tolerance": tolerance * 1e-3}
    run = lab.Run(system.build(solver=solver, precision="double", **settings), seeds=seeds)
    run.compile()
    took, error = [], math.inf
    for _ in range(3):
        run.reset()
        begin = time.process_time()
        record = run.advance(system.ticks)
        took.append(time.process_time() - begin)
        error = system.error(record.times("out.u"), record["out.u"][0])
    return {"solver": solver, "tolerance": tolerance, "error": error, "seconds": min(took), "seeds": seeds}


def noise() -> dict[str, Any]:
    """The largest relative error of the spectrum in eight bands, of 1,000 seeds of 1,024 ticks, in single precision."""
    ticks, lead = 1024, 128
    run = lab.Run(noisy(), seeds=SEEDS)
    run.compile()
    begin = time.process_time()
    values = run.advance(ticks + lead)["out.u"][:, lead:]
    took = time.process_time() - begin
    window = np.hanning(ticks)
    power = (np.abs(np.fft.rfft(values * window)) ** 2).mean(0) * 0.1 / (window**2).sum()
    exact = spectrum_exact(np.fft.rfftfreq(ticks, 0.1))
    bands = np.array_split(np.arange(8, ticks // 2), 8)
    error = max(abs(power[band].sum() / exact[band].sum() - 1) for band in bands)
    return {"error": float(error), "seconds": took, "seeds": SEEDS}


def measure(budget: float) -> None:
    """Measure everything, PathSim as far as the processor seconds of the `budget` for a system reach."""
    from tools.accuracy._peers import measured

    found: dict[str, Any] = {}
    for system in SYSTEMS:
        solvers = ("rodas5p",) if system.stiff else ("tsit5", "dopri8")
        rows = [ours(system, solver, tolerance) for solver in solvers for tolerance in TOLERANCES]
        many = ours(system, solvers[0], 1e-9, SEEDS)
        peers, left = [], budget
        for solver, tolerance in (("RK4", None), ("RKDP87", 1e-6), ("RKDP87", 1e-10), ("GEAR52A", 1e-6)):
            if left <= 0 or (system.stiff and solver != "GEAR52A"):
                continue
            peer = measured(system, solver, tolerance)
            if peer is not None:
                peers.append(peer)
                left -= peer["seconds"]
        found[system.name] = {"by": system.by, "ours": rows, "many": many, "peers": peers}
        print(system.name, min(row["error"] for row in rows), [p["error"] for p in peers], flush=True)
        DATA.write_text(json.dumps({"systems": found, "noise": {}}, indent=1) + "\n", encoding="utf-8")
    DATA.write_text(json.dumps({"systems": found, "noise": noise()}, indent=1) + "\n", encoding="utf-8")


def table() -> str:
    """The table of the stored measurements."""
    stored = json.loads(DATA.read_text(encoding="utf-8"))
    lines = [
        "| system | reference | TimLab: error, CPU ms | PathSim: error, CPU ms | PathSim's time ÷ TimLab's, one seed | "
        "the same, for each of 1,000 seeds |",
        "|---|---|---|---|---|---|",
    ]
    for name, entry in stored["systems"].items():
        mine = "<br>".join(_cell(row) for row in entry["ours"])
        peers = "<br>".join(_cell(row) for row in entry["peers"]) or "not modelled"
        lines.append(f"| {name} | {entry['by']} | {mine} | {peers} | {_ratio(entry, 1)} | {_ratio(entry, SEEDS)} |")
    if stored["noise"]:
        error, seconds = stored["noise"]["error"], stored["noise"]["seconds"]
        text = f"largest relative error in eight bands {error:.1e}, {1e3 * seconds:.0f} ms for 1,000 seeds"
        lines.append(f"| noise, spectrum | closed form | {text} | not modelled | | |")
    return "\n".join(lines) + "\n"


def _cell(row: dict[str, Any]) -> str:
    tolerance = "" if row["tolerance"] is None else f" {row['tolerance']:.0e}"
    error = "fails" if not math.isfinite(row["error"]) else f"{row['error']:.1e}"
    return f"{row['solver']}{tolerance}: {error}, {1e3 * row['seconds']:.3g}"


def _ratio(entry: dict[str, Any], seeds: int) -> str:
    """How much faster the fastest of ours is that errs no more than PathSim's most exact run."""
    peers = [row for row in entry["peers"] if math.isfinite(row["error"])]
    if not peers:
        return ""
    best = min(peers, key=lambda row: row["error"])
    rows = entry["ours"] if seeds == 1 else [entry["many"]]
    rows = [row for row in rows if row["error"] <= best["error"]]
    return (
        f"{best['seconds'] / min(row['seconds'] / row.get('seeds', 1) for row in rows):,.0f}" if rows else "less exact"
    )


def page() -> None:
    """Put the table into the page."""
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(MARKS[0])
    PAGE.write_text(before + MARKS[0] + "\n" + table() + "\n" + MARKS[1] + rest.split(MARKS[1])[1], encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("measure", "page"))
    parser.add_argument("--budget", type=float, default=20.0, help="processor seconds of PathSim for each system")
    given = parser.parse_args()
    measure(given.budget) if given.what == "measure" else page()
