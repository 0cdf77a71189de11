"""The systems in PathSim."""

# pyright: reportMissingImports=false, reportArgumentType=false, reportAttributeAccessIssue=false, reportOptionalMemberAccess=false
# (PathSim is in the extra peers, and its types do not fit its own examples)

import math
import time
from typing import Any

import numpy as np
from pathsim import Connection, Simulation
from pathsim.blocks import (
    Adder,
    Amplifier,
    Constant,
    Delay,
    Function,
    Integrator,
    Relay,
    SampleHold,
    Scope,
    Source,
    WhiteNoise,
)
from pathsim.events import ZeroCrossing, ZeroCrossingDown, ZeroCrossingUp
from pathsim.solvers import GEAR52A, RK4, RKDP87

from tools.accuracy._systems import ENERGY, KINETIC, PULL, START, STATIC, STIFFNESS, System, python_of

SOLVERS = {"RK4": RK4, "RKDP87": RKDP87, "GEAR52A": GEAR52A}
Parts = tuple[list[Any], list[Any], list[Any], Any]
"""Blocks, connections, events and the scope."""


def from_equations(system: System, tick: float, seen: Function | None = None) -> Parts:
    """Differential equations: an integrator and a function for each state. The scope sees the first state, or what
    function of all of them is `seen`."""
    names = tuple(system.equations)
    scope = Scope(sampling_period=tick)
    states = [Integrator(initial) for _, initial in system.equations.values()]
    slopes = [Function(python_of(formula, names)) for formula, _ in system.equations.values()]
    wires = [
        Connection(state, *(slope[n] for slope in slopes), *([scope] * (n == 0) if seen is None else [seen[n]]))
        for n, state in enumerate(states)
    ]
    wires += [Connection(slope, state) for slope, state in zip(slopes, states, strict=True)]
    return [*states, *slopes, scope], wires, [], scope


def pendulum(system: System, tick: float) -> Parts:
    """The double pendulum, of which the energy is recorded."""
    energy = Function(python_of(f"{ENERGY} - ({START})", tuple(system.equations)))
    blocks, wires, events, scope = from_equations(system, tick, energy)
    return [*blocks, energy], [*wires, Connection(energy, scope)], events, scope


def ball(system: System, tick: float) -> Parts:
    """The bouncing ball."""
    gravity = Constant(-9.81)
    speed = Integrator(0.0)
    height = Integrator(1.0)
    scope = Scope(sampling_period=tick)

    def bounce(now: float) -> None:
        height.engine.set(np.abs(height.engine.get()))
        speed.engine.set(-0.8 * speed.engine.get())

    hit = ZeroCrossing(func_evt=lambda now: float(height.engine.get()[0]), func_act=bounce, tolerance=1e-10)
    wires = [Connection(gravity, speed), Connection(speed, height), Connection(height, scope)]
    return [gravity, speed, height, scope], wires, [hit], scope


def relay(system: System, tick: float) -> Parts:
    """The lag under a relay."""
    switch = Relay(0.5, -0.5, -2.0, 2.0)
    gain = Amplifier(-1.0)
    level = Integrator(0.0)
    total = Adder()
    scope = Scope(sampling_period=tick)
    wires = [Connection(switch, total[0]), Connection(gain, total[1]), Connection(total, level)]
    wires += [Connection(level, switch, gain, scope)]
    return [switch, gain, level, total, scope], wires, [], scope


def sampled(system: System, tick: float) -> Parts:
    """The controller that samples."""
    wanted = Constant(1.0)
    error = Adder("+-")
    gain = Amplifier(5.0)
    hold = SampleHold(0.1)
    net = Adder("+-")
    level = Integrator(0.0)
    scope = Scope(sampling_period=tick)
    wires = [Connection(wanted, error[0]), Connection(level, error[1], net[1], scope), Connection(error, gain)]
    wires += [Connection(gain, hold), Connection(hold, net[0]), Connection(net, level)]
    return [wanted, error, gain, hold, net, level, scope], wires, [], scope


