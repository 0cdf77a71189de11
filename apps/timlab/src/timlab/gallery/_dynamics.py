"""Diagrams that do not learn: a controller, an attractor, a ball, a pendulum, spiking neurons."""

import numpy as np

from timlab.blocks import (
    PID,
    Compare,
    Constant,
    DiscreteLag,
    Expression,
    Gain,
    Integrator,
    Join,
    Lag,
    MatrixGain,
    Portrait,
    Pulse,
    Raster,
    Saturation,
    Scope,
    Select,
    Sum,
    UnitDelay,
)
from timlab.diagram import Diagram
from timlab.gallery._wiring import connect

ACTUATOR_LIMIT = 1.6
PID_GAINS = {"proportional_gain": 4.0, "integral_gain": 2.0, "derivative_gain": 1.0, "filter": 0.1}


def anti_windup() -> Diagram:
    """A PID controller with a limited actuator, with and without anti-windup."""
    diagram = Diagram(
        tick=0.01,
        title="PID with anti-windup",
        comment="Two equal processes of second order follow a rectangular wave. Their actuators reach only "
        f"{ACTUATOR_LIMIT:g}, little more than a step needs. 'PID tracked' knows the limit: while its output is "
        "clipped, its integral is led back (anti-windup, with the time constant 'tracking'). 'PID wound up' does not "
        "know it: its integral winds up, and the process overshoots until it has unwound. Move 'tracking' to 100 s: "
        "both are the same then. Or move the limits, or the gains.",
    )
    diagram.add("wanted", Pulse(frequency=0.05, high=1.0))
    for name, knows in (("tracked", True), ("wound up", False)):
        limits = {"low": -ACTUATOR_LIMIT, "high": ACTUATOR_LIMIT, "tracking": 0.5, "limited": True} if knows else {}
        diagram.add(f"error {name}", Sum("+-"))
        diagram.add(f"PID {name}", PID(**PID_GAINS, **limits))
        diagram.add(f"actuator {name}", Saturation(-ACTUATOR_LIMIT, ACTUATOR_LIMIT))
        diagram.add(f"valve {name}", Lag(1.0))
        diagram.add(f"process {name}", Lag(2.0))
        connect(
            diagram,
            ("wanted", f"error {name}.u1"),
            (f"process {name}", f"error {name}.u2"),
            (f"error {name}", f"PID {name}"),
            (f"PID {name}", f"actuator {name}"),
            (f"actuator {name}", f"valve {name}"),
            (f"valve {name}", f"process {name}"),
        )
    diagram.add("response", Scope(("wanted", "tracked", "wound_up"), window=40.0))
    diagram.add("command", Scope(("tracked", "wound_up"), window=40.0))
    connect(
        diagram,
        ("wanted", "response.wanted"),
        ("process tracked", "response.tracked"),
        ("process wound up", "response.wound_up"),
        ("PID tracked", "command.tracked"),
        ("PID wound up", "command.wound_up"),
    )
    return diagram


def lorenz() -> Diagram:
    """The Lorenz attractor, from two nearly equal starts."""
    two = (2,)
    diagram = Diagram(
        tick=0.01,
        title="Lorenz attractor",
        comment="Lorenz's three equations (1963) of a fluid heated from below, from two starts that differ by a "
        "thousandth. At first the two move as one; after some ten seconds nothing of that is left: the system is "
        "chaotic. The portrait is its butterfly. Change 'rho' in 'dy' during a run: below 24.06 both come to rest at "
        "one of two points, below 1 at 0.",
    )
    diagram.add("x", Integrator((1.0, 1.001), two))
    diagram.add("y", Integrator(1.0, two))
    diagram.add("z", Integrator(20.0, two))
    diagram.add("dx", Expression("sigma * (y - x)", ("x", "y"), ("sigma",), 10.0, two))
    diagram.add("dy", Expression("x * (rho - z) - y", ("x", "y", "z"), ("rho",), 28.0, two))
    diagram.add("dz", Expression("x * y - beta * z", ("x", "y", "z"), ("beta",), 8 / 3, two))
    diagram.add("butterfly", Portrait(two, across=(-22.0, 22.0), up=(0.0, 50.0)))
    diagram.add("over time", Scope(("x",), two, window=40.0))
    for rate, reads in (("dx", "xy"), ("dy", "xyz"), ("dz", "xyz")):
        connect(diagram, *((state, f"{rate}.{state}") for state in reads), (rate, rate[1]))
    connect(diagram, ("x", "butterfly.x"), ("z", "butterfly.y"), ("x", "over time.x"))
    return diagram


