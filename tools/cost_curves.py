"""What a decision costs over seeds, units, muscles and the width of networks: `python -m tools.cost_curves`, from the
root of a checkout.

    python -m tools.cost_curves measure      # some five minutes; stores benchmarks/curves/cost.json, and draws it
    python -m tools.cost_curves draw         # docs/images/cost-curves.png, from what is stored

Let nothing else run on the machine. Every point is the best of three pieces of work, by wall time, after one that
compiles. The two limits are what simple loops on this machine reach: additions to arrays as large as the learner's
state, compiled by numba, for memory; for arithmetic, a random number and a logistic function for each unit, compiled by
JAX, and of networks a loop of multiplications and additions, compiled by numba.
"""

import argparse
import datetime
import json
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib as mpl
import numba
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator

import motorgrad as mg
from motorgrad._compiler import loop_options
from motorgrad._files import write_atomically
from motorgrad._random import BLOCK, draw_block
from motorgrad.benchmarks._bodies import body
from motorgrad.benchmarks._networks import Stream, learner
from motorgrad.bodies import compile_model
from motorgrad.learning import SGD, Agent, olgarb
from motorgrad.policies import hyperplanes
from motorgrad.tasks import Hexapod, Hopper, LinearRecruitment
from motorgrad.training import agent_for, provenance, stepper_for
from tools.figures._style import BLUE, FAINT, GREEN, RED, STYLE, panels
from tools.speed._processes import ROOT, present

STORED = ROOT / "benchmarks" / "curves" / "cost.json"
PICTURE = ROOT / "docs" / "images" / "cost-curves.png"
POWERS = [4**k for k in range(7)]  # 1 … 4,096 seeds or units
POOL = 8
WIDTHS = [4, 16, 64, 256, 1024]
BODIES = ("arm6", "myosuite:myohand_r", "myosuite:myoarm_r", "myosuite:myolegs", "myosuite:myotorso")
LARGEST = "myosuite:myofullbody"  # 416 muscles
WORK = 0.25  # seconds of a piece of work
TRAFFIC = 4 * 2 * 4 + 2 * 4
"""Bytes per unit and decision of linear recruitment: thresholds, gains and their traces are read and written, a random
number is written and read."""
Point = dict[str, float]


def best(work: Callable[[int], object], first: int) -> float:
    """The seconds of one decision: the best of three times as many as fill `WORK`."""
    work(first)  # compiles
    count = first
    while (took := _timed(work, count)) < WORK / 4:
        count *= 4
    count = max(1, round(count * WORK / took))
    return min(_timed(work, count) for _ in range(3)) / count


def _timed(work: Callable[[int], object], count: int) -> float:
    start = time.perf_counter()
    work(count)
    return time.perf_counter() - start


def worlds(seeds: int, units: int) -> Point:
    """Decisions per second in total of linear recruitment, and what the two limits would allow."""
    task = LinearRecruitment(units=units)
    stepper = stepper_for(task, agent_for(task), range(seeds))
    took = best(stepper.advance, BLOCK)
    return {
        "seeds": seeds,
        "units": units,
        "decisions": seeds / took,
        "memory": bandwidth(16 * units * seeds) / (TRAFFIC * units),
        "arithmetic": seeds / best(*drawing(seeds, units)),
    }


@numba.njit(fastmath=True)
def _add(count: int, into: np.ndarray, other: np.ndarray) -> None:
    for k in range(count):
        for i in range(len(into)):
            into[i] += np.float32(k) * other[i]


