"""Dynamics against SciPy and closed forms."""

import dataclasses

import numpy as np
import pytest
import scipy.linalg
import scipy.signal
from block_driver import answer, drive, of

from timlab import Diagram, Outlet, Run

RNG = np.random.default_rng(7)
U = RNG.normal(size=200)
ONE = of("constant", 1.0)


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [
        pytest.param((2.0,), (0.5, 1.0), marks=pytest.mark.ci),
        pytest.param((1.0, 3.0), (1.0, 2.0, 5.0), marks=pytest.mark.ci),
        ((3.0, 0.0, 1.0), (2.0, 2.0, 8.0)),  # passes its input on at once
        ((4.0,), (1.0, 2.0, 5.0, 3.0, 1.0)),
    ],
)
def test_transfer_function_is_that_of_scipy(numerator, denominator):
    diagram = Diagram(0.01)
    for name, source in (("step", ONE), ("wave", of("sine", frequency=0.7))):
        diagram.add(name, source)
        diagram.add(f"{name} block", of("transfer function", numerator, denominator))
        diagram.add(f"{name} out", Outlet())
        diagram.connect(name, f"{name} block.u")
        diagram.connect(f"{name} block", f"{name} out")
    record = Run(diagram).advance(400)
    times = np.arange(400) * 0.01
    _, step = scipy.signal.step((numerator, denominator), T=times)
    np.testing.assert_allclose(record["step out.u"][0], step, atol=3e-5)
    wave = np.sin(2 * np.pi * 0.7 * times)
    _, expected, _ = scipy.signal.lsim((numerator, denominator), wave, times)
    # SciPy takes the wave as straight from tick to tick
    np.testing.assert_allclose(record["wave out.u"][0], expected, atol=3e-4)


def test_transfer_function_filters_every_element_by_itself():
    block = of("transfer function", (1.0, 1.0), (1.0, 2.0, 5.0), shape=(2, 2))
    source = of("constant", ((1.0, 2.0), (-1.0, 0.0)), shape=(2, 2))
    one = answer(of("transfer function", (1.0, 1.0), (1.0, 2.0, 5.0)), ONE, 100)
    np.testing.assert_allclose(answer(block, source, 100), one[:, None, None] * np.array([[1, 2], [-1, 0]]), atol=1e-6)


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [((1.0,), (2.0, -1.0)), ((1.0, 0.5), (1.0, -0.9, 0.4)), ((2.0, 1.0, 0.5), (2.0, 0.3, 0.1))],
)
def test_discrete_transfer_function_is_that_of_scipy(numerator, denominator):
    behind = (0.0,) * (len(denominator) - len(numerator)) + numerator  # lfilter wants powers of 1/z
    expected = scipy.signal.lfilter(behind, denominator, U)
    block = of("discrete transfer function", numerator, denominator)
    np.testing.assert_allclose(drive(block, 200, u=U)["y"], expected, atol=2e-5)


def test_state_space_is_that_of_scipy():
    a, b = ((-1.0, 2.0), (-3.0, -0.5)), ((1.0, 0.0), (0.5, 2.0))
    c, d = ((1.0, 1.0), (0.0, 1.0), (2.0, 0.0)), ((0.0, 1.0), (0.0, 0.0), (0.5, 0.0))
    block = of("state space", a, b, c, d, initial=(0.3, -0.2), direct=True)
    times = np.arange(300) * 0.01
    u = np.tile([1.0, -2.0], (300, 1))
    _, expected, _ = scipy.signal.lsim((a, b, c, d), u, times, X0=[0.3, -0.2])
    given = answer(block, of("constant", (1.0, -2.0), shape=(2,)), 300)
    np.testing.assert_allclose(given, expected, atol=2e-5)


def test_state_space_of_single_numbers_has_single_ports():
    block = of("state space", ((0.0, 1.0), (-4.0, -0.4)), (0.0, 1.0), (1.0, 0.0))
    assert block.inputs["u"].shape == block.outputs["y"].shape == ()
    _, expected = scipy.signal.step(((1.0,), (1.0, 0.4, 4.0)), T=np.arange(300) * 0.01)
    np.testing.assert_allclose(answer(block, ONE, 300), expected, atol=2e-5)