def spiking(system: System, tick: float) -> Parts:
    """The neuron."""
    current = Constant(1.5)
    net = Adder("+-")
    level = Integrator(0.0)
    scope = Scope(sampling_period=tick)
    fires = ZeroCrossingUp(
        func_evt=lambda now: float(level.engine.get()[0]) - 1.0,
        func_act=lambda now: level.engine.set(np.zeros(1)),
        tolerance=1e-10,
    )
    wires = [Connection(current, net[0]), Connection(level, net[1], scope), Connection(net, level)]
    return [current, net, level, scope], wires, [fires], scope


def stick_slip(system: System, tick: float) -> Parts:
    """The mass on the floor: one event begins a slip, the other ends it."""
    pull = Source(lambda now: PULL * now)
    stretch = Adder("+-")
    spring = Amplifier(STIFFNESS)
    slips = [False]
    push = Function(lambda force: force - KINETIC if slips[0] else 0.0)
    speed = Integrator(0.0)
    place = Integrator(0.0)
    scope = Scope(sampling_period=tick)

    def slip(now: float) -> None:
        slips[0] = True
        begins.off()
        ends.on()

    def stick(now: float) -> None:
        slips[0] = False
        speed.engine.set(np.zeros(1))
        ends.off()
        begins.on()

    begins = ZeroCrossingUp(
        func_evt=lambda now: STIFFNESS * (PULL * now - float(place.engine.get()[0])) - STATIC,
        func_act=slip,
        tolerance=1e-10,
    )
    ends = ZeroCrossingDown(func_evt=lambda now: float(speed.engine.get()[0]), func_act=stick, tolerance=1e-10)
    ends.off()
    wires = [Connection(pull, stretch[0]), Connection(place, stretch[1], scope), Connection(stretch, spring)]
    wires += [Connection(spring, push), Connection(push, speed), Connection(speed, place)]
    return [pull, stretch, spring, push, speed, place, scope], wires, [begins, ends], scope


def delayed(system: System, tick: float) -> Parts:
    """The level less 1, because PathSim's `Delay` begins with 0."""
    level = Integrator(0.0)
    past = Delay(1.0)
    back = Function(lambda past: -1 - past)
    above = Function(lambda level: level + 1)
    scope = Scope(sampling_period=tick)
    wires = [Connection(level, past, above), Connection(past, back), Connection(back, level), Connection(above, scope)]
    return [level, past, back, above, scope], wires, [], scope


def noise(ticks: int, tick: float, seed: int) -> tuple[np.ndarray, float]:
    """A run of white noise through a lag of 1 s by RK4 steps of a tenth of a tick, and its processor seconds."""
    source = WhiteNoise(spectral_density=1.0, sampling_period=tick, seed=seed)
    net = Adder("+-")
    level = Integrator(0.0)
    scope = Scope(sampling_period=tick)
    wires = [Connection(source, net[0]), Connection(level, net[1], scope), Connection(net, level)]
    simulation = Simulation([source, net, level, scope], wires, dt=tick / 10, Solver=RK4, log=False)
    begin = time.process_time()
    simulation.run((ticks - 1) * tick, adaptive=False)
    took = time.process_time() - begin
    return np.asarray(scope.read()[1])[0], took


BUILDERS = {
    "double pendulum, energy": pendulum,
    "stick–slip": stick_slip,
    "transport delay": delayed,
    "bouncing ball": ball,
    "relay": relay,
    "sampled controller": sampled,
    "integrate and fire": spiking,
}


def measured(system: System, solver: str, tolerance: float | None) -> dict[str, Any]:
    """The error and the processor seconds of one run."""
    blocks, wires, events, scope = BUILDERS.get(system.name, from_equations)(system, system.tick)
    settings = {} if tolerance is None else {"tolerance_lte_rel": tolerance, "tolerance_lte_abs": tolerance * 1e-3}
    step = system.tick / 10 if tolerance is None else min(system.tick / 10, 1e-3)
    simulation = Simulation(blocks, wires, events=events, dt=step, Solver=SOLVERS[solver], log=False, **settings)
    begin = time.process_time()
    try:
        simulation.run(system.tick * (system.ticks - 1), adaptive=tolerance is not None)
        took = time.process_time() - begin
        times, values = scope.read()
        error = system.error(np.asarray(times), np.asarray(values)[0])
    except (FloatingPointError, OverflowError, ValueError, RuntimeError):
        took = time.process_time() - begin
        error = math.inf
    return {"solver": solver, "tolerance": tolerance, "error": error, "seconds": took}
