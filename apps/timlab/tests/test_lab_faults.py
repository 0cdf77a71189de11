"""What stops a run, and says where and when; what is reached without end is held, not lost."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from lab_examples import wire
from timlab import (
    Compare,
    Constant,
    Diagram,
    Expression,
    Gain,
    Integrator,
    Interpreter,
    Lag,
    Ramp,
    Relay,
    Run,
    RunFault,
    Saturation,
    Sine,
    Step,
    Sum,
    Switch,
    Timeline,
    UnitDelay,
)
from timlab.compiler._loops import solved

EXACT = {"precision": "double", "relative_tolerance": 1e-10, "absolute_tolerance": 1e-12}


def made(blocks, *wires, tick=0.1, **settings) -> Diagram:
    diagram = Diagram(tick, **settings)
    for name, block in blocks.items():
        diagram.add(name, block)
    return wire(diagram, *wires)


def square(start: float = 2.0, **settings) -> Diagram:
    """x' = x², whose solution ends at the inverse of the start."""
    return made({"x": Integrator(start), "q": Expression("x^2", ("x",))}, "x q.x", "q x", **settings)


def ball(kept: float = 0.8, pull=None, limited: bool = False, above: bool = False, **settings) -> Diagram:
    """A ball from 5 m that keeps some of its speed. Limits of its height are what docs/lab.md advised.
    It is reset where it no longer is above the ground, or where it reaches it.
    """
    limits = {"low": 0.0, "high": 100.0, "limited": True} if limited else {}
    blocks = {
        **{"gravity": pull or Constant(-10.0)},
        **{"speed": Integrator(reset="falling" if above else "rising", external=True)},
        **{"height": Integrator(5.0, **limits), "down": Compare(">" if above else "<="), "back": Gain(-kept)},
    }
    bounce = ("height down.u1", "down speed.reset", "speed back", "back speed.initial")
    return made(blocks, "gravity speed.u", "speed height", *bounce, **settings)


def relay(drift, **settings) -> Diagram:
    """x' = r + drift, with r = −1 where x ≥ 0, else 1."""
    blocks = {"drift": drift, "r": Relay(0, 0, off=1.0, on=-1.0), "sum": Sum("++"), "x": Integrator(0.05)}
    return made(blocks, "x r", "r sum.u1", "drift sum.u2", "sum x", **settings)


@pytest.mark.parametrize("solver", ["rk4", pytest.param("tsit5", marks=pytest.mark.ci)])
def test_the_block_the_time_and_the_seed_are_named(solver):
    """Two seeds of three end, the third at the earliest time."""
    starts = np.array([0.1, 2.0, 1.0])
    run = Run(square(solver=solver), seeds=[4, 8, 6], sweep={"x.initial": starts}, watch=["x.y"])
    with pytest.raises(RunFault, match=r"in seed 8.*on_fault=\"warn\"") as caught:
        run.advance(30)
    fault = caught.value
    assert (fault.problem.path, fault.seed) == ("x", 8)
    assert solver == "tsit5" or fault.kind == "not finite"  # others may find that steps become too short
    assert run.tick == fault.tick == fault.record.ticks
    assert np.isfinite(fault.record["x.y"]).all()
    if solver == "tsit5":
        assert fault.time == pytest.approx(0.5, abs=1e-4)
    with pytest.raises(RunFault) as again:
        run.advance(1)  # it stays there
    assert again.value.tick == fault.tick


def test_who_goes_on_knowingly_is_warned_once():
    run = Run(square(on_fault="warn"), watch=["x.y"])
    with pytest.warns(RuntimeWarning, match="x: its state becomes infinite at tick 6") as told:
        record = run.advance(30)
    assert len(told) == 1
    assert record.ticks == run.tick == 30
    assert not np.isfinite(record["x.y"][0, 10:]).any()
    run.advance(5)
    assert [problem.path for problem in run.warnings] == ["x"]


