"""Sinks: what they show is what they saw."""

import dataclasses
import functools

import numpy as np
import pytest
from block_driver import of
from pyarrow import parquet

from timlab import BLOCKS, Diagram, Run
from timlab.blocks._figure import MAX_LINE_POINTS, thinned
from timlab.blocks._scopes import Viewer

TICK = 0.01


WAVES = {
    "a": of("sine", frequency=(1.0, 2.0), shape=(2,)),
    "b": of("normal noise", deviation=0.2, shape=(2,)),
}


@functools.cache
def waves():
    """A run of the waves on all that shows them, of three seeds: one program."""
    diagram = Diagram(TICK)
    sinks = {
        "scope": of("scope", ("a", "b"), (2,)),
        "recorder": of("recorder", ("a", "b"), (2,)),
        "XY portrait": of("XY portrait", shape=(2,), across=(-2.0, 2.0)),
        "histogram": of("histogram", (2,), 5, (-0.5, 0.5)),
        "raster": of("raster", shape=(2,)),
    }
    ports = {"XY portrait": ("x", "y"), "histogram": ("u",), "raster": ("u",)}
    for name, block in {**WAVES, **sinks}.items():
        diagram.add(name, block)
    for name in sinks:
        given = ports.get(name, ("a", "b"))
        for source, port in zip("ab" if len(given) == 2 else "b", given, strict=True):
            diagram.connect(source, f"{name}.{port}")
    return sinks, Run(diagram, 3).advance(200)


def seen(sink, sources, ticks=200, seeds=3):
    """A record of a sink named "sink" whose inputs are these sources."""
    diagram = Diagram(TICK)
    diagram.add("sink", sink)
    for port, source in sources.items():
        diagram.add(port, source)
        diagram.connect(port if len(source.outputs) == 1 else f"{port}.parameters", f"sink.{port}")
    return Run(diagram, seeds).advance(ticks)


def example(name):
    """A sink of every kind, with a record and its name there."""
    sinks, record = waves()
    if name in sinks:
        return sinks[name], record, name
    if name == "policy map":
        sink = of(name, 3, 2, forces=((1, 0), (0, 1), (0, 0)))
        numbers = (0.0, 0.0, 1.0, 0.5, -1.0, 0.5, *np.log([0.2, 0.4, 0.3, 0.3, 0.1, 0.1]))
        parameters = of("constant", numbers, (12,))
        return sink, seen(sink, {"parameters": parameters, "place": WAVES["a"]}), "sink"
    sink = of(name, shape=(2,))
    return sink, seen(sink, {"u": WAVES["b"]}), "sink"


VIEWERS = [name for name, kind in BLOCKS.items() if issubclass(kind, Viewer)]


@pytest.mark.representatives("histogram", "raster")
@pytest.mark.parametrize("name", VIEWERS)
def test_shows_what_it_saw_as_a_picture(name):
    sink, record, path = example(name)
    figure = sink.figure(record, path)
    picture = figure._repr_png_()
    assert picture[:8] == b"\x89PNG\r\n\x1a\n"
    assert figure.axes[0].get_xlabel()
    assert figure.axes[0].get_ylabel() or name in ("scope", "recorder")
    assert sink.drawing
    with pytest.raises(ValueError, match=r"unknown signal 'elsewhere\."):
        sink.figure(record, "elsewhere")


def test_scope_of_many_seeds_is_median_and_quartiles():
    sink, record, _ = example("scope")
    axes = sink.figure(record, "scope").axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    assert list(lines) == ["a[0]", "a[1]", "b[0]", "b[1]"]
    np.testing.assert_allclose(lines["b[1]"].get_ydata(), np.median(record["scope.b"][..., 1], axis=0))
    np.testing.assert_allclose(lines["b[1]"].get_xdata(), np.arange(200) * TICK)
    assert len(axes.collections) == 4
    assert axes.get_title(loc="left") == "median and quartiles of 3 seeds"
    one = dataclasses.replace(record, signals={address: signal[:1] for address, signal in record.signals.items()})
    axes = sink.figure(one, "scope").axes[0]
    np.testing.assert_array_equal(axes.lines[2].get_ydata(), one["scope.b"][0, :, 0])
    assert not axes.collections


def test_scope_with_a_sample_period_stands_at_its_own_times():
    sink = of("scope", ("u",), every=4)
    record = seen(sink, {"u": of("ramp")}, seeds=1)
    line = sink.figure(record, "sink").axes[0].lines[0]
    np.testing.assert_allclose(line.get_xdata(), np.arange(0, 200, 4) * TICK)
    np.testing.assert_allclose(line.get_ydata(), np.arange(0, 200, 4) * TICK, atol=1e-6)


def test_portrait_has_a_path_for_each_seed_and_element():
    sink, record, path = example("XY portrait")
    axes = sink.figure(record, path).axes[0]
    paths = axes.lines[::2]
    assert len(paths) == 6
    np.testing.assert_array_equal(paths[4].get_ydata(), record["XY portrait.y"][1, :, 1])
    assert axes.get_xlim() == (-2, 2)


def test_raster_has_a_dash_wherever_something_fired():
    sink = of("raster", (4,))
    fired = of("expression", "u > 0.8", shape=(4,))
    wave = of("sine", frequency=(3.0, 4.0, 5.0, 7.0), phase=(0.1, 0.7, 1.3, 2.9), shape=(4,))
    diagram = Diagram(TICK)
    for name, block in (("noise", wave), ("fired", fired), ("sink", sink)):
        diagram.add(name, block)
    diagram.connect("noise", "fired")
    diagram.connect("fired", "sink")
    record = Run(diagram, 2).advance(100)
    rows = sink.figure(record, "sink").axes[0].collections
    assert len(rows) == 8
    for row, signal in zip(rows, record["sink.u"].transpose(0, 2, 1).reshape(8, 100), strict=True):
        np.testing.assert_allclose(row.get_positions(), np.flatnonzero(signal) * TICK)