def bouncing_ball() -> Diagram:
    """A ball that bounces at instants which the solver locates."""
    diagram = Diagram(
        tick=0.01,
        solver="tsit5",
        title="Bouncing ball",
        comment="A ball falls on a plate and rises again with four fifths of its speed ('bounce'), but never with less "
        "than the plate gives it ('least'). The solver locates every hit, between two ticks, and resets the speed "
        "there; with solver = rk4 hits happen at ticks, and heights are a matter of luck. With 'least' at 0 the ball "
        "hits ever faster, infinitely often in a finite time, and then falls through the plate.",
    )
    diagram.add("gravity", Constant(-GRAVITY))
    diagram.add("speed", Integrator(reset="rising", external=True))
    diagram.add("height", Integrator(2.0))
    diagram.add("hit", Compare("<="))
    diagram.add("plate", Expression("max(-bounce * speed, least)", ("speed",), ("bounce", "least"), (0.8, 2.0)))
    diagram.add("flight", Scope(("height",), window=10.0, unit="m"))
    diagram.add("height and speed", Portrait(across=(-0.2, 2.2), up=(-7.0, 7.0)))
    connect(
        diagram,
        ("gravity", "speed.u"),
        ("speed", "height"),
        ("height", "hit.u1"),
        ("hit", "speed.reset"),
        ("speed", "plate.speed"),
        ("plate", "speed.initial"),
        ("height", "flight.height"),
        ("height", "height and speed.x"),
        ("speed", "height and speed.y"),
    )
    return diagram


# kg, kg, m, m/s²
CART = 1.0
BOB = 0.2
ROD = 0.5
GRAVITY = 9.81


def pendulum() -> Diagram:
    """An inverted pendulum on a cart, balanced by state feedback."""
    gains = _balancing_gains()
    diagram = Diagram(
        tick=0.01,
        title="Pendulum on a cart",
        comment=f"A bob of {BOB:g} kg on a massless rod of {ROD:g} m stands upright on a cart of {CART:g} kg, which a "
        "force moves along a rail. The force is a weighted sum of position, speed, angle and angular velocity; the "
        "weights are those of the linear–quadratic regulator for the upright position. Every five seconds the cart is "
        "pushed. Make the pushes stronger ('high' of 'push'): beyond some 50 N the pendulum falls, as the equations "
        "are not linear. Or set 'strength' to 0 and let it swing.",
    )
    diagram.add("push", Pulse(frequency=0.2, duty=0.04, delay=1.0, high=4.0))
    # angle 0 is upright; both follow from Lagrange's equations, with the force f along the rail
    inner = f"{BOB} * sin(angle) * ({ROD} * rate^2 - {GRAVITY} * cos(angle))"
    diagram.add(
        "acceleration",
        Expression(f"(force + {inner}) / ({CART} + {BOB} * sin(angle)^2)", ("force", "angle", "rate")),
    )
    diagram.add(
        "angular acceleration",
        Expression(f"({GRAVITY} * sin(angle) - cos(angle) * acceleration) / {ROD}", ("acceleration", "angle")),
    )
    for name, initial in (("speed", 0.0), ("position", 0.0), ("rate", 0.0), ("angle", 0.2)):
        diagram.add(name, Integrator(initial))
    diagram.add("state", Join((0, 0, 0, 0)))
    diagram.add("feedback", MatrixGain((tuple(-gains),)))
    diagram.add("command", Select(1))
    diagram.add("strength", Gain(1.0))
    diagram.add("force", Sum("++"))
    diagram.add("motion", Scope(("position", "angle"), window=15.0))
    diagram.add("forces", Scope(("force",), window=15.0, unit="N"))
    connect(
        diagram,
        ("acceleration", "speed"),
        ("speed", "position"),
        ("acceleration", "angular acceleration.acceleration"),
        ("angle", "acceleration.angle"),
        ("rate", "acceleration.rate"),
        ("angle", "angular acceleration.angle"),
        ("angular acceleration", "rate"),
        ("rate", "angle"),
        *((name, f"state.u{n}") for n, name in enumerate(("position", "speed", "angle", "rate"), 1)),
        ("state", "feedback"),
        ("feedback", "command"),
        ("command", "strength"),
        ("strength", "force.u1"),
        ("push", "force.u2"),
        ("force", "acceleration.force"),
        ("position", "motion.position"),
        ("angle", "motion.angle"),
        ("strength", "forces.force"),
    )
    return diagram


