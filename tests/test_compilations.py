"""The compilation cache of the tests (`compilations.py`)."""

import os
import subprocess
import sys
import zlib
from pathlib import Path

import pytest

import compilations


@pytest.fixture
def compress():
    try:
        import zstandard
    except ImportError:
        return zlib.compress
    return zstandard.ZstdCompressor().compress


def entries(store):
    return sorted(path.name for path in (store / compilations._key()).iterdir())


def test_a_run_finds_what_the_run_before_it_compiled(tmp_path, compress):
    first = compilations.open_run(tmp_path)
    (first / "program-cache").write_bytes(compress(b"code"))
    compilations.close_run(first, tmp_path)
    second = compilations.open_run(tmp_path)
    assert (second / "program-cache").read_bytes() == compress(b"code")
    assert not first.exists()


def test_runs_at_the_same_time_do_not_share_a_folder(tmp_path, compress):
    runs = [compilations.open_run(tmp_path) for _ in range(2)]
    for index, run in enumerate(runs):
        (run / f"program{index}-cache").write_bytes(compress(b"code"))
        (run / "both-cache").write_bytes(compress(b"code"))
    for run in runs:
        compilations.close_run(run, tmp_path)
    assert entries(tmp_path) == ["both-cache", "program0-cache", "program1-cache"]


def test_half_an_entry_is_not_kept(tmp_path, compress):
    run = compilations.open_run(tmp_path)
    whole = compress(bytes(range(256)) * 100)
    (run / "whole-cache").write_bytes(whole)
    (run / "half-cache").write_bytes(whole[: len(whole) // 2])
    (run / "empty-cache").write_bytes(b"")
    compilations.close_run(run, tmp_path)
    assert entries(tmp_path) == ["whole-cache"]


def test_the_store_is_bounded_and_keeps_what_was_used_last(tmp_path, compress):
    run = compilations.open_run(tmp_path)
    for index in range(4):
        entry = run / f"program{index}-cache"
        entry.write_bytes(compress(b"code"))
        os.utime(entry, (index, index))
    compilations.close_run(run, tmp_path, most_bytes=2 * len(compress(b"code")))
    assert entries(tmp_path) == ["program2-cache", "program3-cache"]


def test_entries_of_other_versions_go(tmp_path):
    (tmp_path / "python3.0-jax0").mkdir()
    run = compilations.open_run(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([compilations._key(), run.name])


PROGRAM = """
import jax
from jax import monitoring
found = []
monitoring.register_event_listener(lambda name, **_: found.append(name.rpartition("/")[2]))
jax.jit(lambda x: 2 * x + 1)(3.0)
print(found.count("cache_hits"), found.count("cache_misses"))
"""


@pytest.mark.ci
def test_a_process_finds_what_one_of_another_run_compiled(tmp_path, process_environment):
    counts = []
    for _ in range(2):
        run = compilations.open_run(tmp_path)
        environment = {**process_environment, **compilations.environment(run)}
        done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, env=environment)
        assert done.returncode == 0, done.stderr
        counts.append(tuple(map(int, done.stdout.split())))
        compilations.close_run(run, tmp_path)
    (hits, misses), again = counts
    assert misses > 0
    assert again == (hits + misses, 0)


@pytest.mark.ci
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux's account of a process's memory")
def test_programs_are_dropped_when_a_process_uses_much_memory():
    code = """
import jax, compilations
programs = [jax.jit(lambda x, i=i: x + i) for i in range(20)]
before = [float(program(1.0)) for program in programs]
live = lambda: len(jax.devices()[0].client.live_executables())
assert not compilations.drop_programs(1 << 40) and live() >= 20, live()
assert compilations.drop_programs(1) and live() < 20, live()
assert before == [float(program(1.0)) for program in programs]
"""
    subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parent, check=True)


def test_programs_share_one_context_of_the_compiler():
    """If a new JAX keeps it elsewhere, programs take five times the memory: mend `share_context` then."""
    import jax

    one, other = (jax.jit(lambda x, k=k: x + k).lower(1.0).compiler_ir() for k in range(2))
    assert one.context is other.context