def test_a_formula_without_a_value_is_named_with_its_input():
    blocks = {"t": Ramp(1.0), "q": Expression("sin(t)/t", ("t",)), "x": Integrator()}
    for engine in (Run, Interpreter):
        run = engine(made(blocks, "t q.t", "q x"), watch=["q.y"])
        with pytest.raises(RunFault, match=r"q\.y: becomes NaN at tick 0 \(0 s\)\. It begins here: its input t = 0"):
            run.advance(3)


def test_a_discrete_state_counts_and_the_past_is_kept():
    """A number that doubles: 2 ** 128 is infinite in single precision."""
    blocks = {"x": UnitDelay(1.0), "twice": Gain(2.0)}
    timeline = Timeline(Run(made(blocks, "x twice", "twice x"), watch=["x.y"]), every=50)
    with pytest.raises(RunFault, match=r"twice\.y: becomes infinite at tick 127") as caught:
        timeline.advance(200)
    np.testing.assert_array_equal(caught.value.record["x.y"][0], 2.0 ** np.arange(127))
    assert (timeline.tick, timeline.end) == (127, 127)
    timeline.seek(60)
    assert timeline.advance(1)["x.y"][0, 0] == 2.0**60


@pytest.mark.ci
@pytest.mark.parametrize("precision", ["single", "double"])
def test_a_part_that_is_too_fast_for_the_solver_is_named(precision):
    blocks = {"one": Constant(1.0), "fast": Lag(1e-7)}
    diagram = made(blocks, "one fast", tick=1.0, solver="tsit5", precision=precision)
    with pytest.raises(RunFault, match=r'fast: at .* s .*solver="rodas5p"') as caught:
        Run(diagram).advance(3)
    assert caught.value.kind == "limit"
    diagram.solver = "rodas5p"
    assert Run(diagram, watch=["fast.y"]).advance(2)["fast.y"][0, 1] == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("limited", [False, pytest.param(True, marks=pytest.mark.ci)])
def test_a_ball_comes_to_rest_and_lifts_off_again(limited):
    """It rests after 9 s, and lies until what pulls it down pulls it up, at 10.25 s."""
    diagram = ball(limited=limited, pull=Step(10.25, -10.0, 1.0), tick=0.5, solver="tsit5", **EXACT)
    record = Run(diagram, watch=["height.y", "speed.y"]).advance(26)
    times, high, speed = record.times("height.y"), record["height.y"][0], record["speed.y"][0]
    rests = (times > 9) & (times < 10.25)
    np.testing.assert_allclose(high[rests], 0, atol=1e-15)
    np.testing.assert_array_equal(speed[rests], 0)
    up = np.maximum(times[times > 10] - 10.25, 0)
    np.testing.assert_allclose(high[times > 10], up**2 / 2, atol=1e-12)


@pytest.mark.ci
def test_a_ball_rests_in_single_precision_and_many_bounces_are_no_limit():
    run = Run(ball(tick=0.5, solver="tsit5"), seeds=2, sweep={"back.gain": [-0.95, -0.4]}, watch=["height.y"])
    record = run.advance(90)
    times, high = record.times("height.y"), record["height.y"]
    for row, kept in enumerate((0.95, 0.4)):
        np.testing.assert_allclose(high[row, times > 1 + 2 * kept / (1 - kept)], 0, atol=1e-6)


def fall(kept: float, time: float) -> float:
    """The height of a ball that bounces, by the parabolas between its bounces."""
    begins, speed = 1.0, 10 * kept
    if time < begins:
        return 5 - 5 * time**2
    while speed > 1e-12 and time >= begins + speed / 5:
        begins, speed = begins + speed / 5, speed * kept
    return max(speed * (time - begins) - 5 * (time - begins) ** 2, 0)


@pytest.mark.parametrize("above", [False, pytest.param(True, marks=pytest.mark.ci)])
@pytest.mark.parametrize("precision", ["single", pytest.param("double", marks=pytest.mark.ci)])
def test_a_ball_that_keeps_little_of_its_speed_comes_to_rest(precision, above):
    """It fell through the ground: its last hops are lower than roundings of the place at which it is found there."""
    keeps = np.array([0.5, 0.2, 0.1, 0.05, 0.01, 1e-4, 0.0])
    diagram = ball(above=above, tick=0.1, solver="tsit5", precision=precision)
    record = Run(diagram, 7, {"back.gain": -keeps}, watch=["height.y", "speed.y"]).advance(34)
    exact = [[fall(kept, time) for time in record.times("height.y")] for kept in keeps]
    np.testing.assert_allclose(record["height.y"], exact, atol=3e-6 if precision == "single" else 1e-14)
    np.testing.assert_array_equal(record["speed.y"][:, -1], 0)


