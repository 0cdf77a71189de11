"""Diagrams: beside the same ones in PathSim, compilation, and learning diagrams beside the library's own training."""

import importlib.util
import time
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from motorgrad.benchmarks import Row, in_turn, rate
from motorgrad.tasks import make
from motorgrad.training import agent_for, stepper_for
from timlab import Diagram, Gain, Integrator, Run, Sink, Sum, UnitDelay
from timlab.gallery import example

TICK = 0.01
STIFFNESS = 4.0
DAMPING = 0.3


def rows(quick: bool, pairs: int) -> Iterator[Row]:
    """The rows of TimLab in the speed table; `pairs`, how many of ours and of others are measured in turn."""
    for blocks, ticks, peer in ((10, 1_000_000, 500), (100, 300_000, 100), (500, 100_000, 20)):
        wanted = "≥ 1,000,000" if blocks == 100 else ""
        yield peer_row(blocks, 100 if quick else ticks, 2 if quick else peer, pairs, "≥ 100")
        yield discrete_row(blocks, 100 if quick else 2 * ticks, pairs, wanted)
    for name, ticks in (("linear-recruitment", 4_000), ("particle", 2_000)):
        wanted = "≥ 1,000,000" if name == "linear-recruitment" else ""
        yield learning_diagram_row(name, 16 if quick else 1000, 50 if quick else ticks, pairs, wanted)
    yield beside_training_row("linear-recruitment", 16 if quick else 1000, 50 if quick else 4_000, pairs)
    yield compile_row(10 if quick else 100, True)
    yield compile_row(10 if quick else 500, False, "≤ 5")


