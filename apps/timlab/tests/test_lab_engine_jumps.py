"""Sources that jump are integrated exactly: at a tick's border, between ticks, and after going back."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lab_examples import same, wire
from timlab import (
    Block,
    DataFile,
    Diagram,
    Expression,
    Gain,
    Integrator,
    Interpreter,
    Outlet,
    Pulse,
    Run,
    Step,
    Sum,
    Timeline,
    problems,
)

ENGINES = pytest.mark.parametrize("engine", [Run, Interpreter])
COMPILED = pytest.mark.parametrize("engine", [Run, pytest.param(Interpreter, marks=pytest.mark.ci)])  # as a step is


def integral(source: Block, tick: float, substeps: int = 1, port: str = "y") -> Diagram:
    """The integral of a source."""
    diagram = Diagram(tick, substeps)
    diagram.add("source", source)
    diagram.add("level", Integrator())
    diagram.add("out", Outlet())
    return wire(diagram, f"source.{port} level", "level out")


def assert_exact(engine, diagram, ticks, exact, jump):
    """The integral errs by rounding only: its error is below 10⁻⁴ of a tick's worth of the jump, where it was 1/6."""
    record = engine(diagram).advance(ticks)
    error = np.abs(record["out.u"][0] - exact(record.times("out.u"))).max()
    assert error < 1e-4 * diagram.tick * jump


@pytest.mark.ci
# a run with a step on every tick is below
@pytest.mark.representatives("7.37-0.01-Run", "7.37-0.01-Interpreter", "9.999-0.0125-Run")
@ENGINES
@pytest.mark.parametrize("tick", [0.001, 0.01, 0.0125, 0.1])
@pytest.mark.parametrize("place", [0, 1, 7, 7.37, 9.999])
def test_the_integral_of_a_step_is_exact(engine, tick, place):
    at = place * tick
    for substeps in (1, 3):
        diagram = integral(Step(at, 0.5, -2.0), tick, substeps)
        exact = lambda t: 0.5 * np.minimum(t, at) - 2.0 * np.maximum(t - at, 0.0)  # noqa: E731
        assert_exact(engine, diagram, 12, exact, 2.5)


def test_every_step_on_a_tick_of_a_long_run_is_exact():
    """1,000 seeds, each with its step at another tick, in single precision."""
    tick, at = 0.01, 0.01 * np.arange(1000)
    run = Run(integral(Step(0.0), tick), seeds=1000, sweep={"source.at": at})
    record = run.advance(1024)
    exact = np.maximum(record.times("out.u") - at[:, None], 0.0)
    np.testing.assert_allclose(np.diff(record["out.u"]), np.diff(exact), atol=1e-6)  # the rounding of a sum of 10 s


@COMPILED
def test_the_integral_of_a_pulse_train_is_exact(engine):
    def area(t):
        whole, part = np.divmod(3.0 * (t - 0.05), 1.0)
        return (whole * (0.37 * 2 - 0.63) + np.where(part < 0.37, 2 * part, 0.37 * 2 - (part - 0.37))) / 3.0

    diagram = integral(Pulse(3.0, 0.37, delay=0.05, low=-1.0, high=2.0), 0.01)
    assert_exact(engine, diagram, 60, lambda t: area(t) - area(0.0), 3.0)


def test_a_pulse_train_faster_than_the_ticks_ends():
    record = Run(integral(Pulse(1e9), 0.01)).advance(20)
    assert np.isfinite(record["out.u"]).all()


@COMPILED
@pytest.mark.parametrize("between", ["hold", pytest.param("linear", marks=pytest.mark.ci)])
def test_the_integral_of_a_table_is_exact(engine, between, tmp_path):
    times, rows = np.array([0.0, 0.1, 0.1234, 0.3, 0.4]), np.array([1.0, -2.0, 5.0, 0.5, 3.0])
    np.savez(tmp_path / "table.npz", t=times, y=rows)
    block = DataFile(str(tmp_path / "table.npz"), time="t", between=between, after="repeat")
    fine = (np.arange(80_000) + 0.5) * 1e-5 % 0.4
    values = rows[np.searchsorted(times, fine, "right") - 1] if between == "hold" else np.interp(fine, times, rows)
    area = np.concatenate([[0.0], np.cumsum(values) * 1e-5])
    diagram = integral(block, 0.01)
    record = engine(diagram).advance(75)
    error = record["out.u"][0] - area[np.round(record.times("out.u") * 1e5).astype(int)]
    # a kink of the line within a tick is not a jump: there the error is of second order
    assert np.abs(error).max() < (0.01 * 7 * 1e-3 if between == "hold" else 0.01**2 * 500 / 10)