@pytest.mark.ci
@pytest.mark.parametrize("kept", [0.05, 0.0])
def test_the_interpreter_lets_a_ball_rest_too(kept):
    seen = Interpreter(ball(kept, tick=0.1, solver="tsit5"), watch=["height.y"]).advance(13)["height.y"][0]
    np.testing.assert_allclose(seen, [fall(kept, 0.1 * tick) for tick in range(13)], atol=3e-6)


def test_coupled_relays_slide():
    """Filippov: A r + d = 0. With the second A, both were misjudged, and x1 drifted away while its relay said +1."""
    both, drift = np.array([[[1, 0.3], [0.2, 1]], [[1, -0.6], [0.6, 1]]]), np.array([0.4, -0.3])
    blocks, wires = {}, []
    for own, other in ((0, 1), (1, 0)):
        blocks |= {f"x{own}": Integrator(0.05 - 0.03 * own), f"r{own}": Relay(0, 0, off=1.0, on=-1.0)}
        blocks |= {f"sum{own}": Sum("+++"), f"d{own}": Constant(drift[own]), f"A{own}": Gain()}
        wires += [f"x{own} r{own}", f"r{own} sum{own}.u1", f"r{other} A{own}", f"A{own} sum{own}.u2"]
        wires += [f"d{own} sum{own}.u3", f"sum{own} x{own}"]
    sweep = {"A0.gain": both[:, 0, 1], "A1.gain": both[:, 1, 0]}
    run = Run(made(blocks, *wires, solver="tsit5"), 2, sweep, watch=["r0.y", "r1.y", "x0.y", "x1.y"])
    record = run.advance(12)
    for seed, coupling in enumerate(both):
        for own, share in enumerate(np.linalg.solve(coupling, -drift)):
            np.testing.assert_allclose(record[f"r{own}.y"][seed, 5:], share, atol=2e-5)
            np.testing.assert_allclose(record[f"x{own}.y"][seed, 5:], 0, atol=1e-6)


@pytest.mark.parametrize("solver", ["tsit5", pytest.param("rodas5p", marks=pytest.mark.ci)])
def test_a_relay_without_hysteresis_slides(solver):
    """Filippov: x stays at 0, and the relay's equivalent output is −0.8 sin(πt)."""
    record = Run(relay(Sine(0.8, 0.5), solver=solver, **EXACT), watch=["x.y", "r.y"]).advance(40)
    times = record.times("x.y")[3:]
    np.testing.assert_allclose(record["x.y"][0, 3:], 0, atol=1e-12)
    # the share is that of the last step, which is at most a sixteenth of the tick
    np.testing.assert_allclose(
        record["r.y"][0, 3:], -0.8 * np.sin(np.pi * times), atol=0.8 * np.pi * 0.1 / 16 / 2 * 1.1
    )


@pytest.mark.ci
def test_a_relay_leaves_where_it_cannot_hold():
    """x' = r + 2 sin(ωt) slides until 2 sin(ωt) = 1."""
    record = Run(relay(Sine(2.0, 0.1), solver="tsit5", **EXACT), watch=["x.y", "r.y"]).advance(30)
    times, rate = record.times("x.y"), 0.2 * np.pi
    leaves = np.arcsin(0.5) / rate
    after = 2 / rate * (np.cos(rate * leaves) - np.cos(rate * times)) - (times - leaves)
    np.testing.assert_allclose(record["x.y"][0, 2:], np.where(times < leaves, 0, after)[2:], atol=1e-5)
    assert (record["r.y"][0, times > leaves + 0.1] == -1).all()


