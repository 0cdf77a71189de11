"""Figures of Hill-type muscles: their curves, and the experiments beside a fine reference integration."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root_scalar

from motorgrad.bodies import (
    Hill,
)

BELLS = (
    (0.8150671134243542, 1.055033428970575, 0.162384573599574, 0.063303448465465),
    (0.433004984392647, 0.716775413397760, -0.029947116970696, 0.200356847296188),
    (0.1, 1.0, 0.353553390593274, 0.0),
)
"""As OpenSim has them."""


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
    active = sum(b1 * math.exp(-0.5 * ((fiber - b2) / (b3 + b4 * fiber)) ** 2) for b1, b2, b3, b4 in BELLS)
    offset = math.exp(4 * (0.2 - 1) / 0.6)
    passive = (math.exp(4 * (fiber - 1) / 0.6) - offset) / (math.exp(4) - offset)
    tendon = (length - hill.optimal_fiber_length * fiber * cosine) / hill.tendon_slack_length
    pull = max(0.2 * math.exp(math.log(6) / hill.tendon_strain * (tendon - 1)) - 0.2, 0)

    def excess(speed: float) -> float:
        factor = -0.3211346127989808 * math.asinh(-8.149 * speed - 0.374) + 0.8825327733249912
        return cosine * (activation * active * factor + passive + hill.fiber_damping * speed) - pull

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