def test_discrete_state_space_is_that_of_scipy():
    a, b, c, d = ((0.5, 0.2), (-0.3, 0.8)), (1.0, 0.5), (1.0, -1.0), 0.25
    system = scipy.signal.dlti(a, np.reshape(b, (2, 1)), np.reshape(c, (1, 2)), d, dt=1)
    _, expected, _ = scipy.signal.dlsim(system, U)
    block = of("discrete state space", a, b, c, d, direct=True)
    np.testing.assert_allclose(drive(block, 200, u=U)["y"], expected[:, 0], atol=2e-5)


def test_matrices_that_do_not_fit_are_refused_by_name():
    for settings, message in (
        ({"a": ((1.0, 2.0),)}, "a = .*: must be a square list of rows"),
        ({"b": (1.0, 2.0)}, "b = .*: must be a list of 1 numbers"),
        ({"c": (1.0, 2.0)}, "c = .*: must be a list of 1 numbers"),
        ({"d": 1.0}, "d = 1.0: must be 0 unless direct is true"),
        ({"d": ((1.0, 2.0),), "direct": True}, "d: shape = \\(1, 2\\)"),
        ({"initial": (1.0, 2.0)}, "initial: shape"),
    ):
        with pytest.raises(ValueError, match=message):
            of("state space", **settings)
    for settings, message in (
        ({"numerator": (1.0, 2.0, 3.0)}, "numerator = .*: must be at most 2"),
        ({"denominator": (0.0, 1.0)}, "denominator = .*: must be a list whose first coefficient is not 0"),
        ({"denominator": (1.0,)}, "denominator = .*: must be 2 … 21"),
        ({"numerator": 1.0}, "numerator = 1.0: must be a list of coefficients"),
    ):
        with pytest.raises(ValueError, match=message):
            of("transfer function", **settings)


MOVING = {"a": ((1.0, 0.1), (0.0, 0.95)), "b": (0.0, 0.1), "c": (1.0, 0.0)}
NOISE = {"q": ((1e-3, 2e-4), (2e-4, 4e-3)), "r": 0.02}


def test_the_gain_of_a_kalman_filter_goes_to_that_of_riccatis_equation():
    a, c = np.array(MOVING["a"]), np.array([MOVING["c"]])
    before = scipy.linalg.solve_discrete_are(a.T, c.T, np.array(NOISE["q"]), np.array([[NOISE["r"]]]))
    gain = before @ c.T / (c @ before @ c.T + NOISE["r"])
    after = before - gain @ c @ before
    found = drive(of("kalman filter", **MOVING, **NOISE), 200, y=U)
    np.testing.assert_allclose(found["deviation"][-1], np.sqrt(np.diag(after)), rtol=1e-4)
    u, x = U[-50:], found["x"][-50:]
    predicted = x[:-1] @ a.T
    np.testing.assert_allclose(x[1:], predicted + (u[1:, None] - predicted @ c.T) * gain[:, 0], atol=1e-4)


def test_a_kalman_filter_tracks_better_than_it_is_told_and_goes_on_by_its_model_while_nothing_is_sensed():
    a, b = np.array(MOVING["a"]), np.array(MOVING["b"])
    pushes = np.sin(np.arange(400) / 20)
    states = np.zeros((400, 2))
    shaken = RNG.multivariate_normal(np.zeros(2), NOISE["q"], 400)
    for t in range(399):
        states[t + 1] = a @ states[t] + b * pushes[t] + shaken[t]
    seen = states[:, 0] + np.sqrt(NOISE["r"]) * RNG.normal(size=400)
    sensed = np.arange(400) < 360
    found = drive(of("kalman filter", **MOVING, **NOISE), 400, y=np.where(sensed, seen, 1e6), u=pushes, sensed=sensed)
    errors = found["x"] - states
    assert np.std(errors[20:360, 0]) < 0.7 * np.std((seen - states[:, 0])[20:360])
    assert 0.8 < np.std(errors[20:360] / found["deviation"][20:360]) < 1.2  # as certain as it should be
    alone = found["x"][359]
    for t in range(359, 399):
        alone = a @ alone + b * pushes[t]
    np.testing.assert_allclose(found["x"][-1], alone, rtol=1e-3, atol=1e-4)
    assert np.all(np.diff(found["deviation"][359:, 0]) > 0)


