"""Diagrams as Functional Mock-up Units: fmpy validates and runs them, with the outputs of the diagram's own run."""

import numpy as np
import pytest
from units import needs_compiler

import timlab as lab
from timlab import Diagram, Fmu, Interpreter, Run, write_fmu
from timlab.blocks.worlds._fmu_instance import CoSimulation
from timlab.compiler import draw_span
from timlab.engine import MAX_TICKS
from timlab.fmi._random import draw

pytestmark = [needs_compiler, pytest.mark.needs("motorgrad[fmi]")]
VERSIONS = ("2.0", "3.0")


def simulated(path, ticks, tick):
    """What fmpy records of a unit at the start and after each of its steps, by the names of outputs."""
    import fmpy
    from fmpy.validation import validate_fmu

    record = fmpy.simulate_fmu(str(path), stop_time=ticks * tick, output_interval=tick, step_size=tick)
    assert validate_fmu(str(path)) == []
    return {name: record[name][: ticks + 1] for name in record.dtype.names}


def mixed():
    """Inlets and outlets of all kinds and shapes, a state, noise and a slower block."""
    made = Diagram(tick=0.02)
    made.add("u", lab.Inlet([1.0, 0.5], shape=(2,)))
    made.add("on", lab.Inlet(kind="bool"))
    made.add("count", lab.Inlet(3, kind="int"))
    made.add("noise", lab.UniformNoise(every=2))
    made.add("gain", lab.MatrixGain(matrix=[[1.0, 2.0], [3.0, -1.0]]))
    made.add("level", lab.Integrator(0.25))
    made.connect("u", "gain")
    made.connect("noise", "level")
    for name, source, port in (("y", "gain", {"shape": (2,)}), ("z", "level", {}), ("b", "on", {"kind": "bool"})):
        made.add(name, lab.Outlet(**port))
        made.connect(source, name)
    made.add("n", lab.Outlet(kind="int"))
    made.connect("count", "n")
    return made


@pytest.mark.parametrize("version", VERSIONS)
def test_a_unit_gives_what_the_diagram_gives(version, tmp_path):
    found = simulated(write_fmu(mixed(), tmp_path / "mixed.fmu", version), 10, 0.02)
    record = Run(mixed()).advance(11)
    y = np.stack([found["y[0]"], found["y[1]"]], axis=1) if version == "2.0" else found["y"]
    np.testing.assert_array_equal(y, record["y.u"][0])
    np.testing.assert_array_equal(found["z"], record["z.u"][0])
    np.testing.assert_array_equal(found["b"], record["b.u"][0])
    np.testing.assert_array_equal(found["n"], record["n.u"][0])
    assert len(set(found["z"])) > 5


def waves(**settings):
    """A sine of 1 Hz, its integral, and the integral of an inlet at 1."""
    made = Diagram(tick=0.05, **settings)
    for name, block in {
        "one": lab.Inlet(1.0),
        "sine": lab.Sine(),
        "area": lab.Integrator(),
        "way": lab.Integrator(),
    }.items():
        made.add(name, block)
    for source, name in (("sine", "y"), ("area", "a"), ("way", "w")):
        made.add(name, lab.Outlet())
        made.connect(source, name)
    made.connect("sine", "area")
    made.connect("one", "way")
    return made


def check_waves(times, y, a, w, near):
    np.testing.assert_allclose(y, np.sin(2 * np.pi * times), rtol=0, atol=1e-6)
    np.testing.assert_allclose(a, (1 - np.cos(2 * np.pi * times)) / (2 * np.pi), rtol=0, atol=near)
    np.testing.assert_allclose(w, times, rtol=0, atol=near)


@pytest.mark.parametrize("version", VERSIONS)
def test_outputs_belong_to_the_end_of_a_step(version, tmp_path):
    import fmpy

    path = str(write_fmu(waves(), tmp_path / "waves.fmu", version))
    found = fmpy.simulate_fmu(path, stop_time=1.0, output_interval=0.1, step_size=0.1)  # of two ticks
    np.testing.assert_allclose(found["time"], 0.1 * np.arange(11), atol=1e-12)
    check_waves(found["time"], found["y"], found["a"], found["w"], 1e-5)
    outer = Diagram(tick=0.05)
    outer.add("unit", Fmu(path))
    record = Run(outer, watch=["unit.y", "unit.a", "unit.w"]).advance(21)
    y, a, w = (record[f"unit.{name}"][0] for name in "yaw")
    check_waves(record.times("unit.y"), y, a, w, 1e-5)
    for start, step in ((5.0, 0.05), (0.0, 0.07)):
        with pytest.raises(Exception, match="fmi"):
            fmpy.simulate_fmu(path, start_time=start, stop_time=start + 1.0, output_interval=step, step_size=step)


