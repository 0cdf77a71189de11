"""Sources against their closed forms, SciPy, and the files they read."""

import copy
import os
import zipfile

import numpy as np
import pyarrow as pa
import pytest
import scipy.signal
from block_driver import alone, arrays, drive, of
from pyarrow import csv, parquet

from timlab import Diagram, Moment, Outlet, Run

TIMES = np.arange(300) * 0.01


def test_step_jumps_at_its_time():
    y = alone(of("step", at=0.7, before=-1.0, after=2.0), 300)[0]
    np.testing.assert_array_equal(y, np.where(np.arange(300) >= 70, 2.0, -1.0))


def test_a_step_late_in_a_run_is_at_its_tick():
    times = np.arange(999_900, 1_000_100, dtype=np.float32) * np.float32(0.01)  # as a diagram rounds them
    block = arrays(of("step", at=10_000.0))
    given = [float(block.output((), {}, Moment(0, time, 0.01, (), time))["y"]) for time in times]
    np.testing.assert_array_equal(given, np.arange(999_900, 1_000_100) >= 1_000_000)


def test_ramp_rises_from_its_start():
    y = alone(of("ramp", slope=3.0, start=1.0, initial=0.5), 300)[0]
    np.testing.assert_allclose(y, 0.5 + 3.0 * np.maximum(TIMES - 1.0, 0), atol=1e-5)


def test_sine_of_a_list_of_frequencies():
    y = alone(of("sine", amplitude=2.0, frequency=(1.0, 3.0), phase=0.5, offset=1.0, shape=(2,)), 300)[0]
    expected = 1.0 + 2.0 * np.sin(2 * np.pi * TIMES[:, None] * np.array([1.0, 3.0]) + 0.5)
    np.testing.assert_allclose(y, expected, atol=2e-5)


def test_pulse_is_high_for_its_part_of_every_cycle():
    y = alone(of("pulse", frequency=2.0, duty=0.3, delay=0.1, low=-1.0, high=4.0), 300)[0]
    np.testing.assert_array_equal(y, np.where((np.arange(300) - 10) % 50 < 15, 4.0, -1.0))


@pytest.mark.parametrize("sweep", ["linear", "logarithmic"])
def test_chirp_is_that_of_scipy(sweep):
    y = alone(of("chirp", first=0.5, last=8.0, duration=2.0, phase=np.pi / 2, sweep=sweep), 300)[0]
    np.testing.assert_allclose(y, scipy.signal.chirp(TIMES, 0.5, 2.0, 8.0, sweep), atol=2e-4)