@COMPILED
@pytest.mark.parametrize(
    ("formula", "exact"),
    [
        ("if(t >= 0.3, 2, -1)", lambda t: 2 * np.maximum(t - 0.3, 0) - np.minimum(t, 0.3)),
        pytest.param("sign(late - t)", lambda t: np.minimum(t, 0.2) - np.maximum(t - 0.2, 0), marks=pytest.mark.ci),
        ("mod(t, 0.2) < 0.1", lambda t: (t + 1e-9) // 0.2 * 0.1 + np.minimum((t + 1e-9) % 0.2, 0.1)),
        pytest.param(
            "floor(t * 10)",
            lambda t: 0.05 * (n := (t + 1e-9) // 0.1) * (n - 1) + n * (t - 0.1 * n),
            marks=pytest.mark.ci,
        ),
    ],
)
def test_a_formula_that_jumps_at_a_tick_is_integrated_exactly(engine, formula, exact):
    diagram = integral(Expression(formula, (), ("late",), 0.2), 0.01)
    assert_exact(engine, diagram, 45, exact, 3.0)


def motor(tick: float) -> Diagram:
    """A DC motor under a PI controller; the wanted speed jumps at 0.1 s, the load at 0.5 s."""
    diagram = Diagram(tick)
    blocks = {
        **{"wanted": Step(0.1, after=15.0), "load": Step(0.5, after=0.4)},
        **{"error": Sum("+-"), "kp": Gain(0.5), "ki": Gain(5.0), "sum": Integrator(), "drive": Sum("++")},
        **{"voltage": Sum("+--"), "resistance": Gain(1.2), "emf": Gain(0.1), "inductance": Gain(1 / 0.06)},
        **{"current": Integrator(), "torque": Gain(0.1), "net": Sum("+--"), "friction": Gain(0.001)},
        **{"inertia": Gain(1 / 0.01), "speed": Integrator(), "out": Outlet()},
    }
    for name, block in blocks.items():
        diagram.add(name, block)
    return wire(
        diagram,
        *("wanted error.u1", "speed error.u2", "error kp", "error ki", "ki sum", "kp drive.u1", "sum drive.u2"),
        *("drive voltage.u1", "current resistance", "resistance voltage.u2", "speed emf", "emf voltage.u3"),
        *("voltage inductance", "inductance current", "current torque", "torque net.u1", "load net.u2"),
        *("speed friction", "friction net.u3", "net inertia", "inertia speed", "speed out"),
    )


def motor_by_scipy(times: np.ndarray) -> np.ndarray:
    """The speed of `motor`."""

    def slope(t, x, wanted, load):
        current, speed, total = x
        voltage = 0.5 * (wanted - speed) + total
        return [
            (voltage - 1.2 * current - 0.1 * speed) / 0.06,
            (0.1 * current - load - 0.001 * speed) / 0.01,
            5 * (wanted - speed),
        ]

    speed, state = np.zeros(len(times)), np.zeros(3)
    for begin, end, wanted, load in ((0.0, 0.1, 0.0, 0.0), (0.1, 0.5, 15.0, 0.0), (0.5, 3.0, 15.0, 0.4)):
        found = solve_ivp(slope, (begin, end), state, args=(wanted, load), rtol=1e-10, atol=1e-10, dense_output=True)
        here = (times > begin - 1e-9) & (times < end - 1e-9)
        speed[here], state = found.sol(times[here])[1], found.y[:, -1]
    return speed


@pytest.mark.ci
@pytest.mark.parametrize("tick", [0.001, 0.005, 0.01])
def test_a_motor_in_a_loop_moves_as_scipy_says(tick):
    record = Run(motor(tick)).advance(round(2.0 / tick))
    expected = motor_by_scipy(record.times("out.u"))
    np.testing.assert_allclose(record["out.u"][0], expected, atol=2e-4)


@pytest.mark.ci
def test_the_interpreter_moves_the_motor_too():
    record = Interpreter(motor(0.01)).advance(60)
    np.testing.assert_allclose(record["out.u"][0], motor_by_scipy(record.times("out.u")), atol=2e-4)


@pytest.mark.parametrize("at", [pytest.param(0.3, marks=pytest.mark.ci), 0.3037])
def test_going_back_over_a_jump_repeats_it_bit_for_bit(at):
    timeline = Timeline(Run(integral(Step(at), 0.01), seeds=3), every=7)
    whole = timeline.advance(60)["out.u"]
    end = timeline.run.state
    for tick in (0, 29, 30, 31, 45):
        timeline.seek(tick)
        np.testing.assert_array_equal(timeline.advance(60 - tick)["out.u"], whole[:, tick:])
        same(timeline.run.state, end)


def test_a_jump_moves_with_its_parameter_while_it_runs():
    run = Run(integral(Step(0.5), 0.01))
    run.advance(10)
    run["source.at"] = 0.155
    assert run.advance(21)["out.u"][0, -1] == pytest.approx(0.3 - 0.155, abs=1e-6)
    assert run.compilations == 1


def test_a_block_that_declares_no_time_of_its_jump_is_refused():
    class Wrong(Step):
        def next_jump(self, now):
            return now.tick

    diagram = Diagram()
    diagram.add("wrong", Wrong())
    assert [each.message for each in problems(diagram)] == ["next_jump: returns uint32[]: must be one time in seconds"]