@pytest.mark.parametrize("version", VERSIONS)
def test_outputs_for_model_exchange_belong_to_their_time(version, tmp_path):
    import fmpy

    made = waves(solver="tsit5", precision="double")
    path = str(write_fmu(made, tmp_path / "waves.fmu", version, interface="model exchange"))
    found = fmpy.simulate_fmu(path, start_time=5.0, stop_time=6.0, output_interval=0.1, relative_tolerance=1e-9)
    check_waves(found["time"], found["y"], found["a"], found["w"] + 5.0, 1e-6)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_step_begins_where_the_last_ended(version, tmp_path):
    unit, variables = running(write_fmu(waves(), tmp_path / "waves.fmu", version), tmp_path)
    given, shown = [(variables["one"], 1.0)], [variables["w"]]
    unit.step(given, 0.0, 0.05)
    unit.step(given, 0.05, 0.1)
    np.testing.assert_allclose(unit.read(shown), [0.15], atol=1e-6)
    with pytest.raises(RuntimeError, match="DoStep"):
        unit.step(given, 0.4, 0.05)
    unit.close()


def running(path, folder):
    """A unit in co-simulation, and its variables by name."""
    import fmpy

    unit = fmpy.read_model_description(str(path))
    inside = fmpy.extract(str(path), str(folder / "unpacked"))
    return CoSimulation(unit, inside, [], 1), {variable.name: variable for variable in unit.modelVariables}


@pytest.mark.parametrize("version", VERSIONS)
def test_a_unit_makes_no_tick_after_the_last(version, tmp_path):
    run = Run(mixed())
    run.restore({**run.state, "tick": MAX_TICKS - 4})
    path = write_fmu(run, tmp_path / "late.fmu", version)
    assert len(simulated(path, 3, 0.02)["z"]) == 4
    with pytest.raises(Exception, match="DoStep"):
        simulated(path, 6, 0.02)


@pytest.fixture(scope="module")
def learned():
    """The policy of the chain after 2,000 decisions, alone; and the observations of the next 50."""
    run = Run(lab.example("chain"), watch=["world.observation"])
    run.advance(2000)
    alone = lab.extract(lab.example("chain"), ["policy"])
    alone.replace("world", lab.Inlet([0.0] * 6, shape=(6,)))
    policy = Run(alone)
    assert policy.restore_matching(run.state) == []
    return policy, run.advance(50)["world.observation"][0]


@pytest.mark.ci
@pytest.mark.parametrize("version", VERSIONS)
def test_a_learned_controller_acts_elsewhere_as_here(version, learned, tmp_path):
    policy, observations = learned
    path = write_fmu(policy, tmp_path / "chain.fmu", version)
    tick, outlet = policy.plan.tick, "policy action"
    unit, variables = running(path, tmp_path)
    names = [f"world[{n}]" for n in range(observations.shape[1])] if version == "2.0" else ["world"]
    own = policy.fork()
    actions, found = [], []
    for k, observation in enumerate(observations):
        parts = observation if version == "2.0" else [observation]
        given = list(zip([variables[name] for name in names], parts, strict=True))
        unit._write(given)
        found.append(unit.read([variables[outlet]])[0])
        unit.step(given, k * tick, tick)
        own["world.value"] = observation.tolist()
        actions.append(own.advance(1)[f"{outlet}.u"][0, 0])
    unit.close()
    np.testing.assert_array_equal(found, actions)
    assert 0 < np.mean(actions) < 1


def learner():
    made = lab.example("chain")
    made.add("reward", lab.Outlet())
    made.connect("world.reward", "reward")
    return made