def test_noise_that_is_no_covariance_is_refused():
    for settings, message in (
        ({"r": 0.0}, "r = 0.0: must be variances above 0"),
        ({"q": -1.0}, "q = -1.0: must be variances of 0 or above"),
        ({"q": ((1.0, 0.5), (0.0, 1.0))}, "q = .*: must be the same in rows and columns"),
        ({"uncertainty": (1.0, 2.0, 3.0)}, "uncertainty: shape"),
    ):
        with pytest.raises(ValueError, match=message):
            of("kalman filter", **MOVING, **settings)


def test_lag_is_exponential():
    times = np.arange(200) * 0.01
    given = answer(of("lag", 0.3, 2.0, -1.0), ONE, 200)
    np.testing.assert_allclose(given, 2 - 3 * np.exp(-times / 0.3), atol=2e-6)


@pytest.mark.parametrize("constant", [0.001, 0.3, 50.0])
def test_discrete_lag_is_exact_for_a_held_input(constant):
    given = drive(of("discrete lag", constant, 2.0, -1.0), 100, 0.1, u=np.ones(100))["y"]
    np.testing.assert_allclose(given, 2 - 3 * np.exp(-np.arange(100) * 0.1 / constant), atol=1e-5)


@pytest.mark.parametrize("method", ["forward", "backward", "trapezoid"])
def test_discrete_integrator_is_a_sum(method):
    given = drive(of("discrete integrator", 0.5, method=method), 200, 0.1, u=U)["y"]
    part = {"forward": 0.0, "backward": 1.0, "trapezoid": 0.5}[method]
    before = np.concatenate([[0], np.cumsum(U)[:-1]])
    np.testing.assert_allclose(given, 0.5 + 0.1 * (before + part * U), atol=1e-4)


@pytest.mark.parametrize("method", ["forward", "backward", "trapezoid"])
def test_discrete_integrator_does_not_wind_up(method):
    block = of("discrete integrator", 0.0, -0.5, 0.7, method, True)
    u = np.concatenate([np.ones(50), -np.ones(50)])
    y = drive(block, 100, 0.1, u=u)["y"]
    assert y.min() == np.float32(-0.5)
    assert y.max() == np.float32(0.7)
    assert y[52] < 0.7  # it comes back at once


def test_discrete_integrator_begins_again():
    reset = np.arange(20) == 7
    y = drive(of("discrete integrator", 2.0), 20, 1.0, u=np.ones(20), reset=reset)["y"]
    np.testing.assert_allclose(y, np.where(np.arange(20) < 8, 2 + np.arange(20), 2 + np.arange(20) - 8))


@pytest.mark.parametrize("shape", [(), (2,)])
@pytest.mark.parametrize("length", [1, 7])
def test_delay_gives_what_was(length, shape):
    u = RNG.normal(size=(30, *shape))
    y = drive(of("delay", -1.0, length, shape=shape), 30, u=u)["y"]
    np.testing.assert_array_equal(y, np.concatenate([np.full((length, *shape), -1.0), u[:-length]]).astype(np.float32))


def pid_of_scipy(block):
    """Numerator and denominator of k_P + k_I/s + k_D s/(tau s + 1)."""
    p, i, d, tau = block.proportional_gain, block.integral_gain, block.derivative_gain, block.filter
    return np.array([p * tau + d, p + i * tau, i]), np.array([tau, 1.0, 0.0])


@pytest.mark.ci
def test_pid_answers_a_step_as_its_transfer_function():
    block = of("PID controller", 2.0, 1.5, 0.4, 0.2)
    times = np.arange(300) * 0.01
    _, expected = scipy.signal.step(pid_of_scipy(block), T=times)
    np.testing.assert_allclose(answer(block, ONE, 300), expected, atol=5e-5)