def bandwidth(size: int) -> float:
    """Bytes per second, read and written, of a loop over two arrays that have `size` bytes together."""
    into, other = (np.zeros(max(size // 8, 1024), np.float32) for _ in range(2))
    return 3 * into.nbytes / best(lambda count: _add(count, into, other), 10)


def drawing(seeds: int, units: int) -> tuple[Callable[[int], object], int]:
    """Draws a number and computes a logistic function for each unit and seed, for so many decisions; and how many these
    are at first."""

    def block(number: jax.Array, total: jax.Array) -> jax.Array:
        drawn = draw_block(jnp.arange(seeds), "policy", number.astype(jnp.uint32), units)
        return jax.lax.fori_loop(0, BLOCK, lambda t, total: jax.nn.sigmoid(total - drawn[t]), total)

    @jax.jit
    def blocks(count: jax.Array) -> jax.Array:
        return jax.lax.fori_loop(0, count, block, jnp.zeros((units, seeds)))

    compiled = blocks.lower(jnp.int32(0)).compile(loop_options())
    return lambda count: jax.block_until_ready(compiled(jnp.int32(-(-count // BLOCK)))), 4 * BLOCK


def muscles() -> list[Point]:
    """Physics steps per second of bodies, alone and while OLGARB learns with linear units, one seed."""
    found = []
    composed = [
        mg.tasks.compose(
            name,
            actions="binary",
            observe=["joint-positions", "joint-velocities"],
            reward=[mg.tasks.terms.Effort(weight=-0.1)],
        )
        for name in (*BODIES, LARGEST)
    ]
    for task in (Hopper(), Hexapod(), *composed):
        model = compile_model(task.dynamics)
        decisions = 20 if model.nu > 200 else 200
        figures = body(task, 1, decisions, 3, Agent(hyperplanes(task), olgarb(0.9), SGD(1e-3)))
        assert figures.other is not None
        found.append({"muscles": int(model.nu), "learning": figures.ours, "physics": figures.other})
    return sorted(found, key=lambda point: point["muscles"])


def networks() -> list[Point]:
    """Decisions per second of a policy and a critic of two hidden layers each, in a world that costs nothing."""
    task = Stream()
    arithmetic = 1e9 * multiplications()
    found = []
    for width in WIDTHS:
        stepper = stepper_for(task, learner((width, width)), [0])
        weights = 2 * (width * width + width * task.observation_size)
        # the weights are read and written, and so are their traces
        memory = bandwidth(8 * weights) / (16 * weights)
        found.append(
            {
                "width": width,
                "decisions": 1 / best(stepper.advance, 16),
                "memory": memory,
                "arithmetic": arithmetic / (5 * weights),  # forwards, twice for the critic; backwards; trace; step
            }
        )
    return found


@numba.njit(fastmath=True)
def _multiply(count: int, matrix: np.ndarray, vector: np.ndarray) -> np.float32:
    total = np.float32(0)
    for _ in range(count):
        for i in range(matrix.shape[0]):
            for j in range(matrix.shape[1]):
                total += matrix[i, j] * vector[j]
        vector[0] = total
    return total


def multiplications() -> float:
    """Billions of multiplications and additions per second of a loop over a small matrix."""
    matrix, vector = np.zeros((64, 64), np.float32), np.zeros(64, np.float32)
    return matrix.size / best(lambda count: _multiply(count, matrix, vector), 100) / 1e9


def measure() -> None:
    """Measure and store all curves."""
    commit, changed = present()
    found = {
        "commit": commit,
        "changed": changed,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "machine": {name: value for name, value in provenance().items() if name not in ("command", "started")},
        "seeds": [worlds(seeds, POOL) for seeds in POWERS],
        "units": [worlds(1, units) for units in POWERS],
        "muscles": muscles(),
        "networks": networks(),
    }
    STORED.parent.mkdir(exist_ok=True)
    write_atomically(STORED, f"{json.dumps(found, indent=1, ensure_ascii=False)}\n".encode())


def draw() -> None:
    """Draw what is stored."""
    found = json.loads(STORED.read_text(encoding="utf-8"))
    with mpl.rc_context(STYLE):
        figure, ((seeds, units), (muscled, wide)) = panels(2, 5.2, rows=2)
        _limited(seeds, found["seeds"], "seeds", f"seeds, {POOL} units each")
        _limited(units, found["units"], "units", "units, one seed")
        _limited(wide, found["networks"], "width", "units of each hidden layer")
        units.legend(loc="lower left")
        _curve(muscled, found["muscles"], "muscles", "physics", FAINT, "physics alone")
        _curve(muscled, found["muscles"], "muscles", "learning", BLUE, "learning")
        _axes(muscled, "muscles", "physics steps/s", [4, 24, 80, 210, 416])
        muscled.legend(loc="lower left")
        PICTURE.parent.mkdir(exist_ok=True)
        figure.savefig(PICTURE, dpi=150)


def _limited(axes: Axes, points: list[Point], over: str, words: str) -> None:
    _curve(axes, points, over, "memory", GREEN, "limit: memory", "--")
    _curve(axes, points, over, "arithmetic", RED, "limit: arithmetic", "--")
    _curve(axes, points, over, "decisions", BLUE, "learning")
    _axes(axes, words, "decisions/s", [point[over] for point in points])


def _curve(axes: Axes, points: list[Point], over: str, name: str, colour: str, label: str, line: str = "-") -> None:
    marks: dict[str, Any] = {} if line == "--" else {"marker": "o", "markersize": 3}
    axes.plot([p[over] for p in points], [p[name] for p in points], color=colour, linestyle=line, label=label, **marks)


def _axes(axes: Axes, across: str, up: str, ticks: list[float]) -> None:
    axes.set(xscale="log", yscale="log", xlabel=across, ylabel=up)
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:,.0f}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tools.cost_curves", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("command", choices=["measure", "draw"])
    if parser.parse_args().command == "measure":
        measure()
    draw()


if __name__ == "__main__":
    main()