@pytest.mark.ci
def test_a_learner_learns_elsewhere(tmp_path):
    made = learner()
    found = simulated(write_fmu(made, tmp_path / "learner.fmu"), 600, made.tick)
    rewards = Run(made).advance(601)["reward.u"][0]
    np.testing.assert_array_equal(found["reward"], rewards)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_unit_of_ours_is_a_block_again(version, tmp_path):
    path = write_fmu(mixed(), tmp_path / "mixed.fmu", version)
    outer = Diagram(tick=0.02)
    outer.add("unit", Fmu(str(path)))
    run = Run(outer, watch=["unit.z"])
    record = run.advance(8)
    np.testing.assert_array_equal(record["unit.z"][0], Run(mixed()).advance(8)["z.u"][0])
    state = run.state
    first = run.advance(5)["unit.z"]
    run.restore(state)
    np.testing.assert_array_equal(run.advance(5)["unit.z"], first)
    run.close()


def test_an_unwired_input_has_all_its_start_values(tmp_path):
    made = Diagram(tick=0.1)
    for name, inlet in (
        ("u", lab.Inlet([1.0, 2.0, 3.0], shape=(3,))),
        ("on", lab.Inlet([True, False], shape=(2,), kind="bool")),
        ("n", lab.Inlet(7, kind="int")),
    ):
        made.add(name, inlet)
        made.add(f"{name} out", lab.Outlet(inlet.shape, inlet.kind))
        made.connect(name, f"{name} out")
    path = str(write_fmu(made, tmp_path / "unit.fmu", "3.0"))
    outer = Diagram(tick=0.1)
    outer.add("unit", Fmu(path))
    outer.add("other", Fmu(path, start_values="u = [4.0, 5.0, 6.0]\non = true\nn = 8"))
    watch = [f"{name}.{port}_out" for name in ("unit", "other") for port in ("u", "on", "n")]
    for run in (Run(outer, watch=watch), Interpreter(outer, watch=watch)):
        record = run.advance(3)
        for name, u, on, n in (("unit", [1, 2, 3], [1, 0], 7), ("other", [4, 5, 6], [1, 1], 8)):
            np.testing.assert_array_equal(record[f"{name}.u_out"][0], np.tile(u, (3, 1)))
            np.testing.assert_array_equal(record[f"{name}.on_out"][0], np.tile(on, (3, 1)))
            np.testing.assert_array_equal(record[f"{name}.n_out"][0], [n] * 3)
    for start, told in (("[1.0, 2.0]", "u = .*: must be one value at the start, or 3"), ("[nan, 1, 1]", "finite")):
        with pytest.raises(ValueError, match=told):
            Fmu(path, start_values=f"u = {start}")


@pytest.mark.ci
def test_a_unit_keeps_its_time_as_the_run_does(tmp_path):
    np.savez(tmp_path / "table.npz", when=[0.0, 0.25, 0.26, 1.0], y=[3.0, 1.0, 4.0, 2.0])
    table = {"columns": ("y",), "time": "when", "after": "repeat", "between": "linear"}
    made = Diagram(tick=0.01)
    blocks: dict[str, lab.Block] = {
        "wave": lab.Sine(frequency=0.1),
        "chirp": lab.Chirp(1.0, 0.1, 1.6, 2e6),
        "pulse": lab.Pulse(10.0),
        "jump": lab.Step(1e6 + 0.25),
        "ramp": lab.Ramp(0.7, 1e6),
        "formula": lab.Expression("sin(2*pi*3*t) + floor(10*t)", ()),
        "table": lab.DataFile(str(tmp_path / "table.npz"), **table),
        "mode": lab.StateMachine(transitions=(("*", "since >= 0.1", "on"), ("on", "t < 1000000.3", "off"))),
    }
    for name, block in blocks.items():
        (port, given), *_ = block.outputs.items()
        made.add(name, block)
        made.add(f"{name} out", lab.Outlet(kind=given.kind))
        made.connect(f"{name}.{port}", f"{name} out")
    made.connect("wave", "mode.u")
    run = Run(made)
    run.restore({**run.state, "tick": 10**8})
    path = write_fmu(run, tmp_path / "late.fmu")
    record, found = run.advance(51), simulated(path, 50, 0.01)
    for name in (f"{name} out" for name in blocks):
        np.testing.assert_allclose(found[name], record[f"{name}.u"][0], rtol=2e-7, atol=2e-7, err_msg=name)
        assert len(set(found[name])) > 1


