"""Diagrams: beside the same ones in PathSim, compilation, and learning diagrams beside the library's own training."""

from typing import Any

import jax
import numpy as np

from motorgrad._extras import installed
from motorgrad.benchmarks import Figures, Goal, Row, figures, in_turn, started, timed
from motorgrad.tasks import make
from motorgrad.training import agent_for, stepper_for
from timlab import Diagram, Gain, Integrator, Run, Sink, Sum, UnitDelay
from timlab.gallery import example

TICK = 0.01
STIFFNESS = 4.0
DAMPING = 0.3


FIRST_TICK = """
from timlab import Run
from timlab.gallery import example
Run(example("chain")).advance(1)
"""


def rows() -> list[Row]:
    """The rows of TimLab in the speed table."""

    def continuous(blocks: int, ticks: int, peer: int):
        return lambda quick, pairs: beside_peer(blocks, 100 if quick else ticks, 2 if quick else peer, pairs)

    def separate(blocks: int, ticks: int):
        return lambda quick, pairs: discrete(blocks, 100 if quick else 2 * ticks, pairs)

    def learns(name: str, ticks: int):
        return lambda quick, pairs: learning(name, 16 if quick else 1000, 50 if quick else ticks, pairs)

    million = Goal(1e6, "ticks/s")
    found = []
    for blocks, ticks, peer in ((10, 1_000_000, 500), (100, 300_000, 100), (500, 100_000, 20)):
        name = f"diagram of {blocks} blocks"
        goal = million if blocks == 100 else None
        found += [
            Row(f"diagram-{blocks}", f"{name}, continuous ÷ PathSim", continuous(blocks, ticks, peer), Goal(100)),
            Row(f"discrete-{blocks}", f"{name}, discrete", separate(blocks, ticks), goal),
        ]
    of_seeds = "1,000 seeds"
    return [
        *found,
        Row(
            "diagram-recruitment",
            f"diagram linear-recruitment that learns, {of_seeds}",
            learns("linear-recruitment", 4_000),
            million,
        ),
        Row("diagram-particle", f"diagram particle that learns, {of_seeds}", learns("particle", 2_000)),
        Row(
            "diagram-training",
            f"diagram linear-recruitment ÷ training, {of_seeds}",
            lambda quick, pairs: beside_training(
                "linear-recruitment", 16 if quick else 1000, 50 if quick else 4_000, pairs
            ),
        ),
        Row(
            "first-tick-100",
            "diagram of 100 blocks, until its first tick",
            lambda quick, pairs: compiling(10 if quick else 100, True),
        ),
        Row(
            "first-tick-500",
            "diagram of 500 blocks, until its first tick",
            lambda quick, pairs: compiling(10 if quick else 500, False),
            Goal(5, "s", at_most=True),
        ),
        Row(
            "first-tick-timlab",
            "import timlab, and the first tick of the diagram chain, in a new process",
            lambda quick, pairs: started(["-c", FIRST_TICK], min(pairs, 3)),
            Goal(1.5, "s", at_most=True),
            quick=False,
        ),
    ]


def beside_peer(blocks: int, ticks: int, peer_ticks: int, pairs: int = 5) -> Figures:
    """Ticks per second of a ring of coupled oscillators, by RK4, against PathSim's if that is installed.

    **Arguments:** how many `blocks`, of which five make an oscillator; the `ticks` that we make at a time, and those
    that PathSim makes; how many `pairs` are measured.
    """
    run = Run(oscillators(blocks // 5))
    run.advance(1)  # compiles
    if not installed("pathsim"):
        also = "PathSim is not installed: extra peers"
        return in_turn("ticks/s", ticks, lambda: run.advance(ticks), pairs=pairs, also=also)
    peer = PathSimOscillators(blocks // 5)
    works = (lambda: run.advance(ticks), lambda: peer.advance(peer_ticks))
    return in_turn("ticks/s", ticks, *works, peer_ticks, pairs)


def discrete(blocks: int, ticks: int, runs: int = 5) -> Figures:
    """Ticks per second of a diagram of delays, gains and sums."""
    run = Run(network(blocks))
    run.advance(1)  # compiles
    return in_turn("ticks/s", ticks, lambda: run.advance(ticks), pairs=runs)


def compiling(blocks: int, single: bool) -> Figures:
    """Seconds from a diagram to its first tick; if `single`, also with every block compiled separately."""

    def first_tick(stacked: bool) -> None:
        Run(oscillators(blocks // 5, TICK / 2), stacked=stacked).advance(1)  # not the program of other rows

    works = []
    for stacked in (True, False) if single else (True,):
        jax.clear_caches()
        works.append(timed(lambda stacked=stacked: first_tick(stacked)))
    also = "other: every block by itself" if single else ""
    return figures("s", [(works[0], works[1] if single else None)], also)


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


def learning(name: str, seeds: int, ticks: int, runs: int = 5) -> Figures:
    """Learning ticks per second in total of a diagram of the gallery, with all seeds in one call."""
    run = Run(remove_sinks(example(name)), seeds)
    run.advance(ticks)  # compiles
    return in_turn("ticks/s", ticks * seeds, lambda: run.advance(ticks), pairs=runs)


def beside_training(name: str, seeds: int, ticks: int, pairs: int = 5) -> Figures:
    """The same diagram against `motorgrad.train`'s loop on the task of that name, which is compiled in one piece."""
    run = Run(remove_sinks(example(name)), seeds)
    task = make(name)
    whole = stepper_for(task, agent_for(task), range(seeds))
    run.advance(ticks)
    whole.advance(ticks)
    works = (lambda: run.advance(ticks), lambda: whole.advance(ticks))
    return in_turn("ticks/s", ticks * seeds, *works, pairs=pairs)


def remove_sinks(diagram: Diagram) -> Diagram:
    """Remove all sinks from a diagram, so that nothing is recorded."""
    for name in [name for name, node in diagram.nodes.items() if isinstance(node.block, Sink)]:
        diagram.remove(name)
    return diagram
