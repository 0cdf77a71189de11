"""The memory of the tests' compiled programs (`compilations.py`)."""

import subprocess
import sys
from pathlib import Path

import pytest


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