def test_its_random_numbers_are_jaxs():
    for tick in (0, 127, 128, 1000):
        span = np.asarray(draw_span(7, 123456789, tick // 128, 3))
        np.testing.assert_array_equal(draw(7, 123456789, np.uint32(tick), 3), span[tick % 128])


def swing():
    """A pendulum that is pushed by an inlet and by a sine, in double precision."""
    made = Diagram(tick=0.05, solver="tsit5", relative_tolerance=1e-11, absolute_tolerance=1e-12, precision="double")
    blocks = {
        "push": lab.Inlet(0.3),
        "wind": lab.Sine(0.2, 0.5),
        "pull": lab.Expression("p + w - 9.81 * sin(a)", ("p", "w", "a")),
    }
    for name, block in {**blocks, "speed": lab.Integrator(0.1), "angle": lab.Integrator(1.0)}.items():
        made.add(name, block)
    for name in ("y", "a"):
        made.add(name, lab.Outlet())
    for wire in ("push pull.p", "wind pull.w", "angle pull.a", "pull speed", "speed angle", "angle a", "pull y"):
        made.connect(*wire.split())
    return made


@pytest.mark.ci
@pytest.mark.parametrize("version", VERSIONS)
def test_another_simulator_integrates_a_unit_for_model_exchange(version, tmp_path):
    import fmpy
    from fmpy.validation import validate_fmu

    path = write_fmu(swing(), tmp_path / "swing.fmu", version, interface="model exchange")
    assert validate_fmu(str(path)) == []
    found = fmpy.simulate_fmu(str(path), stop_time=2, output_interval=0.05, relative_tolerance=1e-10)
    record = Run(swing()).advance(41)
    assert fmpy.read_model_description(str(path)).coSimulation is None
    for name in ("a", "y"):
        np.testing.assert_allclose(found[name][:41], record[f"{name}.u"][0], rtol=0, atol=1e-7)
    outer = Diagram(tick=0.05)
    outer.add("unit", Fmu(str(path), substeps=50))
    again = Run(outer, watch=["unit.a"]).advance(21)["unit.a"][0]
    np.testing.assert_allclose(again, record["a.u"][0, :21], rtol=0, atol=1e-5)


def test_model_exchange_refuses_what_is_not_continuous(tmp_path):
    path = tmp_path / "x.fmu"
    with pytest.raises(ValueError, match=r"precision = 'single': must be 'double', to be exported for model exchange"):
        write_fmu(mixed(), path, interface="model exchange")
    for block in (lab.UnitDelay(), lab.Relay(), lab.Integrator(limited=True)):
        made = swing()
        made.add("other", block)
        made.connect("angle", "other")
        with pytest.raises(ValueError, match=r"other = .*: must be without memory, random numbers or jumps"):
            write_fmu(made, path, interface="model exchange")


def test_sources_alone_and_equal_units(tmp_path):
    from fmpy.validation import validate_fmu

    first = write_fmu(mixed(), tmp_path / "a.fmu", compiled=False).read_bytes()
    assert write_fmu(mixed(), tmp_path / "a.fmu", compiled=False).read_bytes() == first
    assert validate_fmu(str(tmp_path / "a.fmu")) == []


def test_what_cannot_be_exported_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"world = 'Body': must be a block that is compiled"):
        write_fmu(lab.example("hopper"), tmp_path / "hopper.fmu")
    with pytest.raises(ValueError, match=r"seeds = \[0, 1\]: must be a single one"):
        write_fmu(Run(mixed(), seeds=2), tmp_path / "mixed.fmu")
    with pytest.raises(ValueError, match=r"must be a name that ends in .fmu"):
        write_fmu(mixed(), tmp_path / "mixed.zip")
    made = mixed()
    made.add("pulse", lab.Pulse())
    made.add("ramp", lab.Integrator())
    made.connect("pulse", "ramp")
    with pytest.raises(ValueError, match=r"pulse = 'Pulse': must be a source that is held within a tick"):
        write_fmu(made, tmp_path / "mixed.fmu")
    assert not list(tmp_path.iterdir())
    made.replace("pulse", lab.Pulse(period=0.02))
    write_fmu(made, tmp_path / "mixed.fmu", compiled=False)
