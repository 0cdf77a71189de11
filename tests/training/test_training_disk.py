"""A full disk, a folder moved away, a lost mount: the run learns on, says so, and loses nothing."""

import contextlib
import shutil
import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pytest
from training_examples import NEVER, assert_same, assert_same_run, columns

import motorgrad as mg
from motorgrad._files import write_atomically
from motorgrad.cli import main
from motorgrad.training import NotSaved, RunWarning
from motorgrad.training.store import RunDirectory

RUN = {"task": "three-state", "steps": 100_000, "seeds": 2, "window": 9_999, "checkpoint_every": 0.0}
PATIENCE = 600.0  # seconds


def train(out, **changes):
    return mg.train(**{**RUN, **changes}, out=out, progress=False)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return train(tmp_path_factory.mktemp("undisturbed"))


def mounted(*command):
    """Mount something, or skip the test where that is not allowed."""
    done = subprocess.run(["mount", *map(str, command)], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"cannot mount: {done.stderr.strip()}")


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 256 KiB."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted("-t", "tmpfs", "-o", "size=256k", "none", disk)
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)


def fill(disk):
    with (disk / "ballast").open("wb", buffering=0) as file, contextlib.suppress(OSError):
        while True:
            file.write(bytes(512))


def in_turn(*acts):
    """A callback that does these one after the other, each at a record of its own, before the record is saved."""
    left = iter(acts)
    return lambda report: next(left, nothing)()


def nothing():
    pass


def disturbed(path, spoil, mend, told="could not be saved", **changes):
    """Train, spoil the disk after some checkpoints, mend it some records later; the run and what was said last."""

    def mend_what_was_said():
        assert any(told in str(each.message) for each in said)
        mend()

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        run = train(path, **changes, callbacks=in_turn(nothing, spoil, nothing, nothing, mend_what_was_said))
    assert {each.category for each in said} == {RunWarning}
    texts = [str(each.message) for each in said]
    *failed, again = texts
    assert failed
    assert all("could not be saved" in text for text in failed)  # one for each reason, not one for each attempt
    assert len(failed) <= 4
    assert "saved again" in again
    return run, failed[-1]


def test_a_full_disk_loses_nothing(small_disk, undisturbed):
    path = small_disk / "run"
    run, failed = disturbed(path, lambda: fill(small_disk), (small_disk / "ballast").unlink)
    assert "No space left on device" in failed
    assert_same_run(run, undisturbed)
    assert_same_run(mg.load(path), mg.load(undisturbed.path))


def test_a_folder_moved_away_and_back_loses_nothing(tmp_path, undisturbed):
    path, away = tmp_path / "run", tmp_path / "away"
    run, failed = disturbed(path, lambda: path.rename(away), lambda: away.rename(path))
    assert "No such file or directory" in failed
    assert_same_run(run, undisturbed)
    assert_same_run(mg.load(path), mg.load(undisturbed.path))


def test_nothing_is_written_to_another_folder_in_its_place(tmp_path, undisturbed):
    path, away = tmp_path / "run", tmp_path / "away"

    def spoil():
        path.rename(away)
        shutil.copytree(undisturbed.path, path)  # even one with the same files, and held by another process
        (path / ".holder").write_text("1 another")

    def mend():
        assert {file: file.read_bytes() for file in undisturbed.path.rglob("*.state")}.items() >= {
            undisturbed.path / file.relative_to(path): file.read_bytes() for file in path.rglob("*.state")
        }.items()
        shutil.rmtree(path)
        away.rename(path)

    run, _ = disturbed(path, spoil, mend, "another folder is in its place")
    assert_same_run(mg.load(path), mg.load(undisturbed.path))
    assert_same_run(run, undisturbed)


@pytest.mark.ci
def test_a_lost_mount_loses_nothing(tmp_path, undisturbed):
    disk, place = tmp_path / "disk", tmp_path / "place"
    disk.mkdir()
    place.mkdir()
    mounted("--bind", disk, place)
    try:
        run, _ = disturbed(
            place / "run",
            lambda: subprocess.run(["umount", "-l", str(place)], check=True),
            lambda: mounted("--bind", disk, place),
        )
        assert_same_run(run, undisturbed)
        assert_same_run(mg.load(place / "run"), mg.load(undisturbed.path))
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)
    assert list(place.iterdir()) == []  # nothing was written below it meanwhile


