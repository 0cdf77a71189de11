"""What depends on time, 10 s, 10³ s and 10⁶ s after the start, against closed forms in extended precision."""

import jax
import numpy as np
import pytest
from block_driver import drive, of

from timlab import Diagram, Run
from timlab.diagram import as_written

TICK, STARTS = 0.01, (10, 10**3, 10**6)  # s
TICKS = 60
FINE = np.longdouble(1e-9)  # s: more than rounding takes from a time, and less than anything here lasts
TURN = 2 * np.longdouble("3.14159265358979323846264338327950288")


def exact(text):
    """A decimal in extended precision."""
    return np.longdouble(text)


def on(t, frequency, duty, delay="0"):
    """Whether a pulse is high."""
    return (exact(frequency) * (t - exact(delay)) + FINE) % 1 < exact(duty)


SWEEP = exact("0.5") * exact("1.5") / exact(2e6)  # half the change of the frequency, per second
WAVES = {
    "sine": (of("sine", frequency=3.0), lambda t: np.sin(TURN * 3 * t)),
    "slow sine": (of("sine", frequency=0.1, phase=0.5), lambda t: np.sin(TURN * exact("0.1") * t + exact("0.5"))),
    "chirp": (
        of("chirp", first=0.1, last=1.6, duration=2e6),
        lambda t: np.sin(TURN * t * (exact("0.1") + SWEEP * t)),
    ),
    "formula": (of("expression", "sin(2*pi*3*t)", ()), lambda t: np.sin(TURN * 3 * t)),
    "constant": (
        of("expression", "cos(2*pi*f*t)", (), ("f",), 0.1),
        lambda t: np.cos(TURN * exact("0.1") * t),
    ),
    "saw": (of("expression", "mod(t, 0.1)", ()), lambda t: (t + FINE) % exact("0.1") - FINE),
}
JUMPS = {
    "pulse": (of("pulse", 10.0), lambda t: on(t, 10, "0.5")),
    "late pulse": (of("pulse", 3.0, 0.3, 0.1), lambda t: on(t, 3, "0.3", "0.1")),
    "slow pulse": (of("pulse", 0.1, 0.7), lambda t: on(t, "0.1", "0.7")),
    "formula jumps": (of("expression", "mod(t, 0.1) < 0.05", ()), lambda t: on(t, 10, "0.5")),
    "formula counts": (of("expression", "floor(t / 0.05)", ()), lambda t: np.floor(t / exact("0.05") + FINE)),
}


def soon(start):
    """What a source does soon after a time: its block, and its closed form."""
    when = repr(start + 0.25)
    return {
        "step": (of("step", at=start + 0.25), lambda t: t >= exact(when) - FINE),
        "wait": (of("expression", f"t >= {when}", ()), lambda t: t >= exact(when) - FINE),
        "ramp": (of("ramp", start=start, slope=0.7), lambda t: exact("0.7") * np.maximum(t - start, 0)),
    }


@pytest.fixture(scope="module", params=["single", "double"])
def seen(request):
    """The precision, and for each start the times and the outputs by name, of all sources in one diagram."""
    blocks = {name: block for name, (block, _) in {**WAVES, **JUMPS}.items()}
    blocks |= {f"{name} {start}": block for start in STARTS for name, (block, _) in soon(start).items()}
    diagram = Diagram(TICK, precision=request.param)
    for name, block in blocks.items():
        diagram.add(name, block)
    run, found = Run(diagram, watch=[f"{name}.y" for name in blocks]), {}
    state = run.state
    for start in STARTS:
        first = round(start / TICK)
        run.restore({**state, "tick": first})
        record = run.advance(TICKS)
        times = np.arange(first, first + TICKS).astype(np.longdouble) * exact(repr(TICK))
        found[start] = times, {name: record[f"{name}.y"][0] for name in blocks}
    return request.param, found


@pytest.mark.parametrize("start", STARTS)
def test_waves_keep_their_phase(start, seen):
    precision, found = seen
    times, outputs = found[start]
    for name, (_, form) in WAVES.items():
        near = 2e-6 if precision == "single" else 1e-13 * (1 + start)
        assert np.abs(outputs[name] - form(times)).max() < near, name
    ramp = soon(start)["ramp"][1](times)
    np.testing.assert_allclose(outputs[f"ramp {start}"], ramp.astype(float), rtol=1e-6, atol=1e-13 * start)


@pytest.mark.parametrize("start", STARTS)
def test_jumps_are_at_their_ticks(start, seen):
    _, found = seen
    times, outputs = found[start]
    for name, (_, form) in JUMPS.items():
        np.testing.assert_array_equal(outputs[name], form(times).astype(outputs[name].dtype), name)
    for name in ("step", "wait"):
        expected = soon(start)[name][1](times)
        assert 0 < expected.sum() < TICKS
        np.testing.assert_array_equal(outputs[f"{name} {start}"], expected, name)


