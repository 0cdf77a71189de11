"""Linear systems against their closed forms, and the order of the integrator."""

import jax
import numpy as np
import pytest
from scipy import signal

from lab_examples import wire
from timlab import Constant, Diagram, Gain, Integrator, Interpreter, Outlet, Run, Sum, UnitDelay


@pytest.fixture
def _double():
    with jax.enable_x64(True):
        yield


def oscillator(tick: float, substeps: int = 1, stiffness: float = 4.0, damping: float = 0.3) -> Diagram:
    """A driven, damped oscillator of two integrators, seen at its place and speed."""
    diagram = Diagram(tick, substeps)
    diagram.add("force", Constant(1.0))
    diagram.add("sum", Sum("+--"))
    diagram.add("speed", Integrator(0.5))
    diagram.add("place", Integrator(-1.0))
    diagram.add("spring", Gain(stiffness))
    diagram.add("damper", Gain(damping))
    diagram.add("y", Outlet())
    diagram.add("v", Outlet())
    return wire(
        diagram,
        *("force sum.u1", "spring sum.u2", "damper sum.u3", "sum speed", "speed place", "place spring"),
        *("speed damper", "place y", "speed v"),
    )


def exact(times: np.ndarray, stiffness: float = 4.0, damping: float = 0.3) -> np.ndarray:
    """The oscillator's place and speed by SciPy, whose input is constant."""
    matrix = np.array([[0.0, 1.0], [-stiffness, -damping]])
    system = signal.StateSpace(matrix, [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)))
    return signal.lsim(system, np.ones_like(times), times, [-1.0, 0.5])[1]


@pytest.mark.parametrize("engine", [Run, pytest.param(Interpreter, marks=pytest.mark.ci)])
@pytest.mark.usefixtures("_double")
def test_an_oscillator_moves_as_its_closed_form_says(engine):
    record = engine(oscillator(0.02, 2)).advance(30 if engine is Interpreter else 1000)
    expected = exact(record.times("y.u"))
    np.testing.assert_allclose(record["y.u"][0], expected[:, 0], atol=2e-8)
    np.testing.assert_allclose(record["v.u"][0], expected[:, 1], atol=4e-8)


@pytest.mark.ci  # with steps of another order the oscillator would not move as its closed form says
@pytest.mark.usefixtures("_double")
def test_the_error_falls_with_the_fourth_power_of_the_step():
    errors = []
    for halvings in range(4):
        ticks = 20 * 2**halvings
        record = Run(oscillator(4.0 / ticks)).advance(ticks + 1)
        errors.append(abs(record["y.u"][0, -1] - exact(np.linspace(0, 4, ticks + 1))[-1, 0]))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 4.0, atol=0.25)


@pytest.mark.ci  # the oscillator of a closed form takes two steps in a tick
@pytest.mark.usefixtures("_double")
def test_steps_within_a_tick_are_as_good_as_ticks():
    coarse = Run(oscillator(0.2, substeps=10)).advance(21)["y.u"][0, -1]
    fine = Run(oscillator(0.02)).advance(201)["y.u"][0, -1]
    assert coarse == pytest.approx(fine, abs=1e-12)


@pytest.mark.usefixtures("_double")
def test_a_source_that_does_not_move_is_held_over_the_step():
    # x' = u with u a held ramp of n at tick n: the sum of the ramp, not its integral
    diagram = Diagram(tick=0.1)
    diagram.add("one", Constant(1.0))
    diagram.add("sum", Sum())
    diagram.add("count", UnitDelay())
    diagram.add("level", Integrator())
    diagram.add("y", Outlet())
    wire(diagram, "one sum.u1", "count sum.u2", "sum count", "count level", "level y")
    record = Run(diagram).advance(11)
    np.testing.assert_allclose(record["y.u"][0], 0.1 * np.cumsum([0, *range(10)]), atol=1e-12)


@pytest.mark.usefixtures("_double")
def test_a_discrete_filter_is_scipys():
    # y = 0.7 y₁ − 0.2 y₂ + u, of delays and gains, at every third tick
    diagram = Diagram()
    rate = {"every": 3}
    diagram.add("one", Constant(1.0))
    diagram.add("sum", Sum("+++"))
    diagram.add("first", UnitDelay(**rate))
    diagram.add("second", UnitDelay(**rate))
    diagram.add("a", Gain(0.7))
    diagram.add("b", Gain(-0.2))
    diagram.add("y", Outlet(every=3))
    wire(diagram, "one sum.u1", "a sum.u2", "b sum.u3", "sum first", "first second", "first a", "second b", "sum y")
    record = Run(diagram).advance(90)
    expected = signal.lfilter([1.0], [1.0, -0.7, 0.2], np.ones(30))
    np.testing.assert_allclose(record["y.u"][0], expected, atol=1e-12)
    np.testing.assert_allclose(record.times("y.u"), 0.03 * np.arange(30))
