"""TensorBoard event files, read back by TensorBoard itself."""

import importlib.util
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import motorgrad as mg
from motorgrad.training import write_tensorboard
from motorgrad.training.plots._tensorboard import FILE, EventFiles, start_time

INSTALLED = importlib.util.find_spec("tensorboard") is not None
needs_tensorboard = pytest.mark.skipif(not INSTALLED, reason="needs the extra motorgrad[tensorboard]")
SETTINGS = {"task": "hopper", "seeds": [4, 1], "window": 50, "progress": False}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return mg.train(**SETTINGS, steps=300, out=tmp_path_factory.mktemp("run"))


def scalars(folder):
    """Everything that TensorBoard reads in a folder, by tag: `(step, wall time, value)` of each point."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    events = EventAccumulator(str(folder), size_guidance={"scalars": 0}).Reload()
    return {tag: [(e.step, e.wall_time, e.value) for e in events.Scalars(tag)] for tag in events.Tags()["scalars"]}


def assert_holds(folder, run):
    """The event files hold the run's records: all, once, in order."""
    assert sorted(path.name for path in folder.iterdir()) == sorted(f"seed-{seed}" for seed in run.seeds)
    decision, wall = (run.metrics[name].to_numpy()[:: len(run.seeds)] for name in ("decision", "wall_time"))
    skipped = {"seed", "decision", "simulated_time", "wall_time", "cpu_time", "parameters"}
    for row, seed in enumerate(run.seeds):
        found = scalars(folder / f"seed-{seed}")
        for name in set(run.metrics.column_names) - skipped:
            values = run.curve(name)[1][row]
            seen = np.isfinite(values)
            step, time, value = np.array(found.pop(name, [])).reshape(-1, 3).T
            np.testing.assert_array_equal(step, decision[seen])
            np.testing.assert_array_equal(value, values[seen])
            np.testing.assert_allclose(time - start_time(run.path), wall[seen], atol=1e-5)
        assert not found


@needs_tensorboard
def test_tensorboard_reads_the_runs_records(run, tmp_path):
    assert np.isnan(run.curve("apex")[1]).any()  # some points are missing
    assert write_tensorboard(run, tmp_path / "deep" / "in") == tmp_path / "deep" / "in"
    assert_holds(tmp_path / "deep" / "in", run)


@pytest.mark.ci
@needs_tensorboard
def test_a_run_in_memory_is_written_too(tmp_path):
    run = mg.train("chain", steps=30, seeds=1, window=10, progress=False)
    write_tensorboard(run, tmp_path)
    assert [step for step, *_ in scalars(tmp_path / "seed-0")["reward"]] == [10, 20, 30]


def halves(run):
    """The run's records in two parts."""
    return run.metrics[:6], run.metrics[6:]


@needs_tensorboard
def test_records_may_come_in_parts_and_the_file_is_the_same(run, tmp_path):
    write_tensorboard(run, tmp_path / "whole")
    parts = EventFiles(tmp_path / "parts", run.seeds, start_time(run.path))
    parts.add(None)
    for half in halves(run):
        parts.add(half)
    parts.add(None)
    for seed in run.seeds:
        whole, piecewise = (tmp_path / name / f"seed-{seed}" / FILE for name in ("whole", "parts"))
        assert whole.read_bytes() == piecewise.read_bytes()


@needs_tensorboard
@pytest.mark.parametrize("left", ["torn", "behind", "ahead", "empty", "other"])
def test_whatever_a_killed_process_left_no_point_is_lost_or_double(left, run, tmp_path):
    write_tensorboard(run, tmp_path)
    file = tmp_path / "seed-4" / FILE
    whole, (first, rest) = file.read_bytes(), halves(run)
    file.write_bytes(
        {"torn": whole[:-7], "behind": whole[: len(whole) // 2], "empty": b"", "other": b"x" + whole}.get(left, whole)
    )
    inode = file.stat().st_ino
    files = EventFiles(tmp_path, run.seeds, start_time(run.path))
    if left == "ahead":  # records were rolled back to an older checkpoint
        files.add(first)
        assert len(file.read_bytes()) < len(whole)
        files.add(rest)
    else:
        files.add(run.metrics)
    assert file.read_bytes() == whole
    assert_holds(tmp_path, run)
    if left in ("torn", "behind"):
        assert file.stat().st_ino == inode  # an open TensorBoard follows it


@pytest.mark.ci
@needs_tensorboard
def test_a_continued_run_is_brought_up_to_date(tmp_path):
    short = mg.train(**SETTINGS, steps=200, out=tmp_path / "run")
    write_tensorboard(short, tmp_path / "events")
    assert_holds(tmp_path / "events", short)
    long = mg.train(**SETTINGS, steps=400, out=tmp_path / "run")
    write_tensorboard(long, tmp_path / "events")
    assert_holds(tmp_path / "events", long)


def test_the_missing_package_is_named(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RuntimeError, match=r"pip install 'motorgrad\[tensorboard\]'"):
        write_tensorboard(run, tmp_path / "events")
    assert not (tmp_path / "events").exists()


# ---- as training goes


@needs_tensorboard
def test_training_keeps_the_files_up_to_date_at_every_commit(tmp_path):
    settings = {**SETTINGS, "out": tmp_path, "checkpoint_every": 0.0}
    mg.train(**settings, steps=70)  # the last record is short, and made again when the run goes on
    longer = mg.train(**settings, steps=300, tensorboard=True)
    assert_holds(tmp_path / "tensorboard", longer)
    assert mg.train(**settings, steps=330, tensorboard=True).metrics.num_rows == 2 * 7
    longest = mg.train(**settings, steps=400, tensorboard=True)
    assert_holds(tmp_path / "tensorboard", longest)


@pytest.mark.slow
@needs_tensorboard
def test_killed_and_resumed_training_leaves_no_point_double_or_lost(compiled_environment, tmp_path):
    task = ["three-state", "--steps", 2_000_000, "--window", 9_999, "--seeds", 2]
    options = ["--checkpoint-every", 0.01, "--tensorboard", "--out", tmp_path / "run"]
    command = [sys.executable, "-m", "motorgrad", "train", *map(str, task + options)]
    file = tmp_path / "run" / "tensorboard" / "seed-0" / FILE
    for wanted in (2_000, 9_000):
        child = subprocess.Popen(
            command, env=compiled_environment, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )
        deadline = time.monotonic() + 120
        while child.poll() is None and not (file.exists() and file.stat().st_size > wanted):
            assert time.monotonic() < deadline
            time.sleep(0.002)
        child.kill()
        assert child.wait() == -signal.SIGKILL
        assert scalars(file.parent)["reward"]  # while it was going
    assert subprocess.run(command, env=compiled_environment, capture_output=True).returncode == 0
    assert_holds(tmp_path / "run" / "tensorboard", mg.load(tmp_path / "run"))


def test_a_run_in_memory_keeps_no_files():
    with pytest.raises(ValueError, match="tensorboard = True: must be False for a run in memory"):
        mg.train("chain", steps=10, tensorboard=True)


def test_the_missing_package_is_named_before_training(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(RuntimeError, match=r"pip install 'motorgrad\[tensorboard\]'"):
        mg.train("chain", steps=10, out=tmp_path / "run", tensorboard=True)
    assert not (tmp_path / "run").exists()