def closed(controller, ticks=1500, every=1):
    """A controller before a double lag with a limited drive, and a jump of the reference to 1."""
    diagram = Diagram(0.01)
    diagram.add("error", of("sum", "+-"))
    diagram.add("reference", ONE)
    diagram.add("controller", dataclasses.replace(controller, every=every))
    diagram.add("plant", of("transfer function", (1.0,), (1.0, 1.5, 0.5)))
    for name in ("level", "drive"):
        diagram.add(name, Outlet())
    diagram.connect("reference", "error.u1")
    diagram.connect("plant", "error.u2")
    diagram.connect("error", "controller")
    diagram.connect("controller", "plant")
    diagram.connect("plant", "level")
    diagram.connect("controller", "drive")
    record = Run(diagram).advance(ticks)
    return record["level.u"][0], record["drive.u"][0]


def test_pid_closes_a_loop_as_scipy_says():
    block = of("PID controller", 2.0, 0.6, 0.5, 0.2)
    above, below = pid_of_scipy(block)
    loop = np.polymul(below, (1.0, 1.5, 0.5))
    level, _ = closed(block, 1000)
    _, expected = scipy.signal.step((above, np.polyadd(loop, above)), T=np.arange(1000) * 0.01)
    np.testing.assert_allclose(level, expected, atol=2e-4)


@pytest.mark.parametrize("name", ["PID controller", pytest.param("discrete PID controller", marks=pytest.mark.ci)])
def test_pid_with_limits_does_not_wind_up(name):
    gains = {"proportional_gain": 4.0, "integral_gain": 2.0}
    limits = {"low": 0.0, "high": 0.6, "limited": True}
    level, drive_ = closed(of(name, **gains, **limits, tracking=0.5))
    wound, _ = closed(of(name, **gains, **limits, tracking=1e6))
    assert drive_.min() >= 0
    assert drive_.max() <= np.float32(0.6)
    assert abs(level[-1] - 1) < 0.02
    assert level.max() < 1.1 < wound.max()  # without it the loop overshoots


@pytest.mark.parametrize("name", ["PID controller", "discrete PID controller"])
def test_what_does_not_integrate_is_not_led_back_from_a_limit(name):
    """A controller of one part alone has its gain times the error again once it is within its limits."""
    block = of(name, 2.0, (0.0, 1.0), initial=(0.1, 0.0), tracking=0.5, limited=True, shape=(2,))
    diagram = Diagram(0.01)
    diagram.add("error", of("step", at=5.0, before=3.0, after=0.05, shape=(2,)))
    diagram.add("controller", block)
    diagram.connect("error", "controller")
    y = Run(diagram, watch=["controller.y"]).advance(502)["controller.y"][0]
    np.testing.assert_allclose(y[:500], 1.0, atol=1e-6)
    np.testing.assert_allclose(y[-1, 0], 2 * 0.05 + 0.1, atol=1e-6)
    assert y[-1, 1] == -1  # led back to 3 · (T − 2) + 1, far below the limits: T makes wind-up the other way


def test_discrete_pid_is_a_linear_filter():
    h, p, i, d, tau = 0.1, 1.5, 0.8, 0.3, 0.25
    block = of("discrete PID controller", p, i, d, tau)
    part = p * U
    integral = scipy.signal.lfilter([0.0, h * i], [1.0, -1.0], U)
    slope = scipy.signal.lfilter([d, -d], [tau + h, -tau], U)
    np.testing.assert_allclose(drive(block, 200, h, u=U)["y"], part + integral + slope, atol=1e-4)


@pytest.mark.ci
def test_discrete_pid_comes_near_to_the_continuous_one():
    block = {"proportional_gain": 2.0, "integral_gain": 0.6, "derivative_gain": 0.5, "filter": 0.2}
    near, _ = closed(of("discrete PID controller", **block), 1000)
    exact, _ = closed(of("PID controller", **block), 1000)
    assert np.abs(near - exact).max() < 0.01
