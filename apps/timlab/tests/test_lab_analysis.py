"""Bode, step response, root locus and trim against closed forms; records as figures and tables."""

import numpy as np
import pytest

import timlab
from test_lab_linearise import oscillator


@pytest.fixture(scope="module")
def spring():
    """x'' = −4 x − 0.5 x' + u, about 0, from u to x."""
    return timlab.linearise(timlab.Run(oscillator()), ["force.value"], ["place.y"])


def test_the_frequency_response_is_that_of_the_transfer_function(spring):
    found = timlab.bode(spring, frequencies=np.geomspace(0.01, 100, 300))
    exact = 1 / (4 - found.frequency**2 + 0.5j * found.frequency)
    np.testing.assert_allclose(found.magnitude, np.abs(exact), rtol=1e-5)
    np.testing.assert_allclose(found.phase, np.angle(exact), atol=1e-5)
    assert timlab.bode(spring).magnitude.max() == pytest.approx(1 / (0.5 * np.sqrt(4 - 0.125 / 2)), rel=1e-3)


def test_margins_are_those_of_three_equal_lags():
    """k / (s + 1)³ reaches a phase of −180° at ω = √3, where its magnitude is k / 8; and magnitude 1 at √(k^⅔ − 1)."""
    gain = 4.0
    diagram = timlab.Diagram(0.01)
    diagram.add("in", timlab.Inlet(0.0))
    before = "in"
    for number in range(3):
        diagram.add(f"lag {number}", timlab.Lag(1.0, gain if number == 0 else 1.0))
        diagram.connect(before, f"lag {number}")
        before = f"lag {number}"
    found = timlab.bode(timlab.linearise(timlab.Run(diagram), ["in.value"], [f"{before}.y"]))
    assert found.gain_margin == pytest.approx(8 / gain, rel=1e-4)
    assert found.phase_crossover == pytest.approx(np.sqrt(3), rel=1e-4)
    crossing = np.sqrt(gain ** (2 / 3) - 1)
    assert found.gain_crossover == pytest.approx(crossing, rel=1e-4)
    assert found.phase_margin == pytest.approx(np.pi - 3 * np.arctan(crossing), rel=1e-4)
    above, below = found.figure().axes
    assert above.get_title(loc="left") == "gain margin 6.02 dB, phase margin 27.1°"
    assert below.get_xlabel() == "frequency (rad/s)"


def test_a_phase_that_only_comes_near_to_half_a_turn_has_no_gain_margin(spring):
    """A PID loop with a filter and two lags, whose phase goes to −180°; rounding lets it cross at 10⁸ rad/s."""
    a = np.array([[0, 0, 0, -2], [0, -10, 0, -10], [1, -10, -1, -14], [0, 0, 0.5, -0.5]])
    b, c, d = np.array([[2.0], [10.0], [14.0], [0.0]]), np.array([[0.0, 0.0, 0.0, 1.0]]), np.zeros((1, 1))
    found = timlab.bode(spring._replace(A=a, B=b, C=c, D=d, states=["i", "d", "valve", "process"]))
    assert found.gain_margin == np.inf
    assert np.isnan(found.phase_crossover)
    assert found.phase_margin == pytest.approx(1.91, abs=0.01)


def test_the_step_response_rings_as_the_closed_form(spring):
    found = timlab.step_response(spring, end=20.0)
    damped = np.sqrt(4 - 0.25**2)
    t = found.times
    exact = (1 - np.exp(-0.25 * t) * (np.cos(damped * t) + 0.25 / damped * np.sin(damped * t))) / 4
    np.testing.assert_allclose(found.outputs[0], exact, atol=1e-5)
    assert found.overshoot[0] == pytest.approx(np.exp(-0.25 * np.pi / damped), rel=1e-2)
    assert len(found.figure().axes) == 1


@pytest.mark.ci
def test_the_response_of_a_tick_agrees_with_the_run(spring):
    found = timlab.step_response(
        timlab.linearise(timlab.Run(oscillator()), ["force.value"], ["place.y"], discrete=True), end=1.0
    )
    run = timlab.Run(oscillator(), watch=["place.y"])
    run["place.initial"], run["force.value"] = 0.0, 1.0
    run.reset()
    np.testing.assert_allclose(found.outputs[0], run.advance(len(found.times))["place.y"][0], atol=1e-5)
    unstable = timlab.linearise(timlab.Run(oscillator()), ["force.value"], ["place.y"])._replace(
        A=np.array([[0.1, 0], [0, 1]])
    )
    assert np.isnan(timlab.step_response(unstable, end=1.0).settling_time).all()


