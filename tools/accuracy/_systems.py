"""Twelve systems with known answers, as diagrams."""

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import timlab

Reference = Callable[[np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True)
class System:
    """A system, the diagram of it, and what is exact.

    - `build`: the diagram of some settings; its outlet `out` is compared.
    - `exact`: the values at some times; for `measure`, unused.
    - `tick`, `ticks`: of a run.
    - `stiff`: whether explicit methods are useless for it.
    - `equations`: of plain differential equations, a formula and the initial value by state.
    - `scale`: the error is relative to it.
    """

    name: str
    build: Callable[..., timlab.Diagram]
    exact: Reference
    tick: float
    ticks: int
    stiff: bool = False
    equations: Mapping[str, tuple[str, float]] = dataclasses.field(default_factory=dict)
    scale: float = 1.0
    by: str = "closed form"

    def times(self) -> np.ndarray:
        """The times of a run's samples."""
        return np.arange(self.ticks) * self.tick

    def error(self, times: np.ndarray, values: np.ndarray) -> float:
        """The largest error of a run, relative to the system's scale; infinite for values that are not finite."""
        error = np.abs(values - self.exact(times)).max() / self.scale
        return float(error) if np.isfinite(error) else math.inf


def wire(diagram: timlab.Diagram, *wires: str) -> timlab.Diagram:
    """Connect, each wire given as `"source target"`."""
    for each in wires:
        diagram.connect(*each.split(" "))
    return diagram


def from_equations(equations: Mapping[str, tuple[str, float]], tick: float, **settings: Any) -> timlab.Diagram:
    """The diagram of differential equations: an integrator and a formula for each state. The first is recorded."""
    diagram = timlab.Diagram(tick, **settings)
    names = tuple(equations)
    for name, (formula, initial) in equations.items():
        diagram.add(name, timlab.Integrator(initial))
        diagram.add(f"slope of {name}", timlab.Expression(formula, names))
    for name in names:
        for other in names:
            diagram.connect(other, f"slope of {name}.{other}")
        diagram.connect(f"slope of {name}", name)
    diagram.add("out", timlab.Outlet())
    diagram.connect(names[0], "out")
    return diagram


def python_of(formula: str, names: tuple[str, ...]) -> Callable[..., float]:
    """A formula as a function of Python's floats."""
    known = {"sin": math.sin, "cos": math.cos, "min": min, "max": max}
    return eval(f"lambda {', '.join(names)}: {formula.replace('^', '**')}", known)


def by_scipy(equations: Mapping[str, tuple[str, float]], end: float, method: str) -> Reference:
    """The first state by scipy, to 1e-12."""

    @functools.cache
    def found() -> Any:
        names = tuple(equations)
        slopes = [python_of(formula, names) for formula, _ in equations.values()]
        start = [initial for _, initial in equations.values()]
        slope = lambda t, x: [each(*x) for each in slopes]  # noqa: E731
        return solve_ivp(slope, (0, end), start, method, dense_output=True, rtol=1e-12, atol=1e-13).sol

    return lambda times: found()(times)[0]


def equations_system(
    name: str,
    equations: Mapping[str, tuple[str, float]],
    tick: float,
    ticks: int,
    stiff: bool = False,
    scale: float = 1.0,
) -> System:
    """The system of some equations; its reference is scipy's."""
    build = functools.partial(from_equations, equations, tick)
    method = "Radau" if stiff else "DOP853"
    exact = by_scipy(equations, tick * ticks * 1.001, method)
    return System(name, build, exact, tick, ticks, stiff, equations, scale, f"scipy, {method}")


LORENZ = {"x": ("10*(y - x)", 1.0), "y": ("x*(28 - z) - y", 1.0), "z": ("x*y - 8/3*z", 1.0)}
VAN_DER_POL = {"x": ("v", 2.0), "v": ("1000*(1 - x^2)*v - x", 0.0)}
ROBERTSON = {
    "x": ("-0.04*x + 1e4*y*z", 1.0),
    "y": ("0.04*x - 1e4*y*z - 3e7*y^2", 0.0),
    "z": ("3e7*y^2", 0.0),
}
MOTOR = {  # a PI controller whose output is limited to ±1, with back-calculation: w is the speed, i the current
    "w": ("2*i - 0.1*w", 0.0),
    "i": ("(max(-1, min(1, 2*(1 - w) + s)) - i - 0.5*w)/0.05", 0.0),
    "s": ("4*(1 - w) + 10*(max(-1, min(1, 2*(1 - w) + s)) - 2*(1 - w) - s)", 0.0),
}
PENDULUM = {  # two masses of 1 kg on rods of 1 m; p and q are their angular velocities
    "a": ("p", 1.2),
    "b": ("q", -0.5),
    "p": (
        "(-9.81*(3*sin(a) + sin(a - 2*b)) - 2*sin(a - b)*(q^2 + p^2*cos(a - b)))/(3 - cos(2*a - 2*b))",
        0.0,
    ),
    "q": ("2*sin(a - b)*(2*p^2 + 19.62*cos(a) + q^2*cos(a - b))/(3 - cos(2*a - 2*b))", 0.0),
}


ENERGY = "p^2 + 0.5*q^2 + p*q*cos(a - b) - 9.81*(2*cos(a) + cos(b))"
START = -9.81 * (2 * math.cos(1.2) + math.cos(-0.5))


def pendulum(tick: float = 0.05, **settings: Any) -> timlab.Diagram:
    """The double pendulum; its output is the change of its energy, in joules."""
    diagram = from_equations(PENDULUM, tick, **settings)
    names = ("a", "b", "p", "q")
    diagram.add("energy", timlab.Expression(f"{ENERGY} - start", names, ("start",), START))
    diagram.disconnect("out")
    return wire(diagram, *(f"{name} energy.{name}" for name in names), "energy out")


def ball(tick: float = 0.1, **settings: Any) -> timlab.Diagram:
    """A ball that bounces with four fifths of its speed."""
    diagram = timlab.Diagram(tick, **settings)
    blocks = {
        **{"gravity": timlab.Constant(-9.81), "speed": timlab.Integrator(0.0, reset="rising", external=True)},
        **{
            "height": timlab.Integrator(1.0),
            "down": timlab.Compare("<="),
            "back": timlab.Gain(-0.8),
            "out": timlab.Outlet(),
        },
    }
    for name, block in blocks.items():
        diagram.add(name, block)
    bounce = ("height down.u1", "down speed.reset", "speed back", "back speed.initial")
    return wire(diagram, "gravity speed.u", "speed height", *bounce, "height out")


def ball_exact(times: np.ndarray) -> np.ndarray:
    """The height of the ball."""

    def height(time: float) -> float:
        speed = -0.8 * -9.81 * math.sqrt(2 / 9.81)
        left = time - math.sqrt(2 / 9.81)
        if left < 0:
            return 1 - 9.81 / 2 * time**2
        while left > 2 * speed / 9.81:
            left = left - 2 * speed / 9.81
            speed = 0.8 * speed
        return speed * left - 9.81 / 2 * left**2

    return np.array([height(time) for time in times])


def relay(tick: float = 0.1, **settings: Any) -> timlab.Diagram:
    """A lag of 1 s, driven by a relay to +2 or −2, which switches at ±0.5."""
    diagram = timlab.Diagram(tick, **settings)
    for name, block in {
        "relay": timlab.Relay(-0.5, 0.5, off=2.0, on=-2.0),
        "level": timlab.Lag(1.0),
        "out": timlab.Outlet(),
    }.items():
        diagram.add(name, block)
    return wire(diagram, "level relay", "relay level", "level out")


def relay_exact(times: np.ndarray) -> np.ndarray:
    """The level of `relay`."""
    first = math.log(2 / 1.5)
    later = math.log(2.5 / 1.5)

    def level(time: float) -> float:
        if time < first:
            return 2 - 2 * math.exp(-time)
        half, left = divmod(time - first, later)
        return (2.5 * math.exp(-left) - 2) * (1 - 2 * (half % 2))

    return np.array([level(time) for time in times])


STATIC = 1.0
KINETIC = 0.6
STIFFNESS = 10.0
PULL = 0.1


def stick_slip(tick: float = 0.1, **settings: Any) -> timlab.Diagram:
    """A mass of 1 kg on a floor, pulled by a spring whose other end moves at 0.1 m/s; its output is its place."""
    diagram = timlab.Diagram(tick, **settings)
    blocks = {
        **{"pull": timlab.Ramp(PULL), "stretch": timlab.Sum("+-"), "spring": timlab.Gain(STIFFNESS)},
        **{"mass": timlab.DryFriction(1.0, STATIC, KINETIC), "place": timlab.Integrator(), "out": timlab.Outlet()},
    }
    for name, block in blocks.items():
        diagram.add(name, block)
    loop = ("pull stretch.u1", "place stretch.u2", "stretch spring", "spring mass", "mass.y place", "place out")
    return wire(diagram, *loop)


def stick_slip_exact(times: np.ndarray) -> np.ndarray:
    """The place of the mass: while it slips, the stretch of the spring is a sine."""
    rate = math.sqrt(STIFFNESS)
    sine = PULL / rate
    cosine = (STATIC - KINETIC) / STIFFNESS
    lasts = (2 * math.pi - 2 * math.atan2(cosine, sine)) / rate

    def place(time: float) -> float:
        begin = 0.0
        stretch = 0.0
        at = 0.0
        while True:
            slips = begin + (STATIC / STIFFNESS - stretch) / PULL
            if time < slips:
                return at
            stretched = lambda s: (  # noqa: E731
                KINETIC / STIFFNESS + cosine * math.cos(rate * s) + sine * math.sin(rate * s)
            )
            if time < slips + lasts:
                return PULL * time - stretched(time - slips)
            begin = slips + lasts
            stretch = stretched(lasts)
            at = PULL * begin - stretch

    return np.array([place(time) for time in times])


def sampled(tick: float = 0.1, **settings: Any) -> timlab.Diagram:
    """A lag of 1 s under a proportional controller that samples every 0.1 s."""
    diagram = timlab.Diagram(tick, **settings)
    blocks = {
        **{"wanted": timlab.Constant(1.0), "error": timlab.Sum("+-"), "gain": timlab.Gain(5.0, period=0.1)},
        **{"level": timlab.Lag(1.0), "out": timlab.Outlet()},
    }
    for name, block in blocks.items():
        diagram.add(name, block)
    return wire(diagram, "wanted error.u1", "level error.u2", "error gain", "gain level", "level out")


def sampled_exact(times: np.ndarray) -> np.ndarray:
    """The level of `sampled`."""
    ticks = np.floor(np.round(times / 0.1, 9))
    factor = math.exp(-0.1) - 5 * (1 - math.exp(-0.1))
    aim = 5 / 6
    start = aim * (1 - factor**ticks)
    held = 5 * (1 - start)
    decay = np.exp(-(times - ticks * 0.1))
    return held + (start - held) * decay


def spiking(tick: float = 0.1, **settings: Any) -> timlab.Diagram:
    """A leaky integrate-and-fire neuron: at a potential of 1 it fires, and begins at 0 again."""
    diagram = timlab.Diagram(tick, **settings)
    blocks = {
        **{"current": timlab.Constant(1.5), "net": timlab.Sum("+-"), "potential": timlab.Integrator(reset="rising")},
        **{"fires": timlab.Compare(">=", 1.0), "out": timlab.Outlet()},
    }
    for name, block in blocks.items():
        diagram.add(name, block)
    loop = ("current net.u1", "potential net.u2", "net potential.u", "potential fires.u1", "fires potential.reset")
    return wire(diagram, *loop, "potential out")


def spiking_exact(times: np.ndarray) -> np.ndarray:
    """The potential of `spiking`."""
    return 1.5 * (1 - np.exp(-(times % math.log(3.0))))


def delayed(tick: float = 0.02, **settings: Any) -> timlab.Diagram:
    """The rate of change is what the signal was a second ago, negated; it was 1 before the start."""
    diagram = timlab.Diagram(tick, **settings)
    blocks = {
        **{"level": timlab.Integrator(1.0), "past": timlab.Delay(1.0, length=round(1 / tick), between="cubic")},
        **{"back": timlab.Gain(-1.0), "out": timlab.Outlet()},
    }
    for name, block in blocks.items():
        diagram.add(name, block)
    return wire(diagram, "level past", "past back", "back level", "level out")


def delayed_exact(times: np.ndarray) -> np.ndarray:
    """The level of `delayed`, by the method of steps."""

    def level(time: float) -> float:
        return sum((-1) ** k * (time - (k - 1)) ** k / math.factorial(k) for k in range(int(time) + 2))

    return np.array([level(time) for time in times])


def noisy(tick: float = 0.1, **settings: Any) -> timlab.Diagram:
    """White noise through a lag of 1 s."""
    diagram = timlab.Diagram(tick, **settings)
    blocks = {
        "noise": timlab.NormalNoise(deviation=1.0, per="root second"),
        "level": timlab.Lag(1.0),
        "out": timlab.Outlet(),
    }
    for name, block in blocks.items():
        diagram.add(name, block)
    return wire(diagram, "noise level", "level out")


def spectrum_exact(frequencies: np.ndarray, tick: float = 0.1) -> np.ndarray:
    """The power of `noisy` per hertz, on both sides of 0, for noise that is held for a tick and samples at ticks."""
    decay = math.exp(-tick)
    return (1 - decay) ** 2 / np.abs(np.exp(2j * np.pi * frequencies * tick) - decay) ** 2


SYSTEMS = (
    equations_system("Lorenz", LORENZ, 0.05, 101, scale=20.0),
    equations_system("Van der Pol, µ = 1,000", VAN_DER_POL, 10.0, 151, stiff=True, scale=2.0),
    equations_system("Robertson", ROBERTSON, 10.0, 101, stiff=True),
    System("bouncing ball", ball, ball_exact, 0.1, 38),
    equations_system("DC motor with anti-wind-up", MOTOR, 0.05, 81),
    System("sampled controller", sampled, sampled_exact, 0.1, 51),
    System("relay", relay, relay_exact, 0.1, 51),
    System("stick–slip", stick_slip, stick_slip_exact, 0.1, 201),
    System(
        "double pendulum, energy", pendulum, lambda t: np.zeros(len(t)), 0.05, 101, False, PENDULUM, 10.0, "conserved"
    ),
    System("transport delay", delayed, delayed_exact, 0.02, 251),
    System("integrate and fire", spiking, spiking_exact, 0.1, 101),
)
"""The twelfth, noise, is compared by its spectrum."""