def test_histogram_counts():
    sink, record, path = example("histogram")
    parts, edges = sink.parts(record, path)
    counts, _ = np.histogram(record["histogram.u"], 5, (-0.5, 0.5))
    np.testing.assert_allclose(parts, counts / record["histogram.u"].size)
    np.testing.assert_allclose(edges, np.linspace(-0.5, 0.5, 6))


def test_recorder_writes_all_it_saw(tmp_path):
    sink, record, path = example("recorder")
    file = sink.write(record, path, tmp_path / "deep" / "signals.parquet", seeds=(4, 9, 2))
    table = parquet.read_table(file)
    assert table.column_names == ["seed", "tick", "time", "a[0]", "a[1]", "b[0]", "b[1]"]
    assert table.num_rows == 600
    np.testing.assert_array_equal(table["seed"].to_numpy()[::200], [4, 9, 2])
    np.testing.assert_array_equal(table["tick"].to_numpy()[:200], np.arange(200))
    np.testing.assert_allclose(table["time"].to_numpy()[:200], np.arange(200) * TICK)
    np.testing.assert_array_equal(table["b[1]"].to_numpy(), record["recorder.b"][..., 1].ravel())
    data = of("data file", str(file), ("a[0]",))  # and may be read again
    assert list(data.outputs) == ["a[0]"]


def test_recorder_writes_a_stream_piece_by_piece_or_nothing(tmp_path):
    sink = of("recorder", ("u",))
    diagram = Diagram(TICK)
    for name, block in (("u", of("sine")), ("sink", sink)):
        diagram.add(name, block)
    diagram.connect("u", "sink")

    def run():
        return Run(diagram, 2, sweep={"u.amplitude": [1.0, 2.0]})

    sink.write(run().stream(700), "sink", tmp_path / "signals.parquet")
    table = parquet.read_table(tmp_path / "signals.parquet")
    order = np.lexsort((table["tick"].to_numpy(), table["seed"].to_numpy()))
    np.testing.assert_array_equal(table["u"].to_numpy()[order], run().advance(700)["sink.u"].ravel())

    def broken():
        yield run().advance(10)
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match=r"no more"):
        sink.write(broken(), "sink", tmp_path / "broken.parquet")
    assert [path.name for path in tmp_path.iterdir()] == ["signals.parquet"]
    with pytest.raises(ValueError, match=r"file = .*: cannot be written: it is a folder"):
        sink.write(run().advance(10), "sink", tmp_path)
    with pytest.raises(ValueError, match=r"seeds = .*: must be as many as the record has, 2"):
        sink.write(run().advance(10), "sink", tmp_path / "x.parquet", seeds=(1, 2, 3))


def test_policy_map_shows_the_units_that_are_there():
    sink, record, _ = example("policy map")
    outlines = sink.figure(record, "sink").axes[0].collections[1]
    middles = [path.vertices[:-1].mean(0) for path in outlines.get_paths()]
    np.testing.assert_allclose(middles, [(0, 0), (1, 0.5), (-1, 0.5)], atol=0.03)
    extents = [np.ptp(path.vertices, axis=0) / 2 for path in outlines.get_paths()]
    np.testing.assert_allclose(extents, [(0.2, 0.4), (0.3, 0.3), (0.1, 0.1)], rtol=0.01)
    few = {"units": of("constant", 2.0), "parameters": of("constant", np.arange(12) / 10, (12,))}
    diagram = Diagram(TICK)
    for name, block in (*few.items(), ("sink", sink), ("count", of("counter", edge="true"))):
        diagram.add(name, block)
    diagram.add("yes", of("compare", ">", -1.0))
    diagram.connect("units", "yes.u1")
    diagram.connect("yes", "count.u")
    diagram.connect("count", "sink.units")
    diagram.connect("parameters", "sink.parameters")
    record = Run(diagram).advance(2)  # the counter is at 2
    assert len(sink.figure(record, "sink").axes[0].collections[0].get_paths()) == 2


def test_thinned_lines_keep_their_peaks():
    times = np.arange(100_000) * TICK
    values = np.sin(times)
    values[[777, 54_321]] = 5, -6
    at, kept = thinned(times, values)
    assert len(kept) <= MAX_LINE_POINTS
    assert kept.max() == 5
    assert kept.min() == -6
    assert np.all(np.diff(at) > 0)
    np.testing.assert_array_equal(kept, values[np.rint(at / TICK).astype(int)])


def test_wrong_sinks_are_refused_by_name():
    for name, arguments, message in (
        ("scope", {"limits": (1.0, 0.0)}, "limits = .*: must be None, or a list of two numbers"),
        ("scope", {"labels": ()}, "labels = .*: must be a list of 1"),
        ("scope", {"window": 0}, "window = 0.0: must be a finite number above 0, in s"),
        ("recorder", {"labels": ("time",)}, "labels = .*: must be names other than seed"),
        ("histogram", {"bins": 0}, "bins = 0: must be an integer"),
        ("policy map", {"axes": (0, 2)}, "axes = .*: must be two different integers from 0 to 1"),
        ("policy map", {"forces": ((1, 2), (3, 4))}, "forces = .*: must be None, or 1 rows"),
    ):
        with pytest.raises(ValueError, match=message):
            of(name, **arguments)