def peer_row(blocks: int, ticks: int, peer_ticks: int, pairs: int = 5, wanted: str = "") -> Row:
    """Ticks per second of a ring of coupled oscillators, by RK4, against PathSim's if that is installed.

    **Arguments:** how many `blocks`, of which five make an oscillator; the `ticks` that we make at a time, and those
    that PathSim makes; how many `pairs` are measured; the target `wanted`.
    """
    run = Run(oscillators(blocks // 5))
    run.advance(1)  # compiles
    name = f"diagram of {blocks} blocks, continuous"
    if importlib.util.find_spec("pathsim") is None:
        missing = f"{name} (PathSim is not installed: extra peers)"
        return Row(missing, rate(run, ticks, pairs), None, "ticks/s", wanted=wanted)
    peer = PathSimOscillators(blocks // 5)
    return in_turn(
        f"{name} ÷ PathSim",
        "ticks/s",
        ticks,
        lambda: run.advance(ticks),
        lambda: peer.advance(peer_ticks),
        peer_ticks,
        pairs,
        wanted,
    )


def discrete_row(blocks: int, ticks: int, runs: int = 5, wanted: str = "") -> Row:
    """Ticks per second of a diagram of delays, gains and sums."""
    run = Run(network(blocks))
    run.advance(1)  # compiles
    return Row(f"diagram of {blocks} blocks, discrete", rate(run, ticks, runs), None, "ticks/s", wanted=wanted)


def compile_row(blocks: int, single: bool, wanted: str = "") -> Row:
    """Seconds from a diagram to its first tick; if `single`, also with every block compiled separately."""
    took = []
    for stacked in (True, False) if single else (True,):
        diagram = oscillators(blocks // 5, TICK / 2)  # not the program of other rows, which is cached
        jax.clear_caches()
        start = time.perf_counter()
        Run(diagram, stacked=stacked).advance(1)
        took.append(time.perf_counter() - start)
    ours = took[0]
    other = took[1] if single else None
    unit = "s (other: every block by itself)" if single else "s"
    return Row(f"diagram of {blocks} blocks, until its first tick", ours, other, unit, wanted=wanted)


def oscillators(number: int, tick: float = TICK) -> Diagram:
    """A ring of damped oscillators, each coupled to the next: five blocks each."""
    diagram = Diagram(tick)
    for n in range(number):
        diagram.add(f"sum {n}", Sum("--+"))
        diagram.add(f"speed {n}", Integrator(0.0))
        diagram.add(f"place {n}", Integrator(_start_place(n)))
        diagram.add(f"spring {n}", Gain(STIFFNESS))
        diagram.add(f"damper {n}", Gain(DAMPING))
    for n in range(number):
        diagram.connect(f"spring {n}", f"sum {n}.u1")
        diagram.connect(f"damper {n}", f"sum {n}.u2")
        diagram.connect(f"damper {(n + 1) % number}", f"sum {n}.u3")
        diagram.connect(f"sum {n}", f"speed {n}")
        diagram.connect(f"speed {n}", f"place {n}")
        diagram.connect(f"place {n}", f"spring {n}")
        diagram.connect(f"speed {n}", f"damper {n}")
    return diagram


def _start_place(number: int) -> float:
    """The initial place of an oscillator."""
    return float(np.cos(number))


def network(blocks: int, seed: int = 1) -> Diagram:
    """Delays, gains and sums, wired at random."""
    draw = np.random.default_rng(seed)
    diagram = Diagram(TICK)
    for n in range(blocks):
        diagram.add(f"block {n}", (UnitDelay(_start_place(n)), Gain(0.5), Sum("+-"), Gain(-0.3))[n % 4])
    for n in range(blocks):
        for port, declared in diagram.nodes[f"block {n}"].block.inputs.items():
            last = n if declared.feedthrough else blocks
            diagram.connect(f"block {draw.integers(last)}", f"block {n}.{port}")
    return diagram


class PathSimOscillators:
    """The ring of oscillators in PathSim, with its fixed-step RK4."""

    def __init__(self, number: int):
        from pathsim import Connection, Simulation  # pyright: ignore[reportMissingImports]
        from pathsim.blocks import Adder, Amplifier, Integrator  # pyright: ignore[reportMissingImports]
        from pathsim.solvers import RK4  # pyright: ignore[reportMissingImports]

        sums = [Adder("--+") for _ in range(number)]
        speeds = [Integrator(0.0) for _ in range(number)]
        self.places = [Integrator(_start_place(n)) for n in range(number)]
        springs, dampers = ([Amplifier(gain) for _ in range(number)] for gain in (STIFFNESS, DAMPING))
        wires: list[Any] = []
        for n in range(number):
            wires += [Connection(springs[n], sums[n][0]), Connection(sums[n], speeds[n])]
            wires += [Connection(dampers[n], sums[n][1], sums[(n - 1) % number][2])]
            wires += [Connection(speeds[n], self.places[n], dampers[n]), Connection(self.places[n], springs[n])]
        blocks = [*sums, *speeds, *self.places, *springs, *dampers]
        fourth: Any = RK4
        self._simulation = Simulation(blocks, wires, dt=TICK, Solver=fourth, log=False)

    def advance(self, ticks: int) -> None:
        """Make `ticks` steps."""
        for _ in range(ticks):
            self._simulation.timestep(TICK, adaptive=False)

    def positions(self) -> np.ndarray:
        """The places of the oscillators."""
        return np.array([float(place.outputs[0]) for place in self.places])


def learning_diagram_row(name: str, seeds: int, ticks: int, runs: int = 5, wanted: str = "") -> Row:
    """Learning ticks per second in total of a diagram of the gallery, with all seeds in one call."""
    run = Run(remove_sinks(example(name)), seeds)
    run.advance(128)  # compiles
    return Row(
        f"diagram {name} that learns, {seeds:,} seeds", rate(run, ticks, runs) * seeds, None, "ticks/s", wanted=wanted
    )


def beside_training_row(name: str, seeds: int, ticks: int, pairs: int = 5, wanted: str = "") -> Row:
    """The same diagram against `motorgrad.train`'s loop on the task of that name, which is compiled in one piece."""
    run = Run(remove_sinks(example(name)), seeds)
    task = make(name)
    whole = stepper_for(task, agent_for(task), range(seeds))
    run.advance(ticks)
    whole.advance(ticks)
    title = f"diagram {name} ÷ training, {seeds:,} seeds"
    return in_turn(
        title,
        "ticks/s",
        ticks * seeds,
        lambda: run.advance(ticks),
        lambda: whole.advance(ticks),
        pairs=pairs,
        wanted=wanted,
    )


def remove_sinks(diagram: Diagram) -> Diagram:
    """Remove all sinks from a diagram, so that nothing is recorded."""
    for name in [name for name, node in diagram.nodes.items() if isinstance(node.block, Sink)]:
        diagram.remove(name)
    return diagram
