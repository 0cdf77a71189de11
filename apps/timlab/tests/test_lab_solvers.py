"""Solvers that adapt their steps: error, zero crossings, double precision, exact time, algebraic loops."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from lab_examples import same, wire
from timlab import (
    Chirp,
    Compare,
    Constant,
    Delay,
    Diagram,
    DiagramError,
    DryFriction,
    Expression,
    Function,
    Gain,
    Integrator,
    Interpreter,
    Lag,
    Not,
    Outlet,
    Pulse,
    Ramp,
    Relay,
    Run,
    RunFault,
    Sine,
    Step,
    Sum,
    Timeline,
    dumps,
    loads,
    problems,
    to_python,
    unstable_steps,
)

EXACT = {"precision": "double", "relative_tolerance": 1e-10, "absolute_tolerance": 1e-12}


def ball(**settings) -> Diagram:
    """A bouncing ball that keeps four fifths of its speed."""
    diagram = Diagram(0.1, **settings)
    blocks = {
        **{"gravity": Constant(-9.81), "speed": Integrator(0.0, reset="rising", external=True)},
        **{"height": Integrator(1.0), "down": Compare("<="), "back": Gain(-0.8), "out": Outlet()},
    }
    for name, block in blocks.items():
        diagram.add(name, block)
    bounce = ("height down.u1", "down speed.reset", "speed back", "back speed.initial")
    return wire(diagram, "gravity speed.u", "speed height", *bounce, "height out")


def height(times, kept=0.8):
    """The height of the ball."""
    high = []
    for time in times:
        left, speed = time - np.sqrt(2 / 9.81), kept * 9.81 * np.sqrt(2 / 9.81)
        while left > 2 * speed / 9.81:
            left, speed = left - 2 * speed / 9.81, kept * speed
        high.append(1 - 4.905 * time**2 if left < 0 else speed * left - 4.905 * left**2)
    return np.array(high)


def relay(**settings) -> Diagram:
    """A lag of 1 s under a relay to ±2 that switches at ±0.5."""
    diagram = Diagram(0.1, **settings)
    for name, block in {"relay": Relay(-0.5, 0.5, off=2.0, on=-2.0), "level": Lag(1.0), "out": Outlet()}.items():
        diagram.add(name, block)
    return wire(diagram, "level relay", "relay level", "level out")


def level(times):
    """The level of `relay`."""
    half, left = np.divmod(times - np.log(2 / 1.5), np.log(2.5 / 1.5))
    return np.where(times < np.log(2 / 1.5), 2 - 2 * np.exp(-times), (2.5 * np.exp(-left) - 2) * (-1) ** half)


def error(engine, exact, ticks=38) -> float:
    record = engine.advance(ticks)
    return np.abs(record["out.u"] - exact(record.times("out.u"))).max()


@pytest.mark.ci
@pytest.mark.parametrize("solver", ["tsit5", "dopri8", "rodas5p"])
def test_a_relay_switches_at_the_instant(solver):
    assert error(Run(relay(solver=solver, **EXACT)), level) < 1e-10


@pytest.mark.ci
def test_a_ball_bounces_at_the_instant_in_single_precision_too():
    assert error(Run(ball(solver="tsit5")), height) < 1e-4


@pytest.mark.ci
def test_the_interpreter_bounces_too_and_states_are_interchangeable():
    run, slow = Run(ball(solver="tsit5", **EXACT)), Interpreter(ball(solver="tsit5", **EXACT))
    assert error(slow, height, 6) < 1e-13
    run.restore(slow.state)
    np.testing.assert_allclose(run.advance(4)["out.u"], slow.advance(4)["out.u"], atol=1e-13)


def test_seeds_bounce_by_themselves_and_going_back_repeats_them_bit_for_bit():
    kept = np.array([0.8, 0.5, 0.7])
    run = Run(ball(solver="tsit5", **EXACT), seeds=3, sweep={"back.gain": -kept})
    timeline = Timeline(run, every=7)
    record = timeline.advance(38)
    whole, times = record["out.u"], record.times("out.u")
    assert np.abs(whole[0] - height(times)).max() < 1e-12
    for row, factor in enumerate(kept):
        np.testing.assert_allclose(whole[row, :11], height(times[:11], factor), atol=1e-12)
    end = run.state
    for tick in (0, 5, 8, 30):
        timeline.seek(tick)
        np.testing.assert_array_equal(timeline.advance(38 - tick)["out.u"], whole[:, tick:])
        same(run.state, end)
    run["gravity.value"] = -1.62
    assert np.isfinite(run.advance(5)["out.u"]).all()
    assert run.compilations == 1


@pytest.mark.ci
def test_with_fixed_steps_a_ball_bounces_at_ticks():
    record = Run(ball()).advance(12)["out.u"][0]
    assert record.min() < -0.05
    assert record[-1] > record.min()


def test_an_integrator_rests_at_its_limits_without_wind_up():
    diagram = Diagram(0.1, solver="tsit5", **EXACT)
    blocks = {"u": Sine(1.0, 0.25), "y": Integrator(0.0, low=-0.2, high=0.4, limited=True), "out": Outlet()}
    for name, block in blocks.items():
        diagram.add(name, block)
    record = Run(wire(diagram, "u y", "y out")).advance(61)
    times = record.times("out.u")
    swing = lambda t: 2 / np.pi * (1 - np.cos(np.pi / 2 * t))  # noqa: E731
    down = 0.4 + swing(times) - swing(2.0)
    first = np.where(times < 2, np.minimum(swing(times), 0.4), np.maximum(down, -0.2))
    exact = np.where(times < 4, first, np.minimum(-0.2 + swing(times) - swing(4.0), 0.4))
    np.testing.assert_allclose(record["out.u"][0], exact, atol=1e-9)


def test_a_mass_sticks_and_slips_at_the_instant():
    diagram = Diagram(0.1, solver="tsit5", **EXACT)
    blocks = {
        **{"pull": Ramp(0.1), "stretch": Sum("+-"), "spring": Gain(10.0), "mass": DryFriction(1.0, 1.0, 0.6)},
        **{"place": Integrator(), "out": Outlet()},
    }
    for name, block in blocks.items():
        diagram.add(name, block)
    loop = ("pull stretch.u1", "place stretch.u2", "stretch spring", "spring mass", "mass.y place", "place out")
    places = Run(wire(diagram, *loop)).advance(31)["out.u"][0]
    rate, sine, cosine = np.sqrt(10), 0.1 / np.sqrt(10), 0.04
    lasts = (2 * np.pi - 2 * np.arctan2(cosine, sine)) / rate
    end = 0.1 * (1 + lasts) - (0.06 + cosine * np.cos(rate * lasts) + sine * np.sin(rate * lasts))
    np.testing.assert_array_equal(places[:11], 0.0)
    np.testing.assert_allclose(places[np.ceil((1 + lasts) * 10).astype(int) :][:3], end, atol=1e-9)


def test_a_stiff_system_takes_few_steps():
    """Robertson's reaction at 400 s, by scipy's Radau to 1e-12."""
    diagram = Diagram(400.0, solver="rodas5p", precision="double", relative_tolerance=1e-9, absolute_tolerance=1e-13)
    formulas = {
        "x": ("1e4*y*z - 0.04*x", 1.0),
        "y": ("0.04*x - 1e4*y*z - 3e7*y^2", 0.0),
        "z": ("3e7*y^2", 0.0),
    }
    for name, (formula, initial) in formulas.items():
        diagram.add(name, Integrator(initial))
        diagram.add(f"d{name}", Expression(formula, ("x", "y", "z")))
        diagram.connect(f"d{name}", name)
    for name in formulas:
        wire(diagram, *(f"{other} d{name}.{other}" for other in formulas))
    record = Run(diagram, watch=["x.y", "y.y"]).advance(2)
    assert record["x.y"][0, 1] == pytest.approx(0.450518668, abs=1e-8)
    assert record["y.y"][0, 1] == pytest.approx(3.22290144e-06, rel=1e-6)


@pytest.mark.ci
def test_a_delay_moves_between_its_samples():
    diagram = Diagram(0.05, solver="tsit5", **EXACT)
    blocks = {"y": Integrator(1.0), "past": Delay(1.0, length=20, between="cubic"), "back": Gain(-1.0), "out": Outlet()}
    for name, block in blocks.items():
        diagram.add(name, block)
    record = Run(wire(diagram, "y past", "past back", "back y", "y out")).advance(61)
    t = record.times("out.u")
    terms = [1 + 0 * t, -t, (t - 1) ** 2 / 2 * (t > 1), -((t - 2) ** 3) / 6 * (t > 2), (t - 3) ** 4 / 24 * (t > 3)]
    np.testing.assert_allclose(record["out.u"][0], sum(terms), atol=5e-6)  # a bend of the second order at 1 s


def test_double_precision_is_the_diagram_s_own_and_a_step_still_splits():
    diagram = Diagram(0.1, precision="double")
    for name, block in {"u": Step(0.137, after=2.0), "y": Integrator(), "out": Outlet()}.items():
        diagram.add(name, block)
    run = Run(wire(diagram, "u y", "y out"))
    record = run.advance(11)
    assert record["out.u"].dtype == np.float64
    np.testing.assert_allclose(record["out.u"][0], 2 * np.maximum(record.times("out.u") - 0.137, 0), atol=1e-14)
    assert jnp.zeros(()).dtype == jnp.float32
    run.restore(run.state)
    run["u.after"] = 1.0
    assert run.advance(1)["out.u"].dtype == np.float64


def test_a_sine_keeps_its_phase_for_hours():
    """10 Hz near 9,000 s, in single precision; it was off by 0.07."""
    diagram = Diagram(0.001)
    diagram.add("wave", Sine(1.0, 10.0))
    diagram.add("chirp", Chirp(1.0, 10.0, 10.0))
    diagram.add("pulse", Pulse(10.0, 0.25))
    diagram.add("integral", Integrator())
    diagram.connect("pulse", "integral")
    run = Run(diagram, watch=["wave.y", "chirp.y", "pulse.y", "integral.y"])
    state = run.state
    run.restore(state | {"tick": 9_000_037})
    record = run.advance(200)
    exact = np.sin(2 * np.pi * 10 * (np.arange(9_000_037, 9_000_237) % 100) * 0.001)
    np.testing.assert_allclose(record["wave.y"][0], exact, atol=1e-6)
    np.testing.assert_allclose(record["chirp.y"][0], exact, atol=1e-6)
    high = np.arange(9_000_037, 9_000_237) % 100 < 25
    np.testing.assert_array_equal(record["pulse.y"][0], high)
    integral = 0.001 * np.cumsum(high)[:-1]
    np.testing.assert_allclose(record["integral.y"][0, 1:] - record["integral.y"][0, 0], integral, atol=1e-6)


def looped(integrated: bool = True, **settings) -> Diagram:
    """s = u − tanh(3 s), and its integral, for which the loop is solved four times in a tick."""
    diagram = Diagram(0.1, **settings)
    blocks = {
        **{"u": Sine(1.0, 0.5), "s": Sum("+-"), "g": Gain(3.0), "f": Function("tanh"), "out": Outlet()},
        **({"x": Integrator()} if integrated else {}),
    }
    for name, block in blocks.items():
        diagram.add(name, block)
    return wire(diagram, "u s.u1", "s g", "g f", "f s.u2", "f out", *(["s x"] if integrated else []))


def test_an_algebraic_loop_is_refused_unless_asked_for():
    with pytest.raises(DiagramError, match="algebraic loop: g → f → s → g"):
        Run(looped())


@pytest.mark.parametrize("integrated", [False, pytest.param(True, marks=pytest.mark.ci)])
def test_an_algebraic_loop_is_solved_where_asked_for(integrated):
    watch = ["s.y", "x.y"] if integrated else ["s.y"]
    run = Run(looped(integrated, loops="solve"), seeds=2, watch=watch)
    record = run.advance(20)
    s, u = record["s.y"][0], np.sin(np.pi * record.times("s.y"))
    np.testing.assert_allclose(s + np.tanh(3 * s), u, atol=1e-5)
    state, after = run.state, run.advance(5)[watch[-1]]
    run.restore(state)
    np.testing.assert_array_equal(run.advance(5)[watch[-1]], after)


@pytest.mark.ci
def test_the_interpreter_solves_the_loop_too():
    diagram = looped(loops="solve")
    record, expected = (engine(diagram, watch=["s.y", "x.y"]).advance(4) for engine in (Run, Interpreter))
    for address in ("s.y", "x.y"):
        np.testing.assert_allclose(record[address][0], expected[address][0], atol=1e-5)


def test_a_loop_of_conditions_cannot_be_solved():
    diagram = Diagram(loops="solve")
    for name, block in {"less": Compare("<", 1.0), "twice": Gain(2.0)}.items():
        diagram.add(name, block)
    assert problems(wire(diagram, "less twice", "twice less.u1")) == []  # the gain is real, and is torn
    diagram = Diagram(loops="solve")
    for name in ("one", "other"):
        diagram.add(name, Not())
    found = problems(wire(diagram, "one other", "other one"))
    assert "of conditions only" in found[0].message


def test_an_unstable_step_names_its_block():
    diagram = Diagram(0.1)
    for name, block in {"u": Constant(1.0), "slow": Lag(1.0), "fast": Lag(0.02)}.items():
        diagram.add(name, block)
    run = Run(wire(diagram, "u slow", "slow fast"))
    (line,) = unstable_steps(run)
    assert line.startswith("fast: RK4 steps of 0.1 s are unstable: they multiply a part that dies out at 50 per second")
    with pytest.raises(RunFault, match=r"fast: its state becomes \w+ at tick .* Fast: RK4 steps of 0\.1 s"):
        run.advance(200)


def test_settings_are_saved_and_old_files_load():
    diagram = ball(solver="rodas5p", loops="solve", **EXACT)
    assert loads(dumps(diagram)) == diagram
    assert "relative_tolerance=1e-10" in to_python(diagram)
    assert "solver" not in dumps(ball())
    assert diagram.copy().head == diagram.head
    for name, value in {"solver": "rk5", "precision": "half", "loops": "cut", "relative_tolerance": 0.0}.items():
        with pytest.raises(ValueError, match=name):
            Diagram(**{name: value})


def test_a_lost_state_is_found_and_ends_the_run_quickly():
    """x' = x² has no solution after 1 s."""
    diagram = Diagram(0.5, solver="tsit5")
    diagram.add("x", Integrator(1.0))
    diagram.add("square", Expression("x^2", ("x",)))
    run = Run(wire(diagram, "x square", "square x"))
    with pytest.raises(RunFault, match="x: ") as caught:
        run.advance(20)
    assert caught.value.time == pytest.approx(1.0, abs=1e-5)
    assert run.tick in (1, 2)
    assert run.not_finite() == []
    assert all(np.shape(leaf) == (1,) for leaf in jax.tree.leaves(run.state["pace"]))