def integral(source, seconds, start=0.0, port="y", **settings):
    """The integral of a source that jumps within ticks of 0.1 s."""
    diagram = Diagram(0.1, **settings)
    diagram.add("source", source)
    diagram.add("integral", of("integrator"))
    diagram.connect(f"source.{port}", "integral")
    run = Run(diagram, watch=["integral.y"])
    run.restore({**run.state, "tick": round(start / 0.1)})
    return run.advance(round(seconds / 0.1) + 1)["integral.y"][0, -1]


@pytest.mark.parametrize("solver", ["rk4", pytest.param("tsit5", marks=pytest.mark.ci)])
def test_a_pulse_does_not_drift(solver):
    assert abs(integral(of("pulse", 10.0), 60.0, precision="double", solver=solver) - 30) < 1e-9


@pytest.mark.parametrize(("precision", "near"), [("single", 1e-5), ("double", 1e-7)])
def test_jumps_within_ticks_are_found_late_in_a_run(precision, near):
    pulse = of("pulse", 10.0, 0.25, 0.03)
    assert abs(integral(pulse, 1.0, 1e6, precision=precision) - 0.25) < near


TABLE = {"when": np.array([0.0, 0.25, 0.26, 1.0]), "y": np.array([3.0, 1.0, 4.0, 2.0])}


@pytest.mark.parametrize("precision", ["single", "double"])
def test_a_data_file_keeps_its_times(precision, tmp_path):
    base = 1e6 + np.arange(100) * 0.01  # closer than single precision tells apart
    np.savez(tmp_path / "a.npz", when=TABLE["when"], y=TABLE["y"])
    np.savez(tmp_path / "b.npz", when=base, y=np.arange(100.0))
    diagram = Diagram(TICK, precision=precision)
    for name, file, settings in (
        ("hold", "a", {"after": "repeat"}),
        ("line", "a", {"after": "repeat", "between": "linear"}),
        ("late", "b", {}),
        ("late line", "b", {"between": "linear"}),
    ):
        diagram.add(name, of("data file", str(tmp_path / f"{file}.npz"), ("y",), time="when", **settings))
    run = Run(diagram, watch=[f"{name}.y" for name in diagram.nodes])
    record, state = None, run.state
    for start in STARTS:
        run.restore({**state, "tick": round(start / TICK)})
        record = run.advance(100)
        parts = np.arange(100) * TICK
        row = np.searchsorted(TABLE["when"], parts + 1e-9, side="right") - 1
        np.testing.assert_array_equal(record["hold.y"][0], TABLE["y"][row])
        np.testing.assert_allclose(record["line.y"][0], np.interp(parts, TABLE["when"], TABLE["y"]), atol=2e-5)
    assert record is not None
    np.testing.assert_array_equal(record["late.y"][0], np.arange(100))
    np.testing.assert_allclose(record["late line.y"][0], np.arange(100), atol=1e-4)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_the_time_in_a_state_does_not_drift(precision):
    """Nor stand still, as a sum of ticks does in single precision after 2.6·10⁵ s."""
    lengths = ("0.57", "10.01", "400000.07")
    diagram = Diagram(TICK, precision=precision)
    for length in lengths:
        rows = (("a", f"since >= {length}", "b"),)
        diagram.add(length.replace(".", "_"), of("state machine", ("a", "b"), rows, reads=()))
    run = Run(diagram, watch=[f"{name}.state" for name in diagram.nodes])
    state = run.state
    for name, length in zip(diagram.nodes, lengths, strict=True):
        due = round(float(length) / TICK)
        for block in state["blocks"].values():
            block["state"][1][...] = due - 5
        run.restore({**state, "tick": 10**8 - 5})
        turned = run.advance(10)[f"{name}.state"][0]
        np.testing.assert_array_equal(turned, np.arange(10) > 5)


def test_a_time_is_compared_with_a_signal_as_signals_are():
    given = drive(of("expression", "t >= u", ("u",)), 6, u=np.full(6, 0.3))["y"]
    np.testing.assert_array_equal(given, np.arange(6) >= 3)


def test_numbers_count_as_they_were_written():
    numbers = [0.1, 1.3, 3.0, 1000.7, 0.00025, 999999.9, -7.77, 0.0, 123456.0]
    with jax.enable_x64(True):
        found = as_written(np.array(numbers, np.float32))
        np.testing.assert_allclose(found, numbers, rtol=3e-16)  # XLA multiplies by the inverse of a constant
        others = np.array([1 / 3, np.pi, 1e-30, 3e38], np.float32)
        np.testing.assert_allclose(as_written(others), others.astype(float), rtol=6e-8)
        np.testing.assert_array_equal(as_written(others.astype(float)), others.astype(float))