def test_a_source_with_a_sample_period_is_held():
    y = alone(of("ramp", every=5), 300)[0]
    np.testing.assert_allclose(y, TIMES[np.arange(300) // 5 * 5], atol=1e-6)


def test_uniform_noise_has_its_range_and_mean():
    y = alone(of("uniform noise", low=-2.0, high=6.0, shape=(3,)), 2000, seeds=4)
    assert -2 <= y.min() < -1.9
    assert 5.9 < y.max() < 6
    assert abs(y.mean() - 2) < 5 * 8 / np.sqrt(12 * y.size)
    assert np.unique(y).size > 0.99 * y.size  # seeds, ticks and places differ


@pytest.mark.ci
def test_normal_noise_per_root_second_integrates_alike_at_any_period():
    diagram = Diagram(0.01)
    for every in (1, 10):
        diagram.add(f"noise {every}", of("normal noise", deviation=0.5, per="root second", every=every))
        diagram.add(f"integral {every}", of("discrete integrator"))
        diagram.add(f"out {every}", Outlet())
        diagram.connect(f"noise {every}", f"integral {every}.u")
        diagram.connect(f"integral {every}", f"out {every}")
    record = Run(diagram, 1000).advance(401)
    for every in (1, 10):
        end = record[f"out {every}.u"][:, -1]  # after 4 s
        assert abs(end.std() / (0.5 * 2) - 1) < 0.1
        assert abs(end.mean()) < 5 / np.sqrt(1000)


def test_normal_noise_is_normal():
    y = alone(of("normal noise", mean=3.0, deviation=2.0, shape=(3,)), 1000, seeds=4).ravel()
    assert scipy.stats.kstest(y, "norm", (3.0, 2.0)).pvalue > 1e-4


COLUMNS = {"when": np.array([0.0, 0.5, 1.0]), "a": np.array([1.0, 3.0, 2.0]), "b": np.array([10, 20, 40])}


def write(path):
    """Write the columns as a file of the kind of its name."""
    if path.suffix == ".npz":
        np.savez(path, **COLUMNS)
    else:
        (csv.write_csv if path.suffix == ".csv" else parquet.write_table)(pa.table(COLUMNS), path)


@pytest.mark.parametrize("kind", ["csv", "parquet", "npz"])
def test_data_file_gives_its_columns(kind, tmp_path):
    path = tmp_path / f"table.{kind}"
    write(path)
    rows = of("data file", str(path), ("b", "a"))
    np.testing.assert_array_equal(drive(rows, 5)["a"], [1, 3, 2, 2, 2])
    repeated = of("data file", str(path), ("a", "b"), after="repeat")
    np.testing.assert_array_equal(drive(repeated, 5)["b"], [10, 20, 40, 10, 20])


@pytest.mark.ci
@pytest.mark.representatives("csv")  # what is read is the same from every kind of file
@pytest.mark.parametrize("kind", ["csv", "parquet", "npz"])
def test_data_file_gives_its_columns_at_their_times(kind, tmp_path):
    path = tmp_path / f"table.{kind}"
    write(path)
    line = of("data file", str(path), ("a",), time="when", between="linear")
    y = alone(line, 150, port="a")[0]
    np.testing.assert_allclose(y, np.interp(np.arange(150) * 0.01, COLUMNS["when"], COLUMNS["a"]), atol=1e-5)
    held = alone(of("data file", str(path), ("b",), time="when"), 150, port="b")[0]
    np.testing.assert_array_equal(held, np.repeat([10, 20, 40], 50))
    again = alone(of("data file", str(path), ("b",), time="when", after="repeat"), 250, port="b")[0]
    np.testing.assert_array_equal(again, np.tile(np.repeat([10, 20], 50), 3)[:250])


def test_data_files_of_one_size_run_as_one_and_are_not_mixed(tmp_path):
    diagram = Diagram(0.1)
    for name, numbers in (("a", [1.0, 2.0, 3.0]), ("b", [7.0, 8.0, 9.0])):
        np.savez(tmp_path / f"{name}.npz", y=numbers)
        diagram.add(name, of("data file", str(tmp_path / f"{name}.npz")))
        diagram.add(f"{name} out", Outlet())
        diagram.connect(name, f"{name} out")
    run = Run(diagram)
    begin = run.state
    record = run.advance(3)
    np.testing.assert_array_equal(record["a out.u"][0], [1, 2, 3])
    np.testing.assert_array_equal(record["b out.u"][0], [7, 8, 9])
    run.restore(begin)
    np.testing.assert_array_equal(run.advance(3)["b out.u"], record["b out.u"])


def test_bad_data_files_are_refused_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # messages cut long paths
    np.savez(tmp_path / "good.npz", y=[1.0, 2.0], t=[0.0, 0.0], short=[1.0], text=["a", "b"], nan=[1.0, np.nan])
    os.mkfifo(tmp_path / "pipe.csv")
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as bomb:
        bomb.writestr("y.npy", bytes(2**26))
        for number in range(16):  # more of them, in the same bytes of the file
            again = copy.copy(bomb.getinfo("y.npy"))
            again.filename = f"{number}.npy"
            bomb.filelist.append(again)
    for name in ("broken.npz", "broken.csv", "broken.parquet"):
        (tmp_path / name).write_bytes(b"\x00\xff no table, \n 1")
    good = "good.npz"
    for settings, message in (
        ({"path": "absent.csv"}, r"path = 'absent\.csv': cannot be read: No such file"),
        ({"path": "table.txt"}, r"path = .*: must be a file whose name ends in \.csv"),
        ({"path": "."}, "path = .*: must be a file whose name ends"),
        ({"path": "pipe.csv"}, r"path = .*pipe\.csv': must be a file, not a folder, a pipe"),
        ({"path": "bomb.npz"}, r"path = .*bomb\.npz': not an NPZ file of arrays: bytes when unpacked = "),
        ({"path": ""}, "path = '': must be a path"),
        ({"path": "broken.npz"}, r"path = .*broken\.npz': not an NPZ file"),
        ({"path": "broken.csv"}, r"path = .*broken\.csv': "),
        ({"path": "broken.parquet"}, r"path = .*broken\.parquet': not a Parquet table"),
        ({"path": good, "columns": ("z",)}, "unknown column 'z': .*known are nan, short, t, text, y"),
        ({"path": good, "columns": ("text",)}, "column text: must be a list of at least one number"),
        ({"path": good, "columns": ("nan",)}, "column nan, row 1: must be a finite number"),
        ({"path": good, "columns": ("y", "short")}, "columns of different lengths: y 2, short 1"),
        ({"path": good, "time": "t"}, "column t: must increase from row to row"),
        ({"path": good, "between": "linear"}, "between = 'linear': must be 'hold' without a column"),
        ({"path": good, "columns": ()}, "columns = .*: must be a list of 1"),
    ):
        with pytest.raises(ValueError, match=message) as error:
            of("data file", **settings)
        assert "\n" not in str(error.value)