def test_the_root_locus_has_the_roots_of_the_closed_loop(spring):
    gains = np.array([0.0, 1.0, 5.0, 20.0])
    found = timlab.root_locus(spring, gains=gains)
    for gain, poles in zip(gains, found.poles, strict=True):
        np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(np.roots([1, 0.5, 4 + gain])), atol=1e-5)
    assert found.zeros.size == 0
    assert timlab.root_locus(spring).figure().axes[0].get_xlabel() == "real part (1/s)"


def test_an_index_that_is_not_there_is_refused(spring):
    with pytest.raises(ValueError, match=r"output = 1: must be an index of place\.y"):
        timlab.bode(spring, output=1)
    with pytest.raises(ValueError, match=r"input = -1: must be an index of force\.value"):
        timlab.root_locus(spring, input=-1)
    apart = spring._replace(C=np.zeros_like(spring.C))
    for analysis in (timlab.bode, timlab.root_locus):
        with pytest.raises(ValueError, match=r"'force\.value → place\.y': must be an output that the input moves"):
            analysis(apart)


@pytest.mark.ci
def test_trim_finds_the_force_that_holds_a_spring():
    run = timlab.Run(oscillator(), watch=["place.y"])
    found = timlab.trim(run, ["force.value"], {"place.y": 0.5})
    assert found.inputs["force.value"] == pytest.approx(2.0, rel=1e-4)
    np.testing.assert_allclose(found.run.advance(500)["place.y"], 0.5, atol=1e-4)
    assert run.tick == 0
    assert run["force.value"] == 0.0
    assert timlab.trim(run).outputs == {}
    np.testing.assert_allclose(timlab.trim(run).run.advance(100)["place.y"], 0.0, atol=1e-5)


@pytest.mark.ci
def test_trim_finds_the_upright_pendulum_and_says_where_there_is_none():
    run = timlab.Run(timlab.example("pendulum"))
    run["push.high"] = 0.0
    found = timlab.trim(run, outputs={"position.y": 0.0})
    linear = timlab.linearise(found.run, outputs=["angle.y"])
    np.testing.assert_allclose(linear.state, 0.0, atol=1e-4)
    assert np.linalg.eigvals(linear.A).real.max() < 0  # the regulator holds it there
    drift = timlab.Diagram(0.1)
    drift.add("one", timlab.Constant(1.0))
    drift.add("level", timlab.Integrator())
    drift.connect("one", "level")
    with pytest.raises(ValueError, match="no equilibrium was found near the present state: level still misses by"):
        timlab.trim(timlab.Run(drift))


@pytest.fixture(scope="module")
def record():
    diagram = timlab.Diagram(0.1)
    diagram.add("noise", timlab.NormalNoise(shape=(2,)))
    diagram.add("fine", timlab.Scope(shape=(2,)))
    diagram.add("clock", timlab.Ramp())
    diagram.add("coarse", timlab.Scope(every=5))
    diagram.connect("noise", "fine")
    diagram.connect("clock", "coarse")
    return timlab.Run(diagram, seeds=3).advance(20)


def test_a_record_is_a_table(record):
    table = record.to_pandas()
    assert table.columns.names == ["signal", "seed"]
    assert table.index.name == "time"
    assert table["fine.u[1]"].shape == (20, 3)
    np.testing.assert_array_equal(table["fine.u[1]"].to_numpy().T, record["fine.u"][..., 1])
    coarse = table["coarse.u"][0].dropna()
    np.testing.assert_allclose(coarse.index, [0.0, 0.5, 1.0, 1.5])
    np.testing.assert_allclose(coarse, coarse.index, atol=1e-6)


def test_a_record_is_a_figure(record):
    above, below = record.plot().axes
    assert (above.get_ylabel(), below.get_ylabel()) == ("fine.u", "coarse.u")
    assert below.get_xlabel() == "time (s)"
    (axes,) = record.plot("coarse.u").axes
    np.testing.assert_allclose(axes.lines[0].get_xdata(), [0.0, 0.5, 1.0, 1.5])
    with pytest.raises(ValueError, match="unknown signal"):
        record.plot("corse.u")
