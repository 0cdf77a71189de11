"""The store of compiled programs, which users and tests have."""

import os
import subprocess
import sys
import time
import zlib
from pathlib import Path

import pytest

from motorgrad import _program_store


@pytest.fixture
def compress():
    if sys.version_info >= (3, 14):
        from compression import zstd

        return zstd.compress
    try:
        import zstandard
    except ImportError:
        return zlib.compress
    return zstandard.ZstdCompressor().compress


def entries(store):
    return sorted(path.name for path in (store / _program_store.key()).iterdir())


def test_a_run_finds_what_the_run_before_it_compiled(tmp_path, compress):
    first = _program_store.open_run(tmp_path)
    (first / "program-cache").write_bytes(compress(b"code"))
    _program_store.close_run(first, tmp_path)
    second = _program_store.open_run(tmp_path)
    assert (second / "program-cache").read_bytes() == compress(b"code")
    assert not first.exists()


def test_runs_at_the_same_time_do_not_share_a_folder(tmp_path, compress):
    runs = [_program_store.open_run(tmp_path) for _ in range(2)]
    for index, run in enumerate(runs):
        (run / f"program{index}-cache").write_bytes(compress(b"code"))
        (run / "both-cache").write_bytes(compress(b"code"))
    for run in runs:
        _program_store.close_run(run, tmp_path)
    assert entries(tmp_path) == ["both-cache", "program0-cache", "program1-cache"]