@pytest.mark.ci
def test_a_fast_lag_under_a_relay_in_a_long_tick():
    blocks = {"x": Lag(0.01, initial=0.3), "r": Relay(0, 0, off=1.0, on=-1.0)}
    run = Run(made(blocks, "x r", "r x", tick=5.0, solver="dopri8"), watch=["x.y", "r.y"])
    record = run.advance(5)
    for address in ("x.y", "r.y"):
        np.testing.assert_allclose(record[address][0, 1:], 0, atol=1e-4)
    state, after = run.state, run.advance(2)["x.y"]
    run.restore(state)
    np.testing.assert_array_equal(run.advance(2)["x.y"], after)


@pytest.mark.ci
def test_what_chatters_is_bounded_by_the_tick_and_told():
    blocks = {"over": Compare(">="), "down": Constant(-1.0), "up": Constant(1.0), "rate": Switch()}
    wires = ("x over.u1", "over rate.condition", "down rate.on", "up rate.off", "rate x")
    run = Run(made({"x": Integrator(0.25), **blocks}, *wires, solver="tsit5"), watch=["x.y"])
    with pytest.warns(RuntimeWarning, match="over: chatters from tick 2 .*Relay") as told:
        record = run.advance(20)
    assert len(told) == 1
    assert np.abs(record["x.y"][0, 3:]).max() < 0.1 / 100 * 1.1


def diode(peak: float, **settings) -> Diagram:
    """A diode behind 1 kΩ: v = V − R i, i = 1 pA (exp(v / 25 mV) − 1)."""
    blocks = {"V": Sine(peak, 1.0), "v": Sum("+-"), "i": Expression("1e-12*(exp(v/0.025)-1)", ("v",)), "R": Gain(1e3)}
    return made(blocks, "V v.u1", "R v.u2", "v i.v", "i R", loops="solve", **settings)


@pytest.mark.parametrize("precision", ["single", pytest.param("double", marks=pytest.mark.ci)])
def test_a_diode_conducts(precision):
    record = Run(diode(5.0, precision=precision), watch=["v.y"]).advance(10)
    exact: list[Any] = [
        brentq(lambda v, V=V: V - 1e-9 * (np.exp(v / 0.025) - 1) - v, -6, 1, xtol=1e-15)
        for V in 5 * np.sin(2 * np.pi * record.times("v.y"))
    ]
    np.testing.assert_allclose(record["v.y"][0], exact, atol=1e-5 if precision == "single" else 1e-13)


def test_the_solution_of_a_loop_has_a_derivative():
    """x = a − exp(x)/10 has x' = 1 / (1 + exp(x)/10) in a, which a solver for stiff systems asks for."""

    def output(a):
        return solved(lambda x: a - jnp.exp(x) / 10, lambda x: x, jnp.zeros(1))

    x = brentq(lambda x: 1 - np.exp(x) / 10 - x, 0, 1)
    np.testing.assert_allclose(output(1.0), x, rtol=1e-6)
    np.testing.assert_allclose(jax.jacfwd(output)(1.0), 1 / (1 + np.exp(x) / 10), rtol=1e-6)


@pytest.mark.ci
@pytest.mark.parametrize("solver", ["rk4", "tsit5", "rodas5p"])
def test_a_saturation_in_a_loop(solver):
    """y = clip(k (u − y)) is clip(k u / (1 + k))."""
    blocks = {"u": Sine(2.0, 1.0), "e": Sum("+-"), "k": Gain(50.0), "y": Saturation(), "x": Integrator()}
    wires = ("u e.u1", "y e.u2", "e k", "k y", "y x")
    record = Run(made(blocks, *wires, loops="solve", solver=solver, **EXACT), watch=["y.y"]).advance(16)
    exact = np.clip(50 / 51 * 2 * np.sin(2 * np.pi * record.times("y.y")), -1, 1)
    np.testing.assert_allclose(record["y.y"][0], exact, atol=1e-13)


def test_a_loop_without_a_solution_is_named():
    run = Run(made({"x": Expression("exp(x)", ("x",))}, "x x.x", loops="solve"), watch=["x.y"])
    with pytest.raises(RunFault, match=r"x: at 0 s \(tick 0\): Newton's method finds no solution .* a lag or a delay"):
        run.advance(2)