def _balancing_gains() -> np.ndarray:
    """The gains of the linear–quadratic regulator for the upright pendulum: of position, speed, angle and rate."""
    from scipy.linalg import solve_continuous_are  # for this diagram alone, and it takes a while to load

    a = np.array(
        [
            [0, 1, 0, 0],
            [0, 0, -BOB * GRAVITY / CART, 0],
            [0, 0, 0, 1],
            [0, 0, GRAVITY * (CART + BOB) / (CART * ROD), 0],
        ]
    )
    b = np.array([[0], [1 / CART], [0], [-1 / (CART * ROD)]])
    states = np.diag([1.0, 1.0, 10.0, 1.0])
    force = np.array([[0.1]])
    return np.linalg.solve(force, b.T @ solve_continuous_are(a, b, states, force))[0].round(3)


NEURONS = 30
INHIBITORY = 6
# s
MEMBRANE = 0.02
SYNAPSE = 0.005


def spiking() -> Diagram:
    """Leaky integrate-and-fire neurons with synapses, and their spikes."""
    step = 0.0005
    many = (NEURONS,)
    diagram = Diagram(
        tick=step,
        title="LIF neurons with synapses",
        comment=f"{NEURONS} leaky integrate-and-fire neurons. The potential of each goes to its drive with a time "
        f"constant of {1000 * MEMBRANE:g} ms; at the threshold of 1 it is set back to 0, and the neuron fires. A spike "
        f"adds to the current of other neurons, which falls with {1000 * SYNAPSE:g} ms: the last {INHIBITORY} neurons "
        "inhibit, the others excite, one in five pairs is connected. The raster has a row for each. Set 'coupling' "
        "to 0: every neuron fires regularly at a rate of its own, or never where its drive is below the threshold. At "
        "15 excitation feeds on itself, and they fire three times as often. Or change 'drive'.",
    )
    chance = np.random.default_rng(1)
    sign = np.where(np.arange(NEURONS) < NEURONS - INHIBITORY, 1.0, -4.0)
    weights = sign * chance.uniform(0.5, 1.5, (NEURONS, NEURONS)) * (chance.random((NEURONS, NEURONS)) < 0.2)
    np.fill_diagonal(weights, 0.0)
    drives = np.linspace(0.95, 1.25, NEURONS)[chance.permutation(NEURONS)]
    decay = float(np.exp(-step / MEMBRANE))
    diagram.add("bias", Constant(tuple(drives.round(3).tolist()), many))
    diagram.add("drive", Gain(1.0, many))
    diagram.add("input", Sum("++", many))
    diagram.add("potential", UnitDelay(tuple(chance.uniform(0.0, 1.0, NEURONS).round(3).tolist()), many))
    diagram.add("fires", Compare(relation=">=", margin=1.0, shape=many))
    membrane = "if(fires > 0, 0, input + decay * (v - input))"
    diagram.add("membrane", Expression(membrane, ("v", "input", "fires"), ("decay",), decay, many))
    diagram.add("synapses", MatrixGain(tuple(map(tuple, weights.round(3).tolist()))))
    diagram.add("current", DiscreteLag(SYNAPSE, shape=many))
    diagram.add("coupling", Gain(1.0, many))
    diagram.add("spikes", Raster(many, window=0.5))
    diagram.add("three", Select(NEURONS, (0, 1, 2)))
    diagram.add("potentials", Scope(("v",), (3,), window=0.2))
    connect(
        diagram,
        ("bias", "drive"),
        ("drive", "input.u1"),
        ("coupling", "input.u2"),
        ("potential", "fires.u1"),
        ("potential", "membrane.v"),
        ("input", "membrane.input"),
        ("fires", "membrane.fires"),
        ("membrane", "potential"),
        ("fires", "synapses"),
        ("synapses", "current"),
        ("current", "coupling"),
        ("fires", "spikes"),
        ("potential", "three"),
        ("three", "potentials"),
    )
    return diagram