def test_half_an_entry_is_not_kept(tmp_path, compress):
    run = _program_store.open_run(tmp_path)
    whole = compress(bytes(range(256)) * 100)
    (run / "whole-cache").write_bytes(whole)
    (run / "half-cache").write_bytes(whole[: len(whole) // 2])
    (run / "empty-cache").write_bytes(b"")
    _program_store.close_run(run, tmp_path)
    assert entries(tmp_path) == ["whole-cache"]


def test_the_store_is_bounded_and_keeps_what_was_used_last(tmp_path, compress):
    run = _program_store.open_run(tmp_path)
    for index in range(4):
        entry = run / f"program{index}-cache"
        entry.write_bytes(compress(b"code"))
        os.utime(entry, (index, index))
    _program_store.close_run(run, tmp_path, most_bytes=2 * len(compress(b"code")))
    assert entries(tmp_path) == ["program2-cache", "program3-cache"]


def test_the_number_of_entries_is_bounded(tmp_path, compress):
    run = _program_store.open_run(tmp_path)
    for index in range(4):
        (run / f"program{index}-cache").write_bytes(compress(b"code"))
    _program_store.close_run(run, tmp_path, most_entries=3)
    assert len(entries(tmp_path)) == 3


def test_what_nobody_uses_goes_and_what_another_version_uses_stays(tmp_path):
    day = 24 * 3600
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    here = _program_store._here()
    killed = f"{here}{ended.pid}-a"
    going = f"{here}{os.getpid()}-a"
    ages = {"python3.0-jax0": 31 * day, "python3.0-jax1": 2 * day, killed: day, going: 2 * day}
    ages |= {"run-elsewhere-1-a": 2 * day, "run-elsewhere-2-a": 8 * day}
    for name, age in ages.items():
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (time.time() - age, time.time() - age))
    run = _program_store.open_run(tmp_path)
    left = [_program_store.key(), "python3.0-jax1", going, "run-elsewhere-1-a", run.name]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(left)


PROGRAM = """
import jax
from jax import monitoring
from motorgrad._program_store import keep_programs
found = []
monitoring.register_event_listener(lambda name, **_: found.append(name.rpartition("/")[2]))
{}
keep_programs()
print(jax.jit(lambda x: 2 * x + 1)(3.0))
print(found.count("cache_hits"), found.count("cache_misses"))
"""


def counted(environment, before=""):
    """How many programs a process found and how many it compiled, and what it warned of."""
    code = PROGRAM.format(before)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    value, counts = done.stdout.splitlines()
    assert value == "7.0"
    return tuple(map(int, counts.split())), done.stderr


@pytest.fixture
def kept(tmp_path, process_environment):
    """The environment of processes that share a new store, in `tmp_path / "store"`."""
    return process_environment | {_program_store.VARIABLE: str(tmp_path / "store")}


@pytest.mark.parametrize("before", ["", "jax.numpy.ones(3) + 1"], ids=["first", "JAX has compiled before"])
def test_a_process_finds_what_an_earlier_one_compiled(tmp_path, kept, before):
    (hits, misses), _ = counted(kept, before)
    assert (hits, misses > 0) == (0, True)
    assert counted(kept, before)[0] == (misses, 0)
    assert [path.name for path in (tmp_path / "store").iterdir()] == [_program_store.key()]  # and no run


def test_what_a_killed_process_leaves_breaks_nothing(tmp_path, kept):
    killed = PROGRAM.format("") + "import os; os._exit(9)"
    assert subprocess.run([sys.executable, "-c", killed], env=kept, check=False).returncode == 9
    assert entries(tmp_path / "store") == []
    assert counted(kept)[0][0] == 0


def test_nothing_is_kept_where_the_user_has_turned_it_off(tmp_path, process_environment):
    off = process_environment | {_program_store.VARIABLE: "off", "XDG_CACHE_HOME": str(tmp_path), "HOME": str(tmp_path)}
    assert counted(off) == ((0, 0), "")
    assert not [*tmp_path.iterdir()]


def test_a_cache_that_the_user_has_chosen_is_used(tmp_path, kept):
    own = tmp_path / "own"
    assert counted(kept | _program_store.environment(own))[0][1] > 0
    assert [*own.iterdir()]
    counted(kept, f"jax.config.update('jax_compilation_cache_dir', {str(own)!r})")
    assert not (tmp_path / "store").exists()


def test_a_folder_that_cannot_be_written_is_told_once(tmp_path, kept):
    (tmp_path / "file").write_text("")
    where = str(tmp_path / "file" / "programs")
    counts, said = counted(kept | {_program_store.VARIABLE: where}, "keep_programs()")
    assert counts == (0, 0)
    assert said.count(f"compiled programs cannot be kept in {where}: Not a directory") == 1


@pytest.mark.skipif(os.name == "nt", reason="permissions are those of POSIX")
def test_a_folder_that_others_may_write_to_is_not_used(tmp_path):
    tmp_path.chmod(0o770)
    with pytest.raises(PermissionError, match="others may write to it"):
        _program_store.make_private(tmp_path)


def test_the_folder_is_in_the_users_cache(monkeypatch):
    monkeypatch.delenv(_program_store.VARIABLE)
    monkeypatch.setenv("XDG_CACHE_HOME", "/cache")
    monkeypatch.setattr(sys, "platform", "linux")
    assert _program_store.store_folder() == Path("/cache/motorgrad/programs")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert _program_store.store_folder() == Path.home() / ".cache" / "motorgrad" / "programs"
    monkeypatch.setattr(sys, "platform", "darwin")
    assert _program_store.store_folder() == Path.home() / "Library" / "Caches" / "motorgrad" / "programs"


TRAINING = """
import hashlib
import jax, numpy as np
from jax import monitoring
import motorgrad as mg
found = []
monitoring.register_event_listener(lambda name, **_: found.append(name.rpartition("/")[2]))
run = mg.train(mg.make("hopper"), steps=40, seeds=2, progress=False)
arrays = [np.asarray(leaf) for leaf in jax.tree.leaves(run.policies)] + [run.metrics["reward"].to_numpy()]
print(hashlib.sha256(b"".join(each.tobytes() for each in arrays)).hexdigest())
print(found.count("cache_misses"))
"""


@pytest.mark.ci
def test_a_training_from_stored_programs_is_the_same_bit_for_bit(kept):
    results = []
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", TRAINING], capture_output=True, text=True, env=kept)
        assert done.returncode == 0, done.stderr
        results.append(done.stdout.split())
    (first, compiled), (second, again) = results
    assert first == second
    assert int(compiled) > 0
    assert again == "0"