LIMITED = """
import resource, sys, motorgrad as mg
path, steps = sys.argv[1], int(sys.argv[2])
limits = iter([600] * 3)  # bytes of a file, at the first records
def limit(report):
    resource.setrlimit(resource.RLIMIT_FSIZE, (next(limits, resource.RLIM_INFINITY), resource.RLIM_INFINITY))
how = {"window": 9_999, "checkpoint_every": 0.0, "callbacks": limit, "progress": False}
mg.train("three-state", steps=steps, seeds=2, out=path, **how)
"""


@pytest.mark.slow
def test_writes_that_the_system_refuses_lose_nothing(compiled_environment, tmp_path, undisturbed):
    command = [sys.executable, "-c", LIMITED, str(tmp_path / "run"), str(RUN["steps"])]
    done = subprocess.run(command, env=compiled_environment, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    assert "File too large" in done.stderr
    assert "saved again" in done.stderr
    assert_same_run(mg.load(tmp_path / "run"), mg.load(undisturbed.path))


def moved_away_for_good(path, *then, **changes):
    """Train, and move the folder away after some checkpoints; the error with which it ends."""
    acts = [nothing, lambda: path.rename(path.with_name("away")), *then]
    told = "decisions and could not be saved: No such file or directory"
    with pytest.warns(RunWarning, match="could not be saved"), pytest.raises(NotSaved, match=told) as error:
        train(path, **changes, callbacks=in_turn(*acts))
    return error.value


def test_it_ends_when_nothing_could_be_saved_for_so_long_and_has_all_in_memory(tmp_path, undisturbed):
    run = moved_away_for_good(tmp_path / "run", give_up_after=0.1).run
    wanted, found = columns(undisturbed.metrics), columns(run.metrics)
    rows = np.isin(wanted["decision"], found["decision"])
    for name in wanted:
        np.testing.assert_array_equal(found[name], wanted[name][rows])
    if run.complete:
        assert_same(run.policies, undisturbed.policies)
    assert not (tmp_path / "run").exists()
    assert_same_run(train(tmp_path / "away"), undisturbed)  # from what had been saved


def test_it_ends_when_asked_although_it_cannot_be_saved(tmp_path):
    asked = [nothing, lambda: signal.raise_signal(signal.SIGINT)]
    error = moved_away_for_good(tmp_path / "run", *asked, steps=2_000_000_000)
    assert (tmp_path / "away").exists()
    assert error.run.decision == 4 * RUN["window"]  # at once


def test_the_command_says_in_one_line_that_it_could_not_save(tmp_path, capsys, monkeypatch):
    path = tmp_path / "run"
    save = RunDirectory.save

    def save_and_move(*all_of):
        save(*all_of)
        if path.exists():
            path.rename(tmp_path / "away")

    monkeypatch.setattr(RunDirectory, "save", save_and_move)
    command = ["train", "three-state", "--steps", "1000", "--seeds", "2"]
    command += ["--checkpoint-every", "0", "--give-up-after", "0.1"]
    with pytest.warns(RunWarning, match="could not be saved"):
        assert main([*command, "--out", str(path)]) == 2
    assert "could not be saved" in capsys.readouterr().err.splitlines()[-1]


def test_a_clock_that_jumps_changes_nothing(tmp_path, monkeypatch, undisturbed):
    random = np.random.default_rng(0)
    monkeypatch.setattr(time, "time", lambda: random.uniform(0, 4e9))
    monkeypatch.setattr(time, "time_ns", lambda: int(random.uniform(0, 4e18)))
    saved = []
    monkeypatch.setattr(RunDirectory, "save", lambda *all_of, save=RunDirectory.save: (saved.append(1), save(*all_of)))
    assert_same_run(train(tmp_path / "rarely", checkpoint_every=NEVER), undisturbed)
    assert len(saved) == 1
    assert_same_run(train(tmp_path / "often", checkpoint_every=0), undisturbed)
    assert len(saved) > 5


def test_space_is_given_back_and_orphans_go_at_the_next_start(tmp_path, undisturbed):
    path = shutil.copytree(undisturbed.path, tmp_path / "run")
    orphans = [path / folder / f".{name}.partial" for folder, name in (
        ("", "config.toml"), ("metrics", "000000000001-000000000001.parquet"), ("checkpoint", "000000000001.state"),
    )]  # fmt: skip
    for orphan in orphans:
        orphan.write_bytes(b"half of")
    assert_same_run(train(path), undisturbed)
    assert not any(orphan.exists() for orphan in orphans)


def test_a_failed_write_leaves_no_orphan(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(IsADirectoryError):
        write_atomically(tmp_path / "folder", b"cannot replace a folder")
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]
