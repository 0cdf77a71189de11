"""Figures of Hill-type muscles: their curves, and the experiments beside a fine reference integration."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp
from scipy.optimize import root_scalar

from motorgrad.bodies import CURVES, Hill, contract
from tools.figures._muscle_curves import PUBLISHED
from tools.figures._style import BLUE, FAINT, GREEN, RED, panels


def rates(state: Any, hill: Hill, length: float, velocity: float, excitation: float) -> tuple[float, float, float]:
    """The rates of activation and of the fiber's length, and the force, all written out anew from the papers.

    The fiber's velocity solves the balance of fiber and tendon, by Brent's method.
    """
    activation, fiber = state
    ease = 0.5 + 1.5 * activation
    up = excitation > activation
    pace = 1 / (hill.activation_time_constant * ease) if up else ease / hill.deactivation_time_constant
    height = math.sin(hill.pennation_angle)
    cosine = math.sqrt(1 - (height / fiber) ** 2)
    curves = PUBLISHED[hill.curves]
    active = curves.active(fiber)
    passive = curves.passive(fiber)
    tendon = (length - hill.optimal_fiber_length * fiber * cosine) / hill.tendon_slack_length
    pull = max(curves.tendon(tendon, hill.tendon_strain), 0)

    def excess(speed: float) -> float:
        return cosine * (activation * active * curves.velocity(speed) + passive + hill.fiber_damping * speed) - pull

    speed = _root(excess, -1e3, 1e3)
    return pace * (excitation - activation), hill.max_contraction_velocity * speed, hill.max_isometric_force * pull


def _root(function: Callable[[float], float], low: float, high: float) -> float:
    return float(root_scalar(function, bracket=(low, high), method="brentq", xtol=1e-13, rtol=1e-13).root)


def reference(
    hill: Hill,
    length: float,
    seconds: np.ndarray,
    excitation: float = 1.0,
    activation: float = 0.0,
    release: float = math.inf,
    load: float = 0.0,
    mass: float = 1.0,
) -> np.ndarray:
    """Length of the path and force at some times, `(2, times)`: what `contract` simulates, integrated to 1e-9."""

    def still(fiber: float) -> float:
        return rates((activation, fiber), hill, length, 0.0, excitation)[1]

    height = math.sin(hill.pennation_angle)
    # between a tendon that is slack and one stretched to twice the strain of the greatest force
    tendons = (hill.tendon_slack_length * (1 + 2 * hill.tendon_strain), hill.tendon_slack_length)
    least, most = (math.hypot((length - each) / hill.optimal_fiber_length, height) for each in tendons)
    fiber = _root(still, least, most)
    settings: Any = {"method": "LSODA", "rtol": 1e-9, "atol": 1e-11, "dense_output": True}

    def held(_: float, state: Any) -> Any:
        return rates(state, hill, length, 0.0, excitation)[:2]

    def free(_: float, state: Any) -> Any:
        *muscle, force = rates(state[:2], hill, state[2], state[3], excitation)
        return [*muscle, state[3], (load - force) / mass]

    end = min(release, seconds[-1])
    first = solve_ivp(held, (0.0, max(end, 1e-9)), (activation, fiber), **settings)
    found = []
    if release < seconds[-1]:
        second = solve_ivp(free, (release, seconds[-1]), (*first.y[:, -1], length, 0.0), **settings)
    for time in seconds:
        state = (*first.sol(time), length, 0.0) if time <= release else second.sol(time)  # type: ignore[possibly-undefined]
        found.append((state[2], rates(state[:2], hill, state[2], state[3], excitation)[2]))
    return np.array(found).T


SOLEUS = Hill(1000.0, optimal_fiber_length=0.1, tendon_slack_length=0.2, pennation_angle=0.3)
HELD = 0.2 * 1.01 + 0.1 * math.cos(0.3)  # m, of the path
RELEASE = {"activation": 1.0, "release": 0.02, "load": 500.0, "mass": 20.0}
STEP = 0.001  # s


def curves() -> Figure:
    """The curves of a Hill-type muscle: both sets, a row each."""
    figure, axes = panels(3, height=4.6, rows=2, sharex="col", sharey="col")
    length = np.linspace(0.2, 1.9, 300)
    velocity = np.linspace(-1.2, 1.2, 300)
    stretch = np.linspace(0.98, 1.06, 300)
    for row, (words, curves) in enumerate(zip(("De Groote et al.", "Millard et al."), CURVES.values(), strict=True)):
        fiber, speed, tendon = axes[row]
        fiber.plot(length, curves.active_force_length(length), color=RED, label="active, $f_L$")
        fiber.plot(length, curves.passive_force_length(length), color=BLUE, label="passive, $f_P$")
        fiber.set(ylabel=f"{words}\nforce / $F_0$", ylim=(0, 1.6))
        speed.plot(velocity, curves.force_velocity(velocity), color=RED)
        speed.set(ylabel="factor")
        for strain, colour in ((0.033, FAINT), (0.049, GREEN), (0.1, BLUE)):
            pull = np.maximum(curves.tendon_force_length(stretch, strain), 0)
            tendon.plot(stretch, pull, color=colour, label=f"$e_T$ = {strain:g}")
        tendon.set(ylim=(0, 1.6))
        for each, at in ((fiber, (1.0, 1.0)), (speed, (0.0, 1.0)), (speed, (-1.0, 0.0))):
            each.plot(*at, "o", color="0.2", markersize=3)
    for each, title in zip(axes[0], ("fiber, $f_L$ and $f_P$", "fiber, $f_V$", "tendon, $f_T$"), strict=True):
        each.set(title=title)
    for each, words in zip(axes[1], ("length / optimal", "velocity / greatest", "length / slack"), strict=True):
        each.set(xlabel=words)
    axes[0, 0].legend(loc="upper left")
    axes[0, 2].legend()
    return figure


def experiments() -> Figure:
    """Isometric contraction and quick release, on both kinds of tendon, and the fine integration."""
    figure, axes = panels(2, height=4.4, rows=2, sharex="col")
    _experiment(axes[:, 0], 0.2, {})
    _experiment(axes[:, 1], 0.12, RELEASE)
    axes[0, 0].set(title="isometric contraction", ylabel="force (N)", ylim=(0, 1050))
    axes[0, 1].set(title="quick release", ylim=(0, 1050))
    axes[1, 0].set(ylabel="change of length (mm)")
    axes[0, 0].legend(loc="lower right")
    axes[1, 1].legend(loc="lower left")
    return figure


def _experiment(axes: np.ndarray, seconds: float, settings: Any) -> None:
    force, change = axes
    run = contract(SOLEUS, HELD, seconds, timestep=STEP, **settings)
    rigid = contract(replace(SOLEUS, tendon="rigid"), HELD, seconds, timestep=STEP, **settings)
    exact = reference(SOLEUS, HELD, run.seconds, **settings)
    time = 1e3 * run.seconds
    force.plot(time, exact[1], color=FAINT, linewidth=4, alpha=0.5, label="fine integration")
    force.plot(time, run.force, color=RED, label="compliant tendon")
    force.plot(time, rigid.force, color=BLUE, linestyle="--", label="rigid tendon")
    parts: tuple[tuple[str, np.ndarray, str], ...] = (
        ("path", run.length, "0.2"),
        ("fiber", run.fiber_length, RED),
        ("tendon", run.tendon_length, GREEN),
    )
    for name, length, colour in parts:
        change.plot(time, 1e3 * (length - length[0]), color=colour, label=name)
    change.set(xlabel="time (ms)")
    _error(force, float(np.abs(run.force - exact[1]).max()))


def _error(axes: Axes, error: float) -> None:
    words = f"greatest error at 1 ms: {error:.1f} N"
    axes.annotate(words, (0.98, 0.62), xycoords="axes fraction", ha="right", va="top", fontsize=8, color="0.3")
