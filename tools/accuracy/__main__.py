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

import timlab
from motorgrad._files import write_atomically
from tools.accuracy._systems import SYSTEMS, System, noisy, spectrum_exact

ROOT = Path(__file__).parents[2]
DATA = ROOT / "docs" / "data" / "lab-accuracy.json"
PAGE = ROOT / "docs" / "lab" / "accuracy.md"
MARKS = "<!-- table -->\n", "<!-- end of table -->\n"
TOLERANCES = (1e-6, 1e-9, 1e-12)
SEEDS = 1000
FEW = 20
NOISY = 1152  # ticks of a run of noise


def ours(system: System, solver: str, tolerance: float, seeds: int = 1) -> dict[str, Any]:
    """The error and the processor seconds of a run of TimLab: the least of three, after compilation."""
    settings = {"relative_tolerance": tolerance, "absolute_tolerance": tolerance * 1e-3}
    run = timlab.Run(system.build(solver=solver, precision="double", **settings), seeds=seeds)
    run.compile()
    took = []
    error = math.inf
    for _ in range(3):
        run.reset()
        begin = time.process_time()
        record = run.advance(system.ticks)
        took.append(time.process_time() - begin)
        error = system.error(record.times("out.u"), record["out.u"][0])
    return {"solver": solver, "tolerance": tolerance, "error": error, "seconds": min(took), "seeds": seeds}


def spectrum_error(values: np.ndarray, lead: int = 128) -> float:
    """The largest relative error of the spectrum of some runs, in eight bands, after the first `lead` ticks."""
    values = values[:, lead:]
    ticks = values.shape[1]
    window = np.hanning(values.shape[1])
    power = (np.abs(np.fft.rfft(values * window)) ** 2).mean(0) * 0.1 / (window**2).sum()
    exact = spectrum_exact(np.fft.rfftfreq(ticks, 0.1))
    bands = np.array_split(np.arange(8, ticks // 2), 8)
    return float(max(abs(power[band].sum() / exact[band].sum() - 1) for band in bands))


def noise() -> dict[str, Any]:
    """The spectra of TimLab's noise and PathSim's, which are exact for infinitely many runs."""
    from tools.accuracy._peers import noise as noise_of_peer

    rows = []
    for seeds in (1, FEW, SEEDS):
        run = timlab.Run(noisy(), seeds=seeds)
        run.compile()
        took = []
        values = np.zeros(0)
        for _ in range(3):
            run.reset()
            begin = time.process_time()
            values = run.advance(NOISY)["out.u"]
            took.append(time.process_time() - begin)
        row = {"solver": "rk4", "tolerance": None, "seconds": min(took), "seeds": seeds}
        rows.append(row | {"error": spectrum_error(values)})
    runs = [noise_of_peer(NOISY, 0.1, seed) for seed in range(FEW)]
    error = spectrum_error(np.stack([values for values, _ in runs]))
    seconds = min(took for _, took in runs)
    peer = {"solver": "RK4", "tolerance": None, "error": error, "seconds": seconds, "seeds": FEW}
    return {"ours": rows, "peer": peer}


def measure(budget: float) -> None:
    """Measure everything, PathSim as far as the processor seconds of the `budget` for a system reach."""
    from tools.accuracy._peers import measured

    found: dict[str, Any] = {}
    for system in SYSTEMS:
        peers = []
        left = budget
        for solver, tolerance in (("RK4", None), ("RKDP87", 1e-6), ("RKDP87", 1e-10), ("GEAR52A", 1e-6)):
            if left > 0 and (not system.stiff or solver == "GEAR52A"):
                peers.append(measured(system, solver, tolerance))
                left -= peers[-1]["seconds"]
        solvers = ("rodas5p",) if system.stiff else ("tsit5", "dopri8")
        rows = [ours(system, solver, tolerance) for solver in solvers for tolerance in TOLERANCES]
        many = [ours(system, row["solver"], row["tolerance"], SEEDS) for row in _exact_enough(rows, peers)]
        found[system.name] = {"by": system.by, "ours": rows, "many": many, "peers": peers}
        print(system.name, min(row["error"] for row in rows), [p["error"] for p in peers], flush=True)
    write_atomically(DATA, (json.dumps({"systems": found, "noise": noise()}, indent=1) + "\n").encode())


def _exact_enough(rows: list[dict[str, Any]], peers: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those that err no more than PathSim's most exact run."""
    return [row for row in rows if row["error"] <= min(peer["error"] for peer in peers)]


def table() -> str:
    """The table of the stored measurements."""
    stored = json.loads(DATA.read_text(encoding="utf-8"))
    lines = [
        "| system | reference | TimLab: error, CPU ms | PathSim: error, CPU ms | PathSim's time ÷ TimLab's, one seed | "
        "the same, for each of 1,000 seeds |",
        "|---|---|---|---|---|---|",
    ]
    for name, entry in stored["systems"].items():
        mine, peers = ("<br>".join(map(_cell, entry[side])) for side in ("ours", "peers"))
        ratios = _ratio(entry["ours"], entry["peers"]), _ratio(entry["many"], entry["peers"])
        lines.append(f"| {name} | {entry['by']} | {mine} | {peers} | {ratios[0]} | {ratios[1]} |")
    one, few, many = stored["noise"]["ours"]
    peer = stored["noise"]["peer"]
    mine = "<br>".join(f"{row['seeds']:,} seeds: {row['error']:.1e}, {1e3 * row['seconds']:.3g}" for row in (few, many))
    theirs = f"{peer['seeds']} seeds: {peer['error']:.1e}, {1e3 * peer['seconds']:.3g} each"
    ratios = (f"{peer['seconds'] / row['seconds'] * row['seeds']:,.0f}" for row in (one, many))
    lines.append(f"| noise, by its spectrum | closed form | {mine} | {theirs} | {' | '.join(ratios)} |")
    return "\n".join(lines) + "\n"


def _cell(row: dict[str, Any]) -> str:
    tolerance = "" if row["tolerance"] is None else f" {row['tolerance']:.0e}"
    error = "fails" if not math.isfinite(row["error"]) else f"{row['error']:.1e}"
    return f"{row['solver']}{tolerance}: {error}, {1e3 * row['seconds']:.3g}"


def _ratio(rows: list[dict[str, Any]], peers: list[dict[str, Any]]) -> str:
    """How much faster the fastest of ours is, for each seed, that errs no more than PathSim's most exact run."""
    best = min(peers, key=lambda row: row["error"])
    seconds = [row["seconds"] / row["seeds"] for row in _exact_enough(rows, peers)]
    return f"{best['seconds'] / min(seconds):,.0f}" if seconds else "less exact"


def page() -> str:
    """The page with the table in it."""
    before, rest = PAGE.read_text(encoding="utf-8").split(MARKS[0])
    return before + MARKS[0] + "\n" + table() + "\n" + MARKS[1] + rest.split(MARKS[1])[1]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("measure", "page"))
    parser.add_argument("--budget", type=float, default=20.0, help="processor seconds of PathSim for each system")
    given = parser.parse_args()
    if given.what == "measure":
        measure(given.budget)
    else:
        write_atomically(PAGE, page().encode())
